"""Places drawn among other things."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.geometry import Rectangle, box_distances_m
from blast_env.sites import Draws, ObstacleSpace, draw_place

AREA = Rectangle(1.0, 2.0, 9.0, 8.0)
HALVES = st.integers(0, 20).map(lambda count: count / 2.0)
SIDES = st.integers(1, 8).map(lambda count: count / 2.0)
RECTANGLES = st.builds(
    lambda x, y, width, height: Rectangle.from_corner((x, y), (width, height)),
    HALVES,
    HALVES,
    SIDES,
    SIDES,
)
OTHERS = st.lists(
    st.builds(ObstacleSpace, RECTANGLES, st.sampled_from([0.0, 1.0, 2.0])), max_size=4
)


def draws(seed: int) -> Draws:
    return Draws(np.random.default_rng(seed))


def gap_m(one: Rectangle, other: Rectangle) -> float:
    left, bottom, right, top = (np.array(side) for side in other)
    return float(box_distances_m(one, (left, bottom, right, top)))


@given(st.integers(0, 1000), SIDES, SIDES, OTHERS)
def test_a_place_lies_in_its_area_on_the_grid_and_apart(
    seed: int, width_m: float, height_m: float, others: list[ObstacleSpace]
) -> None:
    place = draw_place(draws(seed), AREA, (width_m, height_m), others)
    if place is None:
        return
    assert AREA.contains(place)
    assert (place.right - place.left, place.top - place.bottom) == (width_m, height_m)
    assert all((2.0 * side).is_integer() for side in place)
    for rectangle, distance_m in others:
        assert gap_m(rectangle, place) >= distance_m - 1e-6
        assert not rectangle.overlaps(place)


def test_the_only_place_is_found() -> None:
    # A gap of 1 m beside a block that fills the rest: it may be touched.
    rest = ObstacleSpace(Rectangle(1.0, 2.0, 8.0, 8.0), 0.0)
    assert draw_place(draws(0), AREA, (1.0, 6.0), [rest]) == Rectangle(8.0, 2.0, 9.0, 8.0)


@pytest.mark.parametrize("size_m", [(8.5, 1.0), (1.0, 6.5)])
def test_there_is_no_place_for_what_is_too_large(size_m: tuple[float, float]) -> None:
    assert draw_place(draws(0), AREA, size_m, []) is None
