"""Largest speed of a vehicle at every place of its reach: a search over place, direction, speed.

The vehicle is a point with a speed. Over a distance s it accelerates by v^2 = v0^2 + 2 a s, up to
its largest speed, and in a turn with radius r its speed is at most v^2 = f g r, where f is the grip
of its tyres (UFC 4-022-02, after MIL-HDBK-1013/14, equations 5 and 6). Braking is instantaneous.

Places are points 0.5 m apart, and there are sixteen directions. From a point the vehicle goes
straight on, or turns on an arc to one of the next two directions on either side, with a radius
from a table. A turn tighter than 3.5 m is one on the spot, with the speed limit of that radius. All
rounding is towards higher speeds: a place is open if any place within 0.25 m is, a radius counts as
the next larger one of the table, and a run-up is longer by one step. Only a gap that is passed at a
heading between two directions can allow more: tests accept 2 %.

More obstacles leave fewer steps, so they never raise a speed. Nor do fewer arcs: a search with few
of them quickly and safely identifies most pieces that a vehicle hits too fast.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Rectangle
from blast_env.sections import PointM
from blast_env.vehicles.driving_steps import (
    DIRECTIONS,
    LENGTHS,
    NEVER,
    SPOT,
    IntArray32,
    Labels,
    all_arcs,
    arcs_up_to,
    wide_places,
)
from blast_env.vehicles.vehicle import Motion

GRAVITY_M_S2: Final = 9.81

KM_H_PER_M_S: Final = 3.6

STEP_M: Final = 0.5
"""Spacing of places."""

_EPSILON_M: Final = 1e-6


@dataclass(frozen=True, eq=False)
class SpeedField:
    """The largest speeds of a vehicle, by direction and place.

    Attributes:
        half_m: Half of its width.
        run_up_m: Run-up from standstill for each speed (directions, rows, columns), below 0 for
            unreachable states; place (row, column) is at `STEP_M * (column, row)`.
        is_open: Whether each place is open to its centre (rows, columns).
        starts: Places of its entries (rows, columns).
    """

    motion: Motion
    half_m: float
    run_up_m: Labels
    is_open: BoolArray
    starts: BoolArray

    @classmethod
    def of(
        cls,
        motion: Motion,
        half_m: float,
        is_open: BoolArray,
        starts: Sequence[tuple[BoolArray, PointM]],
        arc_step: int = 1,
    ) -> "SpeedField":
        """Compute the speeds.

        Args:
            motion: Motion of the vehicle.
            half_m: Half of its width.
            is_open: Whether each place is open to its centre (rows, columns).
            starts: Places of each entry (rows, columns), with the direction into the site.
            arc_step: Use one arc in `arc_step`, see `Arcs.every`; speeds are exact with 1, and no
                larger otherwise.
        """
        # Imported here because Numba takes half a second to import.
        from blast_env.vehicles.driving_kernels import spread

        def label(speed_km_h: float) -> float:
            return _run_up_m(motion, speed_km_h) / STEP_M

        # 1. Speeds as run-ups from standstill, v^2 = 2 a s: a step adds its length, a limit caps.
        top = label(motion.max_speed_km_h)
        most = np.full(is_open.shape, top, dtype=np.float32)
        for area in motion.slow:
            inside = places_in(area.rectangle_m.grown(-STEP_M / 2.0))
            most[inside] = np.minimum(most[inside], label(area.speed_km_h))
        # Restrict the search to the bounding box of the open places, to save time.
        box = _around(is_open)
        ground, most = np.ascontiguousarray(is_open[box]), np.ascontiguousarray(most[box])
        # 2. The states at the entries: all directions that lead into the site.
        labels = np.full((len(DIRECTIONS), *ground.shape), NEVER)
        entered = np.zeros_like(is_open)
        for start, inwards in starts:
            entered |= start & is_open
            at = start[box] & ground
            for number, step in enumerate(DIRECTIONS):
                if step @ inwards > 0:
                    labels[number][at] = np.minimum(
                        label(motion.entry_km_h) + LENGTHS[number], most[at]
                    )
        # 3. From there along straight steps, arcs and turns on the spot. In a turn of radius r the
        # tyres hold v^2 / r <= grip g, which is a run-up of grip g r / (2 a).
        per_radius = _per_radius(motion)
        arcs = arcs_up_to(top / per_radius, arc_step)
        spread(
            ground,
            wide_places(ground),
            most < top,
            most,
            labels,
            DIRECTIONS,
            LENGTHS,
            arcs,
            np.minimum(arcs.radii * per_radius, top).astype(np.float32),
            max((label(area.speed_km_h) for area in motion.slow), default=top),
            min(SPOT * per_radius, top),
        )
        step_m = np.float32(STEP_M)
        run_up_m = np.full((len(DIRECTIONS), *is_open.shape), step_m * NEVER)
        np.multiply(step_m, labels, out=run_up_m[:, *box])
        return cls(motion, half_m, run_up_m, is_open, entered)

    @property
    def places_km_h(self) -> FloatArray:
        """The largest speed at each place in any direction (rows, columns); NaN if unreachable."""
        run_up_m = self.run_up_m.max(axis=0).astype(np.float64)
        return np.where(run_up_m < 0.0, np.nan, self._km_h(run_up_m))

    def impact_km_h(self, rectangle: Rectangle, among: BoolArray | None = None) -> float | None:
        """Return the largest speed at which the vehicle hits a rectangle; `None` if it does not.

        Args:
            rectangle: The rectangle, m.
            among: Places from which it may hit (rows, columns); the open ones unless given.
        """
        state = self._hit(rectangle, among)
        return None if state is None else self._hit_km_h(state)

    def way_to(self, place_m: PointM) -> tuple["WayPoint", ...]:
        """Return a way to a place with the largest speed there; empty if there is none."""
        x, y = (round(coordinate_m / STEP_M) for coordinate_m in place_m)
        _, rows, columns = self.run_up_m.shape
        near = self.run_up_m[:, max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]
        number, up, right = np.unravel_index(int(near.argmax()), near.shape)
        if near[number, up, right] < 0.0:
            return ()
        row, column = max(y - 1, 0) + int(up), max(x - 1, 0) + int(right)
        return self._way(int(np.ravel_multi_index((int(number), row, column), (16, rows, columns))))

    def _hit(self, rectangle: Rectangle, among: BoolArray | None = None) -> int | None:
        """Return the state from which the vehicle hits a rectangle fastest, if there is one."""
        from blast_env.vehicles.driving_kernels import fastest_into

        left, bottom, right, top = rectangle.grown(self.half_m)
        _, rows, columns = self.run_up_m.shape
        low, high = max(floor(bottom / STEP_M) - 3, 0), min(ceil(top / STEP_M) + 4, rows)
        first, after = max(floor(left / STEP_M) - 3, 0), min(ceil(right / STEP_M) + 4, columns)
        if low >= high or first >= after:
            return None
        found = fastest_into(
            self.run_up_m,
            self.is_open if among is None else among,
            np.array((low, high, first, after)),
            STEP_M * DIRECTIONS.astype(np.float64),
            np.float32(STEP_M) * LENGTHS,
            np.array((left, bottom, right, top)),
            STEP_M,
            STEP_M / 2.0 + _EPSILON_M,
            _EPSILON_M,
        )
        return None if found < 0 else found

    def _hit_km_h(self, state: int) -> float:
        number = state // self.run_up_m[0].size
        speed = self._km_h(float(self.run_up_m.flat[state]) + float(STEP_M * LENGTHS[number]))
        return min(float(speed), self.motion.max_speed_km_h)

    def _km_h(self, run_up_m: FloatArray | float) -> FloatArray:
        speeds: FloatArray = KM_H_PER_M_S * np.sqrt(
            2.0 * self.motion.acceleration_m_s2 * np.maximum(run_up_m, 0.0)
        )
        return speeds

    def _way(self, state: int) -> tuple["WayPoint", ...]:
        return tuple(reversed([*self._backwards(state)]))

    def _backwards(self, state: int) -> Iterator["WayPoint"]:
        """Yield the places of a way from its end back to an entry.

        If the way loops to gain speed, the rest is a short way from there to the entry.
        """
        # From the end backwards, each time to a state that explains the speed of the present one.
        _, rows, columns = self.run_up_m.shape
        seen: set[int] = set()
        following: int | None = state
        while following is not None and following not in seen:
            seen.add(following)
            number, place = divmod(following, rows * columns)
            row, column = divmod(place, columns)
            run_up_m = float(self.run_up_m[number, row, column])
            yield WayPoint((STEP_M * column, STEP_M * row), float(self._km_h(run_up_m)))
            if self.starts[row, column] and run_up_m <= self._entry_m(number) + _EPSILON_M:
                return
            following = self._before(number, row, column)
        for y, x in self._back_to_entry(row, column):
            run_up_m = float(self.run_up_m[:, y, x].max())
            yield WayPoint((STEP_M * x, STEP_M * y), float(self._km_h(run_up_m)))

    def _entry_m(self, number: int) -> float:
        """Return the run-up, m, of the entry speed in a direction."""
        return _run_up_m(self.motion, self.motion.entry_km_h) + STEP_M * float(LENGTHS[number])

    def _before(self, number: int, row: int, column: int) -> int | None:
        """Return a state from which one step gives the speed of this state, if there is one."""
        _, rows, columns = self.run_up_m.shape
        own_m = float(self.run_up_m[number, row, column]) - 1e-3
        arcs = all_arcs()
        into = np.flatnonzero(arcs.of[:, 1] == number)
        steps: list[tuple[int, IntArray32, float, int | None]]
        steps = [(number, DIRECTIONS[number], float(LENGTHS[number]), None)]
        steps += [
            (int(arcs.of[arc, 0]), arcs.ends[arc], float(arcs.lengths[arc]), int(arc))
            for arc in into
        ]
        # The same conditions as in `spread`, backwards: a step that could have given this speed.
        for one, step, length, arc in steps:
            x, y = column - int(step[0]), row - int(step[1])
            if not (0 <= x < columns and 0 <= y < rows):
                continue
            before_m = float(self.run_up_m[one, y, x])
            if before_m < 0.0 or before_m + STEP_M * length < own_m:
                continue
            if arc is not None:
                points = arcs.points[arcs.first[arc] : arcs.first[arc + 1]] + (x, y)
                inside = (points >= 0).all() and (points < (columns, rows)).all()
                if not (inside and self.is_open[points[:, 1], points[:, 0]].all()):
                    continue
                most_m = STEP_M * float(arcs.radii[arc]) * _per_radius(self.motion)
                if most_m < own_m:
                    continue
            return int((one * rows + y) * columns + x)
        # No step did: the vehicle turned on the spot here, coming from its fastest direction.
        fastest = int(self.run_up_m[:, row, column].argmax())
        return None if fastest == number else (fastest * rows + row) * columns + column

    def _back_to_entry(self, row: int, column: int) -> Iterator[tuple[int, int]]:
        """Yield the open places on a shortest way from a place to an entry."""
        # Breadth first, so the first entry met is a nearest one.
        came: dict[tuple[int, int], tuple[int, int] | None] = {(row, column): None}
        queue = deque(came)
        rows, columns = self.is_open.shape
        while queue:
            here = queue.popleft()
            if self.starts[here]:
                way = [here]
                while (before := came[way[-1]]) is not None:
                    way.append(before)
                yield from reversed(way[:-1])
                return
            for up, right in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
                there = here[0] + up, here[1] + right
                inside = 0 <= there[0] < rows and 0 <= there[1] < columns
                if inside and there not in came and self.is_open[there]:
                    came[there] = here
                    queue.append(there)


class WayPoint(NamedTuple):
    """A place on the way of a vehicle.

    Attributes:
        place_m: Place of its centre.
        speed_km_h: Largest possible speed there in that direction.
    """

    place_m: PointM
    speed_km_h: float


def places_shape(width_m: float, height_m: float) -> tuple[int, int]:
    """Return the number of rows and of columns of places on a site."""
    return round(height_m / STEP_M) + 1, round(width_m / STEP_M) + 1


def _around(places: BoolArray) -> tuple[slice, slice]:
    """Return the bounding box of some places, rows and columns; all if there are none."""
    if not places.any():
        return slice(None), slice(None)
    found = (np.flatnonzero(places.any(axis=axis)) for axis in (1, 0))
    rows, columns = (slice(int(item[0]), int(item[-1]) + 1) for item in found)
    return rows, columns


def _run_up_m(motion: Motion, speed_km_h: float) -> float:
    """Return the run-up from standstill to a speed, m."""
    return float((speed_km_h / KM_H_PER_M_S) ** 2 / (2.0 * motion.acceleration_m_s2))


def _per_radius(motion: Motion) -> float:
    """Return the run-up to the largest speed in a turn, divided by the turn's radius."""
    return motion.grip * GRAVITY_M_S2 / (2.0 * motion.acceleration_m_s2)


def places_in(rectangle: Rectangle) -> tuple[slice, slice]:
    """Return the rows and columns of the places in a closed rectangle."""
    left, bottom, right, top = rectangle
    rows = slice(max(ceil(bottom / STEP_M - _EPSILON_M), 0), floor(top / STEP_M + _EPSILON_M) + 1)
    columns = slice(
        max(ceil(left / STEP_M - _EPSILON_M), 0), floor(right / STEP_M + _EPSILON_M) + 1
    )
    return rows, columns
