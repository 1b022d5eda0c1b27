"""The state of the gas for compiled code, and its operations cell by cell.

The state is an array (5 or 6, z, y, x) in units of still air, with a margin of cells around it.
"""

from math import sqrt
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.compilation import compiled
from blast_env.gas.simd import called_rarely, fetch, get, lanes_at, place, put

Reals = NDArray[Any]

Extent = NDArray[np.int32]
"""First and last + 1 cells of each row along x outside which the air is still; zeros in a row of
still air (z, y, 2)."""

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

FLOOR: Final = 1e-6
"""Floor of density and pressure, in units of those of still air."""

_ROWS_AHEAD: Final = 16
"""Rows between one that is read and one that is loaded into the cache."""


@njit(forceinline=False, error_model="numpy", fastmath=FUSED)
def lift(state: Any, cells: int, first: int, notes: Any) -> None:
    """Raise the density and pressure of the cells of a vector to the floor, at the same velocity.

    The number of cells that were below is added to the notes.
    """
    called_rarely()
    for at in range(first, first + lanes_at(state)):
        # 1. Density: momentum falls or rises with it, so that the velocity stays.
        r, motion = get(state, DENSITY * cells + at), 0.0
        slower = FLOOR / r if r > 0.0 else 0.0
        is_thin = not r >= FLOOR
        for k in range(X_MOMENTUM, ENERGY):
            momentum = get(state, k * cells + at)
            if is_thin:
                momentum = momentum * slower if r > 0.0 else 0.0
                put(state, k * cells + at, momentum)
            motion += momentum * momentum
        if is_thin:
            put(state, DENSITY * cells + at, FLOOR)
            r = FLOOR
        # 2. Pressure, from the energy that is not motion.
        # A little more than the floor, or rounding leaves the pressure below it.
        least = 1.01 * FLOOR / (GAMMA - 1.0) + 0.5 * motion / r
        is_cold = not get(state, ENERGY * cells + at) >= least
        if is_cold:
            put(state, ENERGY * cells + at, least)
        if is_thin or is_cold:
            put(notes, 1, get(notes, 1) + 1.0)


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def burn(state: Reals, extent: Extent, share: Any, heat: Any) -> None:
    """Convert a share of the fuel in the cells of an extent to energy, `heat` per mass."""
    for z in range(extent.shape[0]):
        for y in range(extent.shape[1]):
            for x in range(extent[z, y, 0], extent[z, y, 1]):
                # The share is 1 - exp(-dt / tau): first-order decay, exact for any step.
                burnt = share * state[FUEL, z, y, x]
                state[FUEL, z, y, x] -= burnt
                state[ENERGY, z, y, x] += heat * burnt


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def cool(state: Reals, extent: Extent, hottest: Any) -> None:
    """Add mass to gas hotter than `hottest` times still air, down to that temperature.

    Energy and momentum are unchanged.
    """
    real = state.dtype.type
    half, one, zero, gamma_1 = real(0.5), real(1.0), real(0.0), real(GAMMA - 1.0)
    for z in range(extent.shape[0]):
        for y in range(extent.shape[1]):
            for x in range(extent[z, y, 0], extent[z, y, 1]):
                density = state[DENSITY, z, y, x]
                if density >= one:
                    continue
                motion = zero
                for k in range(X_MOMENTUM, ENERGY):
                    motion += state[k, z, y, x] * state[k, z, y, x]
                # p / rho is the temperature: at the same pressure, more mass is as much colder.
                pressure = gamma_1 * (state[ENERGY, z, y, x] - half * motion / density)
                state[DENSITY, z, y, x] = max(density, pressure / hottest)


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
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
                # c^2 = gamma p / rho, with p / rho = (gamma - 1) e of the inner energy e (Toro,
                # section 3.1).
                sound = sqrt(GAMMA * (GAMMA - 1.0) * inner)
                fastest = max(fastest, max(abs(u), abs(v), abs(w)) + sound)
    return fastest


@compiled(nogil=True, error_model="numpy")
def widen(extent: Extent, whole: Extent, axis: int) -> None:
    """Extend an extent along an axis by the range of a sweep, one cell.

    Slopes vanish in a cell of still air beside another one, so that nothing flows between them.

    Args:
        extent: The extent; updated in place (z, y, 2).
        whole: The extent of the grid (z, y, 2).
        axis: The axis, 0 for x.
    """
    planes, rows = extent.shape[0], extent.shape[1]
    # Along x: one more cell at both ends of each row.
    if axis == 0:
        for z in range(planes):
            for y in range(rows):
                if extent[z, y, 1] > 0:
                    extent[z, y, 0] = max(extent[z, y, 0] - 1, whole[z, y, 0])
                    extent[z, y, 1] = min(extent[z, y, 1] + 1, whole[z, y, 1])
        return
    # Along y and z: the union of each row with the rows on both sides.
    # The rows before are extended already: keep what they were, a row or a plane of them.
    before = np.zeros((rows if axis == 2 else 1, 2), dtype=np.int32)
    for z in range(planes):
        if axis == 1:
            before[:] = 0
        for y in range(rows):
            low = before[y] if axis == 2 else before[0]
            low0, low1 = low[0], low[1]
            low[0], low[1] = extent[z, y, 0], extent[z, y, 1]
            if whole[z, y, 1] == 0:
                continue
            _unite(extent[z, y], low0, low1)
            if axis == 1 and y + 1 < rows:
                _unite(extent[z, y], extent[z, y + 1, 0], extent[z, y + 1, 1])
            if axis == 2 and z + 1 < planes:
                _unite(extent[z, y], extent[z + 1, y, 0], extent[z + 1, y, 1])


@njit(error_model="numpy")
def _unite(row: Any, first: int, end: int) -> None:
    """Extend a row of an extent to another one."""
    if end > 0:
        row[0] = min(row[0], first) if row[1] > 0 else first
        row[1] = max(row[1], end)


@compiled(nogil=True, error_model="numpy")
def layers_of(extent: Extent, axis: int) -> tuple[int, int, int]:
    """Return the first layer of cells in an extent, the last + 1, and the number of cells.

    Args:
        extent: The extent (z, y, 2).
        axis: The axis that layers are normal to: 1 for rows in all planes, 2 for planes.
    """
    first, end, cells = -1, 0, 0
    for z in range(extent.shape[0]):
        for y in range(extent.shape[1]):
            if extent[z, y, 1] > 0:
                layer = y if axis == 1 else z
                first, end = layer if first < 0 else min(first, layer), max(end, layer + 1)
                cells += extent[z, y, 1] - extent[z, y, 0]
    return max(first, 0), end, cells


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def tighten(state: Reals, still: Reals, extent: Extent) -> None:
    """Remove the cells of still air at both ends of each row of an extent.

    The ends lie far apart in memory: those of rows to come are loaded into the cache.

    Args:
        state: The state (5 or 6, z, y, x).
        still: Its values in still air (5 or 6,).
        extent: The extent; updated in place (z, y, 2).
    """
    values, length = place(state), state.shape[3]
    bounds, rows = place(extent), extent.shape[0] * extent.shape[1]
    for z in range(extent.shape[0]):
        for y in range(extent.shape[1]):
            to_come = min(z * extent.shape[1] + y + _ROWS_AHEAD, rows - 1)
            fetch(values, to_come * length + get(bounds, 2 * to_come))
            fetch(values, to_come * length + max(get(bounds, 2 * to_come + 1) - 1, 0))
            first, end = extent[z, y, 0], extent[z, y, 1]
            while first < end and _is_still(state, still, z, y, first):
                first += 1
            while first < end and _is_still(state, still, z, y, end - 1):
                end -= 1
            extent[z, y, 0], extent[z, y, 1] = (first, end) if first < end else (0, 0)


@njit(error_model="numpy", fastmath=FUSED)
def _is_still(state: Reals, still: Reals, z: int, y: int, x: int) -> bool:
    k = 0
    while k < len(still) and state[k, z, y, x] == still[k]:
        k += 1
    return k == len(still)


@compiled(nogil=True, error_model="numpy")
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
        coarse: State of the larger cells, updated in place; cells without air are unchanged.
        z_start: First layer of smaller cells in each layer of larger cells, and the end (nz + 1,).
        y_start: The same along y.
        x_start: The same along x.
    """
    real = coarse.dtype.type
    # Means of conserved variables over the air of a larger cell, summed in double precision.
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
