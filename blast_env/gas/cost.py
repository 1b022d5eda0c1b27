"""Estimates of the cost of a gas-dynamics blast before it begins.

They come from a small model of the solver: the number of cells behind the front, in a half ball on
the ground within the site, the number of steps until the loads are known, and the number of cells
that a core updates per second. docs/engineers/gas.md compares estimates with measured costs.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import cbrt, ceil, expm1, prod
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.gas.ending import SOUND_M_S, corners_m, sound_s, watched_structures
from blast_env.gas.settings import GasSettings
from blast_env.site.blast_site import BlastSite

MOST_BYTES: Final = 8 * 2**30
MOST_S: Final = 6 * 3600.0
"""Limits on the memory and the core time of a blast; costlier ones are refused."""

_STEP_S_PER_M: Final = (0.68e-3, 1.32e-3)
"""Ratio of time step to cell side while the products are hot, and after they have settled."""

_AHEAD_M: Final = 12.0
_AHEAD_AFTER_S: Final = 0.01
"""Final lead of the front of 100 kg over sound from the detonation, and its time constant."""

_AFTER_S: Final = 0.02
"""Duration of a run of 100 kg after sound has reached all the places that it waits for."""

_PARTS: Final = 100
"""Number of intervals of a run in which updated cells are counted."""

_ROWS: Final = 24
"""Number of rows along y and z that stand for all, where cells behind a front are counted."""

_CELLS_PER_S: Final = 25e6
_BYTES_PER_CELL: Final = 28.0
_PROCESS_BYTES: Final = 270e6
_DRAWING_S: Final = 2.5


@dataclass(frozen=True)
class CostGuess:
    """Estimated cost of one blast.

    Attributes:
        cells: Number of smallest cells, including those around the site.
        steps: Number of steps until the loads are known.
        memory_bytes: Memory of the process.
        moved: Number of cell updates, summed over all steps.
    """

    cells: int
    steps: int
    memory_bytes: float
    moved: float

    @property
    def seconds(self) -> float:
        """Time on a busy or old core, without films; a fast core takes half to 80 % of it."""
        return self.moved / _CELLS_PER_S

    def check(self, settings: GasSettings) -> None:
        """Refuse a blast that costs too much.

        Raises:
            BlastEnvError: If it needs more memory than `MOST_BYTES` or more time than `MOST_S`.
        """
        what, instead = self._words(settings)
        if self.memory_bytes > MOST_BYTES:
            raise BlastEnvError(
                f"a blast of {what} would need {self.memory_bytes / 2**30:.1f} GiB, must be at "
                f"most {MOST_BYTES / 2**30:g}: {instead}"
            )
        if self.seconds > MOST_S:
            raise BlastEnvError(
                f"a blast of {what} would take {self.seconds / 3600.0:.1f} h of a core, must be at "
                f"most {MOST_S / 3600.0:g}: {instead}"
            )

    @contextmanager
    def within_memory(self, settings: GasSettings) -> Iterator[None]:
        """Name the cells of a blast for which the memory does not suffice.

        Raises:
            BlastEnvError: In the place of a `MemoryError` of what is done in this context.
        """
        try:
            yield
        except MemoryError:
            what, instead = self._words(settings)
            raise BlastEnvError(
                f"a blast of {what} needs some {self.memory_bytes / 2**30:.1f} GiB, which the "
                f"memory of this computer does not have: {instead}"
            ) from None

    def _words(self, settings: GasSettings) -> tuple[str, str]:
        """Return the size of a blast, and what to take instead."""
        what = f"{self.cells:,} {settings.cell_words} and {self.steps:,} steps"
        return what, "take larger cells" + (", or cells='coarse'" * (not settings.is_growing))


def cost_of_run(settings: GasSettings, site: BlastSite, response_s: float = 0.0) -> CostGuess:
    """Return the estimated cost of a gas-dynamics blast, without building its grid.

    Args:
        settings: The settings of the run.
        site: The structures, the barrier, the charge and the gauges.
        response_s: Minimum duration of the run after the last load has arrived.
    """
    scale = cbrt(site.charge.tnt_kg / 100.0)
    # 1. How long it runs: until sound has been everywhere that counts, and a while after.
    watched = watched_structures(site, settings.until)
    end_s = sound_s(site, corners_m(site, watched)) + max(_AFTER_S * scale, response_s)
    part_s, ahead_m = (settings.until_s or end_s) / _PARTS, _AHEAD_M * scale
    # 2. Part by part: how far the front is, ahead of sound at first; the cells behind it, which are
    # those that move; and the step, which the hot products keep short.
    left_m, bottom_m, right_m, top_m = site.site_m
    sides_m = (right_m - left_m, top_m - bottom_m, site.air_height_m)
    x_m, y_m = site.charge.position_m
    place = (x_m - left_m) / sides_m[0], (y_m - bottom_m) / sides_m[1]
    steps, moved = 0.0, 0.0
    for part in range(_PARTS):
        now_s = (part + 0.5) * part_s
        front_m = SOUND_M_S * now_s - ahead_m * expm1(-now_s / (_AHEAD_AFTER_S * scale))
        cell_m = settings.smallest_m * 2.0 ** sum(front_m > run_m for run_m in settings.doubled_m)
        step_s = cell_m * _STEP_S_PER_M[now_s > settings.settled_s * scale]
        counts = _cells_in(sides_m, cell_m, settings, margin=False)
        run = front_m / cell_m + 1.0
        steps += part_s / step_s
        moved += part_s / step_s * _cells_behind(run, counts, place)
    # 3. Memory is that of all cells at their smallest.
    cells = prod(_cells_in(sides_m, settings.smallest_m, settings, margin=True))
    return CostGuess(cells, ceil(steps), _PROCESS_BYTES + _BYTES_PER_CELL * cells, moved)


def _cells_behind(run: float, counts: tuple[int, ...], place: tuple[float, float]) -> float:
    """Return the number of cells behind a front, in a half ball on the floor of a site.

    Args:
        run: Its radius in cells.
        counts: Number of cells of the site along x, y and z.
        place: Its centre, as shares of the site along x and y.
    """
    # Rows along x, by their distance from the centre in y and their height.
    (left, right), (front, back) = (
        (share * count, (1.0 - share) * count)
        for share, count in zip(place, counts[:2], strict=True)
    )
    low, high, top = -min(front, run), min(back, run), min(float(counts[2]), run)
    shares = (np.arange(_ROWS) + 0.5) / _ROWS
    beside, above = np.meshgrid(low + (high - low) * shares, top * shares)
    # Half of each row inside the ball, cut off at the site on both sides; their mean times the area
    # of the section.
    half = np.sqrt(np.maximum(run**2 - beside**2 - above**2, 0.0))
    return float((np.minimum(left, half) + np.minimum(right, half)).mean()) * (high - low) * top


def _cells_in(
    sides_m: tuple[float, float, float], cell_m: float, settings: GasSettings, *, margin: bool
) -> tuple[int, ...]:
    """Return the number of cells in a site and its surroundings, along x, y and z.

    Args:
        sides_m: Width, depth and height of the air of the site.
        cell_m: Side of a cell.
        settings: The settings of the run.
        margin: Whether to include the outermost cells, which are not updated.
    """
    # Imported here, because both import Numba, and an estimate may not be followed by a blast.
    from blast_env.gas.grid import layers_to
    from blast_env.gas.state import MARGIN

    layers, outside = layers_to(settings.border_m / cell_m), MARGIN if margin else 0
    around = ceil(settings.margin_m / cell_m) + layers + outside
    more = (2 * around, 2 * around, layers + 2 * outside)
    return tuple(ceil(round(a / cell_m, 9)) + n for a, n in zip(sides_m, more, strict=True))


def cost_words(costs: Sequence[CostGuess], drawn: int = 0) -> str:
    """Return the cost of blasts one after the other, in words.

    Args:
        drawn: Number of blasts with a film, maps or walls.
    """
    if not costs:
        return "nothing to run: all results are available"
    blasts = "a blast" if len(costs) == 1 else f"{len(costs)} blasts"
    seconds = sum(cost.seconds for cost in costs) + drawn * _DRAWING_S
    memory_gb = max(cost.memory_bytes for cost in costs) / 1e9
    return f"{blasts} of gas: about {time_words(seconds)} on a busy core, {memory_gb:.1f} GB"


def time_words(seconds: float) -> str:
    """Return a time in words, rounded."""
    if seconds < 10.0:
        return f"{max(ceil(seconds), 1)} s"
    if seconds < 100.0:
        return f"{5.0 * round(seconds / 5.0):.0f} s"
    if seconds < 5400.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"
