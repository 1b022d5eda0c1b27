"""The compiled step of the gas: MUSCL-Hancock with HLLC on rows of cells.

There are two passes over the state. `advance_planes` moves the gas along x and y together, with all
fluxes from one time level, so that a quarter turn of the scene turns the result. `advance_columns`
moves it along z. A step consists of a half step in planes, a whole step in columns, and another
half step in planes, which is second-order accurate in time (Strang).

All arithmetic is done on rows of cells along x, which the compiler turns into vector instructions.
That requires three conventions. Rows lie in one flat workspace at constant distances (`PITCH`), so
that the compiler knows that they do not overlap. Loops count from 0, so that no index can be
negative. Where cells differ (solid or air, side of the wave), values are selected without branches.

The ghost state of a cell is its mirror image beside a solid cell, and its copy beside an open face.
All arithmetic is in the precision of the state. All kernels are in one file, because Numba's cache
is invalidated by changes of the file of the function called from Python, and by no others.
"""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.gas.simd import get, larger, put, root, select, smaller
from blast_env.gas.state import (
    DENSITY,
    ENERGY,
    FUEL,
    FUSED,
    GAMMA,
    MARGIN,
    X_MOMENTUM,
    Y_MOMENTUM,
    Z_MOMENTUM,
    Reals,
)

LANES: Final = 8
"""Number of cells of a row processed at once; results beyond the end of the row are not used."""

TILE: Final = 136
"""Maximum number of cells in a tile of a row, without the margins."""

PITCH: Final = 160
"""Distance of rows in the workspace: a tile, its margins, and the excess beyond the end.

It is not a multiple of 64, to avoid cache conflicts.
"""

_LIMIT: Final = 2.0
"""Steepest slope in units of the smaller difference (van Leer's monotonised central limiter)."""

_LEAST_SHARE: Final = 0.1
"""Share of the cell's density or pressure below which reconstructed values are discarded, and the
cell is treated as constant for that pass."""

EDGE_SIZE: Final = 12
"""Length of a row of values kept for the next tile: two cells of six variables."""

_FLOOR: Final = 1e-6
"""Floor of density and pressure, in units of those of still air."""

_STILL: Final = (0.0, 1e-12, 1e-12, 1e-12, 0.0, 1e-24)
"""Thresholds of momentum and fuel, in units of still air, up to which they are set to 0. Ahead of a
wave these decay to subnormal numbers, on which processors are slow, while density and energy are
already those of still air."""

# Rows of a variable follow each other: density, velocities along x, y and z, pressure, fuel share.
_VARIABLES: Final = 6
_U: Final = PITCH
_V: Final = 2 * PITCH
_W: Final = 3 * PITCH
_P: Final = 4 * PITCH
_Y: Final = 5 * PITCH
# The current row ("mid") and its neighbours across, "low" and "high".
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
# Codes of the cells, and the running maxima of the signal speeds.
_CODE_LOW: Final = _ACROSS_LOW + _VARIABLES * PITCH
_CODE_MID: Final = _CODE_LOW + PITCH
_CODE_HIGH: Final = _CODE_MID + PITCH
_SIGNAL: Final = _CODE_HIGH + PITCH
_WORST: Final = _SIGNAL + PITCH
WORK_SIZE: Final = _WORST + PITCH
"""Length of a workspace."""


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _slope(back: Any, ahead: Any, limit: Any, half: Any, zero: Any) -> Any:
    """Return the limited difference across a cell."""
    centre = half * (back + ahead)
    back = limit * back
    ahead = limit * ahead
    least = smaller(smaller(back, ahead), centre)
    most = larger(larger(back, ahead), centre)
    return larger(least, zero) + smaller(most, zero)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _whole(n: int) -> int:
    """Round a number of cells up to `LANES`, because a few cells cost as much as all lanes."""
    return (n + LANES - 1) & -LANES


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _copy_rows(work: Reals, count: int, source: int, target: int, n: int) -> None:
    for k in range(count):
        for i in range(_whole(n)):
            put(work, target + k * PITCH + i, get(work, source + k * PITCH + i))


@njit(error_model="numpy", fastmath=FUSED)
def _load_row(
    state: Reals, code: NDArray[np.int8], work: Reals, z: int, y: int, x: int, n: int
) -> int:
    """Set the row "high" to density, velocity and pressure of n cells from x on.

    Returns:
        Number of cells with too little density or pressure, which were raised to the floor.
    """
    bad = _convert_row(state, work, z, y, x, n)
    if bad > 0:
        _lift_row(state, z, y, x, n)
        _convert_row(state, work, z, y, x, n)
    real = work.dtype.type
    at = (z * code.shape[1] + y) * code.shape[2] + x
    for i in range(_whole(n)):
        put(work, _CODE_HIGH + i, real(get(code, at + i)))
    return bad


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _place(state: Reals, k: int, z: int, y: int, x: int) -> int:
    """Return the flat index of an entry of the state."""
    return ((k * state.shape[1] + z) * state.shape[2] + y) * state.shape[3] + x


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _convert_row(state: Reals, work: Reals, z: int, y: int, x: int, n: int) -> int:
    real = work.dtype.type
    half, one = real(0.5), real(1.0)
    gamma, gamma_1 = real(GAMMA), real(GAMMA - 1.0)
    floor = real(_FLOOR)
    density = _place(state, DENSITY, z, y, x)
    x_momentum = _place(state, X_MOMENTUM, z, y, x)
    y_momentum = _place(state, Y_MOMENTUM, z, y, x)
    z_momentum = _place(state, Z_MOMENTUM, z, y, x)
    energy = _place(state, ENERGY, z, y, x)
    for i in range(_whole(n)):
        r = get(state, density + i)
        mx, my = get(state, x_momentum + i), get(state, y_momentum + i)
        mz = get(state, z_momentum + i)
        per_r = one / r
        u, v, w = mx * per_r, my * per_r, mz * per_r
        p = gamma_1 * (get(state, energy + i) - half * (mx * u + my * v + mz * w))
        sound = root(gamma * p * per_r)
        level = half * (abs(u) + abs(v)) + sound
        upright = abs(w) + sound
        put(work, _HIGH + i, r)
        put(work, _HIGH + _U + i, u)
        put(work, _HIGH + _V + i, v)
        put(work, _HIGH + _W + i, w)
        put(work, _HIGH + _P + i, p)
        put(work, _SIGNAL + i, larger(larger(level, upright), get(work, _SIGNAL + i)))
        put(work, _WORST + i, smaller(r, p))  # in this order, nan is found
    if len(state) > FUEL:
        fuel = _place(state, FUEL, z, y, x)
        for i in range(_whole(n)):
            put(work, _HIGH + _Y + i, get(state, fuel + i) / get(work, _HIGH + i))
    bad = 0
    for i in range(n):
        bad += select(get(work, _WORST + i) >= floor, 0, 1)
    return bad


@njit(error_model="numpy", fastmath=FUSED)
def _lift_row(state: Reals, z: int, y: int, x: int, n: int) -> None:
    """Raise the density and pressure of the cells of a row to the floor, at the same velocity."""
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


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _predict_plane_row(work: Reals, n: int, ratio: Any, along: Reals, x: int, across: Any) -> None:
    """Set the states at the four vertical faces of n cells from x on, half a step later."""
    real = work.dtype.type
    zero, half, gamma = real(0.0), real(0.5), real(GAMMA)
    limit, least = real(_LIMIT), real(_LEAST_SHARE)
    step = half * ratio
    for i in range(_whole(n)):
        side_w, side_e = get(work, _CODE_MID + i), get(work, _CODE_MID + 2 + i)
        side_s, side_n = get(work, _CODE_LOW + 1 + i), get(work, _CODE_HIGH + 1 + i)
        air_w, air_e = side_w == zero, side_e == zero
        air_s, air_n = side_s == zero, side_n == zero
        r, u, v = (
            get(work, _MID + 1 + i),
            get(work, _MID + _U + 1 + i),
            get(work, _MID + _V + 1 + i),
        )
        w, p = get(work, _MID + _W + 1 + i), get(work, _MID + _P + 1 + i)

        back = select(air_w, get(work, _MID + i), r)
        ahead = select(air_e, get(work, _MID + 2 + i), r)
        rx = _slope(r - back, ahead - r, limit, half, zero)
        back = select(air_w, get(work, _MID + _U + i), side_w * u)
        ahead = select(air_e, get(work, _MID + _U + 2 + i), side_e * u)
        ux = _slope(u - back, ahead - u, limit, half, zero)
        back = select(air_w, get(work, _MID + _V + i), v)
        ahead = select(air_e, get(work, _MID + _V + 2 + i), v)
        vx = _slope(v - back, ahead - v, limit, half, zero)
        back = select(air_w, get(work, _MID + _W + i), w)
        ahead = select(air_e, get(work, _MID + _W + 2 + i), w)
        wx = _slope(w - back, ahead - w, limit, half, zero)
        back = select(air_w, get(work, _MID + _P + i), p)
        ahead = select(air_e, get(work, _MID + _P + 2 + i), p)
        px = _slope(p - back, ahead - p, limit, half, zero)

        back = select(air_s, get(work, _LOW + 1 + i), r)
        ahead = select(air_n, get(work, _HIGH + 1 + i), r)
        ry = _slope(r - back, ahead - r, limit, half, zero)
        back = select(air_s, get(work, _LOW + _U + 1 + i), u)
        ahead = select(air_n, get(work, _HIGH + _U + 1 + i), u)
        uy = _slope(u - back, ahead - u, limit, half, zero)
        back = select(air_s, get(work, _LOW + _V + 1 + i), side_s * v)
        ahead = select(air_n, get(work, _HIGH + _V + 1 + i), side_n * v)
        vy = _slope(v - back, ahead - v, limit, half, zero)
        back = select(air_s, get(work, _LOW + _W + 1 + i), w)
        ahead = select(air_n, get(work, _HIGH + _W + 1 + i), w)
        wy = _slope(w - back, ahead - w, limit, half, zero)
        back = select(air_s, get(work, _LOW + _P + 1 + i), p)
        ahead = select(air_n, get(work, _HIGH + _P + 1 + i), p)
        py = _slope(p - back, ahead - p, limit, half, zero)

        # In units of the cell's own widths; bit-identical where those are 1.
        per_x = get(along, x + i)
        fast_u, fast_v = u * per_x, v * across
        spread = ux * per_x + vy * across
        per_r = step / r
        r_half = r - step * ((fast_u * rx + fast_v * ry) + r * spread)
        u_half = u - (step * (fast_u * ux + fast_v * uy) + per_r * (px * per_x))
        v_half = v - (step * (fast_u * vx + fast_v * vy) + per_r * (py * across))
        w_half = w - step * (fast_u * wx + fast_v * wy)
        p_half = p - step * ((fast_u * px + fast_v * py) + gamma * p * spread)

        rx, ux, vx, wx, px = half * rx, half * ux, half * vx, half * wx, half * px
        ry, uy, vy, wy, py = half * ry, half * uy, half * vy, half * wy, half * py
        r_most = larger(abs(rx), abs(ry))
        p_most = larger(abs(px), abs(py))
        good = (r_half - r_most > least * r) & (p_half - p_most > least * p)
        r = select(good, r_half, r)
        u = select(good, u_half, u)
        v = select(good, v_half, v)
        w = select(good, w_half, w)
        p = select(good, p_half, p)
        rx, ux, vx = select(good, rx, zero), select(good, ux, zero), select(good, vx, zero)
        wx, px = select(good, wx, zero), select(good, px, zero)
        ry, uy, vy = select(good, ry, zero), select(good, uy, zero), select(good, vy, zero)
        wy, py = select(good, wy, zero), select(good, py, zero)
        put(work, _WEST + 1 + i, r - rx)
        put(work, _EAST + 1 + i, r + rx)
        put(work, _WEST + _U + 1 + i, u - ux)
        put(work, _EAST + _U + 1 + i, u + ux)
        put(work, _WEST + _V + 1 + i, v - vx)
        put(work, _EAST + _V + 1 + i, v + vx)
        put(work, _WEST + _W + 1 + i, w - wx)
        put(work, _EAST + _W + 1 + i, w + wx)
        put(work, _WEST + _P + 1 + i, p - px)
        put(work, _EAST + _P + 1 + i, p + px)
        put(work, _BELOW + 1 + i, r - ry)
        put(work, _ABOVE + 1 + i, r + ry)
        put(work, _BELOW + _U + 1 + i, u - uy)
        put(work, _ABOVE + _U + 1 + i, u + uy)
        put(work, _BELOW + _V + 1 + i, v - vy)
        put(work, _ABOVE + _V + 1 + i, v + vy)
        put(work, _BELOW + _W + 1 + i, w - wy)
        put(work, _ABOVE + _W + 1 + i, w + wy)
        put(work, _BELOW + _P + 1 + i, p - py)
        put(work, _ABOVE + _P + 1 + i, p + py)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _predict_column_row(work: Reals, n: int, ratio: Any) -> None:
    """Set the states at the lower and the upper faces of n cells, half a step later."""
    real = work.dtype.type
    zero, half, gamma = real(0.0), real(0.5), real(GAMMA)
    limit, least = real(_LIMIT), real(_LEAST_SHARE)
    step = half * ratio
    for i in range(_whole(n)):
        side_s, side_n = get(work, _CODE_LOW + i), get(work, _CODE_HIGH + i)
        air_s, air_n = side_s == zero, side_n == zero
        r, u, v = get(work, _MID + i), get(work, _MID + _U + i), get(work, _MID + _V + i)
        w, p = get(work, _MID + _W + i), get(work, _MID + _P + i)

        back = select(air_s, get(work, _LOW + i), r)
        ahead = select(air_n, get(work, _HIGH + i), r)
        rz = _slope(r - back, ahead - r, limit, half, zero)
        back = select(air_s, get(work, _LOW + _U + i), u)
        ahead = select(air_n, get(work, _HIGH + _U + i), u)
        uz = _slope(u - back, ahead - u, limit, half, zero)
        back = select(air_s, get(work, _LOW + _V + i), v)
        ahead = select(air_n, get(work, _HIGH + _V + i), v)
        vz = _slope(v - back, ahead - v, limit, half, zero)
        back = select(air_s, get(work, _LOW + _W + i), side_s * w)
        ahead = select(air_n, get(work, _HIGH + _W + i), side_n * w)
        wz = _slope(w - back, ahead - w, limit, half, zero)
        back = select(air_s, get(work, _LOW + _P + i), p)
        ahead = select(air_n, get(work, _HIGH + _P + i), p)
        pz = _slope(p - back, ahead - p, limit, half, zero)

        r_half = r - step * (w * rz + r * wz)
        u_half = u - step * (w * uz)
        v_half = v - step * (w * vz)
        w_half = w - (step * (w * wz) + step / r * pz)
        p_half = p - step * (w * pz + gamma * p * wz)
        rz, uz, vz, wz, pz = half * rz, half * uz, half * vz, half * wz, half * pz
        good = (r_half - abs(rz) > least * r) & (p_half - abs(pz) > least * p)
        r = select(good, r_half, r)
        u = select(good, u_half, u)
        v = select(good, v_half, v)
        w = select(good, w_half, w)
        p = select(good, p_half, p)
        rz, uz, vz = select(good, rz, zero), select(good, uz, zero), select(good, vz, zero)
        wz, pz = select(good, wz, zero), select(good, pz, zero)
        put(work, _BELOW + i, r - rz)
        put(work, _ABOVE + i, r + rz)
        put(work, _BELOW + _U + i, u - uz)
        put(work, _ABOVE + _U + i, u + uz)
        put(work, _BELOW + _V + i, v - vz)
        put(work, _ABOVE + _V + i, v + vz)
        put(work, _BELOW + _W + i, w - wz)
        put(work, _ABOVE + _W + i, w + wz)
        put(work, _BELOW + _P + i, p - pz)
        put(work, _ABOVE + _P + i, p + pz)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
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

    Wave speeds are by Einfeldt. The flux at a wall is only the pressure that turns the gas round.
    """
    real = work.dtype.type
    zero, half, one, gamma = real(0.0), real(0.5), real(1.0), real(GAMMA)
    per_pressure = real(1.0 / (GAMMA - 1.0))
    for i in range(_whole(n)):
        side_l = get(work, code_left + i)
        side_r = get(work, code_right + i)
        air_l = side_l == zero
        air_r = side_r == zero
        rl0, rr0 = get(work, left + i), get(work, right + i)
        ul0, ur0 = get(work, left + normal + i), get(work, right + normal + i)
        vl0, vr0 = get(work, left + second + i), get(work, right + second + i)
        wl0, wr0 = get(work, left + third + i), get(work, right + third + i)
        pl0, pr0 = get(work, left + _P + i), get(work, right + _P + i)
        rl = select(air_l, rl0, rr0)
        ul = select(air_l, ul0, side_l * ur0)
        vl = select(air_l, vl0, vr0)
        wl = select(air_l, wl0, wr0)
        pl = select(air_l, pl0, pr0)
        rr = select(air_r, rr0, rl0)
        ur = select(air_r, ur0, side_r * ul0)
        vr = select(air_r, vr0, vl0)
        wr = select(air_r, wr0, wl0)
        pr = select(air_r, pr0, pl0)

        # Divisions and roots are few, because they take most of the time.
        per_both = gamma / (rl * rr)
        sound2_l = pl * rr * per_both
        sound2_r = pr * rl * per_both
        share = rl / (rl + root(rl * rr))
        rest = one - share
        jump = ur - ul
        mean = share * ul + rest * ur
        sound = root(share * sound2_l + rest * sound2_r + half * share * rest * jump * jump)
        slow = smaller(ul - root(sound2_l), mean - sound)
        fast = larger(ur + root(sound2_r), mean + sound)

        # The contact moves at force / drag.
        ql = rl * (slow - ul)
        qr = rr * (fast - ur)
        drag = qr - ql
        force = (pl - pr) + (qr * ur - ql * ul)
        force = select(side_l + side_r < zero, zero, force)

        from_left = force >= zero
        r = select(from_left, rl, rr)
        u = select(from_left, ul, ur)
        v = select(from_left, vl, vr)
        w = select(from_left, wl, wr)
        p = select(from_left, pl, pr)
        q = select(from_left, ql, qr)
        wave = select(from_left, slow, fast)
        outside = select(from_left, slow >= zero, fast <= zero)
        energy = per_pressure * p + half * r * (u * u + v * v + w * w)
        width = wave * drag - force
        per_width = one / (drag * width)
        middle = force * width * per_width
        per_width = drag * drag * per_width
        p_star = p + q * (middle - u)
        r_star = q * per_width
        e_star = ((wave - u) * energy - p * u + p_star * middle) * per_width
        speed = select(outside, u, middle)
        p_face = select(outside, p, p_star)
        mass = speed * select(outside, r, r_star)
        put(work, out + i, mass)
        put(work, out + normal + i, mass * speed + p_face)
        put(work, out + second + i, mass * v)
        put(work, out + third + i, mass * w)
        put(work, out + _P + i, speed * (select(outside, energy, e_star) + p_face))


@njit(error_model="numpy", fastmath=FUSED)
def _predict_plane_fuel(work: Reals, n: int, ratio: Any, along: Reals, x: int, across: Any) -> None:
    """Set the share of fuel at the four vertical faces of n cells from x on, half a step later."""
    real = work.dtype.type
    zero, half, limit = real(0.0), real(0.5), real(_LIMIT)
    for i in range(_whole(n)):
        y = get(work, _MID + _Y + 1 + i)
        u = get(work, _MID + _U + 1 + i) * get(along, x + i)
        v = get(work, _MID + _V + 1 + i) * across
        back = select(get(work, _CODE_MID + i) == zero, get(work, _MID + _Y + i), y)
        ahead = select(get(work, _CODE_MID + 2 + i) == zero, get(work, _MID + _Y + 2 + i), y)
        yx = half * _slope(y - back, ahead - y, limit, half, zero)
        back = select(get(work, _CODE_LOW + 1 + i) == zero, get(work, _LOW + _Y + 1 + i), y)
        ahead = select(get(work, _CODE_HIGH + 1 + i) == zero, get(work, _HIGH + _Y + 1 + i), y)
        yy = half * _slope(y - back, ahead - y, limit, half, zero)
        y_half = y - ratio * (u * yx + v * yy)
        good = y_half - larger(abs(yx), abs(yy)) >= zero
        y, yx, yy = select(good, y_half, y), select(good, yx, zero), select(good, yy, zero)
        put(work, _WEST + _Y + 1 + i, y - yx)
        put(work, _EAST + _Y + 1 + i, y + yx)
        put(work, _BELOW + _Y + 1 + i, y - yy)
        put(work, _ABOVE + _Y + 1 + i, y + yy)


@njit(error_model="numpy", fastmath=FUSED)
def _predict_column_fuel(work: Reals, n: int, ratio: Any) -> None:
    """Set the share of fuel at the lower and the upper faces of n cells, half a step later."""
    real = work.dtype.type
    zero, half, limit = real(0.0), real(0.5), real(_LIMIT)
    for i in range(_whole(n)):
        y = get(work, _MID + _Y + i)
        back = select(get(work, _CODE_LOW + i) == zero, get(work, _LOW + _Y + i), y)
        ahead = select(get(work, _CODE_HIGH + i) == zero, get(work, _HIGH + _Y + i), y)
        yz = half * _slope(y - back, ahead - y, limit, half, zero)
        y_half = y - ratio * get(work, _MID + _W + i) * yz
        good = y_half - abs(yz) >= zero
        y, yz = select(good, y_half, y), select(good, yz, zero)
        put(work, _BELOW + _Y + i, y - yz)
        put(work, _ABOVE + _Y + i, y + yz)


@njit(error_model="numpy", fastmath=FUSED)
def _fuel_row(work: Reals, n: int, left: int, right: int, out: int) -> None:
    """Set the fluxes of fuel from those of mass, with the share of fuel on the upwind side."""
    zero = work.dtype.type(0.0)
    for i in range(_whole(n)):
        mass = get(work, out + i)
        share = select(mass >= zero, get(work, left + _Y + i), get(work, right + _Y + i))
        put(work, out + _Y + i, mass * share)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _shift_rows(work: Reals, count: int, n: int) -> None:
    """Advance to the next row: "high" becomes "mid", and "mid" becomes "low"."""
    _copy_rows(work, count, _MID, _LOW, n)
    _copy_rows(work, count, _HIGH, _MID, n)
    _copy_rows(work, count, _ABOVE, _ABOVE_LOW, n)
    _copy_rows(work, count, _ACROSS, _ACROSS_LOW, n)
    _copy_rows(work, 2, _CODE_MID, _CODE_LOW, n)


@njit(error_model="numpy", fastmath=FUSED)
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
    """Copy the pressures on the recorded faces of a row of n cells from x on."""
    for k in range(first[line], first[line + 1]):
        i = walls[k, 0] - x
        if 0 <= i < n:
            pressure[walls[k, 1]] = get(work, flux + i)


@njit(error_model="numpy", fastmath=FUSED)
def _forget_signals(work: Reals) -> None:
    for i in range(PITCH):
        put(work, _SIGNAL + i, work.dtype.type(0.0))


@njit(error_model="numpy", fastmath=FUSED)
def _fastest(work: Reals, n: int) -> float:
    """Return the fastest signal of the first n cells in the rows since `_forget_signals`."""
    fastest = 0.0
    for i in range(n):
        fastest = max(fastest, get(work, _SIGNAL + i))
    return fastest


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def advance_planes(
    state: Reals,
    code: NDArray[np.int8],
    work: Reals,
    edges: Reals,
    extent: NDArray[np.int64],
    z_from: int,
    z_to: int,
    ratio: Any,
    along: Reals,
    across: Reals,
    pressure: Reals,
    walls: NDArray[np.int32],
    first: NDArray[np.int32],
    notes: NDArray[np.float64],
) -> None:
    """Move the gas along x and y in the planes from z_from to z_to, and in no others.

    Args:
        state: The state (5 or 6, z, y, x), updated in place.
        code: Codes of the cells (z, y, x).
        work: A workspace (WORK_SIZE,).
        edges: A workspace (y, 2 * 6).
        extent: First and last + 1 cells along y and x of each plane, outside which air is still
            (z, 4).
        z_from: First plane.
        z_to: Last plane + 1.
        ratio: Ratio of time step to cell side.
        along: Ratio of cell side to the width of each cell along x (nx + 8,).
        across: The same along y (ny + 8,).
        pressure: Pressures on the recorded faces, updated in place.
        walls: Cell along x on the high side, and index of the face, row by row (k, 2).
        first: First entry of each row in `walls`, for faces normal to x, then to y and z.
        notes: Fastest signal and number of cells raised to the floor; updated in place.
    """
    count = len(state)
    rows = code.shape[1]
    lines = code.shape[0] * rows
    floored_cells = 0
    for z in range(z_from, z_to):
        y0, y1, x0, x1 = extent[z, 0], extent[z, 1], extent[z, 2], extent[z, 3]
        tiles = (x1 - x0 + TILE - 1) // TILE
        for tile in range(tiles):
            xa = x0 + (x1 - x0) * tile // tiles
            xb = x0 + (x1 - x0) * (tile + 1) // tiles
            n = xb - xa + 2 * MARGIN
            _forget_signals(work)
            for y in range(y0 - 2, y1 + 2):
                # Rows up to y are loaded, those up to y - 1 have states at the faces, and those
                # up to y - 2 are finished.
                _shift_rows(work, count, n)
                floored_cells += _load_row(state, code, work, z, y, xa - MARGIN, n)
                _join_tiles(work, edges, y, tile, xb - xa)
                if y < y0:
                    continue
                per_y = across[y - 1]
                _predict_plane_row(work, n - 2, ratio, along, xa - 1, per_y)
                if count > FUEL:
                    _predict_plane_fuel(work, n - 2, ratio, along, xa - 1, per_y)
                if y > y0:
                    _hllc_row(
                        work,
                        n - 4,
                        _ABOVE_LOW + 2,
                        _BELOW + 2,
                        _CODE_LOW + 2,
                        _CODE_MID + 2,
                        _V,
                        _U,
                        _W,
                        _ACROSS + 2,
                    )
                    if count > FUEL:
                        _fuel_row(work, n - 4, _ABOVE_LOW + 2, _BELOW + 2, _ACROSS + 2)
                    line = lines + z * rows + y - 1
                    _record_walls(work, pressure, walls, first, line, _ACROSS + _V + 2, xa, n - 4)
                if y > y0 + 1:
                    _update_plane_row(state, work, z, y - 2, xa, n - 4, ratio, along, across[y - 2])
                if y0 < y < y1 + 1:
                    _hllc_row(
                        work,
                        n - 3,
                        _EAST + 1,
                        _WEST + 2,
                        _CODE_MID + 1,
                        _CODE_MID + 2,
                        _U,
                        _V,
                        _W,
                        _ALONG + 2,
                    )
                    if count > FUEL:
                        _fuel_row(work, n - 3, _EAST + 1, _WEST + 2, _ALONG + 2)
                    line = z * rows + y - 1
                    _record_walls(work, pressure, walls, first, line, _ALONG + _U + 2, xa, n - 3)
                    for k in range(count):
                        for i in range(_whole(n - 4)):
                            at = k * PITCH + 2 + i
                            put(
                                work,
                                _CHANGE + at,
                                get(work, _ALONG + at + 1) - get(work, _ALONG + at),
                            )
            notes[0] = max(notes[0], _fastest(work, n))
    notes[1] += floored_cells


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _join_tiles(work: Reals, edges: Reals, y: int, tile: int, width: int) -> None:
    """Restore the old edge cells of the tile before, and keep those for the next tile."""
    for k in range(_VARIABLES):
        for i in range(MARGIN):
            at = _HIGH + k * PITCH + i
            if tile > 0:
                put(work, at, edges[y, k * MARGIN + i])
            edges[y, k * MARGIN + i] = get(work, at + width)


@njit(error_model="numpy", fastmath=FUSED)
def _update_plane_row(
    state: Reals,
    work: Reals,
    z: int,
    y: int,
    x: int,
    n: int,
    ratio: Any,
    along: Reals,
    per_y: Any,
) -> None:
    zero = work.dtype.type(0.0)
    for k in range(len(state)):
        least = work.dtype.type(_STILL[k])
        row = _place(state, k, z, y, x)
        shift = k * PITCH + 2
        for i in range(n):
            old = get(state, row + i)
            across = get(work, _ACROSS + shift + i) - get(work, _ACROSS_LOW + shift + i)
            change = get(work, _CHANGE + shift + i) * get(along, x + i)
            new = old - ratio * (change + across * per_y)
            new = select(abs(new) > least, new, zero)
            put(state, row + i, select(get(work, _CODE_LOW + 2 + i) == zero, new, old))


@njit(error_model="numpy", fastmath=FUSED)
def _update_column_row(
    state: Reals, work: Reals, z: int, y: int, x: int, n: int, ratio: Any
) -> None:
    zero = work.dtype.type(0.0)
    for k in range(len(state)):
        least = work.dtype.type(_STILL[k])
        row = _place(state, k, z, y, x)
        shift = k * PITCH
        for i in range(n):
            old = get(state, row + i)
            across = get(work, _ACROSS + shift + i) - get(work, _ACROSS_LOW + shift + i)
            new = old - ratio * across
            new = select(abs(new) > least, new, zero)
            put(state, row + i, select(get(work, _CODE_LOW + i) == zero, new, old))


@njit(error_model="numpy", fastmath=FUSED)
def _slice_at(extent: NDArray[np.int64], y: int) -> tuple[int, int, int, int]:
    """Return first and last + 1 cells along z and x of an extent at a y; zeros if it has none."""
    z0, z1, x0, x1 = 0, 0, 0, 0
    for z in range(len(extent)):
        if extent[z, 0] <= y < extent[z, 1]:
            if z1 == 0:
                z0, x0, x1 = z, extent[z, 2], extent[z, 3]
            z1, x0, x1 = z + 1, min(x0, extent[z, 2]), max(x1, extent[z, 3])
    return z0, z1, x0, x1


@njit(nogil=True, cache=True, error_model="numpy", fastmath=FUSED)
def advance_columns(
    state: Reals,
    code: NDArray[np.int8],
    work: Reals,
    extent: NDArray[np.int64],
    y_from: int,
    y_to: int,
    ratio: Any,
    upright: Reals,
    pressure: Reals,
    walls: NDArray[np.int32],
    first: NDArray[np.int32],
    notes: NDArray[np.float64],
) -> None:
    """Move the gas along z in the rows from y_from to y_to; see `advance_planes`.

    `upright` is the ratio of cell side to the height of each cell along z (nz + 8,).
    """
    count = len(state)
    rows = code.shape[1]
    lines = code.shape[0] * rows
    floored_cells = 0
    for y in range(y_from, y_to):
        z0, z1, x0, x1 = _slice_at(extent, y)
        tiles = (x1 - x0 + TILE - 1) // TILE
        for tile in range(tiles):
            x = x0 + (x1 - x0) * tile // tiles
            n = x0 + (x1 - x0) * (tile + 1) // tiles - x
            _forget_signals(work)
            for z in range(z0 - 2, z1 + 2):
                _shift_rows(work, count, n)
                floored_cells += _load_row(state, code, work, z, y, x, n)
                if z < z0:
                    continue
                own_ratio = ratio * upright[z - 1]
                _predict_column_row(work, n, own_ratio)
                if count > FUEL:
                    _predict_column_fuel(work, n, own_ratio)
                if z > z0:
                    _hllc_row(
                        work, n, _ABOVE_LOW, _BELOW, _CODE_LOW, _CODE_MID, _W, _U, _V, _ACROSS
                    )
                    if count > FUEL:
                        _fuel_row(work, n, _ABOVE_LOW, _BELOW, _ACROSS)
                    line = 2 * lines + (z - 1) * rows + y
                    _record_walls(work, pressure, walls, first, line, _ACROSS + _W, x, n)
                if z > z0 + 1:
                    _update_column_row(state, work, z - 2, y, x, n, ratio * upright[z - 2])
            notes[0] = max(notes[0], _fastest(work, n))
    notes[1] += floored_cells
