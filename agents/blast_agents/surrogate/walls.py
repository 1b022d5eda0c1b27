"""What the surrogate sees of a site: points on the walls that count, and what may stop a blast."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from blast_agents.surrogate.horizons import HORIZONS, horizons
from blast_agents.surrogate.ways import SHARES, Ways
from blast_env.arrays import FloatArray, IntArray
from blast_env.calibration import kingery_bulmash
from blast_env.engines.contract import structure_response
from blast_env.errors import BlastEnvError
from blast_env.geometry import Element, Measure, standing
from blast_env.physics.scene import Charge
from blast_env.response.damage import BayDamage, TriangularLoads
from blast_env.scenario import AnyStructure, Scenario
from blast_env.scenario.facade import NamedBay
from blast_env.scenario.terraces import ground_below_m, is_open_below

_ALONG_M: Final = 1.0
_UP_M: Final = 1.5
"""Points on a wall are so far apart, or farther where there would be too many of them."""

MOST_POINTS: Final = 500
"""On all walls of a site, about. More cost time and say the same, for large walls are far away."""

_BEFORE_M: Final = 0.05
"""Points are this far before their wall, so that it does not stop what comes to them."""

_LEAST_HEIGHT_M: Final = 0.3
"""A charge on the ground begins so high: its middle."""

_LEAST_Z: Final = 0.2
"""A point that is nearer to the charge, m/kg^(1/3), has the reflected loads from there."""

_OUTWARD: Final = {"west": (-1, 0), "east": (1, 0), "south": (0, -1), "north": (0, 1)}

FEATURES: Final = 7 + 2 * SHARES
"""Numbers that a network is given about a point: geometry and ways."""

ALL_FEATURES: Final = FEATURES + 2 * HORIZONS
"""The same for a network that is given horizons, too."""


@dataclass(frozen=True, eq=False)
class WallPoints:
    """Points that stand for the walls of a structure that count.

    Attributes:
        points_m: (points, 3).
        outward: Where their wall looks (points, 2).
        area_m2: What each stands for (points,).
        to_edge_m: To the nearest upright edge of its wall (points,).
        to_roof_m: To the roof (points,).
    """

    points_m: FloatArray
    outward: FloatArray
    area_m2: FloatArray
    to_edge_m: FloatArray
    to_roof_m: FloatArray

    @classmethod
    def on(cls, structure: AnyStructure, height_m: float, apart: float = 1.0) -> "WallPoints":
        """Put points on a structure, one a metre along a wall and 1.5 m of its height, or so.

        Args:
            structure: The structure.
            height_m: Its height.
            apart: How many times as far from each other points are.
        """
        left, bottom, right, top = structure.rectangle_m
        rise_m = height_m - structure.base_m
        levels = max(1, round(rise_m / (_UP_M * apart)))
        z_m = structure.base_m + (np.arange(levels) + 0.5) * rise_m / levels
        rows = []
        for face in structure.faces:
            x_out, y_out = _OUTWARD[face]
            length_m = top - bottom if x_out else right - left
            number = max(1, round(length_m / (_ALONG_M * apart)))
            area_m2 = length_m * rise_m / (number * levels)
            for along_m in (np.arange(number) + 0.5) * length_m / number:
                if x_out:
                    x_m, y_m = (left if x_out < 0 else right) + _BEFORE_M * x_out, bottom + along_m
                else:
                    x_m, y_m = left + along_m, (bottom if y_out < 0 else top) + _BEFORE_M * y_out
                edge_m = min(along_m, length_m - along_m)
                rows += [(x_m, y_m, z, x_out, y_out, area_m2, edge_m, height_m - z) for z in z_m]
        table = np.array(rows)
        return cls(table[:, :3], table[:, 3:5], table[:, 5], table[:, 6], table[:, 7])


@dataclass(frozen=True, eq=False)
class Approach:
    """A charge and the walls of a structure: what of it no layout changes.

    Attributes:
        ways: From the charge to the points.
        on_empty: Features of each point where no barrier stands (points, ALL_FEATURES): geometry,
            open ways without and with the barrier, horizons without and with it.
        log_impulse: Logarithm of Kingery and Bulmash's reflected impulse there, Pa s (points,).
        log_peak: Logarithm of their reflected overpressure there, Pa (points,).
        area_m2: What each point stands for (points,).
        kept: What surrogates say of the points where no barrier stands, by what said it.
    """

    ways: Ways
    on_empty: FloatArray
    log_impulse: FloatArray
    log_peak: FloatArray
    area_m2: FloatArray
    kept: dict[object, FloatArray] = field(default_factory=dict, repr=False)

    def features(self, barrier: FloatArray) -> FloatArray:
        """Return the features of all points behind a barrier (points, ALL_FEATURES)."""
        features = self.on_empty.copy()
        changed, shares = self.ways.behind(barrier)
        features[changed, FEATURES - SHARES : FEATURES] = shares
        risen = horizons(self.ways.start_m, self.ways.points_m, barrier)
        features[:, -HORIZONS:] = np.maximum(features[:, -HORIZONS:], risen)
        return features

    def behind(self, barrier: FloatArray, features: int = FEATURES) -> tuple[IntArray, FloatArray]:
        """Return which points a barrier makes a difference to, and their features.

        Args:
            barrier: Left, bottom, right, top and height of each piece, m (pieces, 5).
            features: How many a network is given: `FEATURES` or `ALL_FEATURES`.

        Returns:
            Numbers of the points (behind,), and their features (behind, features).
        """
        if features == ALL_FEATURES:
            whole = self.features(barrier)
            changed: IntArray = np.flatnonzero((whole != self.on_empty).any(axis=1))
            return changed, whole[changed]
        numbers, shares = self.ways.behind(barrier)
        return numbers, np.hstack((self.on_empty[numbers, : FEATURES - SHARES], shares))


class SurrogateSite:
    """A scenario as the surrogate sees it.

    What begins above the ground, and on no terrace, stops nothing, as if it were not there: the
    surrogate never met it. Nor was it fitted to terraces: they are boxes as other structures are.

    Args:
        scenario: The scenario.

    Attributes:
        scenario: The scenario.
        protected: Its protected structures.
        counts_peaks: Whether its objective counts peak overpressures.
        alternatives: The bays of its facades, where their response counts.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.protected = tuple(each for each in scenario.structures if each.protected)
        self.counts_peaks = scenario.objective.needs_peaks
        self.alternatives = scenario.alternatives if scenario.objective.is_response else ()
        air_m = scenario.air_height_m
        self._solids = np.array(
            [
                [*each.rectangle_m, each.height_m or air_m]
                for each in scenario.structures
                if not is_open_below(each, scenario.structures)
            ]
        ).reshape(-1, 5)
        heights_m = [each.height_m or air_m for each in self.protected]
        apart = _apart(self.protected, heights_m)
        self._points = [
            WallPoints.on(*each, apart) for each in zip(self.protected, heights_m, strict=True)
        ]
        self._approaches: dict[Charge, tuple[Approach, ...]] = {}
        self._triangular = {
            each.name: TriangularLoads(
                [bay for bay in self.alternatives if bay.structure == each.name]
            )
            for each in self.protected
        }
        self._responses: dict[tuple[str, frozenset[Element], float, float], float] = {}
        self._named: dict[frozenset[Element], tuple[NamedBay, ...]] = {}

    def approaches(self, charge: Charge) -> tuple[Approach, ...]:
        """Return what comes from a charge to each protected structure on the empty site."""
        if charge not in self._approaches:
            found = tuple(self._approach(charge, points) for points in self._points)
            self._approaches[charge] = found
        return self._approaches[charge]

    def bay_damages(
        self, structure: str, peak_pa: float, impulse_pa_s: float
    ) -> tuple[BayDamage, ...]:
        """Return the damage of the bays of a protected structure under one triangular load."""
        return self._triangular[structure].damages(peak_pa, impulse_pa_s)

    def response(
        self, structure: str, layout: Sequence[Element], peak_pa: float, impulse_pa_s: float
    ) -> float:
        """Return what counts of the response of a protected structure to one triangular load.

        Most layouts differ in what few structures get, so answers are kept.

        Args:
            structure: Its name.
            layout: The layout, whose measures harden bays.
            peak_pa: The peak.
            impulse_pa_s: The impulse.
        """
        measures = frozenset(each for each in layout if isinstance(each, Measure))
        asked = structure, measures, peak_pa, impulse_pa_s
        if asked not in self._responses:
            if measures not in self._named:
                self._named[measures] = self.scenario.named_bays(measures)
            bays = self.bay_damages(structure, peak_pa, impulse_pa_s)
            objective = self.scenario.objective
            self._responses[asked] = structure_response(bays, self._named[measures], objective)[0]
        return self._responses[asked]

    def barrier(self, layout: Sequence[Element]) -> FloatArray:
        """Return left, bottom, right, top and height of what a layout sets down, m (pieces, 5).

        Raises:
            LayoutError: If the catalogue has no such piece.
        """
        zone, air_m = self.scenario.zone, self.scenario.air_height_m
        terraces = [each for each in self.scenario.structures if each.carries]
        rows = []
        for each in standing(layout):
            rectangle_m, own_m = (
                zone.element_rectangle_m(each),
                zone.catalogue.variant(each).height_m,
            )
            top_m = ground_below_m(terraces, rectangle_m) + own_m if own_m else air_m
            rows.append([*rectangle_m, top_m])
        return np.array(rows, dtype=np.float64).reshape(-1, 5)

    def _approach(self, charge: Charge, points: WallPoints) -> Approach:
        start_m = np.array((*charge.position_m, max(charge.height_m, _LEAST_HEIGHT_M)))
        away_m = start_m - points.points_m
        distance_m = np.linalg.norm(away_m, axis=1)
        scale = float(np.cbrt(charge.tnt_kg))
        facing = (away_m[:, :2] * points.outward).sum(axis=1) / distance_m
        ways = Ways.between(start_m, points.points_m, charge.tnt_kg, self._solids)
        geometry = np.stack(
            (
                np.log(distance_m / scale),
                facing,
                np.abs(facing),
                points.points_m[:, 2] / scale,
                points.to_roof_m / scale,
                points.to_edge_m / scale,
                np.full(len(distance_m), np.log(scale)),
            ),
            axis=1,
        )
        met_m = np.maximum(distance_m, _LEAST_Z * scale)
        impulse = kingery_bulmash("reflected_impulse", met_m, charge.tnt_kg)
        peak = kingery_bulmash("reflected_overpressure", met_m, charge.tnt_kg)
        shares, risen = ways.shares(), horizons(start_m, points.points_m, self._solids)
        on_empty = np.hstack((geometry, shares, shares, risen, risen))
        return Approach(ways, on_empty, np.log(impulse), np.log(peak), points.area_m2)


def _apart(structures: Sequence[AnyStructure], heights_m: Sequence[float]) -> float:
    """Return how many times as far apart points are as on a small site, not to be many."""
    area_m2 = 0.0
    for structure, height_m in zip(structures, heights_m, strict=True):
        left, bottom, right, top = structure.rectangle_m
        lengths_m = [
            top - bottom if _OUTWARD[face][0] else right - left for face in structure.faces
        ]
        area_m2 += height_m * sum(lengths_m)
    return float(max(1.0, (area_m2 / (_ALONG_M * _UP_M * MOST_POINTS)) ** 0.5))


def site_of(scenario: Scenario) -> SurrogateSite:
    """Return a scenario as the surrogate sees it.

    Raises:
        BlastEnvError: If nothing on it is protected.
    """
    site = SurrogateSite(scenario)
    if not site.protected:
        raise BlastEnvError(f"{scenario.name}: no structure is protected")
    return site
