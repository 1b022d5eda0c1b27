"""Rectangles: against points along segments, and their outlines against cells of a grid."""

import numpy as np

from blast_env.geometry import Rectangle, outlines, stacked_runs

ROOM = Rectangle(2.0, 1.0, 5.0, 3.0)
LEAST = 1e-6


def test_a_segment_meets_a_rectangle_if_a_point_of_it_is_inside() -> None:
    """From corners of a grid on which many segments are level, touch a side, or are points."""
    starts = [(float(x), float(y)) for x in range(8) for y in range(6)]
    x, y = (np.array(each, dtype=float) for each in zip(*starts, strict=True))
    along = np.linspace(0.0, 1.0, 337)[:, np.newaxis]
    seen = set()
    for start in starts:
        points_x, points_y = (
            begin + along * (end - begin) for begin, end in zip(start, (x, y), strict=True)
        )
        inside = (points_x > ROOM.left + LEAST) & (points_x < ROOM.right - LEAST)
        inside &= (points_y > ROOM.bottom + LEAST) & (points_y < ROOM.top - LEAST)
        met = ROOM.meets_segments(start, x, y)
        assert (met == inside.any(axis=0)).all()
        assert [ROOM.meets_segment(start, end) for end in starts] == met.tolist()
        seen |= set(met.tolist())
    assert seen == {True, False}


def windings(ring: tuple[tuple[float, float], ...], x: float, y: float) -> int:
    """How often a ring runs counterclockwise round a place: its sides right of it that go up."""
    sides = zip(ring, (*ring[1:], ring[0]), strict=True)
    beside = [(a[1], b[1]) for a, b in sides if a[0] == b[0] > x]
    return sum((low < y < high) - (high < y < low) for low, high in beside)


def test_outlines_are_round_what_is_filled_and_have_no_corner_too_many() -> None:
    """Of cells at random, with holes, islands in these, and cells that meet in a corner."""
    generator = np.random.default_rng(3)
    for share in (0.1, 0.3, 0.5, 0.7, 0.9) * 12:
        cells = generator.random((6, 7)) < share
        runs = stacked_runs(cells).tolist()
        plans = [Rectangle(0.5 * b, 0.5 * a, 0.5 * (b + d), 0.5 * (a + c)) for a, b, c, d in runs]
        rings = outlines(plans)
        found = [
            [
                sum(windings(ring, 0.5 * x + 0.25, 0.5 * y + 0.25) for ring in rings)
                for x in range(7)
            ]
            for y in range(6)
        ]
        assert (np.array(found) == cells).all()
        around = np.pad(cells, 1).astype(int)
        fours = around[1:, 1:] + around[:-1, 1:] + around[1:, :-1] + around[:-1, :-1]
        crossed = (around[1:, 1:] == around[:-1, :-1]) & (fours == 2)
        corners = (fours % 2 == 1).sum() + 2 * crossed.sum()
        assert sum(map(len, rings)) == corners
