"""The grid of the gas: cubic cells, some of them solid, and the boundaries at its six faces.

An open face partly reflects waves, and lets the mean pressure in the grid drift. It should
therefore be far away. A skirt achieves this at low cost: layers of cells outside the grid, each
thicker than the one before. They are part of the gas, but no recorder sees them, and they resolve
no waves.
"""

from dataclasses import dataclass
from enum import StrEnum
from math import ceil, isfinite, log
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.gas.state import AIR, MARGIN, MIRROR, OPEN

FACE_NAMES: Final = ("x_low", "x_high", "y_low", "y_high", "z_low", "z_high")

BUFFER_GROWTH: Final = 2.0
"""Ratio of the thickness of a layer of the skirt to that of the one before."""


def layers_to(cells: float) -> int:
    """Return the number of layers of a skirt at least as thick as a number of cells."""
    # n layers of widths g, g^2, g^3, ... are g (g^n - 1) / (g - 1) thick together, which is solved
    # for n. Rounded before the ceiling, because logarithms of powers of g are whole but for their
    # last bits.
    inner = 1.0 + cells * (BUFFER_GROWTH - 1.0) / BUFFER_GROWTH
    return ceil(round(log(inner) / log(BUFFER_GROWTH), 9))


class FaceKind(StrEnum):
    """The boundary at a face of the grid."""

    OPEN = "open"
    MIRROR = "mirror"


@dataclass(frozen=True, eq=False)
class GasGrid:
    """Cubic cells of air and of solid.

    Attributes:
        cell_m: Side of a cell.
        solid: Mask of the solid cells (nx, ny, nz).
        origin_m: Low corner of the first cell: x, y, z.
        x_low: Boundary at the low end of x.
        x_high: Boundary at the high end of x.
        y_low: Boundary at the low end of y.
        y_high: Boundary at the high end of y.
        z_low: Boundary at the low end of z, by default the ground.
        z_high: Boundary at the high end of z.
        buffer_layers: Layers of growing cells beyond each open face; solids at the face extend
            through them, and the rest is air.

    Raises:
        BlastEnvError: If one of them is out of bounds.
    """

    cell_m: float
    solid: NDArray[np.bool_]
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    x_low: FaceKind = FaceKind.OPEN
    x_high: FaceKind = FaceKind.OPEN
    y_low: FaceKind = FaceKind.OPEN
    y_high: FaceKind = FaceKind.OPEN
    z_low: FaceKind = FaceKind.MIRROR
    z_high: FaceKind = FaceKind.OPEN
    buffer_layers: int = 0

    def __post_init__(self) -> None:
        if not (isfinite(self.cell_m) and self.cell_m > 0.0):
            raise BlastEnvError(f"cell_m is {self.cell_m}, but must be above 0")
        if self.solid.ndim != 3 or self.solid.dtype != np.bool_:
            raise BlastEnvError(
                f"solid has shape {self.solid.shape} and type {self.solid.dtype}, "
                "but must be of three dimensions and bool"
            )
        if 0 in self.solid.shape:
            raise BlastEnvError(f"solid has shape {self.solid.shape}: no cells at all")
        if len(self.origin_m) != 3 or not all(isfinite(value) for value in self.origin_m):
            raise BlastEnvError(f"origin_m is {self.origin_m}, but must be three finite lengths")
        for name in FACE_NAMES:
            kind = getattr(self, name)
            if kind not in tuple(FaceKind):
                known = ", ".join(repr(str(known)) for known in FaceKind)
                raise BlastEnvError(f"{name} is {kind!r}, but must be one of {known}")
        if self.buffer_layers < 0:
            raise BlastEnvError(f"skirt is {self.buffer_layers}, but must be at least 0")

    @property
    def shape(self) -> tuple[int, int, int]:
        """Cells along x, y and z."""
        nx, ny, nz = self.solid.shape
        return nx, ny, nz

    def centres_m(self, axis: int) -> NDArray[np.float64]:
        """Return the centres of the cells along an axis (n,)."""
        cells = np.arange(self.shape[axis], dtype=np.float64) + 0.5
        return np.asarray(self.origin_m[axis] + self.cell_m * cells)

    def cell_at(self, position_m: tuple[float, float, float]) -> tuple[int, int, int]:
        """Return the cell that holds a point.

        Raises:
            BlastEnvError: If the point is outside the grid.
        """
        index = []
        for axis, name in enumerate("xyz"):
            low = self.origin_m[axis]
            high = low + self.cell_m * self.shape[axis]
            if not low <= position_m[axis] <= high:
                raise BlastEnvError(
                    f"{name} = {position_m[axis]} m is outside the grid, {low} to {high} m"
                )
            cell = int((position_m[axis] - low) / self.cell_m)
            index.append(min(cell, self.shape[axis] - 1))
        return index[0], index[1], index[2]

    @property
    def buffer_layers_by_axis(self) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
        """Layers of the skirt at the low and the high end of x, y and z; 0 at a mirror."""
        x, y, z = (
            (self._layers_at(FACE_NAMES[2 * axis]), self._layers_at(FACE_NAMES[2 * axis + 1]))
            for axis in range(3)
        )
        return x, y, z

    def _layers_at(self, face: str) -> int:
        return self.buffer_layers if getattr(self, face) == FaceKind.OPEN else 0

    @property
    def lead(self) -> NDArray[np.int64]:
        """First cell of the grid in the arrays of the kernels, along x, y and z (3,)."""
        return np.array([MARGIN + low for low, _ in self.buffer_layers_by_axis])

    @property
    def array_shape(self) -> tuple[int, int, int]:
        """Cells of the kernels' arrays along x, y and z, with the skirt and the margin."""
        nx, ny, nz = (
            n + low + high + 2 * MARGIN
            for n, (low, high) in zip(self.shape, self.buffer_layers_by_axis, strict=True)
        )
        return nx, ny, nz

    @property
    def inner(self) -> tuple[slice, slice, slice]:
        """Slices of the grid in the arrays of the kernels, along z, y and x."""
        x, y, z = (
            slice(int(lead), int(lead) + n) for lead, n in zip(self.lead, self.shape, strict=True)
        )
        return z, y, x

    def narrowness(self, axis: int) -> NDArray[np.float64]:
        """Return the ratio of the cell side to the width of each array cell along an axis (n,)."""
        # Layers widen by g from the grid outwards; the margin has the width of the last one.
        low, high = self.buffer_layers_by_axis[axis]
        own = np.ones(self.shape[axis] + 2 * MARGIN)
        grown = BUFFER_GROWTH ** -np.arange(1.0, self.buffer_layers + 1.0)
        wide = np.concatenate((grown[:low][::-1], own[MARGIN:-MARGIN], grown[:high]))
        return np.pad(wide, MARGIN, mode="edge")

    def codes(self) -> NDArray[np.int8]:
        """Return the codes of the cells for the kernels, with skirt and margin (z, y, x)."""
        # (1) Everything is beyond an open face; (2) the grid and its skirt, through which solids at
        # a face go on; (3) the margin beyond a mirror.
        codes = np.full(self.array_shape, OPEN, dtype=np.int8)
        inner = slice(MARGIN, -MARGIN)
        solid = np.pad(self.solid, self.buffer_layers_by_axis, mode="edge")
        codes[inner, inner, inner] = np.where(solid, MIRROR, AIR)
        for axis in range(3):
            kinds = [getattr(self, name) for name in FACE_NAMES[2 * axis : 2 * axis + 2]]
            for kind, place in zip(kinds, (slice(0, MARGIN), slice(-MARGIN, None)), strict=True):
                beyond = [inner, inner, inner]
                beyond[axis] = place
                codes[tuple(beyond)] = MIRROR if kind == FaceKind.MIRROR else OPEN
        return np.ascontiguousarray(codes.T)
