"""The grid of the gas: cubic cells, some of them solid, and what lies beyond its six faces."""

from dataclasses import dataclass
from enum import StrEnum
from math import isfinite
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.physics.gas.kernels import AIR, MARGIN, MIRROR, OPEN

FACE_NAMES: Final = ("x_low", "x_high", "y_low", "y_high", "z_low", "z_high")


class FaceKind(StrEnum):
    """What lies beyond a face of the grid."""

    OPEN = "open"
    MIRROR = "mirror"


@dataclass(frozen=True, eq=False)
class GasGrid:
    """Cubic cells of air and of solid.

    Attributes:
        cell_m: Side of a cell.
        solid: Which cells are solid (nx, ny, nz).
        origin_m: Low corner of the first cell: x, y, z.
        x_low: What lies beyond the face at the low end of x; the others likewise. The lowest one
            is the ground.
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

    def codes(self) -> NDArray[np.int8]:
        """Return what each cell is to the kernels, margin included (z, y, x)."""
        codes = np.full([n + 2 * MARGIN for n in self.shape], OPEN, dtype=np.int8)
        inner = slice(MARGIN, -MARGIN)
        codes[inner, inner, inner] = np.where(self.solid, MIRROR, AIR)
        for axis in range(3):
            kinds = [getattr(self, name) for name in FACE_NAMES[2 * axis : 2 * axis + 2]]
            for kind, place in zip(kinds, (slice(0, MARGIN), slice(-MARGIN, None)), strict=True):
                beyond = [inner, inner, inner]
                beyond[axis] = place
                codes[tuple(beyond)] = MIRROR if kind == FaceKind.MIRROR else OPEN
        return np.ascontiguousarray(codes.T)
