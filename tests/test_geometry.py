"""Rectangles against points along segments."""

import numpy as np

from blast_env.geometry import Rectangle

ROOM = Rectangle(2.0, 1.0, 5.0, 3.0)
LEAST = 1e-6


def test_a_segment_meets_a_rectangle_if_a_point_of_it_is_inside() -> None:
    """From corners of a grid on which many segments are level, touch a side, or are points."""
    starts = [(float(x), float(y)) for x in range(8) for y in range(6)]
    x, y = (np.array(case, dtype=float) for case in zip(*starts, strict=True))
    along = np.linspace(0.0, 1.0, 337)[:, np.newaxis]
    seen = set()
    for start in starts:
        points_x, points_y = (
            begin + along * (end - begin) for begin, end in zip(start, (x, y), strict=True)
        )
        inside = (points_x > ROOM.left + LEAST) & (points_x < ROOM.right - LEAST)
        inside &= (points_y > ROOM.bottom + LEAST) & (points_y < ROOM.top - LEAST)
        met = ROOM.intersects_segments(start, x, y)
        assert (met == inside.any(axis=0)).all()
        assert [ROOM.intersects_segment(start, end) for end in starts] == met.tolist()
        seen |= set(met.tolist())
    assert seen == {True, False}
