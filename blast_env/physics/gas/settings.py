"""What a run of gas dynamics can be told, and what its results are made of; without Numba."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import floor, inf, isclose, log2, nan
from types import MappingProxyType
from typing import Final, Self, TypeAlias

from blast_env.errors import BlastEnvError, value_text
from blast_env.physics.scene import WALLS
from blast_env.units import MODULE_SIDE_M
from blast_env.values import finite_number

ROOF: Final = "roof"
UNDERSIDE: Final = "underside"
FACE_NAMES: Final = (*WALLS, ROOF, UNDERSIDE)
"""The faces of a structure; those of `FaceTable.face` count through them."""

CHECKED_SCALED_DISTANCE: Final = (1.7, 8.6)
"""Where the source was checked, m/kg^(1/3) (docs/engineers/gas.md)."""
CHECKED_CELLS: Final = 9.2
"""Least cells per cube root of the charge's mass in kg with which it was checked, times 1 m."""

UNIFORM: Final = "uniform"


@dataclass(frozen=True)
class _Growth:
    """How cells grow (docs/engineers/gas.md).

    Attributes:
        smallest_m: Side of the cells that a blast begins with.
        run: How many cells the front runs before they are doubled.
        largest_m: Side of the last ones.
    """

    smallest_m: float
    run: float
    largest_m: float


_GROWING: Final[Mapping[str, _Growth]] = MappingProxyType(
    {"coarse": _Growth(0.5, 90.0, 1.0), "fine": _Growth(0.25, 130.0, 0.5)}
)
CELLS: Final = (UNIFORM, *_GROWING)
"""What cells can be."""

Cells: TypeAlias = float | str
"""Side of cells in m, or "coarse" or "fine" for cells that grow."""

_WAITED_FOR: Final = ("structures", "walls", "gauges")
_FARTHEST_M: Final = 10_000.0
_LEAST_CELL_M: Final = 0.001


@dataclass(frozen=True)
class GasSettings:
    """How finely and how long a blast is run as compressible gas.

    Attributes:
        cell_m: Side of a cell; a module's side must be a whole number of them.
        cells: "uniform", or how cells grow with the blast: until its front has run so many of them,
            then they are twice as large. "coarse", for search on large sites, goes from 0.5 to 1 m,
            "fine", for final statements there, from 0.25 to 0.5 m; from `cell_m` if that is less.
        margin_m: How far the cells keep their size outside the site.
        border_m: How far the open borders are beyond that, and above the air, at least; the cells
            between grow outwards.
        settled_s: When the products of 100 kg are no more than hot gas, see `Settling`; grows with
            the cube root of the mass. Infinite where they never are.
        threads: Threads that share a blast; they change nothing but the time.
        until: Whose loads have to be known before a run ends: those of the walls that count of each
            protected structure ("structures"), of every wall and roof on the site ("walls"), or of
            the protected structures and every gauge ("gauges"); or how long it lasts in seconds,
            also as text.

    Raises:
        BlastEnvError: If one of them is out of bounds.
    """

    cell_m: float = 0.5
    margin_m: float = 2.0
    border_m: float = 24.0
    settled_s: float = 0.06
    threads: int = 1
    until: str | float = "structures"
    cells: str = UNIFORM

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
        if self.until not in _WAITED_FOR:
            object.__setattr__(self, "until", _seconds(self.until))

    @classmethod
    def with_cells(cls, cells: Cells) -> Self:
        """Return settings with cells of one side in m, or with those that "coarse" or "fine" name.

        Raises:
            BlastEnvError: If it is neither.
        """
        return cls(cells=cells) if isinstance(cells, str) else cls(cell_m=cells)

    @property
    def is_growing(self) -> bool:
        """Whether cells grow with the blast."""
        return self.cells != UNIFORM

    @property
    def smallest_m(self) -> float:
        """Side of the smallest cells."""
        if not self.is_growing:
            return self.cell_m
        return min(self.cell_m, _GROWING[self.cells].smallest_m)

    @property
    def doubled_m(self) -> tuple[float, ...]:
        """How far the front has run in the open when cells become twice as large."""
        if not self.is_growing:
            return ()
        growth = _GROWING[self.cells]
        count = floor(log2(growth.largest_m / self.smallest_m) + 1e-9)
        return tuple(growth.run * self.smallest_m * 2.0**k for k in range(count))

    @property
    def cell_words(self) -> str:
        """Its cells, for people."""
        kind = f"{self.cells} cells from" if self.is_growing else "cells of"
        return f"{kind} {self.smallest_m:g} m"

    @property
    def until_s(self) -> float | None:
        """How long a run lasts; `None` where it waits for loads."""
        return None if isinstance(self.until, str) else self.until


def _seconds(until: object) -> float:
    """Return how long a run lasts.

    Raises:
        BlastEnvError: If it says neither that nor what a run waits for.
    """
    try:
        seconds = float(until) if isinstance(until, str) else finite_number("until", until)
    except (ValueError, BlastEnvError):
        seconds = nan
    if not 0.0 < seconds < inf:
        known = ", ".join(repr(each) for each in _WAITED_FOR)
        raise BlastEnvError(f"until is {value_text(until)}, must be {known} or seconds above 0")
    return seconds
