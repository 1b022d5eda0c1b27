"""Settings of a gas-dynamics run and terms of its results; does not import Numba."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import floor, inf, isclose, log2, nan
from types import MappingProxyType
from typing import Final, Self, TypeAlias

from blast_env.errors import BlastEnvError, value_text
from blast_env.geometry import WALLS
from blast_env.units import MODULE_SIDE_M
from blast_env.values import finite_number

ROOF: Final = "roof"
UNDERSIDE: Final = "underside"
FACE_NAMES: Final = (*WALLS, ROOF, UNDERSIDE)
"""The faces of a structure; `FaceTable.face` indexes them."""

CHECKED_SCALED_DISTANCE: Final = (1.7, 8.6)
"""Scaled distances at which the source was checked, m/kg^(1/3) (docs/engineers/gas.md)."""
CHECKED_CELLS: Final = 9.2
"""Least number of cells per m/kg^(1/3) with which the source was checked."""


def distance_unchecked(scaled_m: float) -> str:
    """Return in words that a scaled distance, m/kg^(1/3), was not checked; empty if it was."""
    low, high = CHECKED_SCALED_DISTANCE
    if low <= scaled_m <= high:
        return ""
    return f"scaled distance {scaled_m:.2f} m/kg^(1/3), checked from {low:g} to {high:g}"


def cells_unchecked(cells: float) -> str:
    """Return in words that cells per m/kg^(1/3) were not checked; empty if they were."""
    if cells >= CHECKED_CELLS:
        return ""
    return f"{cells:.2g} cells per m/kg^(1/3), checked from {CHECKED_CELLS:g}: take smaller cells"


UNIFORM: Final = "uniform"


@dataclass(frozen=True)
class _Growth:
    """Growth of cells (docs/engineers/gas.md).

    Attributes:
        smallest_m: Side of the first cells.
        run: Path of the front before cells are doubled, in cells.
        largest_m: Side of the last cells.
    """

    smallest_m: float
    run: float
    largest_m: float


_GROWING: Final[Mapping[str, _Growth]] = MappingProxyType(
    {"coarse": _Growth(0.5, 90.0, 1.0), "fine": _Growth(0.25, 130.0, 0.5)}
)
CELLS: Final = (UNIFORM, *_GROWING)
"""Values of `GasSettings.cells`."""

Cells: TypeAlias = float | str
"""Side of cells in m, or "coarse" or "fine" for cells that grow."""

_WAITED_FOR: Final = ("structures", "walls", "gauges")
_FARTHEST_M: Final = 10_000.0
_LEAST_CELL_M: Final = 0.001


@dataclass(frozen=True)
class GasSettings:
    """Resolution and duration of a gas-dynamics blast.

    Attributes:
        cell_m: Side of a cell; a module's side must be a whole number of them.
        cells: "uniform", or the growth of cells with the blast: they are doubled each time the
            front has run a certain number of them. "coarse", for search on large sites, grows from
            0.5 to 1 m, "fine", for final results there, from 0.25 to 0.5 m; both begin at `cell_m`
            if that is smaller.
        margin_m: Width of the strip of cells of constant size outside the site.
        border_m: Least distance of the open borders from that strip, and from the top of the air;
            the cells between grow outwards.
        settled_s: Time from which the products of 100 kg are treated as hot gas, see `Settling`;
            grows with the cube root of the mass. Infinite for never.
        threads: Number of threads that share a blast; it changes only the time.
        until: The loads to be known before a run ends: those on the counted walls of each protected
            structure ("structures"), on every wall and roof of the site ("walls"), or at the
            protected structures and every gauge ("gauges"); or the duration in seconds, also as
            text.

    Raises:
        BlastEnvError: If one of them is out of bounds.
    """

    cell_m: float = 0.5
    margin_m: float = 2.0
    border_m: float = 24.0
    settled_s: float = 0.02
    threads: int = 1
    until: str | float = "structures"
    cells: str = UNIFORM

    def __post_init__(self) -> None:
        """Check the arguments."""
        if self.cells not in CELLS:
            known = ", ".join(repr(name) for name in CELLS)
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
        """Return settings with cells of one side in m, or with "coarse" or "fine" cells.

        Raises:
            BlastEnvError: If the name is unknown or the side is out of bounds.
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
        """Path of the front in the open at each doubling of cells; empty for uniform cells."""
        if not self.is_growing:
            return ()
        growth = _GROWING[self.cells]
        count = floor(log2(growth.largest_m / self.smallest_m) + 1e-9)
        return tuple(growth.run * self.smallest_m * 2.0**k for k in range(count))

    @property
    def cell_words(self) -> str:
        """Description of the cells for display."""
        kind = f"{self.cells} cells from" if self.is_growing else "cells of"
        return f"{kind} {self.smallest_m:g} m"

    @property
    def until_s(self) -> float | None:
        """Duration of a run; `None` if it waits for loads."""
        return None if isinstance(self.until, str) else self.until


def _seconds(until: object) -> float:
    """Return the duration of a run."""
    try:
        seconds = float(until) if isinstance(until, str) else finite_number("until", until)
    except (ValueError, BlastEnvError):
        seconds = nan
    if not 0.0 < seconds < inf:
        known = ", ".join(repr(name) for name in _WAITED_FOR)
        raise BlastEnvError(f"until is {value_text(until)}, must be {known} or seconds above 0")
    return seconds
