"""Reflection at normal incidence and arrival times, beside Kingery and Bulmash's.

Without a target: a calibration fixes the scale of impulses, not these. They say how far a parameter
set's blast behaves as a shock does.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from blast_env.arrays import FloatArray
from blast_env.calibration.references import kingery_bulmash, scaled_distance
from blast_env.errors import BlastEnvError
from blast_env.runner import share_of
from blast_env.simulation import BlastResult
from blast_env.studies.shielding.ratios import (
    Face,
    LoadKind,
    draw_loads,
    estimate,
    face_loads,
    faces_hit,
    fitted_modules,
    wall_loads,
)
from blast_env.studies.shielding.scenes import StudySettings, facade_scenario, wall_scenario
from blast_env.units import MODULE_SIDE_M, UNITS_PER_M

ARRIVAL_SHARE: Final = 0.05
"""Share of the impulse that has come by the arrival; a particle front has runners, a shock none."""

_GAUGE_WIDTH_M: Final = 4.0  # around the axis, where the wall is head-on


class HeadOnLoad(NamedTuple):
    """The load on the middle of a facade across the flow.

    Attributes:
        transferred_impulse: Normal impulse per module, simulation units.
        arrival_s: When `ARRIVAL_SHARE` of it had come; NaN where nothing came.
    """

    transferred_impulse: float
    arrival_s: float


@dataclass(frozen=True)
class ReflectionStudy(StudySettings):
    """Blasts on facades across the flow, and on the shielding study's wall in the open.

    Attributes:
        distances_m: Distances from the charge's centre, ascending.
    """

    distances_m: tuple[float, ...] = (10.0, 15.0, 20.0, 25.0)

    def __post_init__(self) -> None:
        """Check the arguments.

        Raises:
            BlastEnvError: As `StudySettings`; or if the distances are fewer than two, not
                ascending or beyond the wall in the open.
            ScenarioError: If the parameters do not fit each other or the scenes.
        """
        super().__post_init__()
        path_m = self.geometry.wall_path_m[fitted_modules(self.geometry)]
        for distance_m in self.distances_m:
            if not path_m[0] <= distance_m <= path_m[-1]:
                raise BlastEnvError(
                    f"distances: {distance_m:g} m must be within the wall in the open, "
                    f"{path_m[0]:g} to {path_m[-1]:g} m"
                )
        if len(self.distances_m) < 2 or (np.diff(self.distances_m) <= 0.0).any():
            raise BlastEnvError(
                f"distances: {self.distances_m} m must be at least two, ascending, none twice"
            )
        facade_scenario(self.distances_m[0], self.geometry, self.scene_parameters)

    def run(
        self, processes: int = 1, progress: Callable[[float], None] | None = None
    ) -> "ReflectionReport":
        """Run all blasts. The result does not depend on the number of processes.

        Args:
            processes: Worker processes.
            progress: Called with the share of the blasts that is done.

        Raises:
            BlastEnvError: If a blast ended at its limit of collisions, or if nothing at all
                arrived somewhere.
        """
        parameters = self.scene_parameters
        facades = [facade_scenario(d, self.geometry, parameters) for d in self.distances_m]
        wall = wall_scenario(self.geometry, parameters)
        scenes = len(facades) + 1
        of_facades = share_of(progress, 0, scenes, len(facades))
        head_on = self.run_blasts(facades, head_on_load, processes, of_facades)
        of_wall = share_of(progress, len(facades), scenes)
        (open_field,) = self.run_blasts([wall], face_loads, processes, of_wall)
        side_on = np.array([wall_loads(faces)[LoadKind.TRANSFERRED] for faces in open_field])
        return ReflectionReport(self, np.array(head_on).transpose(1, 2, 0), side_on)


@dataclass(frozen=True, eq=False)
class ReflectionReport:
    """What a reflection study found.

    Attributes:
        study: What was run.
        head_on: `HeadOnLoad` (seeds, 2, distances).
        side_on: Normal impulse on the wall in the open, mean of its two faces (seeds, modules).
    """

    study: ReflectionStudy
    head_on: FloatArray
    side_on: FloatArray

    def __post_init__(self) -> None:
        """Check the loads.

        Raises:
            BlastEnvError: If nothing arrived at a facade, or at the wall in the open.
        """
        arrived = self.head_on[:, 0].sum(axis=0)
        for distance_m, load in zip(self.study.distances_m, arrived, strict=True):
            if not load > 0.0:
                raise BlastEnvError(f"nothing arrived at the facade at {distance_m:g} m")
        if not self.side_on[:, fitted_modules(self.study.geometry)].sum() > 0.0:
            raise BlastEnvError("nothing arrived at the wall in the open")

    @cached_property
    def reflection(self) -> pd.DataFrame:
        """One row a distance: normal impulse head-on over side-on, with its 95 % interval.

        Impulses are per module, simulation units; `scaled_distance` is Z, m/kg^(1/3);
        `kingery_bulmash_ratio` is that of the reflected to the incident impulse, hemispherical.
        """
        study = self.study
        distance_m, charge_kg = np.array(study.distances_m), study.geometry.tnt_kg
        drawn = draw_loads(self.head_on[:, 0], distance_m, self.side_on, study.geometry)
        ratios = np.array([estimate(draws) for draws in (drawn.loads / drawn.free_field).T])
        reflected, incident = (
            kingery_bulmash(quantity, distance_m, charge_kg)
            for quantity in ("reflected_impulse", "incident_impulse")
        )
        return pd.DataFrame(
            {
                "distance_m": distance_m,
                "scaled_distance": scaled_distance(distance_m, charge_kg),
                "head_on": drawn.loads[0],
                "side_on": drawn.free_field[0],
                "ratio": ratios[:, 0],
                "ratio_low": ratios[:, 1],
                "ratio_high": ratios[:, 2],
                "kingery_bulmash_ratio": reflected / incident,
            }
        )

    @cached_property
    def arrivals(self) -> pd.DataFrame:
        """One row a distance: arrival in the simulation, scaled, and Kingery and Bulmash's.

        The model's time has no unit of its own: one factor, `time_scale`, fits its arrivals to
        the reference by least squares of the logarithms. The residual is what remains.
        """
        study = self.study
        distance_m = np.array(study.distances_m)
        simulated_s = np.nanmean(self.head_on[:, 1], axis=0)
        reference_s = kingery_bulmash("arrival_time", distance_m, study.geometry.tnt_kg)
        time_scale = float(np.exp(np.log(reference_s / simulated_s).mean()))
        return pd.DataFrame(
            {
                "distance_m": distance_m,
                "simulated_s": simulated_s,
                "scaled_s": time_scale * simulated_s,
                "kingery_bulmash_s": reference_s,
                "residual_percent": 100.0 * (time_scale * simulated_s / reference_s - 1.0),
                "time_scale": time_scale,
            }
        )


def head_on_load(result: BlastResult) -> HeadOnLoad:
    """Return the load on the middle of the front of the one structure of a blast."""
    collisions = result.collision_array
    (structure,) = result.obstacles
    rows = round(_GAUGE_WIDTH_M / MODULE_SIDE_M)
    first = (structure.rows - rows) // 2
    row = collisions["module"] // structure.columns
    chosen = faces_hit(collisions)[Face.FRONT] & (row >= first) & (row < first + rows)
    hits = np.sort(collisions[chosen], order="time_s")
    come = np.cumsum(hits["transferred_impulse"])
    if not len(come):
        return HeadOnLoad(0.0, np.nan)
    arrival = int(np.searchsorted(come, ARRIVAL_SHARE * come[-1]))
    return HeadOnLoad(float(come[-1]) / rows, float(hits["time_s"][arrival]))


@dataclass(frozen=True)
class NearField:
    """What a parameter set does between the first and the last distance of a study.

    Attributes:
        thermal_share: Share of the charge's energy that is random in direction.
        radius_m: Radius of the balls.
        head_on_slope: d ln i / d ln R of the load on a facade that looks at the charge.
        side_on_slope: Likewise of the load on a wall parallel to the flow.
        ratio_near: Head-on over side-on load at the first distance.
        ratio_far: At the last one.
    """

    thermal_share: float
    radius_m: float
    head_on_slope: float
    side_on_slope: float
    ratio_near: float
    ratio_far: float


def near_field(report: ReflectionReport) -> NearField:
    """Return what a study found."""
    study, parameters = report.study, report.study.parameters
    distance_m = np.array(study.distances_m)
    drawn = draw_loads(report.head_on[:, 0], distance_m, report.side_on, study.geometry)
    head_on, side_on = drawn.loads[0], drawn.free_field[0]
    return NearField(
        thermal_share=parameters.explosive.thermal_share,
        radius_m=parameters.air.radius_units / UNITS_PER_M,
        head_on_slope=_slope(distance_m, head_on),
        side_on_slope=_slope(distance_m, side_on),
        ratio_near=float(head_on[0] / side_on[0]),
        ratio_far=float(head_on[-1] / side_on[-1]),
    )


def reference_near_field(distances_m: Sequence[float]) -> NearField:
    """Return Kingery and Bulmash's, of 100 kg TNT on the ground."""
    distance_m = np.array(distances_m)
    head_on = kingery_bulmash("reflected_impulse", distance_m, 100.0)
    side_on = kingery_bulmash("incident_impulse", distance_m, 100.0)
    ratio = head_on / side_on
    slopes = _slope(distance_m, head_on), _slope(distance_m, side_on)
    return NearField(np.nan, np.nan, *slopes, float(ratio[0]), float(ratio[-1]))


def _slope(distance_m: np.ndarray, load: np.ndarray) -> float:
    return float(np.log(load[-1] / load[0]) / np.log(distance_m[-1] / distance_m[0]))
