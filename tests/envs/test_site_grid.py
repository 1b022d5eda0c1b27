"""Rectangles, lattices and places of charges on the grid of the site."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.envs.observations import SiteGrid
from blast_env.geometry import Rectangle
from blast_env.site import AnySource, PointSource, RectangleSource, SegmentSource, Site

GRID = SiteGrid.of(Site(width_m=10.0, height_m=6.0))
across = st.floats(0.5, 9.5)
up = st.floats(0.5, 5.5)
points = st.tuples(across, up)
sources = st.one_of(
    st.builds(lambda p: PointSource(position_m=p, tnt_kg=1.0), points),
    st.builds(
        lambda p, q: SegmentSource(kind="segment", start_m=p, end_m=q, tnt_kg=1.0), points, points
    ),
    st.builds(
        lambda p: RectangleSource(
            kind="rectangle", corner_m=p, size_m=(9.9 - p[0], 5.9 - p[1]), tnt_kg=1.0
        ),
        points,
    ),
)


def test_the_grid_covers_a_site_that_is_no_whole_number_of_modules() -> None:
    assert (GRID.rows, GRID.columns) == (12, 20)
    assert SiteGrid.of(Site(width_m=10.1, height_m=6.0)) == SiteGrid(12, 21)


@given(points, points)
def test_a_rectangle_covers_its_area(one: tuple, other: tuple) -> None:
    left, right = sorted((one[0], other[0]))
    bottom, top = sorted((one[1], other[1]))
    plane = GRID.rectangle(Rectangle(left, bottom, right, top))
    assert plane.sum(dtype=float) * 0.25 == pytest.approx((right - left) * (top - bottom), abs=1e-4)
    assert 0.0 <= plane.min() <= plane.max() <= 1.0


@given(points)
def test_a_lattice_of_ones_covers_what_its_rectangle_does(corner_m: tuple) -> None:
    plane = GRID.lattice(corner_m, 1, 1).plane(np.ones((1, 1)))
    whole = GRID.rectangle(Rectangle.from_corner(corner_m, (0.5, 0.5)))
    assert plane == pytest.approx(whole, abs=1e-6)


def test_modules_on_the_grid_fill_one_square_each() -> None:
    values = np.arange(6.0).reshape(2, 3)
    plane = GRID.lattice((2.0, 1.5), 2, 3).plane(values)
    assert (plane[3:5, 4:7] == values).all()
    plane[3:5, 4:7] = 0.0
    assert not plane.any()


@given(sources)
def test_the_places_of_a_charge_add_up_to_1_around_their_middle(source: AnySource) -> None:
    plane = GRID.source(source)
    assert plane.sum(dtype=float) == pytest.approx(1.0, abs=1e-5)
    rows, columns = np.indices(plane.shape)
    mean = [((index + 0.5) * 0.5 * plane).sum() for index in (columns, rows)]
    if isinstance(source, RectangleSource):
        middle = source.rectangle_m.centre
    else:
        assert isinstance(source, SegmentSource | PointSource)
        middle = tuple(np.mean(source.segment_m, axis=0))
    # The share of a square that is covered does not tell where in it the rectangle begins.
    tolerance = 0.3 if isinstance(source, RectangleSource) else 1e-4
    assert mean == pytest.approx(middle, abs=tolerance)
