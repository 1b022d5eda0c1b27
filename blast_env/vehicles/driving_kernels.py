"""Compiled search over the steps of a driving vehicle, imported on first use.

Lengths and labels are those of `blast_env.vehicles.driving_steps`.
"""

import numpy as np

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.compilation import compiled
from blast_env.vehicles.driving_steps import NEVER, Arcs, IntArray32, Labels


@compiled()
def spread(
    is_open: BoolArray,
    is_wide: BoolArray,
    is_slow: BoolArray,
    most: Labels,
    labels: Labels,
    directions: IntArray32,
    lengths: Labels,
    arcs: Arcs,
    arc_most: Labels,
    slow_most: float,
    spot_most: float,
) -> None:
    """Raise labels until no step raises one any further.

    A label is the run-up from standstill to a speed, v^2 / 2 a, in steps; below 0 for unreachable
    states. Labels only rise, and their final values do not depend on the order of steps. Places are
    visited in the direction of travel, so that one pass propagates a label to the end.

    Args:
        is_open: Whether each place is open (rows, columns).
        is_wide: Whether each place has room for a turn on the spot (rows, columns).
        is_slow: Whether each place limits the speed (rows, columns).
        most: The largest label at each place (rows, columns).
        labels: Labels, at first those of the entries (directions, rows, columns); changed in place.
        directions: The steps (directions, 2).
        lengths: Their lengths (directions,).
        arcs: The arcs.
        arc_most: The largest label on each arc.
        slow_most: The largest label on an arc over slow places.
        spot_most: The largest label of a turn on the spot.
    """
    count = len(labels)
    changed = labels >= np.float32(0.0)
    spots = np.full(is_open.shape, NEVER)
    spot_limit = np.float32(spot_most)  # in the precision of labels, else the loop would not end
    slow_limit = np.float32(slow_most)
    firsts = np.searchsorted(arcs.of[:, 0], np.arange(count + 1))
    # Label correcting: sweep each direction along itself, so that one sweep carries a label to the
    # end of its line; then the arcs; repeat until no label grows.
    while changed.any():
        for number in range(count):
            _sweep(
                number,
                directions[number],
                lengths[number],
                is_open,
                is_wide,
                most,
                spot_limit,
                spots,
                labels,
                changed,
            )
            own = range(firsts[number], firsts[number + 1])
            _follow_arcs(
                number,
                own,
                arcs,
                arc_most,
                is_open,
                is_slow,
                slow_limit,
                labels,
                changed,
            )


@compiled()
def _sweep(
    number: int,
    step: IntArray32,
    length: np.float32,
    is_open: BoolArray,
    is_wide: BoolArray,
    most: Labels,
    spot_limit: np.float32,
    spots: Labels,
    labels: Labels,
    changed: BoolArray,
) -> None:
    """Take straight steps of one direction along it, and turns on the spot from its places."""
    count, rows, columns = labels.shape
    x, y = step
    for i in range(rows):
        row = i if y >= 0 else rows - 1 - i
        if not changed[number, row].any():
            continue
        for j in range(columns):
            column = j if x >= 0 else columns - 1 - j
            if not changed[number, row, column]:
                continue
            label = labels[number, row, column]
            # A turn on the spot leaves at most this run-up, in all directions.
            spot = min(label, spot_limit)
            if is_wide[row, column] and spot > spots[row, column]:
                spots[row, column] = spot
                for other in range(count):
                    if spot > labels[other, row, column]:
                        labels[other, row, column] = spot
                        changed[other, row, column] = True
            up, right = row + y, column + x
            if not (0 <= up < rows and 0 <= right < columns and is_open[up, right]):
                continue
            # The run-up grows by the step, up to what the speed limit there allows.
            value = min(label + length, most[up, right])
            if value > labels[number, up, right] and _is_passed(is_open, row, column, x, y):
                labels[number, up, right] = value
                changed[number, up, right] = True


@compiled()
def _follow_arcs(
    number: int,
    own: range,
    arcs: Arcs,
    arc_most: Labels,
    is_open: BoolArray,
    is_slow: BoolArray,
    slow_limit: np.float32,
    labels: Labels,
    changed: BoolArray,
) -> None:
    """Take the arcs `own` that begin in one direction, from all places with a new label."""
    _, rows, columns = labels.shape
    for row in range(rows):
        if not changed[number, row].any():
            continue
        for column in range(columns):
            if not changed[number, row, column]:
                continue
            changed[number, row, column] = False
            label = labels[number, row, column]
            for arc in own:
                other = arcs.of[arc, 1]
                up, right = row + arcs.ends[arc, 1], column + arcs.ends[arc, 0]
                if not (0 <= up < rows and 0 <= right < columns):
                    continue
                # An arc bounds the speed by its lateral acceleration, hence the run-up.
                value = min(label + arcs.lengths[arc], arc_most[arc])
                if value <= labels[other, up, right]:
                    continue
                # Every place along the arc must be open; slow ground on it bounds the speed at its
                # end.
                for point in range(arcs.first[arc], arcs.first[arc + 1]):
                    v, u = row + arcs.points[point, 1], column + arcs.points[point, 0]
                    if not (0 <= v < rows and 0 <= u < columns and is_open[v, u]):
                        value = NEVER
                        break
                    if is_slow[v, u]:
                        value = min(value, slow_limit)
                if value > labels[other, up, right]:
                    labels[other, up, right] = value
                    changed[other, up, right] = True


@compiled(inline="always")
def _is_passed(is_open: BoolArray, row: int, column: int, x: int, y: int) -> bool:
    """Return whether a place beside the middle of a straight step is open."""
    if abs(x) == 2:
        return bool(is_open[row, column + x // 2] or is_open[row + y, column + x // 2])
    if abs(y) == 2:
        return bool(is_open[row + y // 2, column] or is_open[row + y // 2, column + x])
    return True


@compiled()
def fastest_into(
    run_up_m: Labels,
    among: BoolArray,
    box: IntArray,
    steps_m: FloatArray,
    lengths_m: Labels,
    sides_m: FloatArray,
    place_m: float,
    slack_m: float,
    epsilon_m: float,
) -> int:
    """Return the state with the fastest next step into a rectangle; -1 if there is none.

    Args:
        run_up_m: As in `SpeedField`.
        among: Places to examine (rows, columns).
        box: First row and the one after the last, then the same for columns, of the search.
        steps_m: Steps of the directions (directions, 2).
        sides_m: Left, bottom, right and top of the rectangle, grown by half of the vehicle's width.
        place_m: Spacing of places.
        slack_m: Largest depth inside the rectangle at which a place counts as outside.
        epsilon_m: Least depth inside the rectangle at which a step must end.
    """
    left, bottom, right, top = sides_m
    _, rows, columns = run_up_m.shape
    best, found = np.float32(-1.0), -1
    for number in range(len(steps_m)):
        step_x, step_y = steps_m[number]
        for row in range(box[0], box[1]):
            y = place_m * row
            if not bottom + epsilon_m < y + step_y < top - epsilon_m:
                continue
            # The step must begin outside and cross a side, not run along it.
            inwards_y = (step_y > 0.0 and y <= bottom + slack_m) or (
                step_y < 0.0 and y >= top - slack_m
            )
            for column in range(box[2], box[3]):
                own, x = run_up_m[number, row, column], place_m * column
                if own < 0.0 or not among[row, column]:
                    continue
                if not left + epsilon_m < x + step_x < right - epsilon_m:
                    continue
                inwards = (
                    inwards_y
                    or (step_x > 0.0 and x <= left + slack_m)
                    or (step_x < 0.0 and x >= right - slack_m)
                )
                value = own + lengths_m[number]
                if inwards and value > best:
                    best, found = value, (number * rows + row) * columns + column
    return found
