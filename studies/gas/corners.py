"""What gets round a block: the first wave on its sides and its back, over the free field's.

The scene is that of the shielding study (`BlockGeometry`), in three dimensions: a charge on the
ground before the middle of a face. A gauge is a module of a wall at the ground, its load the mean
over the module's faces; the free field is along the ground beside a mirror, which is a wall
parallel to the flow, at the same path length.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.physics.gas.engine import GasEngine
from blast_env.physics.presets import preset
from blast_env.simulation.gas import GasBlast, GasResult
from blast_env.studies.shielding.ratios import Region, region_weight
from blast_env.studies.shielding.scenes import BlockGeometry, block_scenario
from blast_env.units import MODULE_SIDE_M
from studies.gas.reference import free_field_gauges
from studies.gas.sites import with_heights

_MARGIN_M: Final = 10.0


@dataclass(frozen=True, eq=False)
class CornerWaves:
    """First waves round a block.

    Attributes:
        geometry: The block.
        height_m: Its height.
        cell_m: Side of a cell.
        coefficient: First positive impulse over the free field's at the same path length, those
            of a side first, then half of the back (gauges,).
        all_phases: Impulse of all positive phases over the same free field's (gauges,).
        unfinished: Share of the gauges' faces whose first positive phase was not over.
    """

    geometry: BlockGeometry
    height_m: float
    cell_m: float
    coefficient: FloatArray
    all_phases: FloatArray
    unfinished: float

    def gauges_of(self, region: Region) -> FloatArray:
        """Return the coefficients of the gauges of a region."""
        return self.coefficient[region_weight(region, self.geometry) > 0.0]

    def mean(self, region: Region, *, all_phases: bool = False) -> float:
        """Return the mean coefficient of a region's modules."""
        weight = region_weight(region, self.geometry)
        return float(
            np.average(self.all_phases if all_phases else self.coefficient, weights=weight)
        )


def corner_waves(
    cell_m: float, height_m: float | None = None, geometry: BlockGeometry | None = None
) -> CornerWaves:
    """Run the block and the free field.

    Args:
        cell_m: Side of a cell; a module's side must be a whole number of them.
        height_m: Height of the block; as high as wide unless given.
        geometry: The block and the charge. Its margin does not matter, the borders being open.

    Raises:
        BlastEnvError: If the block is lower than a module.
    """
    geometry = replace(BlockGeometry() if geometry is None else geometry, margin_m=_MARGIN_M)
    height_m = geometry.side_m if height_m is None else height_m
    if height_m < MODULE_SIDE_M:
        raise BlastEnvError(f"height_m is {height_m:g}, must be at least {MODULE_SIDE_M:g}")
    scenario = with_heights(block_scenario(geometry, preset("ballistic")), height_m)
    result = GasBlast(scenario, engine=GasEngine(cell_m=cell_m, margin_m=0.0)).run()
    free = free_field_gauges(geometry.tnt_kg, geometry.gauge_path_m.tolist(), cell_m)
    paths_m = cell_m * (free.cells[:, 0] + 0.5)
    order = np.argsort(paths_m)
    log_free = np.interp(
        np.log(geometry.gauge_path_m),
        np.log(paths_m[order]),
        np.log(free.first_impulse_pa_s[order]),
    )
    first, every, over = (
        _gauge_means(result, values, geometry)
        for values in (
            result.run.loads.first_impulse_pa_s,
            result.run.loads.positive_impulse_pa_s,
            result.run.loads.first_is_over.astype(np.float64),
        )
    )
    free_pa_s = np.exp(log_free)
    return CornerWaves(
        geometry,
        height_m,
        cell_m,
        first / free_pa_s,
        every / free_pa_s,
        1.0 - float(over.mean()),
    )


def _gauge_means(result: GasResult, values: FloatArray, geometry: BlockGeometry) -> FloatArray:
    """Return the means of face values over the gauges, symmetric ones together (gauges,)."""
    side = geometry.side_modules
    faces = result.faces.assign(value=values)
    low = faces[faces["z_m"] < MODULE_SIDE_M]
    sides = low[low["face"].isin(["south", "north"])].groupby("column")["value"].mean()
    back = low[low["face"] == "east"]
    row = back["row"].to_numpy()
    backs = back["value"].groupby(np.minimum(row, side - 1 - row)).mean()
    return np.concatenate((sides.to_numpy(), backs.to_numpy()))
