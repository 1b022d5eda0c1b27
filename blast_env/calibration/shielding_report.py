"""What a shielding study found: loads round the block over loads in the open."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import numpy as np
import pandas as pd

from blast_env.calibration.references import kingery_bulmash
from blast_env.calibration.shielding_loads import LoadKind
from blast_env.calibration.shielding_ratios import (
    EXPERIMENT,
    REGIONS,
    DrawnLoads,
    Region,
    draw_loads,
    estimate,
    fitted_modules,
    region_weight,
    scaled_ratio,
)
from blast_env.calibration.shielding_record import record_text, shielding_record
from blast_env.calibration.shielding_scenes import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.evaluation.statistics import Estimate

if TYPE_CHECKING:
    from blast_env.calibration.shielding import ShieldingStudy
    from blast_env.calibration.shielding_reflection import ReflectionReport

__all__ = ["EXPERIMENT", "LOADS", "LateShares", "LoadName", "ShieldingReport"]

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
    def one_corner_near(self) -> Estimate:
        """As `one_corner`, the third of the gauges at the front."""
        return self.ratio("one_corner_near")

    @property
    def one_corner_far(self) -> Estimate:
        """As `one_corner`, the third of the gauges at the back."""
        return self.ratio("one_corner_far")

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
        self, exponent: float | None = None, reflection: "ReflectionReport | None" = None
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
