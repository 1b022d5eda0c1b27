"""The compiled step of the gas: MUSCL-Hancock with HLLC on rows of cells.

A step is two passes over the state. `advance_planes` moves the gas along x and y together, with all
fluxes from one time level, so that a quarter turn of the scene turns the result. `advance_columns`
moves it along z. Their order alternates from step to step, which keeps second order in time.

All arithmetic is done on rows of cells along x, which the compiler turns into vector instructions.
That takes three habits. Rows live in one flat workspace at constant distances (`PITCH`), so that
the compiler knows that they do not overlap. Loops count from 0, so that no index can be negative.
Where cells differ (solid or air, which side of the wave) values are selected, not branched to.

A cell beside a solid one sees its own mirror image there, beside an open face its own copy.
Everything here works in the precision of the state.
"""

from math import sqrt
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Reals = NDArray[Any]

GAMMA: Final = 1.4
"""Ratio of the heats, of air and of the products alike."""

MARGIN: Final = 2
"""Layers of cells around the grid that belong to the arrays, but not to the gas."""

DENSITY, X_MOMENTUM, Y_MOMENTUM, Z_MOMENTUM, ENERGY, FUEL = 0, 1, 2, 3, 4, 5
"""Components of the state, each per volume."""

AIR, MIRROR, OPEN = 0, -1, 1
"""Codes of cells: gas, solid (normal velocity changes its sign), beyond an open face."""

TILE: Final = 140
"""Most cells of a row that are worked on at once."""

PITCH: Final = TILE + 2 * MARGIN
"""Distance of rows in the workspace. No multiple of 64, which the cache would not like."""

_LIMIT: Final = 1.5
"""Of generalised minmod: steepest slope in units of the smaller difference."""

_LEAST_SHARE: Final = 0.1
"""Where reconstructed density or pressure is below this share of the cell's, the cell is taken as
constant for that pass."""

EDGE_SIZE: Final = 12
"""Length of a row of what tiles keep for the next one: two cells of six variables."""

_FLOOR: Final = 1e-6
"""Of density and pressure, in units of those of still air."""

# Rows of a variable follow each other: density, velocities along x, y and z, pressure, fuel share.
_VARIABLES: Final = 6
_U: Final = PITCH
_V: Final = 2 * PITCH
_W: Final = 3 * PITCH
_P: Final = 4 * PITCH
_Y: Final = 5 * PITCH
# The three rows around the one that is worked on: "low" and "high" are neighbours across.
_LOW: Final = 0
_MID: Final = _LOW + _VARIABLES * PITCH
_HIGH: Final = _MID + _VARIABLES * PITCH
# States at the faces of the cells after half a step: along the row, and across it.
_WEST: Final = _HIGH + _VARIABLES * PITCH
_EAST: Final = _WEST + _VARIABLES * PITCH
_BELOW: Final = _EAST + _VARIABLES * PITCH
_ABOVE: Final = _BELOW + _VARIABLES * PITCH
_ABOVE_LOW: Final = _ABOVE + _VARIABLES * PITCH
# Fluxes through the low faces along the row, their differences, and fluxes across.
_ALONG: Final = _ABOVE_LOW + _VARIABLES * PITCH
_CHANGE: Final = _ALONG + _VARIABLES * PITCH
_ACROSS: Final = _CHANGE + _VARIABLES * PITCH
_ACROSS_LOW: Final = _ACROSS + _VARIABLES * PITCH
# Codes of the cells, and the fastest signals so far.
_CODE_LOW: Final = _ACROSS_LOW + _VARIABLES * PITCH
_CODE_MID: Final = _CODE_LOW + PITCH
_CODE_HIGH: Final = _CODE_MID + PITCH
_SIGNAL: Final = _CODE_HIGH + PITCH
WORK_SIZE: Final = _SIGNAL + PITCH
"""Length of a workspace."""


@njit(forceinline=True, error_model="numpy")
def _slope(back: Any, ahead: Any, limit: Any, half: Any, zero: Any) -> Any:
    """Return the limited difference across a cell."""
    centre = half * (back + ahead)
    back = limit * back
    ahead = limit * ahead
    least = back if back < ahead else ahead
    most = ahead if back < ahead else back
    least = least if least < centre else centre
    most = most if most > centre else centre
    return (least if least > zero else zero) + (most if most < zero else zero)


@njit(forceinline=True, error_model="numpy")
def _copy_rows(work: Reals, count: int, source: int, target: int, n: int) -> None:
    for k in range(count):
        for i in range(n):
            work[target + k * PITCH + i] = work[source + k * PITCH + i]


@njit(error_model="numpy")
def _load_row(
    state: Reals, code: NDArray[np.int8], work: Reals, z: int, y: int, x: int, n: int
) -> int:
    """Set the row "high" to density, velocity and pressure of n cells from x on.

    Returns:
        How many of them had too little density or pressure, and were lifted to the floor.
    """
    bad = _convert_row(state, work, z, y, x, n)
    if bad > 0:
        _lift_row(state, z, y, x, n)
        _convert_row(state, work, z, y, x, n)
    codes = code[z, y, x : x + n]
    for i in range(n):
        work[_CODE_HIGH + i] = codes[i]
    return bad


@njit(forceinline=True, error_model="numpy")
def _convert_row(state: Reals, work: Reals, z: int, y: int, x: int, n: int) -> int:
    real = work.dtype.type
    half, one = real(0.5), real(1.0)
    gamma, gamma_1 = real(GAMMA), real(GAMMA - 1.0)
    floor = real(_FLOOR)
    density = state[DENSITY, z, y, x : x + n]
    mx = state[X_MOMENTUM, z, y, x : x + n]
    my = state[Y_MOMENTUM, z, y, x : x + n]
    mz = state[Z_MOMENTUM, z, y, x : x + n]
    energy = state[ENERGY, z, y, x : x + n]
    bad = 0
    for i in range(n):
        r = density[i]
        per_r = one / r
        u, v, w = mx[i] * per_r, my[i] * per_r, mz[i] * per_r
        p = gamma_1 * (energy[i] - half * (mx[i] * u + my[i] * v + mz[i] * w))
        bad += 0 if (r >= floor) & (p >= floor) else 1
        sound = sqrt(gamma * p * per_r)
        level = half * (abs(u) + abs(v)) + sound
        upright = half * abs(w) + sound
        signal = work[_SIGNAL + i]
        signal = level if level > signal else signal
        signal = upright if upright > signal else signal
        work[_HIGH + i] = r
        work[_HIGH + _U + i] = u
        work[_HIGH + _V + i] = v
        work[_HIGH + _W + i] = w
        work[_HIGH + _P + i] = p
        work[_SIGNAL + i] = signal
    return bad


@njit(error_model="numpy")
def _lift_row(state: Reals, z: int, y: int, x: int, n: int) -> None:
    """Give the cells of a row at least the floor's density and pressure; motion stays."""
    real = state.dtype.type
    half, floor = real(0.5), real(_FLOOR)
    per_pressure = real(1.0 / (GAMMA - 1.0))
    for i in range(x, x + n):
        density = state[DENSITY, z, y, i]
        if not density >= floor:
            for k in range(X_MOMENTUM, ENERGY):
                state[k, z, y, i] *= floor / density if density > real(0.0) else real(0.0)
            density = floor
            state[DENSITY, z, y, i] = floor
        motion = real(0.0)
        for k in range(X_MOMENTUM, ENERGY):
            motion += state[k, z, y, i] * state[k, z, y, i]
        least = per_pressure * floor + half * motion / density
        if not state[ENERGY, z, y, i] >= least:
            state[ENERGY, z, y, i] = least


@njit(forceinline=True, error_model="numpy")
def _predict_plane_row(work: Reals, n: int, ratio: Any) -> None:
    """Set the states at the four upright faces of n cells, half a step on."""
    real = work.dtype.type
    zero, half, gamma = real(0.0), real(0.5), real(GAMMA)
    limit, least = real(_LIMIT), real(_LEAST_SHARE)
    step = half * ratio
    for i in range(n):
        side_w, side_e = work[_CODE_MID + i], work[_CODE_MID + 2 + i]
        side_s, side_n = work[_CODE_LOW + 1 + i], work[_CODE_HIGH + 1 + i]
        air_w, air_e = side_w == zero, side_e == zero
        air_s, air_n = side_s == zero, side_n == zero
        r, u, v = work[_MID + 1 + i], work[_MID + _U + 1 + i], work[_MID + _V + 1 + i]
        w, p = work[_MID + _W + 1 + i], work[_MID + _P + 1 + i]

        back = work[_MID + i] if air_w else r
        ahead = work[_MID + 2 + i] if air_e else r
        rx = _slope(r - back, ahead - r, limit, half, zero)
        back = work[_MID + _U + i] if air_w else side_w * u
        ahead = work[_MID + _U + 2 + i] if air_e else side_e * u
        ux = _slope(u - back, ahead - u, limit, half, zero)
        back = work[_MID + _V + i] if air_w else v
        ahead = work[_MID + _V + 2 + i] if air_e else v
        vx = _slope(v - back, ahead - v, limit, half, zero)
        back = work[_MID + _W + i] if air_w else w
        ahead = work[_MID + _W + 2 + i] if air_e else w
        wx = _slope(w - back, ahead - w, limit, half, zero)
        back = work[_MID + _P + i] if air_w else p
        ahead = work[_MID + _P + 2 + i] if air_e else p
        px = _slope(p - back, ahead - p, limit, half, zero)

        back = work[_LOW + 1 + i] if air_s else r
        ahead = work[_HIGH + 1 + i] if air_n else r
        ry = _slope(r - back, ahead - r, limit, half, zero)
        back = work[_LOW + _U + 1 + i] if air_s else u
        ahead = work[_HIGH + _U + 1 + i] if air_n else u
        uy = _slope(u - back, ahead - u, limit, half, zero)
        back = work[_LOW + _V + 1 + i] if air_s else side_s * v
        ahead = work[_HIGH + _V + 1 + i] if air_n else side_n * v
        vy = _slope(v - back, ahead - v, limit, half, zero)
        back = work[_LOW + _W + 1 + i] if air_s else w
        ahead = work[_HIGH + _W + 1 + i] if air_n else w
        wy = _slope(w - back, ahead - w, limit, half, zero)
        back = work[_LOW + _P + 1 + i] if air_s else p
        ahead = work[_HIGH + _P + 1 + i] if air_n else p
        py = _slope(p - back, ahead - p, limit, half, zero)

        spread = ux + vy
        per_r = step / r
        r_half = r - step * ((u * rx + v * ry) + r * spread)
        u_half = u - (step * (u * ux + v * uy) + per_r * px)
        v_half = v - (step * (u * vx + v * vy) + per_r * py)
        w_half = w - step * (u * wx + v * wy)
        p_half = p - step * ((u * px + v * py) + gamma * p * spread)

        rx, ux, vx, wx, px = half * rx, half * ux, half * vx, half * wx, half * px
        ry, uy, vy, wy, py = half * ry, half * uy, half * vy, half * wy, half * py
        r_most = abs(rx) if abs(rx) > abs(ry) else abs(ry)
        p_most = abs(px) if abs(px) > abs(py) else abs(py)
        good = (r_half - r_most > least * r) & (p_half - p_most > least * p)
        r = r_half if good else r
        u = u_half if good else u
        v = v_half if good else v
        w = w_half if good else w
        p = p_half if good else p
        rx, ux, vx = rx if good else zero, ux if good else zero, vx if good else zero
        wx, px = wx if good else zero, px if good else zero
        ry, uy, vy = ry if good else zero, uy if good else zero, vy if good else zero
        wy, py = wy if good else zero, py if good else zero
        work[_WEST + 1 + i], work[_EAST + 1 + i] = r - rx, r + rx
        work[_WEST + _U + 1 + i], work[_EAST + _U + 1 + i] = u - ux, u + ux
        work[_WEST + _V + 1 + i], work[_EAST + _V + 1 + i] = v - vx, v + vx
        work[_WEST + _W + 1 + i], work[_EAST + _W + 1 + i] = w - wx, w + wx
        work[_WEST + _P + 1 + i], work[_EAST + _P + 1 + i] = p - px, p + px
        work[_BELOW + 1 + i], work[_ABOVE + 1 + i] = r - ry, r + ry
        work[_BELOW + _U + 1 + i], work[_ABOVE + _U + 1 + i] = u - uy, u + uy
        work[_BELOW + _V + 1 + i], work[_ABOVE + _V + 1 + i] = v - vy, v + vy
        work[_BELOW + _W + 1 + i], work[_ABOVE + _W + 1 + i] = w - wy, w + wy
        work[_BELOW + _P + 1 + i], work[_ABOVE + _P + 1 + i] = p - py, p + py


@njit(forceinline=True, error_model="numpy")
def _predict_column_row(work: Reals, n: int, ratio: Any) -> None:
    """Set the states at the lower and the upper faces of n cells, half a step on."""
    real = work.dtype.type
    zero, half, gamma = real(0.0), real(0.5), real(GAMMA)
    limit, least = real(_LIMIT), real(_LEAST_SHARE)
    step = half * ratio
    for i in range(n):
        side_s, side_n = work[_CODE_LOW + i], work[_CODE_HIGH + i]
        air_s, air_n = side_s == zero, side_n == zero
        r, u, v = work[_MID + i], work[_MID + _U + i], work[_MID + _V + i]
        w, p = work[_MID + _W + i], work[_MID + _P + i]

        back = work[_LOW + i] if air_s else r
        ahead = work[_HIGH + i] if air_n else r
        rz = _slope(r - back, ahead - r, limit, half, zero)
        back = work[_LOW + _U + i] if air_s else u
        ahead = work[_HIGH + _U + i] if air_n else u
        uz = _slope(u - back, ahead - u, limit, half, zero)
        back = work[_LOW + _V + i] if air_s else v
        ahead = work[_HIGH + _V + i] if air_n else v
        vz = _slope(v - back, ahead - v, limit, half, zero)
        back = work[_LOW + _W + i] if air_s else side_s * w
        ahead = work[_HIGH + _W + i] if air_n else side_n * w
        wz = _slope(w - back, ahead - w, limit, half, zero)
        back = work[_LOW + _P + i] if air_s else p
        ahead = work[_HIGH + _P + i] if air_n else p
        pz = _slope(p - back, ahead - p, limit, half, zero)

        r_half = r - step * (w * rz + r * wz)
        u_half = u - step * (w * uz)
        v_half = v - step * (w * vz)
        w_half = w - (step * (w * wz) + step / r * pz)
        p_half = p - step * (w * pz + gamma * p * wz)
        rz, uz, vz, wz, pz = half * rz, half * uz, half * vz, half * wz, half * pz
        good = (r_half - abs(rz) > least * r) & (p_half - abs(pz) > least * p)
        r = r_half if good else r
        u = u_half if good else u
        v = v_half if good else v
        w = w_half if good else w
        p = p_half if good else p
        rz, uz, vz = rz if good else zero, uz if good else zero, vz if good else zero
        wz, pz = wz if good else zero, pz if good else zero
        work[_BELOW + i], work[_ABOVE + i] = r - rz, r + rz
        work[_BELOW + _U + i], work[_ABOVE + _U + i] = u - uz, u + uz
        work[_BELOW + _V + i], work[_ABOVE + _V + i] = v - vz, v + vz
        work[_BELOW + _W + i], work[_ABOVE + _W + i] = w - wz, w + wz
        work[_BELOW + _P + i], work[_ABOVE + _P + i] = p - pz, p + pz


@njit(forceinline=True, error_model="numpy")
def _hllc_row(
    work: Reals,
    n: int,
    left: int,
    right: int,
    code_left: int,
    code_right: int,
    normal: int,
    second: int,
    third: int,
    out: int,
) -> None:
    """Set the fluxes through n faces from the states on their two sides.

    Wave speeds by Einfeldt. A wall gets the pressure that turns the gas round, and nothing else.
    """
    real = work.dtype.type
    zero, half, one, gamma = real(0.0), real(0.5), real(1.0), real(GAMMA)
    per_pressure = real(1.0 / (GAMMA - 1.0))
    for i in range(n):
        side_l = work[code_left + i]
        side_r = work[code_right + i]
        air_l = side_l == zero
        air_r = side_r == zero
        rl0, rr0 = work[left + i], work[right + i]
        ul0, ur0 = work[left + normal + i], work[right + normal + i]
        vl0, vr0 = work[left + second + i], work[right + second + i]
        wl0, wr0 = work[left + third + i], work[right + third + i]
        pl0, pr0 = work[left + _P + i], work[right + _P + i]
        rl = rl0 if air_l else rr0
        ul = ul0 if air_l else side_l * ur0
        vl = vl0 if air_l else vr0
        wl = wl0 if air_l else wr0
        pl = pl0 if air_l else pr0
        rr = rr0 if air_r else rl0
        ur = ur0 if air_r else side_r * ul0
        vr = vr0 if air_r else vl0
        wr = wr0 if air_r else wl0
        pr = pr0 if air_r else pl0

        sound2_l = gamma * pl / rl
        sound2_r = gamma * pr / rr
        root_l, root_r = sqrt(rl), sqrt(rr)
        share = root_l / (root_l + root_r)
        rest = one - share
        jump = ur - ul
        mean = share * ul + rest * ur
        sound = sqrt(share * sound2_l + rest * sound2_r + half * share * rest * jump * jump)
        slow_l, slow_m = ul - sqrt(sound2_l), mean - sound
        fast_r, fast_m = ur + sqrt(sound2_r), mean + sound
        slow = slow_l if slow_l < slow_m else slow_m
        fast = fast_r if fast_r > fast_m else fast_m

        ql = rl * (slow - ul)
        qr = rr * (fast - ur)
        middle = ((pl - pr) + (qr * ur - ql * ul)) / (qr - ql)
        middle = zero if side_l + side_r < zero else middle

        from_left = middle >= zero
        r = rl if from_left else rr
        u = ul if from_left else ur
        v = vl if from_left else vr
        w = wl if from_left else wr
        p = pl if from_left else pr
        q = ql if from_left else qr
        wave = slow if from_left else fast
        outside = (slow >= zero) if from_left else (fast <= zero)
        energy = per_pressure * p + half * r * (u * u + v * v + w * w)
        per_width = one / (wave - middle)
        p_star = p + q * (middle - u)
        r_star = q * per_width
        e_star = ((wave - u) * energy - p * u + p_star * middle) * per_width
        speed = u if outside else middle
        p_face = p if outside else p_star
        mass = speed * (r if outside else r_star)
        work[out + i] = mass
        work[out + normal + i] = mass * speed + p_face
        work[out + second + i] = mass * v
        work[out + third + i] = mass * w
        work[out + _P + i] = speed * ((energy if outside else e_star) + p_face)


@njit(forceinline=True, error_model="numpy")
def _shift_rows(work: Reals, n: int) -> None:
    """Go on to the next row: what was high is now in the middle, what was there is low."""
    _copy_rows(work, _VARIABLES, _MID, _LOW, n)
    _copy_rows(work, _VARIABLES, _HIGH, _MID, n)
    _copy_rows(work, _VARIABLES, _ABOVE, _ABOVE_LOW, n)
    _copy_rows(work, _VARIABLES, _ACROSS, _ACROSS_LOW, n)
    _copy_rows(work, 2, _CODE_MID, _CODE_LOW, n)


@njit(error_model="numpy")
def _record_walls(
    work: Reals,
    pressure: Reals,
    walls: NDArray[np.int32],
    first: NDArray[np.int32],
    line: int,
    flux: int,
    x: int,
    n: int,
) -> None:
    """Copy the pressures that act on the recorded faces of a row of n cells from x on."""
    for k in range(first[line], first[line + 1]):
        i = walls[k, 0] - x
        if 0 <= i < n:
            pressure[walls[k, 1]] = work[flux + i]


@njit(nogil=True, cache=True, error_model="numpy")
def advance_planes(
    state: Reals,
    code: NDArray[np.int8],
    work: Reals,
    edges: Reals,
    box: NDArray[np.int64],
    z_from: int,
    z_to: int,
    ratio: Any,
    pressure: Reals,
    walls: NDArray[np.int32],
    first: NDArray[np.int32],
    notes: NDArray[np.float64],
) -> None:
    """Move the gas along x and y in the planes from z_from to z_to, those of others left alone.

    Args:
        state: The state (5 or 6, z, y, x), changed.
        code: Codes of the cells (z, y, x).
        work: A workspace (WORK_SIZE,).
        edges: A workspace (y, 2 * 6).
        box: First and last + 1 cells along z, y and x outside which the air is still (6,).
        z_from: First plane.
        z_to: Last plane + 1.
        ratio: Time step over cell side.
        pressure: Pressures on the recorded faces, changed.
        walls: Cell beyond the face along x, and number of the face, row by row (k, 2).
        first: First entry of a row among `walls`, for faces along x and then along y.
        notes: Fastest signal so far, cells lifted to the floor so far; changed.
    """
    y0, y1, x0, x1 = box[2], box[3], box[4], box[5]
    tiles = (x1 - x0 + TILE - 1) // TILE
    rows = code.shape[1]
    lines = code.shape[0] * rows
    for i in range(PITCH):
        work[_SIGNAL + i] = 0
    lifted = 0
    for z in range(z_from, z_to):
        for tile in range(tiles):
            xa = x0 + (x1 - x0) * tile // tiles
            xb = x0 + (x1 - x0) * (tile + 1) // tiles
            n = xb - xa + 2 * MARGIN
            for y in range(y0 - 2, y1 + 2):
                # Rows up to y are loaded, those up to y - 1 get their states at the faces, and
                # those up to y - 2 are done.
                _shift_rows(work, n)
                lifted += _load_row(state, code, work, z, y, xa - MARGIN, n)
                _join_tiles(work, edges, y, tile, xb - xa)
                if y < y0:
                    continue
                _predict_plane_row(work, n - 2, ratio)
                if y > y0:
                    _hllc_row(
                        work, n - 4, _ABOVE_LOW + 2, _BELOW + 2, _CODE_LOW + 2, _CODE_MID + 2,
                        _V, _U, _W, _ACROSS + 2,
                    )
                    line = lines + z * rows + y - 1
                    _record_walls(work, pressure, walls, first, line, _ACROSS + _V + 2, xa, n - 4)
                if y > y0 + 1:
                    _update_plane_row(state, work, z, y - 2, xa, n - 4, ratio)
                if y0 < y < y1 + 1:
                    _hllc_row(
                        work, n - 3, _EAST + 1, _WEST + 2, _CODE_MID + 1, _CODE_MID + 2,
                        _U, _V, _W, _ALONG + 2,
                    )
                    line = z * rows + y - 1
                    _record_walls(work, pressure, walls, first, line, _ALONG + _U + 2, xa, n - 3)
                    for k in range(5):
                        for i in range(n - 4):
                            work[_CHANGE + k * PITCH + 2 + i] = (
                                work[_ALONG + k * PITCH + 3 + i]
                                - work[_ALONG + k * PITCH + 2 + i]
                            )
    notes[1] += lifted
    for i in range(PITCH):
        notes[0] = max(notes[0], work[_SIGNAL + i])


@njit(forceinline=True, error_model="numpy")
def _join_tiles(work: Reals, edges: Reals, y: int, tile: int, width: int) -> None:
    """Give the row the cells of the tile before as they were, and keep those for the next one."""
    for k in range(_VARIABLES):
        for i in range(MARGIN):
            at = _HIGH + k * PITCH + i
            if tile > 0:
                work[at] = edges[y, k * MARGIN + i]
            edges[y, k * MARGIN + i] = work[at + width]


@njit(error_model="numpy")
def _update_plane_row(
    state: Reals, work: Reals, z: int, y: int, x: int, n: int, ratio: Any
) -> None:
    zero = work.dtype.type(0.0)
    for k in range(5):
        row = state[k, z, y, x : x + n]
        shift = k * PITCH + 2
        for i in range(n):
            old = row[i]
            across = work[_ACROSS + shift + i] - work[_ACROSS_LOW + shift + i]
            new = old - ratio * (work[_CHANGE + shift + i] + across)
            row[i] = new if work[_CODE_LOW + 2 + i] == zero else old


@njit(error_model="numpy")
def _update_column_row(
    state: Reals, work: Reals, z: int, y: int, x: int, n: int, ratio: Any
) -> None:
    zero = work.dtype.type(0.0)
    for k in range(5):
        row = state[k, z, y, x : x + n]
        shift = k * PITCH
        for i in range(n):
            old = row[i]
            across = work[_ACROSS + shift + i] - work[_ACROSS_LOW + shift + i]
            new = old - ratio * across
            row[i] = new if work[_CODE_LOW + i] == zero else old


@njit(nogil=True, cache=True, error_model="numpy")
def advance_columns(
    state: Reals,
    code: NDArray[np.int8],
    work: Reals,
    box: NDArray[np.int64],
    y_from: int,
    y_to: int,
    ratio: Any,
    pressure: Reals,
    walls: NDArray[np.int32],
    first: NDArray[np.int32],
    notes: NDArray[np.float64],
) -> None:
    """Move the gas along z in the rows from y_from to y_to; see `advance_planes`."""
    z0, z1, x0, x1 = box[0], box[1], box[4], box[5]
    tiles = (x1 - x0 + TILE - 1) // TILE
    rows = code.shape[1]
    lines = code.shape[0] * rows
    for i in range(PITCH):
        work[_SIGNAL + i] = 0
    lifted = 0
    for y in range(y_from, y_to):
        for tile in range(tiles):
            x = x0 + (x1 - x0) * tile // tiles
            n = x0 + (x1 - x0) * (tile + 1) // tiles - x
            for z in range(z0 - 2, z1 + 2):
                _shift_rows(work, n)
                lifted += _load_row(state, code, work, z, y, x, n)
                if z < z0:
                    continue
                _predict_column_row(work, n, ratio)
                if z > z0:
                    _hllc_row(
                        work, n, _ABOVE_LOW, _BELOW, _CODE_LOW, _CODE_MID, _W, _U, _V, _ACROSS
                    )
                    line = 2 * lines + (z - 1) * rows + y
                    _record_walls(work, pressure, walls, first, line, _ACROSS + _W, x, n)
                if z > z0 + 1:
                    _update_column_row(state, work, z - 2, y, x, n, ratio)
    notes[1] += lifted
    for i in range(PITCH):
        notes[0] = max(notes[0], work[_SIGNAL + i])


@njit(nogil=True, cache=True, error_model="numpy")
def fastest_signal(state: Reals) -> float:
    """Return what the time step follows from: sound, and motion by half, in x and y together."""
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
                fastest = max(fastest, 0.5 * (abs(u) + abs(v)) + sound, 0.5 * abs(w) + sound)
    return fastest


@njit(nogil=True, cache=True, error_model="numpy")
def tighten(state: Reals, still: Reals, box: NDArray[np.int64], most: int) -> None:
    """Take layers of still air off the six sides of a box, at most so many from each."""
    for side in range(6):
        for _ in range(most):
            axis = side // 2
            if box[2 * axis] >= box[2 * axis + 1]:
                break
            layer = box[side] if side % 2 == 0 else box[side] - 1
            if not _is_still(state, still, box, axis, layer):
                break
            box[side] += 1 if side % 2 == 0 else -1


@njit(error_model="numpy")
def _is_still(
    state: Reals, still: Reals, box: NDArray[np.int64], axis: int, layer: int
) -> bool:
    z0, z1, y0, y1, x0, x1 = box
    if axis == 0:
        z0, z1 = layer, layer + 1
    elif axis == 1:
        y0, y1 = layer, layer + 1
    else:
        x0, x1 = layer, layer + 1
    for k in range(len(still)):
        for z in range(z0, z1):
            for y in range(y0, y1):
                for x in range(x0, x1):
                    if state[k, z, y, x] != still[k]:
                        return False
    return True
