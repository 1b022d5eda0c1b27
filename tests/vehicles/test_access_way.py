"""The vehicle's way across the zone, in pictures and against a search step by step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.site import AccessWay, Catalogue
from blast_env.vehicles import closing_places, is_open
from tests.site.zones import can_cross


def way(width_cells: int, between: str = "left_right") -> AccessWay:
    return AccessWay.model_validate({"width_m": 0.5 * width_cells, "between": between})


def closing_cells(way: AccessWay, passable: np.ndarray) -> np.ndarray:
    """The cells on which a single module leaves no way."""
    shape = (passable.shape[0], passable.shape[1])
    (closing,) = closing_places(way, passable, Catalogue.of_modules(1, None, 1.0, shape).sizes)
    return closing


def grid(picture: str, solid: str = "#") -> np.ndarray:
    """The cells of a picture, row 0 at the bottom, that are not solid."""
    lines = picture.split()[::-1]
    return np.array([[letter not in solid for letter in line] for line in lines])


CORRIDOR = """
    #######
    .......
    .......
    #######
"""
TOO_NARROW_BY_ONE = """
    #######
    .......
    ...#...
    #######
"""
BEND = """
    ..#####
    ..#####
    .......
    .......
    #####..
"""
TIGHT_BEND = """
    ..#....
    ..#....
    .......
    .......
    ####...
"""
CLOSED_BEND = """
    ..##...
    ..##...
    ..##...
    ...#...
    #......
    ##.....
"""
DIAGONAL_GAP = """
    ..#..
    ..#..
    ...#.
    ...#.
"""
DEAD_END = """
    .......
    .......
    ######.
    .....#.
    .....#.
    ######.
"""


@pytest.mark.parametrize(
    ("picture", "width", "is_way"),
    [
        (CORRIDOR, 2, True),  # exactly as wide as the vehicle
        (CORRIDOR, 3, False),
        (TOO_NARROW_BY_ONE, 1, True),
        (TOO_NARROW_BY_ONE, 2, False),
        (BEND, 2, True),  # the vehicle need not enter at the height at which it leaves
        (TIGHT_BEND, 2, True),
        (CLOSED_BEND, 1, True),
        (CLOSED_BEND, 2, False),  # 2 wide on either side of the step, but not in it
        (DIAGONAL_GAP, 1, False),  # corners that touch leave no gap
        (DEAD_END, 2, True),  # over the top, not through the passage that ends
        (DEAD_END, 3, False),
    ],
)
def test_vehicle_crosses_where_it_fits(picture: str, width: int, is_way: bool) -> None:
    assert is_open(way(width), grid(picture)) is is_way
    assert is_open(way(width, "bottom_top"), grid(picture).T) is is_way


def by_trial(passable: np.ndarray, width: int) -> np.ndarray:
    """The cells that close the way, each found by putting a module there."""
    closing = np.zeros_like(passable)
    for cell in np.ndindex(*passable.shape):
        trial = passable.copy()
        trial[cell] = False
        closing[cell] = not can_cross(trial, width)
    return closing


@given(st.integers(1, 4), st.tuples(st.integers(0, 6), st.integers(0, 6)), st.data())
def test_way_and_closing_cells_are_those_of_a_search(
    width: int, extra: tuple[int, int], data: st.DataObject
) -> None:
    shape = (width + extra[0], width + extra[1])
    density = data.draw(st.sampled_from([0.05, 0.15, 0.3]))
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    passable = rng.random(shape) > density
    assert is_open(way(width), passable) == can_cross(passable, width)
    assert (closing_cells(way(width), passable) == by_trial(passable, width)).all()
    turned = closing_cells(way(width, "bottom_top"), passable.T)
    assert (closing_cells(way(width), passable) == turned.T).all()
