"""The state of the gas for compiled code, and its operations cell by cell.

The state is an array (5 or 6, z, y, x) in units of still air, with a margin of cells around it.
"""

from math import sqrt
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Reals = NDArray[Any]

GAMMA: Final = 1.4
"""Ratio of specific heats, for both air and products."""

MARGIN: Final = 2
"""Layers of cells around the grid that are in the arrays, but not in the gas."""

DENSITY, X_MOMENTUM, Y_MOMENTUM, Z_MOMENTUM, ENERGY, FUEL = 0, 1, 2, 3, 4, 5
"""Components of the state, each per volume."""

AIR, MIRROR, OPEN = 0, -1, 1
"""Codes of cells: gas, solid (the normal velocity changes sign), beyond an open face."""

FUSED: Final = {"contract"}
"""Fused multiply-add: a quarter faster, without reordering of operations."""


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def burn(state: Reals, extent: NDArray[np.int64], share: Any, heat: Any) -> None:
    """Convert a share of the fuel in the cells of an extent to energy, `heat` per mass."""
    for z in range(len(extent)):
        y0, y1, x0, x1 = extent[z]
        for y in range(y0, y1):
            for x in range(x0, x1):
                burnt = share * state[FUEL, z, y, x]
                state[FUEL, z, y, x] -= burnt
                state[ENERGY, z, y, x] += heat * burnt


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def cool(state: Reals, extent: NDArray[np.int64], hottest: Any) -> None:
    """Add mass to gas hotter than `hottest` times still air, down to that temperature.

    Energy and momentum are unchanged.
    """
    real = state.dtype.type
    half, one, zero, gamma_1 = real(0.5), real(1.0), real(0.0), real(GAMMA - 1.0)
    for z in range(len(extent)):
        y0, y1, x0, x1 = extent[z]
        for y in range(y0, y1):
            for x in range(x0, x1):
                density = state[DENSITY, z, y, x]
                if density >= one:
                    continue
                motion = zero
                for k in range(X_MOMENTUM, ENERGY):
                    motion += state[k, z, y, x] * state[k, z, y, x]
                pressure = gamma_1 * (state[ENERGY, z, y, x] - half * motion / density)
                state[DENSITY, z, y, x] = max(density, pressure / hottest)


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def fastest_signal(state: Reals) -> float:
    """Return the largest signal speed, which limits the time step.

    It is the speed of sound plus the largest speed along an axis.
    """
    fastest = 0.0
    for z in range(state.shape[1]):
        for y in range(state.shape[2]):
            for x in range(state.shape[3]):
                density = state[DENSITY, z, y, x]
                u = state[X_MOMENTUM, z, y, x] / density
                v = state[Y_MOMENTUM, z, y, x] / density
                w = state[Z_MOMENTUM, z, y, x] / density
                inner = state[ENERGY, z, y, x] / density - 0.5 * (u * u + v * v + w * w)
                sound = sqrt(GAMMA * (GAMMA - 1.0) * inner)
                fastest = max(fastest, max(abs(u), abs(v), abs(w)) + sound)
    return fastest


@njit(nogil=True, cache=True, error_model="numpy")
def widen(extent: NDArray[np.int64], whole: NDArray[np.int64], axis: int) -> None:
    """Extend an extent along an axis by the range of a sweep, one cell.

    Slopes vanish in a cell of still air beside another one, so that nothing flows between them.

    Args:
        extent: First and last + 1 cells along y and x of each plane; updated in place (z, 4).
        whole: The extent of the grid (z, 4).
        axis: The axis, 0 for x.
    """
    if axis < 2:
        low = 2 * (1 - axis)
        for z in range(len(extent)):
            if extent[z, 1] > 0:
                extent[z, low] = max(extent[z, low] - 1, whole[z, low])
                extent[z, low + 1] = min(extent[z, low + 1] + 1, whole[z, low + 1])
        return
    below = np.zeros(4, dtype=np.int64)
    here = extent[0].copy()
    for z in range(1, len(extent) - 1):
        below[:], here[:] = here, extent[z]
        if whole[z, 1] == 0:
            continue
        for other in (below, extent[z + 1]):
            if other[1] > 0 and extent[z, 1] > 0:
                for low in (0, 2):
                    extent[z, low] = min(extent[z, low], other[low])
                    extent[z, low + 1] = max(extent[z, low + 1], other[low + 1])
            elif other[1] > 0:
                extent[z] = other


@njit(nogil=True, cache=True, error_model="numpy")
def layers_of(extent: NDArray[np.int64], axis: int) -> tuple[int, int, int]:
    """Return the first layer of cells that a sweep moves, the last + 1, and the number of cells.

    Layers are planes, and for a sweep along z rows in all planes.

    Args:
        extent: First and last + 1 cells along y and x of each plane (z, 4).
        axis: The axis, 0 for x.
    """
    first, end, cells = -1, 0, 0
    for z in range(len(extent)):
        y0, y1, x0, x1 = extent[z]
        if y1 > 0:
            low, high = (y0, y1) if axis == 2 else (z, z + 1)
            first, end = low if first < 0 else min(first, low), max(end, high)
            cells += (y1 - y0) * (x1 - x0)
    return max(first, 0), end, cells


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def tighten(state: Reals, still: Reals, extent: NDArray[np.int64], most: int) -> None:
    """Remove rows of still air from the four sides of each plane, at most `most` from each.

    Args:
        state: The state (5 or 6, z, y, x).
        still: Its values in still air (5 or 6,).
        extent: First and last + 1 cells along y and x of each plane; updated in place (z, 4).
        most: Largest number of rows.
    """
    for z in range(len(extent)):
        for side in range(4):
            for _ in range(most):
                if extent[z, 0] >= extent[z, 1] or extent[z, 2] >= extent[z, 3]:
                    extent[z] = 0
                    break
                row = extent[z, side] if side % 2 == 0 else extent[z, side] - 1
                if not _is_still(state, still, z, extent[z], side // 2, row):
                    break
                extent[z, side] += 1 if side % 2 == 0 else -1


@njit(error_model="numpy", fastmath=FUSED)
def _is_still(
    state: Reals, still: Reals, z: int, bounds: NDArray[np.int64], axis: int, row: int
) -> bool:
    y0, y1, x0, x1 = bounds
    if axis == 0:
        y0, y1 = row, row + 1
    else:
        x0, x1 = row, row + 1
    for k in range(len(still)):
        for y in range(y0, y1):
            for x in range(x0, x1):
                if state[k, z, y, x] != still[k]:
                    return False
    return True


@njit(nogil=True, cache=True, error_model="numpy")
def merge(
    fine: Reals,
    fine_code: NDArray[np.int8],
    coarse: Reals,
    coarse_code: NDArray[np.int8],
    z_start: NDArray[np.int64],
    y_start: NDArray[np.int64],
    x_start: NDArray[np.int64],
) -> None:
    """Set larger cells of air to the means over the air in the smaller cells within them.

    Args:
        fine: State of the smaller cells.
        fine_code: Codes of the smaller cells.
        coarse: State of the larger cells, updated in place; cells without air are unchanged.
        coarse_code: Codes of the larger cells.
        z_start: First layer of smaller cells in each layer of larger cells, and the end (nz + 1,).
        y_start: The same along y.
        x_start: The same along x.
    """
    real = coarse.dtype.type
    sums = np.zeros(len(coarse))
    for i in range(MARGIN, coarse.shape[1] - MARGIN):
        for j in range(MARGIN, coarse.shape[2] - MARGIN):
            for k in range(MARGIN, coarse.shape[3] - MARGIN):
                if coarse_code[i, j, k] != AIR:
                    continue
                sums[:] = 0.0
                count = 0
                for z in range(z_start[i], z_start[i + 1]):
                    for y in range(y_start[j], y_start[j + 1]):
                        for x in range(x_start[k], x_start[k + 1]):
                            if fine_code[z, y, x] == AIR:
                                count += 1
                                for m in range(len(coarse)):
                                    sums[m] += fine[m, z, y, x]
                if count > 0:
                    for m in range(len(coarse)):
                        coarse[m, i, j, k] = real(sums[m] / count)
