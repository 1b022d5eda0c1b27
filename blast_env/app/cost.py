"""What work by gas dynamics costs, told before it begins.

A small model of the solver: the cells that there are, the steps until the loads are complete, and
how many cells a core moves on in a second. docs/howto/app.md holds it against blasts that were run.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cbrt, ceil, dist
from typing import Final

import numpy as np

from blast_env.physics.gas.settings import GasSettings
from blast_env.scenario import AnyCharge, Scenario, VehicleCharge
from blast_env.scenario.zone import source_bounds_m

_STEP_S_PER_M: Final = 0.9e-3
"""Time step over the side of a cell, as the sound in the products allows it."""

_SETTLED_S: Final = 0.026
"""How long loads come on after the front, over the cube root of the charge's mass in kg."""

_FRONT_M_S: Final = 390.0
_CELLS_PER_S: Final = 50e6
_DRAWING_S: Final = 2.5
_BYTES_PER_CELL: Final = 60.0
_PROCESS_BYTES: Final = 450e6


@dataclass(frozen=True)
class CostGuess:
    """What one blast costs, about.

    Attributes:
        cells: Cells, those around the site included.
        steps: Steps until the loads are complete.
        memory_bytes: Memory of the process.
    """

    cells: int
    steps: int
    memory_bytes: float

    @property
    def seconds(self) -> float:
        """Time on a core that does nothing else; film and maps not included."""
        return self.cells * self.steps / _CELLS_PER_S


def cost_of_blast(scenario: Scenario, charge: AnyCharge, cell_m: float) -> CostGuess:
    """Return what a blast by gas dynamics costs, about; nothing is built for it."""
    # Here, because it imports Numba, and the page is there before anybody asks.
    from blast_env.physics.gas.grid import GasGrid, layers_to

    settings = GasSettings(cell_m=cell_m)
    site = scenario.site
    margin = 2 * ceil(settings.margin_m / cell_m)
    sides_m = (site.width_m, site.height_m, scenario.air_height_m)
    nx, ny, nz = (ceil(round(side_m / cell_m, 9)) for side_m in sides_m)
    shape = (nx + margin, ny + margin, nz)
    skirt = layers_to(settings.border_m / cell_m)
    grid = GasGrid(cell_m, np.broadcast_to(np.False_, shape), skirt=skirt)
    if isinstance(charge, VehicleCharge):
        tnt_kg, place_m = charge.source.tnt_kg, source_bounds_m(charge.source).centre
    else:
        tnt_kg, place_m = charge.tnt_kg, charge.position_m
    protected = [each for each in scenario.structures if each.protected] or scenario.structures
    far_m = max(
        (
            dist(place_m, (x_m, y_m))
            for box in (each.rectangle_m for each in protected)
            for x_m in (box.left, box.right)
            for y_m in (box.bottom, box.top)
        ),
        default=dist((0.0, 0.0), sides_m[:2]),
    )
    cells = int(np.prod(grid.array_shape))
    time_s = _SETTLED_S * cbrt(tnt_kg) + far_m / _FRONT_M_S
    return CostGuess(
        cells=cells,
        steps=ceil(time_s / (_STEP_S_PER_M * cell_m)),
        memory_bytes=_PROCESS_BYTES + _BYTES_PER_CELL * cells,
    )


def cost_words(costs: Sequence[CostGuess], with_films: bool = False) -> str:
    """Return what some blasts cost one after the other, for people.

    Args:
        costs: Of each.
        with_films: Whether film, maps and walls are drawn of each.
    """
    if not costs:
        return "nothing to run: all of it is there"
    drawn_s = _DRAWING_S if with_films else 0.0
    blasts = "a blast" if len(costs) == 1 else f"{len(costs)} blasts"
    memory_gb = max(each.memory_bytes for each in costs) / 1e9
    return (
        f"{blasts} of gas: about {time_words(sum(each.seconds + drawn_s for each in costs))} on a"
        f" free core, {memory_gb:.1f} GB"
    )


def time_words(seconds: float) -> str:
    """Return a time as people say it."""
    if seconds < 10.0:
        return f"{max(ceil(seconds), 1)} s"
    if seconds < 100.0:
        return f"{5.0 * round(seconds / 5.0):.0f} s"
    if seconds < 5400.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"
