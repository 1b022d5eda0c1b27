"""Compiled work on bricks: cubes of cells that are kept only where there is something to resolve.

A level has a table (z, y, x) of where each of its bricks lies in a pool, -1 for none, and pools of
states (bricks, components, z, y, x). A cell of a level has an index along each axis; the cell
`i // 2` of the level below it covers twice its side, with the same origin.

What connects levels keeps mass, momentum and energy: finer cells get slopes about the mean of the
coarser one, coarser cells get the mean of the finer ones, and where both meet, the coarser cell
gets the flow that the finer ones had (Berger and Colella, J. Comput. Phys. 82 (1989) 64).
"""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.physics.gas.lanes import larger
from blast_env.physics.gas.state import (
    AIR,
    DENSITY,
    ENERGY,
    GAMMA,
    MIRROR,
    OPEN,
    X_MOMENTUM,
    Reals,
)

SIDE: Final = 16
"""Cells along the edge of a brick."""

UNIT: Final = SIDE // 2
"""Cells along the edge of what is refined at once: a brick of the next finer level."""

Table = NDArray[np.int32]
Whole = NDArray[np.int64]


@njit(nogil=True, cache=True, error_model="numpy")
def fill_codes(
    codes: NDArray[np.int8], start: Whole, solid: NDArray[np.bool_], corner: Whole, bounds: Whole
) -> None:
    """Set what the cells of a box are to the kernels.

    Args:
        codes: Codes (z, y, x), set.
        start: Index of the first one (3,), along z, y and x as everything here.
        solid: Which cells of a part of the level are solid (z, y, x); all others are air.
        corner: Index of the first of those (3,).
        bounds: First and last + 1 index of the gas along z, y and x (6,); open beyond it, but
            below it is the ground.
    """
    for i in range(codes.shape[0]):
        for j in range(codes.shape[1]):
            for k in range(codes.shape[2]):
                z, y, x = start[0] + i, start[1] + j, start[2] + k
                code = AIR
                if z < bounds[0]:
                    code = MIRROR
                elif (
                    z >= bounds[1]
                    or not (bounds[2] <= y < bounds[3])
                    or not bounds[4] <= x < bounds[5]
                ):
                    code = OPEN
                else:
                    z, y, x = z - corner[0], y - corner[1], x - corner[2]
                    if (
                        0 <= z < solid.shape[0]
                        and 0 <= y < solid.shape[1]
                        and 0 <= x < solid.shape[2]
                        and solid[z, y, x]
                    ):
                        code = MIRROR
                codes[i, j, k] = code


@njit(nogil=True, cache=True, error_model="numpy")
def gather(
    box: Reals, start: Whole, old: Reals, new: Reals, share: Any, table: Table, still: Reals
) -> int:
    """Copy the cells of a box out of a level, between two times.

    Args:
        box: State (components, z, y, x), set.
        start: Index of its first cell (3,).
        old: Pool of the states at the earlier time.
        new: The same at the later one; not looked at where `share` is 0.
        share: How far the time is from the earlier to the later one.
        table: Where the bricks are.
        still: State of still air (components,), for cells of no brick.

    Returns:
        The number of cells of no brick.
    """
    zero = share == 0.0
    components, nz, ny, nx = box.shape
    missing = 0
    for i in range(nz):
        z = start[0] + i
        for j in range(ny):
            y = start[1] + j
            k = 0
            while k < nx:
                x = start[2] + k
                many = min(SIDE - x % SIDE, nx - k)
                at = table[z // SIDE, y // SIDE, x // SIDE]
                a, b, c = z % SIDE, y % SIDE, x % SIDE
                if at < 0:
                    missing += many
                    for m in range(components):
                        for n in range(many):
                            box[m, i, j, k + n] = still[m]
                elif zero:
                    for m in range(components):
                        for n in range(many):
                            box[m, i, j, k + n] = old[at, m, a, b, c + n]
                else:
                    for m in range(components):
                        for n in range(many):
                            before = old[at, m, a, b, c + n]
                            after = new[at, m, a, b, c + n]
                            box[m, i, j, k + n] = before + share * (after - before)
                k += many
    return missing


@njit(nogil=True, cache=True, error_model="numpy")
def scatter(box: Reals, start: Whole, margin: Whole, pool: Reals, table: Table) -> None:
    """Copy the inner cells of a box into the bricks of a level; all of them are there."""
    components = box.shape[0]
    nz, ny, nx = box.shape[1:]
    for i in range(margin[0], nz - margin[0]):
        z = start[0] + i
        for j in range(margin[1], ny - margin[1]):
            y = start[1] + j
            k = margin[2]
            while k < nx - margin[2]:
                x = start[2] + k
                many = min(SIDE - x % SIDE, nx - margin[2] - k)
                at = table[z // SIDE, y // SIDE, x // SIDE]
                a, b, c = z % SIDE, y % SIDE, x % SIDE
                for m in range(components):
                    for n in range(many):
                        pool[at, m, a, b, c + n] = box[m, i, j, k + n]
                k += many


@njit(nogil=True, cache=True, error_model="numpy")
def is_still(box: Reals, still: Reals) -> bool:
    """Return whether all cells of a box are still air."""
    for m in range(len(still)):
        for i in range(box.shape[1]):
            for j in range(box.shape[2]):
                for k in range(box.shape[3]):
                    if box[m, i, j, k] != still[m]:
                        return False
    return True


@njit(nogil=True, cache=True, error_model="numpy")
def prolong(
    box: Reals,
    start: Whole,
    table: Table,
    coarse: Reals,
    codes: NDArray[np.int8],
    fine_codes: NDArray[np.int8],
) -> None:
    """Set the air cells of a box that are in no brick from the next coarser level.

    Slopes of conserved quantities by minmod, none beside a solid or an open border, and none where
    they would take half the density: each coarser cell keeps what it has.

    Args:
        box: State (components, z, y, x), set; its sides are even.
        start: Index of its first cell (3,), even.
        table: Where the bricks of its level are.
        coarse: State of the coarser cells, from one before the box to one after it.
        codes: Codes of those.
        fine_codes: Codes of the cells of the box.
    """
    real = box.dtype.type
    quarter, half, zero = real(0.25), real(0.5), real(0.0)
    components, nz, ny, nx = box.shape
    slope = np.zeros((components, 3), dtype=box.dtype)
    for i in range(0, nz, 2):
        z = (start[0] + i) // SIDE
        for j in range(0, ny, 2):
            y = (start[1] + j) // SIDE
            for k in range(0, nx, 2):
                if table[z, y, (start[2] + k) // SIDE] >= 0:
                    continue
                ci, cj, ck = i // 2 + 1, j // 2 + 1, k // 2 + 1
                if codes[ci, cj, ck] != AIR:
                    continue
                for axis in range(3):
                    di, dj, dk = int(axis == 0), int(axis == 1), int(axis == 2)
                    clear = codes[ci - di, cj - dj, ck - dk] == AIR
                    clear = clear and codes[ci + di, cj + dj, ck + dk] == AIR
                    for m in range(components):
                        slope[m, axis] = zero
                        if clear:
                            mid = coarse[m, ci, cj, ck]
                            back = mid - coarse[m, ci - di, cj - dj, ck - dk]
                            ahead = coarse[m, ci + di, cj + dj, ck + dk] - mid
                            if back * ahead > zero:
                                least = back if abs(back) < abs(ahead) else ahead
                                slope[m, axis] = quarter * least
                for m in (DENSITY, ENERGY):
                    most = abs(slope[m, 0]) + abs(slope[m, 1]) + abs(slope[m, 2])
                    if most > half * coarse[m, ci, cj, ck]:
                        slope[:] = zero
                for a in range(2):
                    for b in range(2):
                        for c in range(2):
                            if fine_codes[i + a, j + b, k + c] != AIR:
                                continue
                            for m in range(components):
                                along = slope[m, 2] if c else -slope[m, 2]
                                across = slope[m, 1] if b else -slope[m, 1]
                                upright = slope[m, 0] if a else -slope[m, 0]
                                off = along + across + upright
                                box[m, i + a, j + b, k + c] = coarse[m, ci, cj, ck] + off


@njit(nogil=True, cache=True, error_model="numpy")
def restrict(fine: Reals, bricks: Whole, slots: Whole, coarse: Reals, table: Table) -> None:
    """Set the cells below bricks to the means of the finer ones.

    Args:
        fine: Pool of the finer level.
        bricks: Places of the bricks in their table (n, 3).
        slots: Where they lie in the pool (n,).
        coarse: Pool of the coarser level, changed.
        table: Where its bricks are.
    """
    eighth = fine.dtype.type(0.125)
    for n in range(len(slots)):
        z0, y0, x0 = UNIT * bricks[n, 0], UNIT * bricks[n, 1], UNIT * bricks[n, 2]
        at = table[z0 // SIDE, y0 // SIDE, x0 // SIDE]
        z0, y0, x0 = z0 % SIDE, y0 % SIDE, x0 % SIDE
        cells = fine[slots[n]]
        for m in range(coarse.shape[1]):
            for i in range(UNIT):
                for j in range(UNIT):
                    for k in range(UNIT):
                        a, b, c = 2 * i, 2 * j, 2 * k
                        low = cells[m, a, b, c] + cells[m, a, b, c + 1]
                        high = cells[m, a, b + 1, c] + cells[m, a, b + 1, c + 1]
                        sums = low + high
                        low = cells[m, a + 1, b, c] + cells[m, a + 1, b, c + 1]
                        high = cells[m, a + 1, b + 1, c] + cells[m, a + 1, b + 1, c + 1]
                        sums += low + high
                        coarse[at, m, z0 + i, y0 + j, x0 + k] = eighth * sums


@njit(nogil=True, cache=True, error_model="numpy")
def add_flow(
    register: Reals, seams: Table, flow: Reals, first: int, second: int, finer: bool
) -> None:
    """Add what went through one side of a box to what seams are to be put right by.

    Args:
        register: Finer less coarser flow through each seam (seams, components, cells, cells),
            changed.
        seams: Which seam each unit's face in the plane of that side is, -1 for none.
        flow: What went through (components, cells, cells).
        first: Index of its first cell along the first axis of the plane.
        second: The same along the second.
        finer: Whether the box is on the finer side: its cells are then half a seam's.
    """
    components, n1, n2 = flow.shape
    if finer:
        share = flow.dtype.type(0.125)  # two steps, each of a quarter of the area and half the side
        for i in range(0, n1, 2):
            a = (first + i) // 2
            for j in range(0, n2, 2):
                b = (second + j) // 2
                at = seams[a // UNIT, b // UNIT]
                if at >= 0:
                    for m in range(components):
                        low = flow[m, i, j] + flow[m, i, j + 1]
                        sums = low + (flow[m, i + 1, j] + flow[m, i + 1, j + 1])
                        register[at, m, a % UNIT, b % UNIT] += share * sums
    else:
        for i in range(n1):
            a = first + i
            for j in range(n2):
                b = second + j
                at = seams[a // UNIT, b // UNIT]
                if at >= 0:
                    for m in range(components):
                        register[at, m, a % UNIT, b % UNIT] -= flow[m, i, j]


@njit(nogil=True, cache=True, error_model="numpy")
def put_right(
    register: Reals,
    axis: int,
    seams: Whole,
    pool: Reals,
    table: Table,
    solid: NDArray[np.bool_],
    corner: Whole,
) -> None:
    """Give the coarser cells at seams the flow of the finer ones; not beside solids.

    Args:
        register: Finer less coarser flow through each seam (seams, components, cells, cells).
        axis: Axis that the seams are normal to: 0 for z, 1 for y, 2 for x.
        seams: Unit on the high side of each, and whether the coarser cells are there (seams, 4).
        pool: States of the coarser level, changed.
        table: Where its bricks are.
        solid: Which cells of a part of that level are solid.
        corner: Index of the first of those (3,).
    """
    cell = np.zeros(3, dtype=np.int64)
    for n in range(len(seams)):
        high = seams[n, 3] == 1
        for i in range(UNIT):
            for j in range(UNIT):
                beside = False
                for side in range(2):  # the finer side first
                    for a in range(3):
                        cell[a] = UNIT * seams[n, a]
                    cell[1 if axis == 0 else 0] += i
                    cell[1 if axis == 2 else 2] += j
                    if high != (side == 1):
                        cell[axis] -= 1
                    z, y, x = cell[0] - corner[0], cell[1] - corner[1], cell[2] - corner[2]
                    inside = 0 <= z < solid.shape[0] and 0 <= y < solid.shape[1]
                    if inside and 0 <= x < solid.shape[2] and solid[z, y, x]:
                        beside = True
                if beside:
                    continue
                z, y, x = cell[0], cell[1], cell[2]
                at = table[z // SIDE, y // SIDE, x // SIDE]
                for m in range(register.shape[1]):
                    off = register[n, m, i, j]
                    if high:
                        pool[at, m, z % SIDE, y % SIDE, x % SIDE] += off
                    else:
                        pool[at, m, z % SIDE, y % SIDE, x % SIDE] -= off


@njit(nogil=True, cache=True, error_model="numpy")
def look(
    pool: Reals,
    bricks: Whole,
    slots: Whole,
    solid: NDArray[np.bool_],
    corner: Whole,
    least: Any,
    steep: Any,
    loud: Reals,
    loudest: Reals,
    ahead: int,
    wanted: NDArray[np.bool_],
    kept: NDArray[np.bool_],
) -> None:
    """Mark the units of a level that are worth finer cells.

    Where the pressure changes from cell to cell by more than `steep` of the largest overpressure
    that has been there, or is still more than `loud` of that off still air's; and some cells around
    it. What would be marked with half of that may stay.

    Args:
        pool: States of the level.
        bricks: Places of its bricks (n, 3).
        slots: Where they lie in the pool (n,).
        solid: Which cells of a part of the level are solid (z, y, x).
        corner: Index of the first of those (3,).
        least: Change that does not count, in units of still air's pressure.
        steep: See above.
        loud: See above, for each unit (z, y, x); infinite for never.
        loudest: Largest overpressure of each unit so far, in those units, changed.
        ahead: Cells around what is marked that are marked too, at most a unit's side.
        wanted: Units to be refined (z, y, x), set.
        kept: Those that may stay refined, set.
    """
    real = pool.dtype.type
    gamma_1, half, one, zero = real(GAMMA - 1.0), real(0.5), real(1.0), real(0.0)
    p = np.empty((SIDE, SIDE, SIDE), dtype=pool.dtype)
    for n in range(len(slots)):
        cells = pool[slots[n]]
        z0, y0, x0 = SIDE * bricks[n, 0], SIDE * bricks[n, 1], SIDE * bricks[n, 2]
        for i in range(SIDE):
            for j in range(SIDE):
                for k in range(SIDE):
                    motion = real(0.0)
                    for m in range(X_MOMENTUM, ENERGY):
                        motion += cells[m, i, j, k] * cells[m, i, j, k]
                    inner = cells[ENERGY, i, j, k] - half * motion / cells[DENSITY, i, j, k]
                    p[i, j, k] = gamma_1 * inner - one
        # What does not compare is never the larger one: nothing changes towards a solid.
        z0, y0, x0 = z0 - corner[0], y0 - corner[1], x0 - corner[2]
        for i in range(max(-z0, 0), min(solid.shape[0] - z0, SIDE)):
            for j in range(max(-y0, 0), min(solid.shape[1] - y0, SIDE)):
                for k in range(max(-x0, 0), min(solid.shape[2] - x0, SIDE)):
                    if solid[z0 + i, y0 + j, x0 + k]:
                        p[i, j, k] = np.nan
        z0, y0, x0 = z0 + corner[0], y0 + corner[1], x0 + corner[2]
        for octant in range(8):
            a0, b0, c0 = UNIT * (octant // 4), UNIT * (octant // 2 % 2), UNIT * (octant % 2)
            at = ((z0 + a0) // UNIT, (y0 + b0) // UNIT, (x0 + c0) // UNIT)
            most = loudest[at]
            for i in range(a0, a0 + UNIT):
                for j in range(b0, b0 + UNIT):
                    for k in range(c0, c0 + UNIT):
                        most = larger(p[i, j, k], most)
            loudest[at] = most
            per_jump, per_loud = one / max(least, steep * most), one / (loud[at] * max(most, least))
            for i in range(a0, a0 + UNIT):
                for j in range(b0, b0 + UNIT):
                    for k in range(c0, c0 + UNIT):
                        here = p[i, j, k]
                        jump = larger(abs(p[min(i + 1, SIDE - 1), j, k] - here), zero)
                        jump = larger(abs(p[i, min(j + 1, SIDE - 1), k] - here), jump)
                        jump = larger(abs(p[i, j, min(k + 1, SIDE - 1)] - here), jump)
                        off = larger(abs(here) * per_loud, jump * per_jump)
                        if off > half:
                            _mark(kept, z0 + i, y0 + j, x0 + k, ahead)
                            if off > one:
                                _mark(wanted, z0 + i, y0 + j, x0 + k, ahead)


@njit(error_model="numpy")
def _mark(units: NDArray[np.bool_], z: int, y: int, x: int, ahead: int) -> None:
    """Mark the units within some cells of a cell."""
    nz, ny, nx = units.shape
    for a in range(max(z - ahead, 0) // UNIT, min((z + ahead) // UNIT + 1, nz)):
        for b in range(max(y - ahead, 0) // UNIT, min((y + ahead) // UNIT + 1, ny)):
            for c in range(max(x - ahead, 0) // UNIT, min((x + ahead) // UNIT + 1, nx)):
                units[a, b, c] = True


@njit(nogil=True, cache=True, error_model="numpy")
def boxes_of(units: NDArray[np.bool_], most: Whole) -> Whole:
    """Return boxes that together cover marked units once (n, 6), in a fixed order.

    Args:
        units: Which are marked (z, y, x).
        most: Units of a box along each axis, at most (3,).
    """
    left = units.copy()
    found = np.empty((max(int(units.sum()), 1), 6), dtype=np.int64)
    count = 0
    nz, ny, nx = units.shape
    for z in range(nz):
        for y in range(ny):
            for x in range(nx):
                if not left[z, y, x]:
                    continue
                x1, y1, z1 = x + 1, y + 1, z + 1
                while x1 < min(nx, x + most[2]) and left[z, y, x1]:
                    x1 += 1
                while y1 < min(ny, y + most[1]) and left[z, y1, x:x1].all():
                    y1 += 1
                while z1 < min(nz, z + most[0]) and left[z1, y:y1, x:x1].all():
                    z1 += 1
                left[z:z1, y:y1, x:x1] = False
                found[count] = (z, z1, y, y1, x, x1)
                count += 1
    return found[:count]


@njit(nogil=True, cache=True, error_model="numpy")
def paint(
    plane: Reals,
    pool: Reals,
    bricks: Whole,
    slots: Whole,
    axis: int,
    index: int,
    first: int,
    second: int,
    size: int,
) -> None:
    """Set the overpressure in a plane from the bricks that it cuts, in units of still air's.

    Args:
        plane: Over the two other axes, the later one last, in finest cells; changed.
        pool: States of the level.
        bricks: Places of its bricks (n, 3).
        slots: Where they lie in the pool (n,).
        axis: Axis that the plane is normal to: 0 for z, 1 for y, 2 for x.
        index: Index of the plane's cells along it, in the level.
        first: Index of the plane's first cell along its first axis, in finest cells.
        second: The same along its second.
        size: Finest cells along the edge of a cell of the level.
    """
    real = pool.dtype.type
    cell = np.zeros(3, dtype=np.int64)
    one, two = 1 if axis == 0 else 0, 1 if axis == 2 else 2
    for n in range(len(slots)):
        if index // SIDE != bricks[n, axis]:
            continue
        cell[axis] = index % SIDE
        for i in range(SIDE):
            for j in range(SIDE):
                cell[one], cell[two] = i, j
                z, y, x = cell[0], cell[1], cell[2]
                values = pool[slots[n]]
                motion = real(0.0)
                for m in range(X_MOMENTUM, ENERGY):
                    motion += values[m, z, y, x] * values[m, z, y, x]
                inner = values[ENERGY, z, y, x] - real(0.5) * motion / values[DENSITY, z, y, x]
                over = real(GAMMA - 1.0) * inner - real(1.0)
                a0 = (SIDE * bricks[n, one] + i) * size - first
                b0 = (SIDE * bricks[n, two] + j) * size - second
                for a in range(max(a0, 0), min(a0 + size, plane.shape[0])):
                    for b in range(max(b0, 0), min(b0 + size, plane.shape[1])):
                        plane[a, b] = over
