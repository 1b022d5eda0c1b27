"""The governing one of several blasts, by one rule for verdicts, reports and the page.

Where facades count, the lower level of protection governs, then the larger damage of all
components. Ties, and sites without facades, are decided by the load.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.evaluation.engines.contract import BlastLoads
from blast_env.layout.build_scene import build_site
from blast_env.particles.calibration.references import burst_of, in_the_open
from blast_env.site import ObjectiveSection, Scenario
from blast_env.site.scene import OUTWARDS, BlastSite, Charge, StructureOutline
from blast_env.site.sight import in_sight
from blast_env.units import MODULE_SIDE_M

_STEP_M: Final = 1.0
"""Distance between the points of a wall over which a load in the open is averaged."""

Found = TypeVar("Found")


@dataclass(frozen=True, order=True)
class Severity:
    """The severity of a blast, with attributes in the order of comparison.

    Attributes:
        lost_levels: Levels of protection below "high" of buildings with a facade.
        damage: Total damage of all components, or the response in the objective.
        load: The load, in the same unit for all compared blasts.
    """

    lost_levels: int = 0
    damage: float = 0.0
    load: float = 0.0

    @classmethod
    def of_loads(cls, loads: BlastLoads, objective: ObjectiveSection) -> "Severity":
        """Return the severity of a blast by the objective of a site."""
        counted = loads.load(objective)
        if not objective.is_response:
            return cls(load=counted)
        return cls(4 - loads.level, counted, loads.protected_impulse_pa_s)

    @classmethod
    def in_the_open(cls, scenario: Scenario, charge: Charge) -> "Severity":
        """Estimate the severity without a blast, by Kingery and Bulmash's impulse in the open.

        On counted walls in sight of the charge it varies with the angle of incidence (`oblique`).
        On other walls it is the incident impulse.
        """
        site = build_site(scenario, (), 0, charge)
        protected = [each for each in site.structures if each.protected]
        return cls(load=sum(each.weight * _open_pa_s(site, each) for each in protected))


def governing(found: Iterable[Found], severity: Callable[[Found], Severity]) -> Found:
    """Return the worst of several, at least one; the first one of equals."""
    return max(found, key=severity)


def _open_pa_s(site: BlastSite, structure: StructureOutline) -> float:
    """Return the mean impulse in the open over the counted walls of a structure, Pa s."""
    points_m, outward = _points(site, structure)
    charge, seen = site.charge, in_sight(site, points_m, outward)
    way_m = np.array([*charge.position_m, charge.height_m]) - points_m
    away_m = np.linalg.norm(way_m, axis=1)
    facing = (way_m * outward).sum(axis=1) / away_m
    burst = burst_of(charge.height_m, charge.tnt_kg)
    return float(in_the_open("impulse", away_m, facing, seen, charge.tnt_kg, burst).mean())


def _points(site: BlastSite, structure: StructureOutline) -> tuple[FloatArray, FloatArray]:
    """Return points on the counted walls, `_STEP_M` apart, and outward normals (n, 3)."""
    left, bottom, right, top = structure.rectangle_m
    high_m = structure.height_m or site.air_height_m
    z_m = _middles(structure.base_m, high_m)
    points, outwards = [], []
    for line in (each for each in structure.walls if each.side in structure.faces):
        # Before the modules, whose steps may reach beyond the wall.
        along_m, away_m = _middles(0.0, line.length_m), MODULE_SIDE_M * np.array(line.normal)
        plan_m = np.array([line.point_at(each) for each in along_m.tolist()]) + away_m
        grid = np.hstack((np.repeat(plan_m, len(z_m), axis=0), np.tile(z_m, len(plan_m))[:, None]))
        points.append(grid)
        outwards.append(np.tile([*line.normal, 0.0], (len(grid), 1)))
    for wall in () if structure.walls else structure.faces:
        x_m, y_m = (_middles(*ends) for ends in ((left, right), (bottom, top)))
        if wall in ("west", "east"):
            x_m = np.array([left if wall == "west" else right])
        else:
            y_m = np.array([bottom if wall == "south" else top])
        grid = np.stack(np.meshgrid(x_m, y_m, z_m, indexing="ij"), axis=-1).reshape(-1, 3)
        points.append(grid)
        outwards.append(np.tile([*OUTWARDS[wall], 0.0], (len(grid), 1)))
    return np.concatenate(points), np.concatenate(outwards)


def _middles(low_m: float, high_m: float) -> FloatArray:
    count = max(round((high_m - low_m) / _STEP_M), 1)
    return low_m + (high_m - low_m) * (np.arange(count) + 0.5) / count
