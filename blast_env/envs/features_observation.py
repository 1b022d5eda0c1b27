"""The observation `"features"`: a flat vector, for small networks and other learners."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from gymnasium import spaces

from blast_env.envs.observation import (
    Array,
    Sight,
    charge_share,
    cost_shares,
    occupied_cells,
    stock_shares,
)
from blast_env.envs.scenario_source import zone_of
from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.scenario import Placement, Scenario
from blast_env.scenario.clearance import source_bounds_m
from blast_env.scenario.models import AnyStructure

MOST_STRUCTURES: Final = 8
"""Structures that the vector has room for."""

_PER_STRUCTURE: Final = 6
_FIXED: Final = 3 + 6 + 2 + MOST_STRUCTURES * _PER_STRUCTURE


@dataclass(frozen=True)
class FeaturesObservation:
    """A vector of float32 from 0 to 1; x is divided by the site's width, y by its height.

    | from | length | what |
    |---|---|---|
    | 0 | 3 | modules left / modules at first; modules left / 100, at most 1; budget left / budget |
    | 3 | 4 | left, bottom, right, top of the smallest box around where the charge is or may be |
    | 7 | 2 | least and largest mass that the charge may have, (mass / 1000 kg)^(1/3), at most 1 |
    | 9 | 2 | x and y of the lower left corner of the build zone |
    | 11 | 8 x 6 | of each structure: left, bottom, right, top; 1; its weight / the largest weight |
    | 59 | cells | 1 where a module stands, row by row |
    | 59 + cells | cells | 1 where a module may be placed now, row by row |
    | 59 + 2 cells | cells | cost of a module / the highest, row by row |

    Protected structures come first, in the order of the scenario. The weight of another structure
    is 0, and all six values are 0 where there is no structure.
    """

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space: (features,)."""
        zone = zone_of(scenario)
        return spaces.Box(0.0, 1.0, (_FIXED + 3 * zone.rows * zone.columns,), np.float32)

    def episode(self, sight: Sight) -> "FeaturesEpisode":
        """Work out the values that do not change.

        Raises:
            BlastEnvError: If the scenario has more structures than there is room for.
        """
        scenario, zone = sight.scenario, zone_of(sight.scenario)
        size = np.array([scenario.site.width_m, scenario.site.height_m])
        boxes = np.array([source_bounds_m(source) for source in sight.sources])
        charges = [charge_share(source.tnt_kg) for source in sight.sources]
        fixed = [
            np.zeros(3),
            boxes[:, :2].min(axis=0) / size,
            boxes[:, 2:].max(axis=0) / size,
            [min(charges), max(charges)],
            np.array(zone.corner_m) / size,
            _structures(scenario).ravel(),
            np.zeros(2 * zone.rows * zone.columns),
            cost_shares(scenario).ravel(),
        ]
        values = np.concatenate(fixed).astype(np.float32)
        return FeaturesEpisode(np.clip(values, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class FeaturesEpisode:
    """The vector of one episode.

    Attributes:
        static: What does not change (features,); the rest is 0.
    """

    static: Array

    def observe(self, placement: Placement) -> Array:
        """Return all values for the modules placed so far, (features,)."""
        values = self.static.copy()
        values[:3] = stock_shares(placement)
        cells = placement.free.size
        values[_FIXED : _FIXED + cells] = occupied_cells(placement).ravel()
        values[_FIXED + cells : _FIXED + 2 * cells] = placement.free.ravel()
        return values


def _structures(scenario: Scenario) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return the features of the structures, (MOST_STRUCTURES, 6)."""
    structures = sorted(scenario.structures, key=lambda structure: not structure.protected)
    if len(structures) > MOST_STRUCTURES:
        raise BlastEnvError(
            f"scenario {scenario.name!r} has {len(structures)} structures, the observation"
            f" 'features' has room for {MOST_STRUCTURES}: use 'grid'"
        )
    largest = max((each.weight for each in structures if each.protected), default=1.0)
    site = Rectangle(0.0, 0.0, scenario.site.width_m, scenario.site.height_m)
    rows = np.zeros((MOST_STRUCTURES, _PER_STRUCTURE))
    for row, structure in zip(rows, structures, strict=False):
        row[:] = _structure(structure, site, largest)
    return rows


def _structure(structure: AnyStructure, site: Rectangle, largest_weight: float) -> list[float]:
    left, bottom, right, top = structure.rectangle_m
    weight = structure.weight / largest_weight if structure.protected else 0.0
    sides = [left / site.right, bottom / site.top, right / site.right, top / site.top]
    return [*sides, 1.0, weight]
