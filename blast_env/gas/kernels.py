"""The compiled step of the gas: MUSCL-Hancock with HLLC along one axis at a time.

A step is split by dimension: one sweep along each axis over the whole step, and in the next step in
the reverse order, which together are second-order accurate in time (Strang, SIAM J. Numer. Anal. 5
(1968) 506). A sweep has four parts for each cell:

1. density, velocity, pressure and share of fuel from the conserved state;
2. their limited slopes, and the states at both faces of the cell after half a step (MUSCL-Hancock:
   Toro, Riemann Solvers and Numerical Methods for Fluid Dynamics, 3rd ed., section 14.4);
3. the fluxes through its faces by HLLC (Toro, section 10.4; Batten et al., SIAM J. Sci. Comput. 18
   (1997) 1553) with the wave speeds of Einfeldt (SIAM J. Numer. Anal. 25 (1988) 294);
4. the new state from the difference of the fluxes.

All arithmetic is on vectors of neighbouring cells along x (`blast_env.gas.simd`), in the precision
of the state. A sweep along y or z marches through the rows, and keeps what the next row needs. The
sweep along x marches through the vectors of a row, and shifts them by a lane to get neighbours.
Where lanes differ, values are selected without branches.

The ghost state of a cell is its mirror image beside a solid cell, and its copy beside an open face.
A sweep moves only vectors with a cell of air and of the extent of their row. Outside the extent is
still air or no gas, so that nothing flows there.
"""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.compilation import compiled
from blast_env.gas.simd import (
    all_zero,
    everywhere,
    fetch,
    fill,
    get,
    lanes_at,
    larger,
    load,
    load_codes,
    one_higher,
    one_lower,
    own_frame,
    place,
    put,
    rarely,
    root,
    select,
    size,
    smaller,
    store,
)
from blast_env.gas.state import (
    DENSITY,
    ENERGY,
    FLOOR,
    FUEL,
    FUSED,
    GAMMA,
    X_MOMENTUM,
    Extent,
    Reals,
    lift,
)

Variables = tuple[Any, Any, Any, Any, Any, Any]
"""Vectors of density, velocity along the axis of a sweep and along the next two in cyclic order,
pressure, share of fuel; or their fluxes."""

WORK_ROWS: Final = 2
"""Vectors in a workspace: fluxes at recorded faces, and the largest signal speeds."""

_LEAST_SHARE: Final = 0.1
"""Share of the cell's density or pressure below which reconstructed values are discarded, and the
cell is treated as constant for that sweep."""

_STILL_MOMENTUM: Final = 1e-12
_STILL_FUEL: Final = 1e-24
"""Thresholds, in units of still air, up to which they are set to 0. Ahead of a wave these decay to
subnormal numbers, on which processors are slow, while density and energy are already those of still
air."""


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _variables(state: Any, cells: int, at: int, axis: int, fuel: bool) -> tuple[Variables, Any]:
    """Return the variables of the cells of a vector, and 1 / density."""
    r = load(state, DENSITY * cells + at)
    mu = load(state, (X_MOMENTUM + axis) * cells + at)
    mv = load(state, (X_MOMENTUM + (axis + 1) % 3) * cells + at)
    mw = load(state, (X_MOMENTUM + (axis + 2) % 3) * cells + at)
    energy = load(state, ENERGY * cells + at)
    per_r = fill(state, 1.0) / r
    u, v, w = mu * per_r, mv * per_r, mw * per_r
    p = fill(state, GAMMA - 1.0) * (energy - fill(state, 0.5) * (mu * u + mv * v + mw * w))
    y = r
    if fuel:
        y = load(state, FUEL * cells + at) * per_r
    return (r, u, v, w, p, y), per_r


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _safe_variables(
    state: Any, cells: int, at: int, axis: int, fuel: bool, notes: Any
) -> tuple[Variables, Any]:
    """Return the variables after raising density and pressure to the floor."""
    here, per_r = _variables(state, cells, at, axis, fuel)
    # In this order, NaN is found.
    if rarely(not everywhere(smaller(here[0], here[4]) >= fill(state, FLOOR))):
        lift(state, cells, at, notes)
        here, per_r = _variables(state, cells, at, axis, fuel)
    return here, per_r


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _half_slope(low: Any, here: Any, high: Any, quarter: Any, zero: Any) -> Any:
    """Return half the slope of cells, limited to the values of their neighbours.

    It is the smallest of the differences to both neighbours and of half their mean, and 0 where
    they differ in sign (van Leer's monotonised central limiter, J. Comput. Phys. 23 (1977) 276).
    """
    back, ahead = here - low, high - here
    middle = quarter * (back + ahead)
    # The middle, cut off at the smaller rise if both rise, and at the smaller fall if both fall.
    rise = larger(smaller(back, ahead), zero)
    fall = smaller(larger(back, ahead), zero)
    return larger(smaller(middle, rise), fall)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _ghost(air: Any, own: Variables, other: Variables, side: Any) -> Variables:
    """Return own variables of cells of air, and elsewhere the image of the others.

    `side` is the factor of the normal velocity: -1 in a mirror, 1 beyond an open face.
    """
    return (
        # A wall turns the normal velocity round, an open face passes it on (Toro, section 6.3.3).
        select(air, own[0], other[0]),
        select(air, own[1], side * other[1]),
        select(air, own[2], other[2]),
        select(air, own[3], other[3]),
        select(air, own[4], other[4]),
        select(air, own[5], other[5]),
    )


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _at_faces(
    state: Any, low: Variables, here: Variables, high: Variables, per_r: Any, ratio: Any, fuel: bool
) -> tuple[Variables, Variables]:
    """Return the variables of cells at their low and high faces after half a step.

    Args:
        low: Variables of the neighbours on the low side.
        here: Those of the cells.
        high: Those of the neighbours on the high side.
        per_r: 1 / density of the cells.
        ratio: Ratio of time step to width of the cells.
        fuel: Whether the state has fuel.
    """
    zero, quarter, share = fill(state, 0.0), fill(state, 0.25), fill(state, _LEAST_SHARE)
    r, u, v, w, p, y = here

    # 1. Half of the limited slopes.
    dr = _half_slope(low[0], r, high[0], quarter, zero)
    du = _half_slope(low[1], u, high[1], quarter, zero)
    dv = _half_slope(low[2], v, high[2], quarter, zero)
    dw = _half_slope(low[3], w, high[3], quarter, zero)
    dp = _half_slope(low[4], p, high[4], quarter, zero)

    # 2. Half a step of the Euler equations in these variables (Toro, section 14.4).
    r_half = r - ratio * (u * dr + r * du)
    u_half = u - ratio * (u * du + per_r * dp)
    v_half = v - ratio * (u * dv)
    w_half = w - ratio * (u * dw)
    p_half = p - ratio * (u * dp + fill(state, GAMMA) * p * du)

    # 3. First order where density or pressure at a face would fall too far.
    good = (r_half - size(dr) > share * r) & (p_half - size(dp) > share * p)
    r, u, v = select(good, r_half, r), select(good, u_half, u), select(good, v_half, v)
    w, p = select(good, w_half, w), select(good, p_half, p)
    dr, du, dv = select(good, dr, zero), select(good, du, zero), select(good, dv, zero)
    dw, dp = select(good, dw, zero), select(good, dp, zero)

    # 4. The same for the share of fuel, which must not fall below 0.
    dy = zero
    if fuel:
        dy = _half_slope(low[5], y, high[5], quarter, zero)
        y_half = y - ratio * (here[1] * dy)
        good = y_half - size(dy) >= zero
        y, dy = select(good, y_half, y), select(good, dy, zero)
    # 5. Half a slope to either face.
    below = (r - dr, u - du, v - dv, w - dw, p - dp, y - dy)
    above = (r + dr, u + du, v + dv, w + dw, p + dp, y + dy)
    return below, above


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _hllc(state: Any, left: Variables, right: Variables, wall: Any, fuel: bool) -> Variables:
    """Return the fluxes through faces from the variables on their two sides.

    Args:
        left: Variables on the low side of the faces.
        right: Those on the high side.
        wall: Below 0 at walls, where the contact rests.
        fuel: Whether the state has fuel.

    Returns:
        Fluxes of mass, momentum along the axis and along the next two, energy, and fuel.
    """
    zero, half, one = fill(state, 0.0), fill(state, 0.5), fill(state, 1.0)
    rl, ul, vl, wl, pl, yl = left
    rr, ur, vr, wr, pr, yr = right

    # 1. Speeds of the outer waves: the slowest and fastest ones of both states and of their Roe
    # mean (Einfeldt). Divisions and roots are few, because they take most of the time.
    product = rl * rr
    total = rl + root(product)
    per_all = one / (total * product)
    share_l = rl * product * per_all
    share_r = one - share_l
    gamma_per_product = fill(state, GAMMA) * total * per_all
    sound2_l, sound2_r = pl * rr * gamma_per_product, pr * rl * gamma_per_product
    jump = ur - ul
    u_roe = share_l * ul + share_r * ur
    sound_roe = root(
        share_l * sound2_l + share_r * sound2_r + half * share_l * share_r * jump * jump
    )
    s_l = smaller(ul - root(sound2_l), u_roe - sound_roe)
    s_r = larger(ur + root(sound2_r), u_roe + sound_roe)

    # 2. Speed of the contact, `momentum / mass` (Toro, section 10.4), where `q` is the flow of mass
    # through an outer wave.
    q_l, q_r = rl * (s_l - ul), rr * (s_r - ur)
    mass = q_r - q_l
    momentum = (pl - pr) + (q_r * ur - q_l * ul)
    momentum = select(wall < zero, zero, momentum)

    # 3. The side of the contact on which the face is.
    from_left = momentum >= zero
    r, u = select(from_left, rl, rr), select(from_left, ul, ur)
    v, w = select(from_left, vl, vr), select(from_left, wl, wr)
    p, q = select(from_left, pl, pr), select(from_left, q_l, q_r)
    s = select(from_left, s_l, s_r)
    is_outside = select(from_left, s_l, zero - s_r) >= zero

    # 4. The state between that outer wave and the contact (Toro, section 10.4). One division gives
    # both the speed of the contact and 1 / (s - speed of the contact).
    gap = s * mass - momentum
    per_gap = one / (mass * gap)
    u_star = momentum * gap * per_gap
    per_gap = mass * mass * per_gap
    p_star = p + q * (u_star - u)
    energy = fill(state, 1.0 / (GAMMA - 1.0)) * p + half * r * (u * u + v * v + w * w)
    energy_star = ((s - u) * energy - p * u + p_star * u_star) * per_gap

    # 5. The flux of that state, or of the undisturbed one if both waves go the same way.
    speed, p_face = select(is_outside, u, u_star), select(is_outside, p, p_star)
    flow = speed * select(is_outside, r, q * per_gap)
    energy = select(is_outside, energy, energy_star)
    y = flow
    if fuel:
        y = flow * select(flow >= zero, yl, yr)
    return flow, flow * speed + p_face, flow * v, flow * w, speed * (energy + p_face), y


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _update(
    state: Any,
    cells: int,
    at: int,
    axis: int,
    fuel: bool,
    code: Any,
    ratio: Any,
    low: Variables,
    high: Variables,
) -> None:
    """Change the cells of a vector by the difference of the fluxes through their two faces."""
    # Conservative update (Toro, section 5.3): u_new = u - dt / dx (F_high - F_low).
    air = load_codes(state, code, at) == fill(state, 0.0)
    u = (X_MOMENTUM + axis) * cells + at
    v = (X_MOMENTUM + (axis + 1) % 3) * cells + at
    w = (X_MOMENTUM + (axis + 2) % 3) * cells + at
    _change(state, DENSITY * cells + at, air, ratio, low[0], high[0], 0.0)
    _change(state, u, air, ratio, low[1], high[1], _STILL_MOMENTUM)
    _change(state, v, air, ratio, low[2], high[2], _STILL_MOMENTUM)
    _change(state, w, air, ratio, low[3], high[3], _STILL_MOMENTUM)
    _change(state, ENERGY * cells + at, air, ratio, low[4], high[4], 0.0)
    if fuel:
        _change(state, FUEL * cells + at, air, ratio, low[5], high[5], _STILL_FUEL)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _change(state: Any, at: int, air: Any, ratio: Any, low: Any, high: Any, least: float) -> None:
    old = load(state, at)
    new = old - ratio * (high - low)
    if least > 0.0:
        new = select(size(new) > fill(state, least), new, fill(state, 0.0))
    store(state, at, select(air, new, old))


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _record_walls(flux: Any, vector: int, recorded: Any, work: Any) -> None:
    """Copy the fluxes of momentum at the recorded faces of a vector."""
    pressure, walls, first = recorded
    begin, end = get(first, vector), get(first, vector + 1)
    if rarely(begin < end):
        store(work, 0, flux)
        for k in range(begin, end):
            put(pressure, get(walls, 2 * k + 1), get(work, get(walls, 2 * k)))


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _note_signals(state: Any, here: Variables, per_r: Any, work: Any) -> None:
    """Keep the largest speeds of signals along any axis."""
    _, u, v, w, p, _ = here
    # |u| + c, the fastest wave of the Euler equations (Toro, section 3.1).
    most = larger(larger(size(u), size(v)), size(w))
    signal = most + root(fill(state, GAMMA) * p * per_r)
    store(work, lanes_at(state), larger(signal, load(work, lanes_at(state))))


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _still_air(state: Any, still: Any) -> Variables:
    """Return the variables of still air."""
    zero = fill(state, 0.0)
    p = fill(state, GAMMA - 1.0) * fill(state, get(still, ENERGY))
    return fill(state, 1.0), zero, zero, zero, p, zero


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _ratio_at(gas: Any, axis: int, along: bool, m: int) -> Any:
    """Return the ratio of time step to width of the cells of a vector."""
    state, (along_x, along_y, along_z), ratio = gas[0], gas[3], gas[4]
    if along:
        return fill(state, ratio) * load(along_x, m * lanes_at(state))
    return fill(state, ratio * get(along_y if axis == 1 else along_z, m))


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _flux_through(
    state: Any, code: int, at: int, apart: int, left: Any, right: Any, is_clear: bool, fuel: bool
) -> Any:
    """Return the flux through the low faces of a vector; behind a wall is the mirrored gas."""
    wall = fill(state, 0.0)
    if not is_clear:
        side_left = load_codes(state, code, at - apart)
        side_right = load_codes(state, code, at)
        left, right = (
            _ghost(side_left == wall, left, right, side_left),
            _ghost(side_right == wall, right, left, side_right),
        )
        wall = side_left + side_right
    return _hllc(state, left, right, wall, fuel)


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _sweep_run(
    gas: Any,
    begin: int,
    stride: int,
    first: int,
    end: int,
    axis: int,
    along: bool,
    ahead: int,
    fuel: bool,
    measure: bool,
) -> None:
    """Move the gas in vectors of cells, one behind the other.

    Neighbours along y or z are the same lanes of the vectors before and after. Along x they are the
    next lanes, and the cells beyond both ends of the run are still air or no gas.

    Args:
        gas: The places of the arrays.
        begin: Place of the vector at coordinate 0 among all cells.
        stride: Distance of vectors.
        first: Coordinate of the first vector.
        end: That of the last one + 1.
        along: Whether it is x, along which vectors lie.
        ahead: Distance of the vectors to be moved later, which are loaded into the cache.
        fuel: Whether the state has fuel.
        measure: Whether to note the speeds of signals.
    """
    state, code, still, _, _, recorded, work, notes, cells = gas
    air, zero = _still_air(state, still), fill(state, 0.0)
    vectors, apart = axis * (cells // lanes_at(state)), 1 if along else stride
    flux_still = (zero, air[4], zero, zero, zero, zero)
    before, above_before, flux_before = air, air, flux_still
    at = begin + first * stride
    here, per_r = _safe_variables(state, cells, at, axis, fuel, notes)
    for m in range(first, end + 1):
        after, per_r_after, below, above, flux = air, per_r, air, air, flux_still
        for k in range(FUEL + fuel):
            fetch(state, k * cells + at + ahead)
        is_clear = all_zero(state, code, at - apart) and all_zero(state, code, at)
        # 1. The variables at both faces of the cells.
        if m < end:
            if measure:
                _note_signals(state, here, per_r, work)
            if m + 1 < end:
                after, per_r_after = _safe_variables(state, cells, at + stride, axis, fuel, notes)
            low, high = before, after
            if along:
                low, high = one_lower(before, here), one_higher(here, after)
            if not (is_clear and all_zero(state, code, at + apart)):
                side_low = load_codes(state, code, at - apart)
                side_high = load_codes(state, code, at + apart)
                low = _ghost(side_low == zero, low, here, side_low)
                high = _ghost(side_high == zero, high, here, side_high)
            ratio = _ratio_at(gas, axis, along, m)
            below, above = _at_faces(state, low, here, high, per_r, ratio, fuel)
        # 2. The fluxes through the low faces; along x, the last ones are those of still air.
        if m < end or not along:
            left = one_lower(above_before, above) if along else above_before
            flux = _flux_through(state, code, at, apart, left, below, is_clear, fuel)
            _record_walls(flux[1], vectors + at // lanes_at(state), recorded, work)
        # 3. The vector before this one, all of whose fluxes are known now.
        if m > first:
            flux_high = one_higher(flux_before, flux) if along else flux
            ratio = _ratio_at(gas, axis, along, m - 1)
            _update(state, cells, at - stride, axis, fuel, code, ratio, flux_before, flux_high)
        before, here, per_r, above_before, flux_before = here, after, per_r_after, above, flux
        at += stride


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _sweep_rows(gas: Any, bounds: Any, y: int, is_first: bool, fuel: bool, measure: bool) -> None:
    """Move the gas along x in the rows of all planes at a y.

    Before the other sweep of the layer, the next layer is loaded into the cache; after it, the next
    row. A run of vectors ends with the first one without air: it holds the face before it.
    """
    extent, airy, (planes, rows, length) = bounds
    lanes = lanes_at(gas[0])
    vectors = length // lanes
    ahead = length if is_first else rows * length
    for z in range(planes):
        row = z * rows + y
        x0, x1 = get(extent, 2 * row), get(extent, 2 * row + 1)
        if x1 == 0:
            continue
        # The cells at both ends are outside the extent.
        first, last = (x0 - 1) // lanes, x1 // lanes + 1
        while first < last:
            while first < last and get(airy, row * vectors + first) == 0:
                first += 1
            end = first
            while end < last and get(airy, row * vectors + end) != 0:
                end += 1
            if first < end:
                end = min(end + 1, last)
                _sweep_run(gas, row * length, lanes, first, end, 0, True, ahead, fuel, measure)
            first = end


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _sweep_columns(
    gas: Any, bounds: Any, layer: int, axis: int, is_first: bool, fuel: bool, measure: bool
) -> None:
    """Move the gas along y in a plane, or along z in the rows of all planes at a y.

    Before the other sweep of the layer, the next layer is loaded into the cache; otherwise the next
    vectors of the rows, which lie far apart in memory.
    """
    extent, airy, (planes, rows, length) = bounds
    lanes = lanes_at(gas[0])
    vectors = length // lanes
    # 1. The rows across which the gas moves, and the vectors of their extents.
    begin, apart, count = (layer * rows, 1, rows) if axis == 1 else (layer, rows, planes)
    m0, m1, v0, v1 = count, 0, vectors, 0
    for m in range(count):
        row = begin + m * apart
        x0, x1 = get(extent, 2 * row), get(extent, 2 * row + 1)
        if x1 > 0:
            m0, m1 = min(m0, m), m + 1
            v0, v1 = min(v0, x0 // lanes), max(v1, (x1 - 1) // lanes + 1)
    ahead = length if is_first else apart * length + lanes
    # 2. The runs of vectors with air in their extent, one behind the other.
    for v in range(v0, v1):
        m = m0
        while m < m1:
            first = m
            while m < m1 and _has_gas(extent, airy, begin + m * apart, v, vectors, lanes):
                m += 1
            if first < m:
                _sweep_run(
                    gas, begin * length + v * lanes, apart * length, first, m, axis, False, ahead,
                    fuel, measure,
                )  # fmt: skip
            m += 1


@njit(forceinline=True, error_model="numpy", fastmath=FUSED)
def _has_gas(extent: Any, airy: Any, row: int, v: int, vectors: int, lanes: int) -> bool:
    """Return whether a vector of a row has a cell of its extent, and air."""
    overlaps = get(extent, 2 * row) < (v + 1) * lanes and get(extent, 2 * row + 1) > v * lanes
    return overlaps and get(airy, row * vectors + v) != 0


def _sweep_of(fuel: bool) -> Any:
    """Return the sweeps of a state with or without fuel, as `sweep`; compiled for each."""

    @njit(forceinline=False, error_model="numpy", fastmath=FUSED)
    def sweeps(
        gas: Any, bounds: Any, axes: tuple[int, int], first: int, end: int, measure: bool
    ) -> None:
        own_frame()
        for k in range(first, end):
            for number in range(2):
                axis = axes[number]
                is_first = number == 0 and axes[1] >= 0
                last = measure and (number == 1 or axes[1] < 0)
                if axis == 0:
                    _sweep_rows(gas, bounds, k, is_first, fuel, last)
                elif axis > 0:
                    _sweep_columns(gas, bounds, k, axis, is_first, fuel, last)

    return sweeps


_with_fuel, _without_fuel = _sweep_of(True), _sweep_of(False)


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def sweep(
    state: Reals,
    code: NDArray[np.int8],
    airy: NDArray[np.int8],
    extent: Extent,
    axes: tuple[int, int],
    first: int,
    end: int,
    measure: bool,
    ratio: Any,
    narrow: tuple[Reals, Reals, Reals],
    still: Reals,
    recorded: tuple[Reals, NDArray[np.int32], NDArray[np.int32]],
    work: Reals,
    notes: NDArray[np.float64],
) -> None:
    """Move the gas along one or two axes in the layers from first to end, and in no others.

    Layers are planes for the axis y, and for x and z the rows at a y in all planes: sweeps along
    both move a layer along one and then along the other, while it is in the cache.

    Args:
        state: The state (5 or 6, z, y, x), updated in place; rows are whole vectors.
        code: Codes of the cells (z, y, x).
        airy: Whether vectors have a cell of air (z, y, vectors).
        extent: Cells outside which air is still, extended along the axes (z, y, 2).
        axes: The axes of the sweeps, 0 for x: y and -1, or x and z in any order.
        end: Last layer + 1.
        measure: Whether to note the speeds of signals in the last sweep.
        ratio: Ratio of time step to cell side.
        narrow: Ratio of cell side to the width of each cell along x, y and z.
        still: State of still air (5 or 6,).
        recorded: Pressures on the recorded faces, updated in place; lane of the cell on the high
            side and index of the face, vector by vector (k, 2); the first of these entries of each
            vector, for faces normal to x, then to y and z.
        work: A workspace (WORK_ROWS, lanes).
        notes: Fastest signal and number of cells raised to the floor; updated in place (2,).
    """
    work[1] = 0.0
    widths = place(narrow[0]), place(narrow[1]), place(narrow[2])
    pressures = place(recorded[0]), place(recorded[1]), place(recorded[2])
    own = place(work), place(notes), code.size
    gas = (place(state), place(code), place(still), widths, ratio, pressures, *own)
    bounds = place(extent), place(airy), code.shape
    if len(state) > FUEL:
        _with_fuel(gas, bounds, axes, first, end, measure)
    else:
        _without_fuel(gas, bounds, axes, first, end, measure)
    notes[0] = max(notes[0], work[1].max())
