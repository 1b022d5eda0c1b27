"""A shielding study as plain data: what repeats it, and what came out."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import pandas as pd

from blast_env.arrays import FloatArray
from blast_env.calibration.references import kingery_bulmash
from blast_env.errors import BlastEnvError
from blast_env.physics.engines import find_engine
from blast_env.physics.parameters import parameters_digest
from blast_env.provenance import versions
from blast_env.statistics import Estimate
from blast_env.studies.shielding.ratios import (
    EXPERIMENT,
    REGIONS,
    DrawnLoads,
    LoadKind,
    Region,
    draw_loads,
    estimate,
    face_loads,
    fitted_modules,
    gauge_loads,
    region_weight,
    scaled_ratio,
    wall_loads,
)
from blast_env.studies.shielding.reflection import ReflectionReport
from blast_env.studies.shielding.scenes import (
    BlockGeometry,
    StudySettings,
    block_scenario,
    wall_scenario,
)

SCHEMA_VERSION: Final = 1
"""The version of the file that `ShieldingReport.to_json` writes."""


def shielding_record(
    report: "ShieldingReport", exponent: float | None, reflection: ReflectionReport | None
) -> dict[str, Any]:
    """Return everything about a shielding study as what JSON knows; NaN is `None`."""
    study = report.study
    engine = find_engine(study.engine)
    return {
        "schema_version": SCHEMA_VERSION,
        "preset": study.simulation if isinstance(study.simulation, str) else None,
        "parameters": study.parameters.model_dump(mode="json"),
        "parameters_digest": parameters_digest(study.parameters, engine.name),
        "engine": engine.name,
        "versions": versions(engine.version),
        "seeds": list(study.seeds),
        "time_limit_s": study.time_limit_s,
        "geometry": asdict(study.geometry),
        "exponent": exponent,
        "result": {
            "ratios": _rows(report.summary(exponent)),
            "free_field_slope": [_plain(value) for value in report.free_field_slope],
            "late_shares": report.late_shares._asdict(),
            "gauges": _rows(report.gauges),
            "free_field": _rows(report.free_field),
        },
        "reflection": None if reflection is None else _rows(reflection.reflection),
        "arrivals": None if reflection is None else _rows(reflection.arrivals),
    }


def record_text(record: dict[str, Any]) -> str:
    """Return a record as the text of a JSON file."""
    return json.dumps(record, indent=2, allow_nan=False) + "\n"


def _rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table; NaN is `None`."""
    return [
        {str(key): _plain(value) for key, value in row.items()} for row in table.to_dict("records")
    ]


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value


LoadName = Literal["transferred_impulse", "impulse"]
"""The momentum really transferred along the normals, or the paper's m |v|."""

LOADS: Final[Mapping[LoadName, LoadKind]] = MappingProxyType(
    {"transferred_impulse": LoadKind.TRANSFERRED, "impulse": LoadKind.IMPULSE}
)


class LateShares(NamedTuple):
    """Shares of the normal impulse that arrived in the last fifth of the time limit.

    Attributes:
        one_corner: Of that on the sides.
        two_corners: Of that on the back.
        free_field: Of that on the wall in the open.
    """

    one_corner: float
    two_corners: float
    free_field: float


@dataclass(frozen=True, eq=False)
class ShieldingReport:
    """The loads of a shielding study, and their ratios.

    Intervals are 95 % intervals of a bootstrap over seeds: whole seeds are drawn, the free-field
    curve is fitted again, and the ratio is taken. They are too narrow with few seeds, and NaN with
    one.

    Attributes:
        study: What was run.
        block: Loads on the gauges of the block, simulation units (seeds, kinds, gauges); the
            sides from front to back, then the back from the corner to the middle. Each is the
            mean of two symmetric gauges.
        wall: Loads on the wall in the open, mean of its two faces (seeds, kinds, modules).
    """

    study: "ShieldingStudy"
    block: FloatArray
    wall: FloatArray

    def __post_init__(self) -> None:
        """Check the loads.

        Raises:
            BlastEnvError: If nothing arrived at the wall in the open.
        """
        fitted = fitted_modules(self.study.geometry)
        for kind in LOADS.values():
            if not self.wall[:, kind, fitted].sum() > 0.0:
                raise BlastEnvError(
                    f"seeds {self.study.seeds}: nothing arrived at the wall in the open within "
                    f"{self.study.time_limit_s:g} s, so there is no free field to compare with"
                )

    @property
    def one_corner(self) -> Estimate:
        """Normal impulse on the sides over that in the open, at the same path lengths."""
        return self.ratio("one_corner")

    @property
    def two_corners(self) -> Estimate:
        """Normal impulse on the back over that in the open, at the same path lengths."""
        return self.ratio("two_corners")

    def ratio(self, region: Region, load: LoadName = "transferred_impulse") -> Estimate:
        """Return the summed load on the gauges of a region over the summed load in the open.

        Args:
            region: Which gauges.
            load: What is summed: the normal impulse, or the paper's m |v|.
        """
        return self._loads[load].ratio(region_weight(region, self.study.geometry))

    @property
    def free_field_slope(self) -> Estimate:
        """Slope d log load / d log path of the free-field curve from the first gauge to the last.

        Kingery and Bulmash's is `reference_slope`. Far from it, the ratios say how the loads
        compare at the same path lengths, but not with a free field like a real one.
        """
        curve, ends_m = self._loads["transferred_impulse"].curve, self._end_paths_m
        return estimate(np.diff(np.log(curve(ends_m)))[..., 0] / np.diff(np.log(ends_m))[0])

    @property
    def reference_slope(self) -> float:
        """The same slope of Kingery and Bulmash's incident impulse.

        Raises:
            BlastEnvError: If the paths are out of the range of the curves for the charge.
        """
        ends_m = self._end_paths_m
        impulse = kingery_bulmash("incident_impulse", ends_m, self.study.geometry.tnt_kg)
        return float(np.diff(np.log(impulse))[0] / np.diff(np.log(ends_m))[0])

    @property
    def late_shares(self) -> LateShares:
        """How much of the loads arrived so late that more may have been missed."""
        geometry = self.study.geometry
        block, wall = self.block.sum(axis=0), self.wall.sum(axis=0)
        one, two = (region_weight(region, geometry) for region in ("one_corner", "two_corners"))
        amounts = (block @ one, block @ two, wall @ fitted_modules(geometry).astype(float))
        return LateShares(*(_late_share(amount) for amount in amounts))

    @cached_property
    def gauges(self) -> pd.DataFrame:
        """One row a gauge: where it is, its loads, and its ratio with the 95 % interval.

        Loads are means over seeds, simulation units; `free_field_transferred_impulse` is the fitted
        curve at `path_m`. `impulse_ratio` is the ratio of the paper's m |v|.
        """
        geometry = self.study.geometry
        sides, backs = len(geometry.side_path_m), len(geometry.back_path_m)
        transferred, impulse = self._loads["transferred_impulse"], self._loads["impulse"]
        draws = transferred.loads / transferred.free_field
        ratios = np.array([estimate(of_gauge) for of_gauge in draws.T])
        return pd.DataFrame(
            {
                "face": ["side"] * sides + ["back"] * backs,
                "from_edge_m": np.tile(geometry.from_edge_m, 2)[: sides + backs],
                "path_m": geometry.gauge_path_m,
                "transferred_impulse": transferred.loads[0],
                "free_field_transferred_impulse": transferred.free_field[0],
                "ratio": ratios[:, 0],
                "ratio_low": ratios[:, 1],
                "ratio_high": ratios[:, 2],
                "impulse": impulse.loads[0],
                "impulse_ratio": impulse.loads[0] / impulse.free_field[0],
            }
        )

    @cached_property
    def free_field(self) -> pd.DataFrame:
        """One row a module of the wall in the open: `path_m`, mean loads and the fitted curves.

        `fitted` is false for the modules at its ends, which the fit leaves out.
        """
        geometry = self.study.geometry
        mean = self.wall.mean(axis=0)
        table = pd.DataFrame({"path_m": geometry.wall_path_m})
        for name, kind in LOADS.items():
            table[name] = mean[kind]
            table[f"{name}_curve"] = self._loads[name].curve(geometry.wall_path_m)[0]
        return table.assign(fitted=fitted_modules(geometry))

    def summary(self, exponent: float | None = None) -> pd.DataFrame:
        """Return one row a region and load: the ratio with its interval, and the experiments'.

        Args:
            exponent: Exponent B of a calibration's power law; adds the scaled ratios, ratio ** B.

        Raises:
            BlastEnvError: If the exponent is not positive and finite.
        """
        rows = []
        for load in LOADS:
            for region in REGIONS:
                ratio = self.ratio(region, load)
                row: dict[str, Any] = {"region": region, "load": load}
                row |= {"ratio": ratio.value, "low": ratio.low, "high": ratio.high}
                if exponent is not None:
                    value, low, high = scaled_ratio(ratio, exponent)
                    row |= {"scaled": value, "scaled_low": low, "scaled_high": high}
                band = EXPERIMENT.get(region)
                row["experiment"] = np.nan if band is None else band.value
                row["tolerance"] = np.nan if band is None else band.tolerance
                rows.append(row)
        return pd.DataFrame(rows)

    def to_json(
        self, exponent: float | None = None, reflection: ReflectionReport | None = None
    ) -> str:
        """Return the whole study as JSON: what repeats it, and what came out.

        Args:
            exponent: As for `summary`.
            reflection: What a reflection study with the same settings found, to go with it.
        """
        return record_text(shielding_record(self, exponent, reflection))

    @cached_property
    def _loads(self) -> Mapping[LoadName, DrawnLoads]:
        geometry = self.study.geometry
        return {
            name: draw_loads(
                self.block[:, kind], geometry.gauge_path_m, self.wall[:, kind], geometry
            )
            for name, kind in LOADS.items()
        }

    @property
    def _end_paths_m(self) -> FloatArray:
        """Paths to the first and the last gauge (2,)."""
        return self.study.geometry.gauge_path_m[[0, -1]]


def _late_share(amount: FloatArray) -> float:
    """Return how much of the normal impulse on one place (kinds,) came late."""
    transferred, late = (float(amount[kind]) for kind in (LoadKind.TRANSFERRED, LoadKind.LATE))
    return late / transferred if transferred > 0.0 else 0.0


__all__ = [
    "EXPERIMENT",
    "REGIONS",
    "BlockGeometry",
    "Region",
    "ShieldingReport",
    "ShieldingStudy",
    "scaled_ratio",
]


@dataclass(frozen=True)
class ShieldingStudy(StudySettings):
    """Blasts on a block, and on a wall parallel to the flow in the open; see `StudySettings`.

    `ShieldingReport.late_shares` says whether the time limit was long enough.
    """

    def __post_init__(self) -> None:
        """Check the arguments.

        Raises:
            BlastEnvError: As `StudySettings`.
            ScenarioError: If the parameters do not fit each other or the scenes.
        """
        super().__post_init__()
        block_scenario(self.geometry, self.scene_parameters)

    def run(
        self, processes: int = 1, progress: Callable[[float], None] | None = None
    ) -> ShieldingReport:
        """Run all blasts. The result does not depend on the number of processes.

        Args:
            processes: Worker processes.
            progress: Called with the share of the blasts that is done.

        Raises:
            BlastEnvError: If a blast ended at its limit of collisions, or if nothing at all
                arrived at the wall in the open.
        """
        parameters = self.scene_parameters
        scenes = (
            block_scenario(self.geometry, parameters),
            wall_scenario(self.geometry, parameters),
        )
        block, wall = self.run_blasts(scenes, face_loads, processes, progress)
        return ShieldingReport(
            self,
            np.array([gauge_loads(faces) for faces in block]),
            np.array([wall_loads(faces) for faces in wall]),
        )
