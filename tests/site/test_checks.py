import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.geometry import Rectangle
from blast_env.site import PointSource, RectangleSource, SegmentSource, distance_m
from tests.site.documents import (
    KeyPath,
    changed,
    full_document,
    lines_for,
    minimal_document,
    written,
)

HOUSE = ("structures", 0)
BUNKER = ("structures", 1)
AREAS = ("build_zone.keep_outs[0]", "build_zone.cost_areas[0]")
AIR, EXPLOSIVE = (("simulation", "overrides", name) for name in ("air", "explosive"))
KEEP_OUT = ("build_zone", "keep_outs", 0)
PLACE = ("charge", 0, "position_m")


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        ((*BUNKER, "corner_m"), [21.0, 11.0], "structures[1]: 'bunker' .x 21 .* overlaps .*'hous"),
        ((*HOUSE, "corner_m"), [28.5, 8.0], "structures[0]: .* must lie inside the site .x 0 to"),
        ((*BUNKER, "name"), "house", "structures[1].name: is 'house', already the name of struct"),
        ((*BUNKER, "name"), "barrier", "structures[1].name: is 'barrier', the name of the modules"),
        ((*HOUSE, "protected"), False, "structures: none is protected, at least one must have"),
        (PLACE, [19.75, 10.0], "charge[0]: .* as near as 0.25 m .* by 0.5 m, the charge's radius"),
        (("charge", 2, "size_m"), [17.9, 8.0], "charge[2]: its centre comes as near as 0.1 m to"),
        (("charge", 2, "size_m"), [3.0, 18.0], "charge[2]: its centre may be at x 2 to 5 m, y 2"),
        (("build_zone", "rows"), 31, "build_zone: .* y 5 to 20.5 m. must lie inside the site .x 0"),
        ((*KEEP_OUT, "corner_m"), [13.0, 9.0], "build_zone.keep_outs[0]: covers .* must overlap"),
        # 20 rows of 10 cells, two rows of which are the path.
        (("build_zone", "stock"), 181, "build_zone.stock: is 181, must be at most 180, the number"),
        (
            (*AIR, "spacing_units"),
            1.5,
            f"{written(AIR)}.spacing_units: is 1.5, must be 0 .no air. ",
        ),
        ((*EXPLOSIVE, "collide_within_charge"), True, f"{written(EXPLOSIVE)}.offset_units: is 1, "),
    ],
)
def test_sections_that_do_not_fit_are_named(path: KeyPath, value: object, line: str) -> None:
    lines = lines_for(changed(full_document(), path, value))
    assert len(lines) == 1, lines
    assert re.match(f"f.toml: {line}".replace("[", r"\["), lines[0]), lines


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ((*BUNKER, "corner_m"), [22.0, 10.0]),  # side to side with the house
        ((*HOUSE, "corner_m"), [28.0, 0.0]),  # in the corner of the site
        (("charge", 0, "position_m"), [0.5, 10.0]),  # its radius from the border
        (("charge", 0, "position_m"), [19.5, 10.0]),  # its radius from the house
        (("charge", 0, "position_m"), [19.6, 7.7]),  # 0.5 m from the corner of the house
        (("build_zone", "rows"), 30),  # along the border
        ((*KEEP_OUT, "size_m"), [10.0, 1.0]),  # sticks out of the zone
        (("build_zone", "stock"), 180),
        ((*AIR, "spacing_units"), 0.0),
        ((*AIR, "spacing_units"), 2.0),
    ],
)
def test_what_only_touches_is_allowed(path: KeyPath, value: object) -> None:
    assert lines_for(changed(full_document(), path, value)) == []


def test_balls_of_one_charge_may_collide_if_they_do_not_overlap_at_the_start() -> None:
    explosive = {"collide_within_charge": True, "ball_count": 6, "offset_units": 2.0}
    document = {**minimal_document(), "simulation": {"overrides": {"explosive": explosive}}}
    assert lines_for(document) == []
    explosive["offset_units"] = 1.99
    assert len(lines_for(document)) == 1


def test_single_ball_has_nothing_to_collide_with() -> None:
    explosive = {"collide_within_charge": True, "ball_count": 1, "offset_units": 0.0}
    document = {**minimal_document(), "simulation": {"overrides": {"explosive": explosive}}}
    assert lines_for(document) == []


def test_charge_radius_follows_the_overrides() -> None:
    document = changed(full_document(), ("charge", 0, "position_m"), [18.5, 10.0])
    assert lines_for(document) == []
    document = changed(document, (*EXPLOSIVE, "offset_units"), 7.0)
    assert any("must keep clear of it by 2 m" in line for line in lines_for(document))


def test_the_checks_between_sections_follow_once_each_is_sound() -> None:
    document = changed(full_document(), (*BUNKER, "corner_m"), [21.0, 11.0])
    document = changed(document, ("build_zone", "corner_m"), [28.0, 5.0])
    unsound = changed(document, (*HOUSE, "columns"), 0)
    assert [line.split(": ")[1] for line in lines_for(unsound)] == [written((*HOUSE, "columns"))]
    keys = [line.split(": ")[1] for line in lines_for(document)]
    assert keys == ["structures[1]", "build_zone", *AREAS]


COORDINATE = st.integers(0, 40).map(lambda quarters: quarters / 4)
POINT = st.tuples(COORDINATE, COORDINATE)
SIZE = st.tuples(st.integers(1, 12), st.integers(1, 12)).map(lambda s: (s[0] / 4, s[1] / 4))
SOURCE = st.one_of(
    st.builds(PointSource, tnt_kg=st.just(1.0), position_m=POINT),
    st.builds(
        SegmentSource, kind=st.just("segment"), tnt_kg=st.just(1.0), start_m=POINT, end_m=POINT
    ),
    st.builds(
        RectangleSource, kind=st.just("rectangle"), tnt_kg=st.just(1.0), corner_m=POINT, size_m=SIZE
    ),
)


@given(SOURCE, POINT, SIZE)
def test_distance_is_that_of_the_nearest_place_of_the_charge(
    source: PointSource | SegmentSource | RectangleSource,
    corner: tuple[float, float],
    size: tuple[float, float],
) -> None:
    rectangle = Rectangle.from_corner(corner, size)
    share = np.linspace(0.0, 1.0, 401)
    if isinstance(source, RectangleSource):
        box = source.rectangle_m
        grid_x, grid_y = np.meshgrid(
            np.linspace(box.left, box.right, 101), np.linspace(box.bottom, box.top, 101)
        )
        x, y = grid_x.ravel(), grid_y.ravel()
    else:
        (x0, y0), (x1, y1) = source.segment_m
        x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
    beside = np.maximum(0.0, np.maximum(rectangle.left - x, x - rectangle.right))
    above = np.maximum(0.0, np.maximum(rectangle.bottom - y, y - rectangle.top))
    nearest = float(np.hypot(beside, above).min())
    # The places are sampled: the true distance is smaller by at most half their spacing.
    spacing = math.hypot(10.0, 10.0) / 400
    assert nearest - spacing <= distance_m(source, rectangle) <= nearest + 1e-9


def test_air_too_fine_for_the_memory_is_refused() -> None:
    fine = {"air": {"spacing_units": 0.02, "radius_units": 0.01}}
    (line,) = lines_for(changed(minimal_document(), ("simulation",), {"overrides": fine}))
    assert "simulation.overrides.air.spacing_units: is 0.02, which makes" in line
    assert "must make at most 1,000,000" in line


def test_the_modules_of_all_structures_together_have_a_bound() -> None:
    """Nine of 1000 x 1000 took a minute and 4.6 GB, each of them within its own bounds."""
    square = {"kind": "ConcreteSquare", "protected": True, "side_modules": 1000}
    document = minimal_document()
    document["site"] = {"width_m": 2000.0, "height_m": 2000.0}
    document["structures"] = [
        {**square, "name": f"s{i}", "corner_m": [5.0 + 510.0 * (i % 3), 5.0 + 510.0 * (i // 3)]}
        for i in range(9)
    ]
    message = "f.toml: structures: have 9,000,000 modules together, must have at most 250,000"
    assert lines_for(document) == [message]
    document["structures"] = [{**square, "name": "s", "corner_m": [5.0, 5.0], "side_modules": 500}]
    zone = {"corner_m": [300.0, 5.0], "rows": 2, "columns": 2, "stock": 1}
    assert lines_for(document) == []
    assert lines_for({**document, "build_zone": zone}) == [
        "f.toml: structures: have 250,001 modules together, the stock of 1 among them, must"
        " have at most 250,000"
    ]
