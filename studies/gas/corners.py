"""Waves round a block: loads on its sides and its back over those in the free field.

A charge lies on the ground before the middle of a face of a block. A gauge is a module of a wall at
the ground; its load is the mean over the module's faces. The free field is along the ground at the
same path length, beside a mirror, which represents a wall parallel to the flow.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import ceil, hypot
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.site import Scenario
from blast_env.units import MODULE_SIDE_M
from studies.gas.loads import with_heights
from studies.gas.reference import free_field_gauges

_MARGIN_M: Final = 10.0
"""Width of the open ground around the block; it has no effect, because the borders are open."""

Region = Literal["one_corner", "one_corner_near", "one_corner_far", "two_corners"]
"""All gauges of the sides, the front third, the back third of them; the gauges of the back."""

REGIONS: Final[tuple[Region, ...]] = (
    "one_corner",
    "one_corner_near",
    "one_corner_far",
    "two_corners",
)


class ExperimentalBand(NamedTuple):
    """A measured share of the free-field impulse with its tolerance."""

    value: float
    tolerance: float

    @property
    def bounds(self) -> tuple[float, float]:
        """Lower and upper ends of the band."""
        return self.value - self.tolerance, self.value + self.tolerance


EXPERIMENT: Final[Mapping[Region, ExperimentalBand]] = MappingProxyType(
    {"one_corner": ExperimentalBand(0.57, 0.10), "two_corners": ExperimentalBand(0.49, 0.12)}
)
"""Street-junction experiments, scale 1:5: impulse over free-field impulse at the same path length.

Behind one corner the results were 0.48 to 0.67, near and far from the edge.
"""


@dataclass(frozen=True)
class BlockGeometry:
    """A square block in plan, a charge on the axis of one face, and gauges round it.

    The defaults are the block of published street-junction experiments at full size. In these the
    scale was 1:5, with a side of 2.3 m and the charge 1.15 m before the face.

    Attributes:
        side_modules: Number of modules along each side of the block.
        stand_off_m: Distance from the charge's centre to the front face.
        tnt_kg: TNT-equivalent mass of the charge.
    """

    side_modules: int = 23
    stand_off_m: float = 5.75
    tnt_kg: float = 100.0

    @property
    def side_m(self) -> float:
        """Side of the block."""
        return self.side_modules * MODULE_SIDE_M

    @property
    def corner_path_m(self) -> float:
        """Path from the charge's centre to a front corner."""
        return hypot(self.stand_off_m, self.side_m / 2.0)

    @cached_property
    def from_edge_m(self) -> FloatArray:
        """Distance of the middle of each module from the first edge of its face (side_modules,)."""
        return MODULE_SIDE_M * (np.arange(self.side_modules, dtype=np.float64) + 0.5)

    @cached_property
    def side_path_m(self) -> FloatArray:
        """Path to each gauge of a side, ordered from the front corner (side_modules,)."""
        return self.corner_path_m + self.from_edge_m

    @cached_property
    def back_path_m(self) -> FloatArray:
        """Path to each gauge of half the back, from a back corner to the middle (gauges,)."""
        half = ceil(self.side_modules / 2)
        return self.corner_path_m + self.side_m + self.from_edge_m[:half]

    @cached_property
    def gauge_path_m(self) -> FloatArray:
        """Path to each gauge, those of a side first (gauges,)."""
        return np.concatenate((self.side_path_m, self.back_path_m))


def region_weight(region: Region, geometry: BlockGeometry) -> FloatArray:
    """Return the number of modules of a region that each gauge represents (gauges,)."""
    side = geometry.side_modules
    weight, third = np.zeros(len(geometry.gauge_path_m)), round(side / 3)
    if region == "two_corners":
        weight[side:] = 2.0
        if side % 2:
            weight[-1] = 1.0  # the one in the middle
        return weight
    first = side - third if region == "one_corner_far" else 0
    last = third if region == "one_corner_near" else side
    weight[first:last] = 2.0
    return weight


def block_scenario(geometry: BlockGeometry) -> Scenario:
    """Return the block with the charge before the middle of one face.

    Raises:
        ScenarioError: If the charge does not fit on the site.
    """
    side_m = geometry.side_m
    document: dict[str, Any] = {
        "schema_version": 2,
        "name": "block",
        "site": {
            "width_m": 2.0 * _MARGIN_M + geometry.stand_off_m + side_m,
            "height_m": 2.0 * _MARGIN_M + side_m,
        },
        "charge": [
            {
                "kind": "point",
                "position_m": (_MARGIN_M, _MARGIN_M + side_m / 2.0),
                "tnt_kg": float(geometry.tnt_kg),
            }
        ],
        "structures": [
            {
                "kind": "ModularObstacle",
                "name": "block",
                "corner_m": (_MARGIN_M + geometry.stand_off_m, _MARGIN_M),
                "rows": geometry.side_modules,
                "columns": geometry.side_modules,
                "protected": True,
            }
        ],
        "simulation": {"preset": "ballistic"},
    }
    return Scenario.from_document(document, "block")


@dataclass(frozen=True, eq=False)
class CornerWaves:
    """Loads round a block.

    Attributes:
        geometry: The block.
        height_m: Its height.
        cell_m: Side of a cell.
        coefficient: Impulse over that in the free field at the same path length, for a side and
            then for half of the back (gauges,).
    """

    geometry: BlockGeometry
    height_m: float
    cell_m: float
    coefficient: FloatArray

    def gauges_of(self, region: Region) -> FloatArray:
        """Return the coefficients of the gauges of a region."""
        return self.coefficient[region_weight(region, self.geometry) > 0.0]

    def mean(self, region: Region) -> float:
        """Return the mean coefficient over the modules of a region."""
        return float(np.average(self.coefficient, weights=region_weight(region, self.geometry)))


def corner_waves(
    cell_m: float, height_m: float | None = None, geometry: BlockGeometry | None = None
) -> CornerWaves:
    """Run the block and the free field.

    Args:
        cell_m: Side of a cell; a module's side must be a whole number of them.
        height_m: Height of the block; its width unless given.
        geometry: The block and the charge.

    Raises:
        BlastEnvError: If the block is lower than a module.
    """
    geometry = BlockGeometry() if geometry is None else geometry
    height_m = geometry.side_m if height_m is None else height_m
    if height_m < MODULE_SIDE_M:
        raise BlastEnvError(f"height_m is {height_m:g}, must be at least {MODULE_SIDE_M:g}")
    scenario = with_heights(block_scenario(geometry), height_m)
    result = GasBlast(scenario, engine=GasEngine(cell_m=cell_m, margin_m=0.0)).run()
    free = free_field_gauges(geometry.tnt_kg, geometry.gauge_path_m.tolist(), cell_m)
    paths_m = cell_m * (free.cells[:, 0] + 0.5)
    order = np.argsort(paths_m)
    log_free = np.interp(
        np.log(geometry.gauge_path_m),
        np.log(paths_m[order]),
        np.log(free.impulse_pa_s[order]),
    )
    impulse_pa_s = _gauge_means(result, geometry)
    return CornerWaves(geometry, height_m, cell_m, impulse_pa_s / np.exp(log_free))


def _gauge_means(result: GasResult, geometry: BlockGeometry) -> FloatArray:
    """Return the impulses at the gauges, averaged over symmetric ones (gauges,)."""
    side = geometry.side_modules
    low = result.faces[result.faces["z_m"] < MODULE_SIDE_M]
    sides = low[low["face"].isin(["south", "north"])].groupby("column")["impulse_pa_s"].mean()
    back = low[low["face"] == "east"]
    row = back["row"].to_numpy()
    backs = back["impulse_pa_s"].groupby(np.minimum(row, side - 1 - row)).mean()
    return np.concatenate((sides.to_numpy(), backs.to_numpy()))
