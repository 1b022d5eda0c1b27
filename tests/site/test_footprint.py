"""Polygons and their modules: area, walls with true normals, concave shapes, courtyards."""

from math import cos, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError
from blast_env.geometry import Place
from blast_env.site.footprint import Footprint, Ring, footprint_of
from blast_env.units import MODULE_SIDE_M


def block(angle_deg: float, width_m: float = 12.0, depth_m: float = 6.0) -> Ring:
    """Return a rectangle around (20.3, 20.1), turned counterclockwise."""
    turn = radians(angle_deg)
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    places = [(0.5 * x * width_m, 0.5 * y * depth_m) for x, y in corners]
    return tuple(
        (20.3 + x * cos(turn) - y * sin(turn), 20.1 + x * sin(turn) + y * cos(turn))
        for x, y in places
    )


def circle(radius_m: float, sides: int = 64) -> Ring:
    turns = 2.0 * pi * np.arange(sides) / sides
    places = np.stack((30.0 + radius_m * np.cos(turns), 30.0 + radius_m * np.sin(turns)), axis=1)
    return tuple((float(x), float(y)) for x, y in places)


ELL: Ring = ((0.0, 0.0), (10.0, 0.0), (10.0, 4.0), (4.0, 4.0), (4.0, 9.0), (0.0, 9.0))
COURT: Ring = ((1.0, 1.0), (3.0, 1.0), (3.0, 3.0), (1.0, 3.0))


def cell_area_m2(footprint: Footprint) -> float:
    return len(footprint.cells) * MODULE_SIDE_M**2


@given(st.floats(0.0, 360.0), st.floats(4.0, 30.0), st.floats(4.0, 30.0))
def test_modules_have_the_area_of_the_polygon(angle: float, width: float, depth: float) -> None:
    """Within half a module along its edges: a row of centres lies on one side of a wall."""
    footprint = footprint_of(block(angle, width, depth))
    edge_m2 = 2.0 * (width + depth + MODULE_SIDE_M) * MODULE_SIDE_M
    assert cell_area_m2(footprint) == pytest.approx(width * depth, abs=0.5 * edge_m2)


def test_modules_have_that_area_on_average() -> None:
    """No side of a wall is favoured."""
    rng = np.random.default_rng(1)
    sizes = rng.uniform((0.0, 4.0, 4.0), (360.0, 20.0, 20.0), (200, 3))
    areas = [cell_area_m2(footprint_of(block(*siz))) for siz in sizes.tolist()]
    ratio = np.array(areas) / (sizes[:, 1] * sizes[:, 2])
    assert ratio.mean() == pytest.approx(1.0, abs=0.01)
    assert ratio.std() < 0.05


def test_adjoining_buildings_share_no_module_and_leave_no_gap() -> None:
    """A party wall at any place and angle, through centres of modules too."""
    for x0, x1 in ((10.25, 10.25), (10.0, 13.7), (9.1, 9.3)):
        west = footprint_of(((2.0, 2.0), (x0, 2.0), (x1, 12.0), (2.0, 12.0)))
        east = footprint_of(((x0, 2.0), (20.0, 2.0), (20.0, 12.0), (x1, 12.0)))
        assert cell_area_m2(west) + cell_area_m2(east) == pytest.approx(18.0 * 10.0)
        assert not any(one.overlaps(other) for one in west.boxes_m for other in east.boxes_m)


def test_boxes_are_the_modules() -> None:
    for ring in (ELL, block(33.0), circle(7.0)):
        footprint = footprint_of(ring)
        area_m2 = sum((box.right - box.left) * (box.top - box.bottom) for box in footprint.boxes_m)
        assert area_m2 == pytest.approx(cell_area_m2(footprint))


@pytest.mark.parametrize("angle", [0.0, 1.0, 20.0, 45.0, 110.0])
@pytest.mark.parametrize("reverse", [False, True])
def test_walls_have_their_true_lengths_and_normals(angle: float, reverse: bool) -> None:
    ring = block(angle)
    walls = footprint_of(tuple(reversed(ring)) if reverse else ring).walls
    assert sorted(wall.length_m for wall in walls) == pytest.approx([6.0, 6.0, 12.0, 12.0])
    turn = radians(angle)
    across = [wall.normal for wall in walls if wall.length_m > 9.0]
    wanted = {(round(s * sin(turn), 6), round(-s * cos(turn), 6)) for s in (1.0, -1.0)}
    assert {(round(x, 6) + 0.0, round(y, 6) + 0.0) for x, y in across} == {
        (x + 0.0, y + 0.0) for x, y in wanted
    }
    assert [wall.is_oblique for wall in walls] == [angle > 1.0] * 4  # 1 degree is half a step


def test_normals_of_courtyards_point_into_them() -> None:
    footprint = footprint_of(ELL, (COURT,))
    assert footprint.area_m2 == pytest.approx(60.0 - 4.0)
    assert cell_area_m2(footprint) == pytest.approx(56.0)
    assert len(footprint.walls) == 10
    for wall in footprint.walls[6:]:
        x, y = wall.point_at(0.5 * wall.length_m)
        inwards = (2.0 - x) * wall.normal[0] + (2.0 - y) * wall.normal[1]
        assert inwards > 0.9


def test_bends_that_modules_cannot_show_are_straight() -> None:
    """A round hall has walls of some metres, not one per point of its map."""
    assert len(footprint_of(circle(20.0, 400)).walls) <= 40
    notched: Ring = ((0, 0), (10, 0), (10, 5), (5.1, 5), (5.1, 4.9), (5, 4.9), (5, 5), (0, 5))
    assert len(footprint_of(notched).walls) == 4
    assert len(footprint_of(circle(1.0, 64)).walls) >= 6


def faces_of(footprint: Footprint) -> tuple[np.ndarray, np.ndarray]:
    """Return centres and normals of the open sides of the modules."""
    cells = set(footprint.cells)
    centres: list[Place] = []
    outwards: list[Place] = []
    left, bottom = footprint.corner_m
    for row, column in footprint.cells:
        for up, right in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            if (row + up, column + right) not in cells:
                x = left + MODULE_SIDE_M * (column + 0.5 + 0.5 * right)
                y = bottom + MODULE_SIDE_M * (row + 0.5 + 0.5 * up)
                centres.append((x, y))
                outwards.append((float(right), float(up)))
    return np.array(centres), np.array(outwards)


@pytest.mark.parametrize("ring", [block(0.0), block(3.0), block(30.0), block(45.0), ELL])
def test_each_face_is_of_a_wall_and_each_wall_has_its_area(ring: Ring) -> None:
    """The area of the steps along the normal is that of the wall, but for its ends."""
    footprint = footprint_of(ring)
    centres, outwards = faces_of(footprint)
    wall, share = footprint.walls_of(centres, outwards)
    length_m = MODULE_SIDE_M * np.bincount(wall, weights=share, minlength=len(footprint.walls))
    for line, own_m in zip(footprint.walls, length_m.tolist(), strict=True):
        assert own_m == pytest.approx(line.length_m, abs=0.75)
    assert length_m.sum() == pytest.approx(footprint.polygon.length, rel=0.04)
    away = [footprint.walls[n].distances_m(centres[i : i + 1])[0] for i, n in enumerate(wall)]
    assert max(away) < MODULE_SIDE_M


@pytest.mark.parametrize(
    ("outline", "courtyards", "words"),
    [
        (((0, 0), (4, 4), (4, 0), (0, 4)), (), r"outline crosses or touches itself at \(2, 2\) m"),
        (((0, 0), (4, 0), (0, 0)), (), "has 2 different corners, must have at least 3"),
        (((0, 0), (4, 0), (2, 0)), (), "outline"),
        (ELL, (((5.0, 5.0), (6.0, 5.0), (6.0, 6.0)),), r"must lie inside the outline.*\(5, 5\) m"),
        (ELL, (COURT, COURT), "apart from the others"),
    ],
)
def test_what_is_no_polygon_is_refused(
    outline: Ring, courtyards: tuple[Ring, ...], words: str
) -> None:
    with pytest.raises(BlastEnvError, match=words):
        footprint_of(outline, courtyards)
