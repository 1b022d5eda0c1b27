"""Outlines as modules, these as rectangles, and how far they are from the outlines."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from blast_env.geometry import fewest_runs
from blast_env.io.importing import (
    Deviation,
    cells_of,
    dominant_direction_deg,
    grid_offset_m,
    in_blocks,
)

MASKS = arrays(np.bool_, st.tuples(st.integers(1, 9), st.integers(1, 9)))


@given(MASKS)
def test_rectangles_are_the_cells_and_none_is_hidden_by_others(cells: np.ndarray) -> None:
    """Two of four walls are open, so that no part of a building alone is without a load."""
    framed, count = np.pad(cells, 1), np.zeros(cells.shape, dtype=int)
    for row, column, rows, columns in fewest_runs(cells).tolist():
        after, beyond = row + rows, column + columns
        count[row:after, column:beyond] += 1
        beside = [
            framed[row + 1 : after + 1, column],
            framed[row + 1 : after + 1, beyond + 1],
            framed[row, column + 1 : beyond + 1],
            framed[after + 1, column + 1 : beyond + 1],
        ]
        assert sum(not side.any() for side in beside) >= 2
    assert (count == cells).all()


@pytest.mark.parametrize(
    ("rows", "count"),
    [
        (["XXX", "XXX"], 1),
        (["XX.", "XX.", "XXX"], 2),
        (["X.X", "X.X", "XXX"], 3),
        (["XXX", "X.X", "XXX"], 4),
        ([".X.", "XXX", ".X."], 3),
    ],
)
def test_common_footprints_take_few_rectangles(rows: list[str], count: int) -> None:
    cells = np.array([[letter == "X" for letter in row] for row in rows])
    assert len(fewest_runs(cells)) == len(fewest_runs(cells.T)) == count


@given(st.floats(0.0, 90.0), st.floats(2.0, 6.0), st.floats(2.0, 6.0))
def test_modules_lie_with_their_centres_in_the_outline(
    angle: float, width: float, height: float
) -> None:
    """Also where the outline reaches beyond the grid."""
    house = shapely.affinity.rotate(shapely.box(5.0, 5.0, 5.0 + width, 5.0 + height), angle)
    outline = shapely.union(house, shapely.box(-3.0, 9.0, 40.0, 11.0))
    cells = cells_of(outline, (36, 30))
    for row in range(36):
        for column in range(30):
            centre = shapely.Point(0.5 * column + 0.25, 0.5 * row + 0.25)
            assert cells[row, column] == outline.intersects(centre)
    assert not cells_of(shapely.box(-9.0, -9.0, -4.0, 50.0), (36, 30)).any()


def test_deviation_is_area_and_largest_distance_of_the_outlines() -> None:
    """A strip of 0.2 m beside a house of 4 m x 2 m, and a chimney that sticks out 0.75 m."""
    house = shapely.box(0.0, 0.0, 4.0, 2.0)
    wider = Deviation.between(house, shapely.box(0.0, 0.0, 4.2, 2.0))
    assert (wider.area_share, wider.outline_m) == pytest.approx((0.05, 0.2))
    chimney = shapely.union(house, shapely.box(1.0, 2.0, 1.4, 2.75))
    assert Deviation.between(chimney, house).outline_m == pytest.approx(0.75)


def test_coarser_blocks_are_whole() -> None:
    cells = np.zeros((5, 5), dtype=bool)
    cells[0, :2] = cells[1, 0] = True  # three of four
    cells[2, 2] = True  # one of four
    cells[4, 4] = True  # one of one, beyond the grid is nothing
    assert np.argwhere(in_blocks(cells, 2, 0.5)).tolist() == [[0, 0], [0, 1], [1, 0], [1, 1]]
    assert (in_blocks(cells, 1, 0.5) == cells).all()


@given(st.floats(-44.0, 44.0))
def test_direction_is_that_of_most_walls(angle: float) -> None:
    houses = [shapely.box(0, 0, 20, 10), shapely.box(30, 0, 40, 8)]
    askew = shapely.affinity.rotate(shapely.box(60, 0, 75, 12), 31.0)
    turned = [shapely.affinity.rotate(house, angle, origin=(0, 0)) for house in (*houses, askew)]
    assert dominant_direction_deg(turned) == pytest.approx(angle, abs=1e-6)


def test_walls_a_little_askew_do_not_pull_the_direction_away() -> None:
    askew = shapely.affinity.rotate(shapely.box(60, 0, 75, 8), 3.0)
    assert dominant_direction_deg([shapely.box(0, 0, 30, 20), askew]) == pytest.approx(0.0)


@given(st.floats(0.0, 0.49), st.floats(0.0, 0.49))
def test_grid_lies_where_most_walls_are(x: float, y: float) -> None:
    long = shapely.box(10.0 + x, 20.0 + y, 30.0 + x, 30.0 + y)
    short = shapely.box(0.3, 0.2, 2.55, 3.45)
    assert grid_offset_m([short, long]) == pytest.approx((x, y), abs=1e-6)
