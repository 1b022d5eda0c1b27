"""The compiled sweep of the gas in blocks of cells, along one axis.

Blocks are cubes of 8 x 8 x 8 cells of one level of refinement. A sweep moves runs of blocks that
hang together along its axis. It has three parts, each for 16 rows of cells at once:

1. copy the rows of a run, and two cells beyond either end, into a workspace, layer by layer;
2. move them with the algebra of `blast_env.gas.kernels`, and keep the fluxes through all faces;
3. copy the cells back, and add the fluxes at walls and at borders of levels to their records.

Beyond an end are the cells of a resting block, a mirror, an open border, or larger cells. Those of
larger cells are interpolated in space and in time (`blast_env.gas.block_borders`).

All records of fluxes are in excess of still air's, which are exactly 0 where air is still.
"""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.gas.kernels import (
    Variables,
    at_faces,
    ghost,
    hllc,
    note_signals,
    safe_variables,
    still_air,
    update,
)
from blast_env.gas.simd import (
    all_zero,
    copy_eight,
    fill,
    get,
    lanes_at,
    load_codes,
    own_frame,
    place,
    put,
    store,
    transpose_eights,
)
from blast_env.gas.state import DENSITY, ENERGY, FUEL, FUSED, GAMMA, X_MOMENTUM, Reals

SIDE: Final = 8
"""Cells along an edge of a block."""

BLOCK: Final = SIDE**3
_LAYER: Final = SIDE**2
_ROWS: Final = 2 * SIDE
_CHUNKS: Final = _LAYER // _ROWS
BEYOND: Final = 2
"""Layers of cells beyond either end of a run."""

MIRRORED, OPENED, FIRST_BORDER = -1, -2, -3
"""Values of `beside` without a block: a mirror, an open border; at or below the third, the border
of level `FIRST_BORDER - value`."""

CORNERS: Final = 4
"""Larger cells along an edge of a block."""

SMALL: Final = 1 / 8
"""Share of a flux through a face of a small cell in a step in that through a large one."""


@njit(forceinline=True, error_model="numpy")
def _cell(axis: int, layer: int, row: int) -> int:
    """Return the index of a cell in its block from its layer along an axis and its row."""
    high, low = row // SIDE, row % SIDE
    if axis == 0:
        return high * _LAYER + low * SIDE + layer
    if axis == 1:
        return high * _LAYER + layer * SIDE + low
    return layer * _LAYER + row


@njit(forceinline=True, error_model="numpy")
def _copy_in(
    work: Any, work_code: Any, cells: int, to: int, state: Any, code: Any, slot: int,
    components: int, kept: int, axis: int, chunk: int,
) -> None:  # fmt: skip
    """Copy 16 rows of a block into layers of the workspace, from layer `to` on."""
    for half in range(2):
        first = _cell(axis, 0, chunk * _ROWS + half * SIDE)
        column = to * _ROWS + half * SIDE
        if axis == 0:
            transpose_eights(work_code, column, _ROWS, code, slot * BLOCK + first, SIDE)
            for k in range(components):
                transpose_eights(
                    work, k * cells + column, _ROWS, state, (slot * kept + k) * BLOCK + first, SIDE
                )
        else:
            stride = SIDE if axis == 1 else _LAYER
            for m in range(SIDE):
                copy_eight(work_code, column + m * _ROWS, code, slot * BLOCK + first + m * stride)
            for k in range(components):
                at = (slot * kept + k) * BLOCK + first
                for m in range(SIDE):
                    copy_eight(work, k * cells + column + m * _ROWS, state, at + m * stride)


@njit(forceinline=True, error_model="numpy")
def _copy_out(
    work: Any, cells: int, start: int, state: Any, slot: int, components: int, kept: int,
    axis: int, chunk: int,
) -> None:  # fmt: skip
    """Copy layers of the workspace back into 16 rows of a block."""
    for half in range(2):
        first = _cell(axis, 0, chunk * _ROWS + half * SIDE)
        column = start * _ROWS + half * SIDE
        for k in range(components):
            at = (slot * kept + k) * BLOCK + first
            if axis == 0:
                transpose_eights(state, at, SIDE, work, k * cells + column, _ROWS)
            else:
                stride = SIDE if axis == 1 else _LAYER
                for m in range(SIDE):
                    copy_eight(state, at + m * stride, work, k * cells + column + m * _ROWS)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _copy_beyond(
    work: Any, work_code: Any, cells: int, to: int, state: Any, code: Any, still: Any,
    border: Any, border_code: Any, weights: Any, neighbour: int, components: int, kept: int,
    axis: int, side: int, chunk: int,
) -> None:  # fmt: skip
    """Fill the two layers beyond an end of a run; `side` is 0 for the low end."""
    first = SIDE - BEYOND if side == 0 else 0
    for m in range(BEYOND):
        for lane in range(_ROWS):
            row = chunk * _ROWS + lane
            at = (to + m) * _ROWS + lane
            if neighbour >= 0:
                cell = _cell(axis, first + m, row)
                put(work_code, at, get(code, neighbour * BLOCK + cell))
                for k in range(components):
                    put(work, k * cells + at, get(state, (neighbour * kept + k) * BLOCK + cell))
            elif neighbour > FIRST_BORDER:
                put(work_code, at, -1 if neighbour == MIRRORED else 1)
                for k in range(components):
                    put(work, k * cells + at, get(still, k))
            else:
                where = FIRST_BORDER - neighbour
                inner = m * _LAYER + row
                put(work_code, at, get(border_code, where * BEYOND * _LAYER + inner))
                for k in range(components):
                    # The state at the beginning, and shares of what each sweep changed.
                    begin = (where * 4 * kept + k) * BEYOND * _LAYER + inner
                    apart = kept * BEYOND * _LAYER
                    old = get(border, begin)
                    value = old
                    for sweep in range(3):
                        new = get(border, begin + (sweep + 1) * apart)
                        value += get(weights, sweep) * (new - old)
                        old = new
                    put(work, k * cells + at, value)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _keep(
    flux: Any, cells: int, at: int, axis: int, fuel: bool, through: Variables, still: Any
) -> None:
    """Keep the fluxes through the low faces of a vector of cells, in excess of still air's."""
    store(flux, DENSITY * cells + at, through[0])
    store(flux, (X_MOMENTUM + axis) * cells + at, through[1] - still)
    store(flux, (X_MOMENTUM + (axis + 1) % 3) * cells + at, through[2])
    store(flux, (X_MOMENTUM + (axis + 2) % 3) * cells + at, through[3])
    store(flux, ENERGY * cells + at, through[4])
    if fuel:
        store(flux, FUEL * cells + at, through[5])


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _move(
    work: Any, code: Any, flux: Any, cells: int, layers: int, column: int, axis: int,
    fuel: bool, measure: bool, ratio: Any, narrow: Any, begin: int, still: Any, signals: Any,
    notes: Any,
) -> None:  # fmt: skip
    """Move a vector of rows in the workspace, except the two layers at either end.

    Args:
        work: The state in the workspace.
        code: The codes there.
        flux: Fluxes through the low face of each cell in excess of still air's; set.
        cells: Cells of a component in the workspace.
        layers: Layers of the run and beyond its ends.
        column: First row.
        axis: The axis.
        fuel: Whether the state has fuel.
        measure: Whether to note the speeds of signals.
        ratio: Ratio of time step to cell side.
        narrow: Place of the ratios of cell side to the width of the cells, from two layers before
            the grid on.
        begin: First layer of the run in the grid.
        still: State of still air.
        signals: Place of the largest speeds of signals.
        notes: Place of the number of cells raised to the floor.
    """
    air, zero = still_air(work, still), fill(work, 0.0)
    at = column + _ROWS
    low, _ = safe_variables(work, cells, column, axis, fuel, notes)
    here, per_r = safe_variables(work, cells, at, axis, fuel, notes)
    before, flux_before, ratio_before = air, air, zero
    for m in range(1, layers - 1):
        high, per_r_high = safe_variables(work, cells, at + _ROWS, axis, fuel, notes)
        is_clear = all_zero(work, code, at - _ROWS) and all_zero(work, code, at)
        if measure and BEYOND <= m < layers - BEYOND:
            note_signals(work, here, per_r, signals)
        low_image, high_image = low, high
        if not (is_clear and all_zero(work, code, at + _ROWS)):
            side_low = load_codes(work, code, at - _ROWS)
            side_high = load_codes(work, code, at + _ROWS)
            low_image = ghost(side_low == zero, low, here, side_low)
            high_image = ghost(side_high == zero, high, here, side_high)
        ratio_here = fill(work, ratio * get(narrow, begin + m))
        below, above = at_faces(work, low_image, here, high_image, per_r, ratio_here, fuel)
        if m >= BEYOND:
            left, right, wall = before, below, zero
            if not is_clear:
                side_left = load_codes(work, code, at - _ROWS)
                side_right = load_codes(work, code, at)
                left = ghost(side_left == zero, before, below, side_left)
                right = ghost(side_right == zero, below, before, side_right)
                wall = side_left + side_right
            through = hllc(work, left, right, wall, fuel)
            _keep(flux, cells, at, axis, fuel, through, air[4])
            if m > BEYOND:
                update(
                    work, cells, at - _ROWS, axis, fuel, code, ratio_before, flux_before, through
                )
            flux_before = through
        low, here, per_r, before, ratio_before = here, high, per_r_high, above, ratio_here
        at += _ROWS


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _record_walls(
    flux: Any, cells: int, start: int, axis: int, still_p: Any, pressure: Any, faces: Any,
    begin: int, end: int,
) -> None:  # fmt: skip
    """Copy the pressures on the recorded faces of 16 rows of a block."""
    for k in range(begin, end):
        at = (start + get(faces, 3 * k)) * _ROWS + get(faces, 3 * k + 1)
        put(pressure, get(faces, 3 * k + 2), get(flux, (X_MOMENTUM + axis) * cells + at) + still_p)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _add_small(
    flux: Any, cells: int, layer: int, register: Any, where: int, components: int, kept: int,
    chunk: int,
) -> None:  # fmt: skip
    """Add the fluxes of small cells at a border of levels to its register."""
    for k in range(components):
        for j in range(CORNERS):
            at = k * cells + layer * _ROWS + 2 * j
            total = get(flux, at) + get(flux, at + 1)
            total += get(flux, at + SIDE) + get(flux, at + SIDE + 1)
            to = (where * kept + k) * CORNERS**2 + chunk * CORNERS + j
            put(register, to, get(register, to) + SMALL * total)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _take_large(
    flux: Any, cells: int, start: int, beside: Any, children: Any, register: Any, slot: int,
    components: int, kept: int, axis: int, chunk: int,
) -> None:  # fmt: skip
    """Take the fluxes of large cells at borders with smaller ones from their registers."""
    bits = (1, 2, 4)  # of a child's number: x, y, z
    along = bits[axis]
    high = 2 if axis == 2 else 4
    low = 2 if axis == 0 else 1
    for child in range(8):
        kid = get(children, 8 * slot + child)
        if kid < 0:
            continue
        row, column = (CORNERS if child & high else 0), (CORNERS if child & low else 0)
        layer = start + (CORNERS if child & along else 0)
        for side in range(2):
            where = FIRST_BORDER - get(beside, 6 * kid + 2 * axis + side)
            if where < 0:
                continue
            for i in range(CORNERS):
                inner = row + i - 2 * chunk
                if not 0 <= inner < 2:
                    continue
                for k in range(components):
                    at = k * cells + (layer + CORNERS * side) * _ROWS + inner * SIDE + column
                    to = (where * kept + k) * CORNERS**2 + i * CORNERS
                    for j in range(CORNERS):
                        put(register, to + j, get(register, to + j) - get(flux, at + j))


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _sweep_runs(
    gas: Any, runs: Any, first: int, end: int, axis: int, fuel: bool, kept: int, measure: bool,
    ratio: Any, narrow: Any, own: Any, kids: Any, recorded: Any, work: Any,
) -> None:  # fmt: skip
    """Move the runs from first to end; see `sweep_blocks`."""
    state, code, beside, coordinates, still = gas
    border, border_code, register, weights = own
    children, kid_register = kids
    pressure, faces, first_face, columns, rows, still_p = recorded
    scratch, scratch_code, flux, cells, signals, notes = work
    components = FUEL + fuel
    for run in range(first, end):
        slot0, count = get(runs, 2 * run), get(runs, 2 * run + 1)
        layers = count * SIDE + 2 * BEYOND
        for chunk in range(_CHUNKS):
            # 1. Copy the rows.
            before = get(beside, 6 * slot0 + 2 * axis)
            _copy_beyond(
                scratch, scratch_code, cells, 0, state, code, still, border, border_code,
                weights, before, components, kept, axis, 0, chunk,
            )  # fmt: skip
            slot = slot0
            for j in range(count):
                _copy_in(
                    scratch, scratch_code, cells, BEYOND + j * SIDE, state, code, slot,
                    components, kept, axis, chunk,
                )  # fmt: skip
                slot = get(beside, 6 * slot + 2 * axis + 1)
            after = slot
            _copy_beyond(
                scratch, scratch_code, cells, layers - BEYOND, state, code, still, border,
                border_code, weights, after, components, kept, axis, 1, chunk,
            )  # fmt: skip

            # 2. Move them.
            begin = get(coordinates, 3 * slot0 + 2 - axis) * SIDE
            for column in range(0, _ROWS, lanes_at(state)):
                _move(
                    scratch, scratch_code, flux, cells, layers, column, axis, fuel, measure,
                    ratio, narrow, begin, still, signals, notes,
                )  # fmt: skip

            # 3. Copy them back, and record fluxes.
            slot = slot0
            for j in range(count):
                start = BEYOND + j * SIDE
                _copy_out(scratch, cells, start, state, slot, components, kept, axis, chunk)
                z, y = get(coordinates, 3 * slot), get(coordinates, 3 * slot + 1)
                position = (z * rows + y) * columns + get(coordinates, 3 * slot + 2)
                key = (position * 3 + axis) * _CHUNKS + chunk
                _record_walls(
                    flux, cells, start, axis, still_p, pressure, faces, get(first_face, key),
                    get(first_face, key + 1),
                )  # fmt: skip
                _take_large(
                    flux, cells, start, beside, children, kid_register, slot, components, kept,
                    axis, chunk,
                )  # fmt: skip
                slot = get(beside, 6 * slot + 2 * axis + 1)
            if before <= FIRST_BORDER:
                where = FIRST_BORDER - before
                _add_small(flux, cells, BEYOND, register, where, components, kept, chunk)
            if after <= FIRST_BORDER:
                where = FIRST_BORDER - after
                end_layer = layers - BEYOND
                _add_small(flux, cells, end_layer, register, where, components, kept, chunk)


@njit(forceinline=False, error_model="numpy", fastmath=FUSED)
def _sweep_with_fuel(
    gas: Any, runs: Any, first: int, end: int, axis: int, kept: int, measure: bool, ratio: Any,
    narrow: Any, own: Any, kids: Any, recorded: Any, work: Any,
) -> None:  # fmt: skip
    own_frame()
    _sweep_runs(
        gas, runs, first, end, axis, True, kept, measure, ratio, narrow, own, kids, recorded, work
    )


@njit(forceinline=False, error_model="numpy", fastmath=FUSED)
def _sweep_without_fuel(
    gas: Any, runs: Any, first: int, end: int, axis: int, kept: int, measure: bool, ratio: Any,
    narrow: Any, own: Any, kids: Any, recorded: Any, work: Any,
) -> None:  # fmt: skip
    own_frame()
    _sweep_runs(
        gas, runs, first, end, axis, False, kept, measure, ratio, narrow, own, kids, recorded, work
    )


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def sweep_blocks(
    state: Reals,
    code: NDArray[np.int8],
    beside: NDArray[np.int32],
    coordinates: NDArray[np.int32],
    children: NDArray[np.int32],
    still: Reals,
    runs: NDArray[np.int32],
    first: int,
    end: int,
    axis: int,
    fuel: bool,
    measure: bool,
    ratio: Any,
    narrow: Reals,
    border: Reals,
    border_code: NDArray[np.int8],
    register: Reals,
    weights: Reals,
    kid_register: Reals,
    pressure: Reals,
    faces: NDArray[np.int32],
    first_face: NDArray[np.int32],
    shape: tuple[int, int, int],
    work: Reals,
    work_code: NDArray[np.int8],
    flux: Reals,
    signals: Reals,
    notes: NDArray[np.float64],
) -> None:
    """Move the gas along an axis in runs of blocks of one level.

    Args:
        state: The state of all blocks (slots, 6, 512), updated in place.
        code: Codes of their cells (slots, 512).
        beside: What is beside each block, at the low and the high end of x, y and z: the slot of
            a block, or see `MIRRORED`, `OPENED` and `FIRST_BORDER` (slots, 6).
        coordinates: Blocks before each one along z, y and x (slots, 3).
        children: Slots of the smaller blocks within, -1 for none (slots, 8).
        still: State of still air (6,).
        runs: First slot and number of blocks of each run along the axis (n, 2).
        first: First run to move.
        end: Last run to move + 1.
        axis: The axis, 0 for x.
        fuel: Whether the state has fuel.
        measure: Whether to note the speeds of signals.
        ratio: Ratio of time step to cell side.
        narrow: Ratio of cell side to the width of the cells along the axis, from two layers
            before the grid on.
        border: State beyond borders with larger cells at the beginning of their step and after
            each of its sweeps (borders, 4, 6, 128).
        border_code: Codes there (borders, 128).
        register: Fluxes of small cells less those of large ones there (borders, 6, 16), updated.
        weights: Share of the change by each of those sweeps that counts now (3,).
        kid_register: The registers at borders with smaller cells, updated.
        pressure: Pressures on all recorded faces, updated in place.
        faces: Layer and row of each, and its index in `pressure` (k, 3).
        first_face: First entry for each position of a block, axis and chunk of rows.
        shape: Positions of blocks along z, y and x.
        work: A workspace (6, layers, 16).
        work_code: A workspace for codes (layers, 16).
        flux: A workspace for fluxes, like `work`.
        signals: A workspace (2, lanes).
        notes: Fastest signal and number of cells raised to the floor; updated in place (2,).
    """
    signals[:] = 0.0
    still_p = state.dtype.type(GAMMA - 1.0) * still[ENERGY]
    kept = state.shape[1]
    gas = (place(state), place(code), place(beside), place(coordinates), place(still))
    own = (place(border), place(border_code), place(register), place(weights))
    kids = (place(children), place(kid_register))
    recorded = (place(pressure), place(faces), place(first_face), shape[2], shape[1], still_p)
    cells = work.shape[1] * work.shape[2]
    spaces = (place(work), place(work_code), place(flux), cells, place(signals), place(notes))
    if fuel:
        _sweep_with_fuel(
            gas, place(runs), first, end, axis, kept, measure, ratio, place(narrow), own, kids,
            recorded, spaces,
        )  # fmt: skip
    else:
        _sweep_without_fuel(
            gas, place(runs), first, end, axis, kept, measure, ratio, place(narrow), own, kids,
            recorded, spaces,
        )  # fmt: skip
    notes[0] = max(notes[0], signals[1].max())
