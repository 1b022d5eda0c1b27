"""What a run of gas dynamics can be told, and what its results are made of; without Numba."""

from dataclasses import dataclass
from math import inf, isclose
from typing import Final

from blast_env.errors import BlastEnvError, value_text
from blast_env.physics.scene import WALLS
from blast_env.units import MODULE_SIDE_M
from blast_env.values import finite_number

ROOF: Final = "roof"
FACE_NAMES: Final = (*WALLS, ROOF)
"""The faces of a structure; those of `FaceTable.face` count through them."""

CHECKED_SCALED_DISTANCE: Final = (1.7, 8.6)
"""Where the source was checked, m/kg^(1/3) (docs/engineers/gas.md)."""
CHECKED_CELLS: Final = 9.2
"""Least cells per cube root of the charge's mass in kg with which it was checked, times 1 m."""

UNIFORM: Final = "uniform"
CELLS: Final = (UNIFORM, "coarse", "fine")
"""How cells may be chosen."""

_REFINED_M: Final = 0.25
_FARTHEST_M: Final = 10_000.0
_LEAST_CELL_M: Final = 0.001


@dataclass(frozen=True)
class GasSettings:
    """How finely and how long a blast is run as compressible gas.

    Attributes:
        cells: `uniform`, or how cells of different size follow the blast: `coarse` for search,
            `fine` for final statements. Their smallest side is 0.25 m, or `cell_m` if that is less.
        cell_m: Side of a cell; a module's side must be a whole number of them.
        margin_m: How far the cells keep their size outside the site.
        border_m: How far the open borders are beyond that, and above the air, at least; the cells
            between grow outwards.
        settled_s: When the products of 100 kg are no more than hot gas, see `Settling`; grows with
            the cube root of the mass. Infinite where they never are.
        threads: Threads that share a blast; they change nothing but the time.
        time_limit_s: When a run ends at the latest; by default long after the last wave.

    Raises:
        BlastEnvError: If one of them is out of bounds.
    """

    cell_m: float = 0.5
    cells: str = UNIFORM
    margin_m: float = 2.0
    border_m: float = 24.0
    settled_s: float = 0.06
    threads: int = 1
    time_limit_s: float | None = None

    def __post_init__(self) -> None:
        """Check the arguments."""
        if self.cells not in CELLS:
            known = ", ".join(repr(each) for each in CELLS)
            raise BlastEnvError(f"cells is {value_text(self.cells)}, must be one of {known}")
        cell_m = finite_number("cell_m", self.cell_m)
        cells = MODULE_SIDE_M / cell_m if cell_m >= _LEAST_CELL_M else 0.0
        if not (cells >= 1.0 and isclose(cells, round(cells), rel_tol=1e-9)):
            raise BlastEnvError(
                f"cell_m is {self.cell_m:g}, must be {MODULE_SIDE_M:g} m, the side of a module, "
                f"divided by a whole number, and at least {_LEAST_CELL_M:g} m"
            )
        for name, length_m in (("margin_m", self.margin_m), ("border_m", self.border_m)):
            if not 0.0 <= finite_number(name, length_m) <= _FARTHEST_M:
                raise BlastEnvError(f"{name} is {length_m:g}, must be 0 to {_FARTHEST_M:g}")
        if self.settled_s != inf and not finite_number("settled_s", self.settled_s) > 0.0:
            raise BlastEnvError(f"settled_s is {self.settled_s:g}, must be above 0")
        limit_s = self.time_limit_s
        if limit_s is not None and not finite_number("time_limit_s", limit_s) > 0.0:
            raise BlastEnvError(f"time_limit_s is {limit_s:g}, must be above 0")

    @property
    def smallest_m(self) -> float:
        """Side of the smallest cells."""
        return self.cell_m if self.cells == UNIFORM else min(self.cell_m, _REFINED_M)
