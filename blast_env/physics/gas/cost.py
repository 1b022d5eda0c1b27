"""What a blast by gas dynamics costs, told before it begins.

A small model of the solver: the cells that the blast reaches, the steps until the loads are
complete, and how many cells a core moves on in a second. docs/howto/app.md holds it against blasts
that were run.
"""

from dataclasses import dataclass
from math import cbrt, ceil, prod
from typing import Final

from blast_env.errors import BlastEnvError
from blast_env.physics.gas.settings import GasSettings

MOST_BYTES: Final = 8 * 2**30
MOST_S: Final = 6 * 3600.0
"""Memory and time on a core beyond which a blast is refused."""

_STEP_S_PER_M: Final = 0.9e-3
"""Time step over the side of a cell, as the sound in the products allows it."""

_SETTLED_S: Final = 0.026
"""How long loads come on after the front, over the cube root of the charge's mass in kg."""

_FRONT_M_S: Final = 390.0
_CELLS_PER_S: Final = 50e6
_BYTES_PER_CELL: Final = 26.0
_PROCESS_BYTES: Final = 450e6


@dataclass(frozen=True)
class CostGuess:
    """What one blast costs, about.

    Attributes:
        cells: The smallest cells that there are, those around the site included.
        steps: Steps until the loads are complete.
        memory_bytes: Memory of the process.
        moved: Cells that are moved on, in all steps together.
    """

    cells: int
    steps: int
    memory_bytes: float
    moved: float

    @property
    def seconds(self) -> float:
        """Time on a core that does nothing else; film and maps not included."""
        return self.moved / _CELLS_PER_S

    def check(self, settings: GasSettings) -> None:
        """Refuse a blast that costs too much.

        Raises:
            BlastEnvError: If it needs more memory or time than `MOST_BYTES` and `MOST_S`.
        """
        what = f"{self.cells:,} {settings.cell_words} and {self.steps:,} steps"
        instead = "take larger cells" + (", or cells='coarse'" * (not settings.is_growing))
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


def cost_of_run(
    settings: GasSettings, sides_m: tuple[float, float, float], tnt_kg: float, far_m: float
) -> CostGuess:
    """Return what a blast by gas dynamics costs, about; nothing is built for it.

    Args:
        settings: How it is run.
        sides_m: Width, depth and height of the air of the site.
        tnt_kg: Mass of the charge.
        far_m: How far it is from the farthest point that the run waits for.
    """
    end_s = settings.until_s or _SETTLED_S * cbrt(tnt_kg) + far_m / _FRONT_M_S
    cells, steps, moved, now_s = 0, 0, 0.0, 0.0
    for k, run_m in enumerate((*settings.doubled_m, None)):
        cell_m = 2.0**k * settings.smallest_m
        reached_m = sides_m if run_m is None else _reached_m(sides_m, run_m)
        there = _cells_in(reached_m, cell_m, settings)
        cells = cells or _cells_in(sides_m, cell_m, settings)
        until_s = end_s if run_m is None else min(run_m / _FRONT_M_S, end_s)
        taken = ceil((until_s - now_s) / (_STEP_S_PER_M * cell_m))
        steps, moved, now_s = steps + taken, moved + there * taken, until_s
    return CostGuess(cells, steps, _PROCESS_BYTES + _BYTES_PER_CELL * cells, moved)


def _reached_m(sides_m: tuple[float, float, float], run_m: float) -> tuple[float, float, float]:
    """Return the sides of what of a site a front has reached, if the charge is in its middle."""
    width_m, depth_m, height_m = sides_m
    return min(width_m, 2.0 * run_m), min(depth_m, 2.0 * run_m), min(height_m, run_m)


def _cells_in(sides_m: tuple[float, float, float], cell_m: float, settings: GasSettings) -> int:
    """Return how many cells fill a site and what is around it."""
    # Here, because both import Numba, and whoever asks for the cost may never run a blast.
    from blast_env.physics.gas.grid import layers_to
    from blast_env.physics.gas.state import MARGIN

    layers = layers_to(settings.border_m / cell_m)
    around = ceil(settings.margin_m / cell_m) + layers + MARGIN
    more = (2 * around, 2 * around, layers + 2 * MARGIN)
    return prod(ceil(round(a / cell_m, 9)) + n for a, n in zip(sides_m, more, strict=True))
