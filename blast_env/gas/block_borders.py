"""Compiled operations between levels of blocks: borders, means, interpolation.

A level has cells of half the side of the level before. Its blocks are the halves of blocks of that
level along each axis. A place in a level is an index of cells along z, y and x; blocks are entered
in a table of slots by their place in blocks, -1 for none.

Values in smaller cells are interpolated linearly from larger ones, with slopes that the
monotonised central limiter bounds, and conserve mass, momentum and energy: the means of eight small
cells are the large one's values.
"""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.gas.block_kernels import (
    BEYOND,
    BLOCK,
    CORNERS,
    FIRST_BORDER,
    MIRRORED,
    OPENED,
    SIDE,
)
from blast_env.gas.state import (
    AIR,
    DENSITY,
    ENERGY,
    FUEL,
    FUSED,
    GAMMA,
    MIRROR,
    X_MOMENTUM,
    Reals,
)

Table = NDArray[np.int32]
Codes = NDArray[np.int8]

SOLID_ONLY, WITH_AIR, OUTSIDE_ONLY, WHOLE = 0, 1, 2, 3
"""Kinds of places of blocks: without air but solids, with air, beyond open faces, and in the part
of the skirt that is not divided."""

_STENCIL: Final = 7  # a cell and its neighbours at the low and the high end of x, y and z
_LAYER: Final = SIDE**2
NOWHERE: Final = -1

WEAKEST: Final = 0.02
FRONT: Final = 0.25
"""Weak fronts: the least difference of the pressures of neighbours, in units of still air's, and
the least share of it in the larger overpressure."""

AGAIN: Final = 0.5
"""Least overpressure of a front after another one, relative to the highest so far."""


@njit(error_model="numpy")
def _air_at(table: Table, code: Codes, kept: int, z: int, y: int, x: int) -> int:
    """Return the index of a cell in the first component of its block, in the state as a row.

    It is `NOWHERE` if the cell is not air of a block of the level.
    """
    if z < 0 or y < 0 or x < 0:
        return NOWHERE
    k, j, i = z // SIDE, y // SIDE, x // SIDE
    if k >= table.shape[0] or j >= table.shape[1] or i >= table.shape[2]:
        return NOWHERE
    slot = table[k, j, i]
    if slot < 0:
        return NOWHERE
    cell = (z % SIDE * SIDE + y % SIDE) * SIDE + x % SIDE
    return slot * kept * BLOCK + cell if code[slot, cell] == AIR else NOWHERE


@njit(error_model="numpy")
def _fill_stencil(
    stencil: NDArray[np.int32], table: Table, code: Codes, kept: int, z: int, y: int, x: int
) -> None:
    """Find a cell and its neighbours; those that are not air are the cell itself."""
    stencil[0] = _air_at(table, code, kept, z, y, x)
    if stencil[0] < 0:
        return
    stencil[1] = _air_at(table, code, kept, z, y, x - 1)
    stencil[2] = _air_at(table, code, kept, z, y, x + 1)
    stencil[3] = _air_at(table, code, kept, z, y - 1, x)
    stencil[4] = _air_at(table, code, kept, z, y + 1, x)
    stencil[5] = _air_at(table, code, kept, z - 1, y, x)
    stencil[6] = _air_at(table, code, kept, z + 1, y, x)
    for k in range(1, _STENCIL):
        if stencil[k] < 0:
            stencil[k] = stencil[0]


@njit(nogil=True, cache=True, error_model="numpy")
def find_neighbours(
    table: Table, kinds: Codes, faces: NDArray[np.int64], slots: Table, coordinates: Table,
    beside: Table,
) -> int:  # fmt: skip
    """Enter what is beside each block of a level; return the number of borders with larger cells.

    Args:
        table: Slots of the level.
        kinds: Kinds of its places.
        faces: `MIRRORED` or `OPENED` at the low and high end of x, y and z (6,).
        slots: Its slots in order (n,).
        coordinates: Places of blocks (slots, 3).
        beside: What is beside each block; updated in place (slots, 6).
    """
    borders = 0
    shape = table.shape
    for slot in slots:
        for way in range(6):
            at = coordinates[slot].copy()
            axis = 2 - way // 2
            at[axis] += 2 * (way % 2) - 1
            if at[axis] < 0 or at[axis] >= shape[axis]:
                beside[slot, way] = faces[way]
            elif table[at[0], at[1], at[2]] >= 0:
                beside[slot, way] = table[at[0], at[1], at[2]]
            elif kinds[at[0], at[1], at[2]] == SOLID_ONLY:
                beside[slot, way] = MIRRORED
            elif kinds[at[0], at[1], at[2]] == OUTSIDE_ONLY:
                beside[slot, way] = OPENED
            else:
                beside[slot, way] = FIRST_BORDER - borders
                borders += 1
    return borders


@njit(nogil=True, cache=True, error_model="numpy")
def place_borders(
    slots: Table, beside: Table, coordinates: Table, larger_table: Table, code: Codes, kept: int,
    stencils: NDArray[np.int32], border_code: Codes, facing: Table,
) -> None:  # fmt: skip
    """Find the larger cells beyond each border of a level, and the codes of the cells there.

    Args:
        slots: Slots of the level (n,).
        beside: What is beside each block (slots, 6).
        coordinates: Places of blocks (slots, 3).
        larger_table: Slots of the level of larger cells.
        code: Codes of cells (slots, 512).
        kept: Components in the state.
        stencils: Cells for the interpolation at each border, set (borders, 16, 7).
        border_code: Codes of the small cells, set (borders, 128).
        facing: Blocks of larger cells there, set (borders,).
    """
    for slot in slots:
        for way in range(6):
            border = FIRST_BORDER - beside[slot, way]
            if border < 0:
                continue
            axis, high = way // 2, way % 2
            z, y, x = _beyond(coordinates[slot], axis, high, 0, 0)
            facing[border] = larger_table[z // SIDE, y // SIDE, x // SIDE]
            for i in range(CORNERS):
                for j in range(CORNERS):
                    z, y, x = _beyond(coordinates[slot], axis, high, i, j)
                    large = i * CORNERS + j
                    _fill_stencil(stencils[border, large], larger_table, code, kept, z, y, x)
                    kind = AIR
                    if stencils[border, large, 0] < 0:
                        kind = _code_at(larger_table, code, z, y, x)
                    for m in range(BEYOND):
                        for a in range(2):
                            for b in range(2):
                                row = (2 * i + a) * SIDE + 2 * j + b
                                border_code[border, m * _LAYER + row] = kind


@njit(error_model="numpy")
def _code_at(table: Table, code: Codes, z: int, y: int, x: int) -> int:
    slot = table[z // SIDE, y // SIDE, x // SIDE]
    if slot < 0:
        return MIRROR
    return int(code[slot, (z % SIDE * SIDE + y % SIDE) * SIDE + x % SIDE])


@njit(error_model="numpy")
def _beyond(place: Any, axis: int, high: int, i: int, j: int) -> tuple[int, int, int]:
    """Return the place of a large cell beyond a border: along z, y and x."""
    z, y, x = place[0] * CORNERS, place[1] * CORNERS, place[2] * CORNERS
    out = CORNERS if high else -1
    if axis == 0:
        return z + i, y + j, x + out
    if axis == 1:
        return z + i, y + out, x + j
    return z + out, y + i, x + j


@njit(error_model="numpy", fastmath=FUSED)
def _slope(low: Any, here: Any, high: Any, quarter: Any, zero: Any) -> Any:
    """Return a quarter of the limited difference from one large cell to the next."""
    back, ahead = here - low, high - here
    rise, fall = max(min(back, ahead), zero), min(max(back, ahead), zero)
    middle = quarter * (back + ahead)
    return quarter * max(min(middle + middle, rise), fall)


@njit(error_model="numpy", fastmath=FUSED)
def _slopes(row: Any, stencil: Any, component: int, quarter: Any, zero: Any) -> Any:
    """Return the value of a large cell, and its slopes along x, y and z."""
    more = component * BLOCK
    here = row[stencil[0] + more]
    dx = _slope(row[stencil[1] + more], here, row[stencil[2] + more], quarter, zero)
    dy = _slope(row[stencil[3] + more], here, row[stencil[4] + more], quarter, zero)
    dz = _slope(row[stencil[5] + more], here, row[stencil[6] + more], quarter, zero)
    return here, dx, dy, dz


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def see_beyond(
    row: Reals, still: Reals, active: NDArray[np.uint8], stencils: NDArray[np.int32], ways: Table,
    facing: Table, border: Reals, components: int, sweep: int,
) -> None:  # fmt: skip
    """Interpolate the larger cells beyond borders.

    Args:
        row: The state in a row.
        still: State of still air (6,).
        active: Whether the present step may change a block (slots,).
        stencils: Cells for the interpolation (borders, 16, 7).
        ways: Direction of each border: low and high end of x, y, z (borders,).
        facing: Block of larger cells there (borders,).
        border: The state beyond at the beginning of a step of the larger cells and after each of
            its sweeps; updated in place (borders, 4, 6, 128).
        components: Number of components.
        sweep: Number of sweeps of this step so far.
    """
    quarter, zero = row.dtype.type(0.25), row.dtype.type(0.0)
    for n in range(len(stencils)):
        if not active[facing[n]]:
            if sweep == 0:
                for k in range(components):
                    border[n, :, k, :] = still[k]
            continue
        axis = ways[n] // 2
        for k in range(components):
            layers = border[n, sweep, k]
            for large in range(CORNERS**2):
                stencil = stencils[n, large]
                at = large // CORNERS * 2 * SIDE + large % CORNERS * 2
                if stencil[0] < 0:
                    for to in (at, at + SIDE, at + _LAYER, at + _LAYER + SIDE):
                        layers[to] = still[k]
                        layers[to + 1] = still[k]
                    continue
                here, dx, dy, dz = _slopes(row, stencil, k, quarter, zero)
                if axis == 0:
                    along, up, right = dx, dz, dy
                elif axis == 1:
                    along, up, right = dy, dz, dx
                else:
                    along, up, right = dz, dy, dx
                low, high = here - along, here + along
                layers[at] = low - up - right
                layers[at + 1] = low - up + right
                layers[at + SIDE] = low + up - right
                layers[at + SIDE + 1] = low + up + right
                layers[at + _LAYER] = high - up - right
                layers[at + _LAYER + 1] = high - up + right
                layers[at + _LAYER + SIDE] = high + up - right
                layers[at + _LAYER + SIDE + 1] = high + up + right


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def correct_fluxes(
    row: Reals, moving: NDArray[np.uint8], active: NDArray[np.uint8],
    stencils: NDArray[np.int32], ways: Table, facing: Table, register: Reals, coordinates: Table,
    narrow_x: Reals, narrow_y: Reals, narrow_z: Reals, ratio: Any, components: int, kept: int,
) -> None:  # fmt: skip
    """Replace the fluxes of large cells at borders by the sums of those of small cells.

    Args:
        row: The state in a row, updated in place.
        moving: Whether a block is not still; updated in place (slots,).
        active: Whether the present step may change a block (slots,).
        stencils: The large cells, see `see_beyond`.
        ways: Direction of each border.
        facing: Block of larger cells there (borders,).
        register: Fluxes of the small cells less those of the large ones (borders, 6, 16).
        coordinates: Places of blocks (slots, 3).
        narrow_x: Ratio of cell side to the width of the large cells, from two before the grid on.
        narrow_y: The same along y.
        narrow_z: The same along z.
        ratio: Ratio of the time step of the large cells to their side.
        components: Number of components.
        kept: Components in the state.
    """
    for n in range(len(stencils)):
        slot = facing[n]
        if not active[slot]:
            continue
        axis, high = ways[n] // 2, ways[n] % 2
        for large in range(CORNERS**2):
            at = stencils[n, large, 0]
            if at < 0:
                continue
            cell = at % (kept * BLOCK)
            if axis == 0:
                narrow = narrow_x[coordinates[slot, 2] * SIDE + cell % SIDE + BEYOND]
            elif axis == 1:
                narrow = narrow_y[coordinates[slot, 1] * SIDE + cell // SIDE % SIDE + BEYOND]
            else:
                narrow = narrow_z[coordinates[slot, 0] * SIDE + cell // _LAYER + BEYOND]
            share = ratio * narrow if high else -ratio * narrow
            for k in range(components):
                missing = register[n, k, large]
                if missing != 0:
                    row[at + k * BLOCK] += share * missing
                    moving[slot] = 1


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def take_means(
    state: Reals, code: Codes, clear: NDArray[np.uint8], moving: NDArray[np.uint8],
    active: NDArray[np.uint8], slots: Table, parents: Table, coordinates: Table, components: int,
) -> None:  # fmt: skip
    """Set large cells to the means over the air of the small cells within them.

    Args:
        state: The state (slots, 6, 512), updated in place.
        code: Codes of cells (slots, 512).
        clear: Whether all cells of a block are air (slots,).
        moving: Whether a block is not still; updated in place for larger blocks (slots,).
        active: Whether the present step may change a block (slots,).
        slots: The blocks of small cells (n,).
        parents: The block of larger cells around each block (slots,).
        coordinates: Places of blocks (slots, 3).
        components: Number of components.
    """
    eighth = state.dtype.type(0.125)
    for slot in slots:
        parent = parents[slot]
        if not active[parent]:
            continue
        if moving[slot]:
            moving[parent] = 1
        z0, y0, x0 = (
            coordinates[slot, 0] % 2 * CORNERS,
            coordinates[slot, 1] % 2 * CORNERS,
            coordinates[slot, 2] % 2 * CORNERS,
        )
        for z in range(CORNERS):
            for y in range(CORNERS):
                first = (2 * z * SIDE + 2 * y) * SIDE
                to = ((z0 + z) * SIDE + y0 + y) * SIDE + x0
                if not clear[slot]:
                    for x in range(CORNERS):
                        if code[parent, to + x] == AIR:
                            _take_mean(state, code, slot, first + 2 * x, parent, to + x, components)
                    continue
                for k in range(components):
                    small, large = state[slot, k], state[parent, k]
                    for x in range(CORNERS):
                        at = first + 2 * x
                        total = (small[at] + small[at + 1]) + (
                            small[at + SIDE] + small[at + SIDE + 1]
                        )
                        at += _LAYER
                        total += (small[at] + small[at + 1]) + (
                            small[at + SIDE] + small[at + SIDE + 1]
                        )
                        large[to + x] = eighth * total


@njit(error_model="numpy", fastmath=FUSED)
def _take_mean(
    state: Reals, code: Codes, slot: int, first: int, parent: int, to: int, components: int
) -> None:
    for k in range(components):
        count, base, total = 0, state[slot, k, first], 0.0
        for part in range(8):
            at = first + (part // 4) * _LAYER + (part // 2 % 2) * SIDE + part % 2
            if code[slot, at] == AIR:
                if count == 0:
                    base = state[slot, k, at]
                total += float(state[slot, k, at]) - float(base)
                count += 1
        if count > 0:
            state[parent, k, to] = float(base) + total / count


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def divide(
    state: Reals, still: Reals, code: Codes, table: Table, slots: Table, coordinates: Table,
    components: int,
) -> None:  # fmt: skip
    """Set new blocks from the larger cells around them.

    Args:
        state: The state (slots, 6, 512), updated in place.
        still: State of still air (6,).
        code: Codes of cells (slots, 512).
        table: Slots of the level of larger cells.
        slots: The new blocks (n,).
        coordinates: Places of blocks (slots, 3).
        components: Number of components.
    """
    stencil = np.empty(_STENCIL, dtype=np.int32)
    row, kept = state.reshape(-1), state.shape[1]
    quarter, zero = state.dtype.type(0.25), state.dtype.type(0.0)
    for slot in slots:
        z0, y0, x0 = coordinates[slot, 0], coordinates[slot, 1], coordinates[slot, 2]
        for large in range(CORNERS**3):
            z, y, x = large // CORNERS**2, large // CORNERS % CORNERS, large % CORNERS
            _fill_stencil(
                stencil, table, code, kept, z0 * CORNERS + z, y0 * CORNERS + y, x0 * CORNERS + x
            )
            first = (2 * z * SIDE + 2 * y) * SIDE + 2 * x
            for k in range(components):
                here, dx, dy, dz = still[k], zero, zero, zero
                if stencil[0] >= 0:
                    here, dx, dy, dz = _slopes(row, stencil, k, quarter, zero)
                for part in range(8):
                    at = first + (part // 4) * _LAYER + (part // 2 % 2) * SIDE + part % 2
                    value = here + (dx if part % 2 else -dx)
                    value += (dy if part // 2 % 2 else -dy) + (dz if part // 4 else -dz)
                    state[slot, k, at] = value if code[slot, at] == AIR else still[k]


@njit(error_model="numpy", fastmath=FUSED)
def _pressure(state: Reals, slot: int, cell: int) -> Any:
    half = state.dtype.type(0.5)
    motion = state[slot, 1, cell] * state[slot, 1, cell]
    motion += state[slot, 2, cell] * state[slot, 2, cell]
    motion += state[slot, 3, cell] * state[slot, 3, cell]
    inner = state[slot, ENERGY, cell] - half * motion / state[slot, DENSITY, cell]
    return state.dtype.type(GAMMA - 1.0) * inner


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def find_fronts(
    state: Reals,
    code: Codes,
    moving: NDArray[np.uint8],
    slots: Table,
    beside: Table,
    coordinates: Table,
    wanted: NDArray[np.uint8],
    highest: NDArray[np.float32],
    jump: float,
    reach: int,
) -> None:
    """Mark the places of smaller blocks around fronts.

    A front is where the pressures of neighbours differ by a share of the lower one, or by
    `WEAKEST` and by a share `FRONT` of the overpressure. It counts where the overpressure is at
    least `AGAIN` times the highest so far: weaker waves after it raise no peak.

    Args:
        state: The state (slots, 6, 512).
        code: Codes of cells (slots, 512).
        moving: Whether a block is not still (slots,).
        slots: The blocks to search (n,).
        beside: What is beside each block (slots, 6).
        coordinates: Places of blocks (slots, 3).
        wanted: Places of smaller blocks, updated in place.
        highest: Highest overpressures so far in the places of smaller blocks, in units of still
            air's pressure, updated in place.
        jump: Least difference, relative to the lower pressure.
        reach: Cells around such a cell to be divided, too.
    """
    pressure = np.empty(BLOCK, dtype=state.dtype)
    found = np.zeros(BLOCK, dtype=np.uint8)
    now = np.zeros(8, dtype=np.float32)
    counts = np.zeros(8, dtype=np.uint8)
    for slot in slots:
        if not moving[slot]:
            continue
        now[:] = 0.0
        for cell in range(BLOCK):
            pressure[cell] = _pressure(state, slot, cell)
            if code[slot, cell] == AIR:
                part = _eighth(cell)
                now[part] = max(now[part], abs(pressure[cell] - 1))
        for part in range(8):
            z = 2 * coordinates[slot, 0] + part // 4
            y = 2 * coordinates[slot, 1] + part // 2 % 2
            x = 2 * coordinates[slot, 2] + part % 2
            counts[part] = now[part] >= AGAIN * highest[z, y, x]
            highest[z, y, x] = max(highest[z, y, x], now[part])
        found[:] = 0
        for cell in range(BLOCK):
            if code[slot, cell] != AIR or not counts[_eighth(cell)]:
                continue
            for axis in range(3):
                stride = SIDE**axis
                if cell // stride % SIDE < SIDE - 1:
                    other = cell + stride
                    if code[slot, other] == AIR and _differs(pressure[cell], pressure[other], jump):
                        found[cell] = 1
                        found[other] = 1
                elif beside[slot, 2 * axis + 1] >= 0:
                    next_slot = beside[slot, 2 * axis + 1]
                    other = cell - (SIDE - 1) * stride
                    if code[next_slot, other] == AIR and _differs(
                        pressure[cell], _pressure(state, next_slot, other), jump
                    ):
                        found[cell] = 1
        _mark(found, coordinates[slot], wanted, reach)


@njit(error_model="numpy")
def _eighth(cell: int) -> int:
    """Return the number of the eighth of a block that holds a cell."""
    z, y, x = cell // _LAYER, cell // SIDE % SIDE, cell % SIDE
    return z // CORNERS * 4 + y // CORNERS * 2 + x // CORNERS


@njit(error_model="numpy")
def _differs(one: Any, other: Any, jump: float) -> bool:
    """Return whether two pressures, in units of still air's, differ as in a front."""
    difference = abs(one - other)
    if difference > jump * min(one, other):
        return True
    excess = max(abs(one - 1), abs(other - 1))
    return difference > WEAKEST and difference > FRONT * excess


@njit(error_model="numpy")
def _mark(found: NDArray[np.uint8], place: Any, wanted: NDArray[np.uint8], reach: int) -> None:
    for cell in range(BLOCK):
        if found[cell] == 0:
            continue
        z = place[0] * SIDE + cell // _LAYER
        y = place[1] * SIDE + cell // SIDE % SIDE
        x = place[2] * SIDE + cell % SIDE
        z0, z1 = max(z - reach, 0) // CORNERS, min((z + reach) // CORNERS + 1, wanted.shape[0])
        y0, y1 = max(y - reach, 0) // CORNERS, min((y + reach) // CORNERS + 1, wanted.shape[1])
        x0, x1 = max(x - reach, 0) // CORNERS, min((x + reach) // CORNERS + 1, wanted.shape[2])
        for k in range(z0, z1):
            for j in range(y0, y1):
                for i in range(x0, x1):
                    wanted[k, j, i] = 1


@njit(nogil=True, cache=True, error_model="numpy")
def hold_around(wanted: NDArray[np.uint8], larger: NDArray[np.uint8], kinds: Codes) -> None:
    """Mark the larger blocks with air that hold wanted ones and all those around them."""
    shape = wanted.shape
    for z in range(shape[0]):
        for y in range(shape[1]):
            for x in range(shape[2]):
                if not wanted[z, y, x]:
                    continue
                for k in range(max(z - 1, 0) // 2, min(z + 1, shape[0] - 1) // 2 + 1):
                    for j in range(max(y - 1, 0) // 2, min(y + 1, shape[1] - 1) // 2 + 1):
                        for i in range(max(x - 1, 0) // 2, min(x + 1, shape[2] - 1) // 2 + 1):
                            if kinds[k, j, i] == WITH_AIR:
                                larger[k, j, i] = 1


@njit(nogil=True, cache=True, error_model="numpy")
def drop_unheld(
    wanted: NDArray[np.uint8], kinds: Codes, held: NDArray[np.uint8], larger_kinds: Codes
) -> None:
    """Unmark blocks without air, and those with a neighbour outside all larger blocks."""
    shape = wanted.shape
    for z in range(shape[0]):
        for y in range(shape[1]):
            for x in range(shape[2]):
                if wanted[z, y, x] and (
                    kinds[z, y, x] != WITH_AIR or not _is_held(held, larger_kinds, shape, z, y, x)
                ):
                    wanted[z, y, x] = 0


@njit(error_model="numpy")
def _is_held(held: NDArray[np.uint8], kinds: Codes, shape: Any, z: int, y: int, x: int) -> bool:
    for k in range(max(z - 1, 0) // 2, min(z + 1, shape[0] - 1) // 2 + 1):
        for j in range(max(y - 1, 0) // 2, min(y + 1, shape[1] - 1) // 2 + 1):
            for i in range(max(x - 1, 0) // 2, min(x + 1, shape[2] - 1) // 2 + 1):
                if not held[k, j, i] and kinds[k, j, i] in (WITH_AIR, WHOLE):
                    return False
    return True


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def note_motion(
    state: Reals, still: Reals, moving: NDArray[np.uint8], slots: Table, components: int
) -> None:
    """Note which blocks are not still."""
    for slot in slots:
        moving[slot] = 0
        for k in range(components):
            for cell in range(BLOCK):
                if state[slot, k, cell] != still[k]:
                    moving[slot] = 1
                    break
            if moving[slot]:
                break


@njit(nogil=True, cache=True, error_model="numpy")
def find_active(
    table: Table, larger_table: Table, moving: NDArray[np.uint8], slots: Table,
    coordinates: Table, active: NDArray[np.uint8],
) -> int:  # fmt: skip
    """Note which blocks of a level a step may change: those beside moving gas; return how many.

    Args:
        table: Slots of the level.
        larger_table: Slots of the level of larger cells.
        moving: Whether a block is not still (slots,).
        slots: The blocks of the level (n,).
        coordinates: Places of blocks (slots, 3).
        active: The result; updated in place (slots,).
    """
    count = 0
    for slot in slots:
        active[slot] = moving[slot] or _beside_motion(
            table, larger_table, moving, coordinates[slot]
        )
        count += active[slot]
    return count


@njit(error_model="numpy")
def _beside_motion(
    table: Table, larger_table: Table, moving: NDArray[np.uint8], place: Any
) -> bool:
    shape = table.shape
    z, y, x = place[0], place[1], place[2]
    for k in range(max(z - 1, 0), min(z + 2, shape[0])):
        for j in range(max(y - 1, 0), min(y + 2, shape[1])):
            for i in range(max(x - 1, 0), min(x + 2, shape[2])):
                other = table[k, j, i]
                if other < 0 and larger_table.size > 0:
                    other = larger_table[k // 2, j // 2, i // 2]
                if other >= 0 and moving[other]:
                    return True
    return False


@njit(nogil=True, cache=True, error_model="numpy")
def find_runs(
    slots: Table, active: NDArray[np.uint8], beside: Table, axis: int, runs: Table
) -> int:
    """Enter the runs of active blocks along an axis, and return their number.

    Args:
        slots: The blocks of a level (n,).
        active: Whether a step may change them (slots,).
        beside: What is beside each block (slots, 6).
        axis: The axis.
        runs: First slot and number of blocks of each run; updated in place (n, 2).
    """
    count = 0
    for slot in slots:
        before = beside[slot, 2 * axis]
        if not active[slot] or (before >= 0 and active[before]):
            continue
        runs[count, 0], runs[count, 1] = slot, 0
        at = slot
        while at >= 0 and active[at]:
            runs[count, 1] += 1
            at = beside[at, 2 * axis + 1]
        count += 1
    return count


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def burn_blocks(
    state: Reals, slots: Table, active: NDArray[np.uint8], share: Any, heat: Any
) -> None:
    """Convert a share of the fuel in active blocks to energy, `heat` per mass."""
    for slot in slots:
        if active[slot]:
            for cell in range(BLOCK):
                burnt = share * state[slot, FUEL, cell]
                state[slot, FUEL, cell] -= burnt
                state[slot, ENERGY, cell] += heat * burnt


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def cool_blocks(state: Reals, slots: Table, active: NDArray[np.uint8], hottest: Any) -> None:
    """Add mass to gas hotter than `hottest` times still air; see `state.cool`."""
    real = state.dtype.type
    half, one, gamma_1 = real(0.5), real(1.0), real(GAMMA - 1.0)
    for slot in slots:
        if not active[slot]:
            continue
        for cell in range(BLOCK):
            density = state[slot, DENSITY, cell]
            if density >= one:
                continue
            motion = real(0.0)
            for k in range(X_MOMENTUM, ENERGY):
                motion += state[slot, k, cell] * state[slot, k, cell]
            pressure = gamma_1 * (state[slot, ENERGY, cell] - half * motion / density)
            state[slot, DENSITY, cell] = max(density, pressure / hottest)


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def fastest_in(state: Reals, slots: Table) -> float:
    """Return the largest signal speed in blocks; see `state.fastest_signal`."""
    fastest = 0.0
    for slot in slots:
        for cell in range(BLOCK):
            density = state[slot, DENSITY, cell]
            most = 0.0
            for k in range(X_MOMENTUM, ENERGY):
                most = max(most, abs(state[slot, k, cell] / density))
            sound = np.sqrt(GAMMA * _pressure(state, slot, cell) / density)
            fastest = max(fastest, most + sound)
    return float(fastest)


@njit(nogil=True, cache=True, error_model="numpy")
def find_codes(
    solid: NDArray[np.bool_], lead: NDArray[np.int64], outside: Codes, factor: int, slots: Table,
    coordinates: Table, code: Codes, clear: NDArray[np.uint8],
) -> None:  # fmt: skip
    """Set the codes of the cells of blocks.

    Args:
        solid: The solid cells of the level's size in the grid (nx, ny, nz).
        lead: Cells of the level before the grid along x, y and z (3,).
        outside: Codes of the largest cells (z, y, x).
        factor: Cells of the level along the edge of a largest one.
        slots: The blocks (n,).
        coordinates: Places of blocks (slots, 3).
        code: Codes; updated in place (slots, 512).
        clear: Whether all cells of a block are air; updated in place (slots,).
    """
    for slot in slots:
        clear[slot] = 1
        for cell in range(BLOCK):
            z = coordinates[slot, 0] * SIDE + cell // _LAYER
            y = coordinates[slot, 1] * SIDE + cell // SIDE % SIDE
            x = coordinates[slot, 2] * SIDE + cell % SIDE
            i, j, k = x - lead[0], y - lead[1], z - lead[2]
            if 0 <= i < solid.shape[0] and 0 <= j < solid.shape[1] and 0 <= k < solid.shape[2]:
                code[slot, cell] = MIRROR if solid[i, j, k] else AIR
            else:
                code[slot, cell] = outside[z // factor, y // factor, x // factor]
            if code[slot, cell] != AIR:
                clear[slot] = 0


@njit(nogil=True, cache=True, error_model="numpy")
def find_leaves(
    tables: Any, lead: NDArray[np.int64], cells: NDArray[np.int64], level: NDArray[np.int8]
) -> None:
    """Find the finest level with a block at each of some cells of the finest size.

    Args:
        tables: Slots of all levels.
        lead: Finest cells before the grid along x, y and z (3,).
        cells: The cells, x, y and z (n, 3).
        level: The result; updated in place (n,).
    """
    for n in range(len(cells)):
        x, y, z = cells[n, 0] + lead[0], cells[n, 1] + lead[1], cells[n, 2] + lead[2]
        level[n] = 0
        for k in range(len(tables) - 1, -1, -1):
            size = SIDE << (len(tables) - 1 - k)
            if tables[k][z // size, y // size, x // size] >= 0:
                level[n] = k
                break


@njit(nogil=True, cache=True, error_model="numpy")
def excess_at(
    state: Reals, tables: Any, lead: NDArray[np.int64], cells: NDArray[np.int64],
    excess: NDArray[np.float64],
) -> None:  # fmt: skip
    """Set overpressures, in units of still air's pressure, in cells of the finest size (n, 3).

    Operations are not fused, so that they are exactly 0 in still air.
    """
    for n in range(len(cells)):
        x, y, z = cells[n, 0] + lead[0], cells[n, 1] + lead[1], cells[n, 2] + lead[2]
        excess[n] = 0.0
        for k in range(len(tables) - 1, -1, -1):
            shift = len(tables) - 1 - k
            c, b, a = z >> shift, y >> shift, x >> shift
            slot = tables[k][c // SIDE, b // SIDE, a // SIDE]
            if slot >= 0:
                cell = (c % SIDE * SIDE + b % SIDE) * SIDE + a % SIDE
                excess[n] = _pressure(state, slot, cell) - state.dtype.type(1.0)
                break
