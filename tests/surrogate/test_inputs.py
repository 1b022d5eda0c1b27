"""What the networks take: open ways, relations of solids, and traits of pieces."""

from itertools import product

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from blast_env.site import load_scenario
from blast_env.surrogate import (
    ABOVE_M,
    FALLS_M,
    STATIONS,
    WallPoints,
    Ways,
    piece_traits,
    solid_relations,
)
from tests.surrogate.cases import CHARGE_M, NOTHING, wall

POINT_M = np.array([[20.0, 0.0, 1.5]])


BOXES = st.lists(
    st.tuples(st.floats(2.0, 16.0), st.floats(-6.0, 6.0), st.floats(0.5, 6.0)),
    min_size=1,
    max_size=5,
)


APART_M = 0.05


def shares(*solids: list[float], point_m: np.ndarray = POINT_M) -> np.ndarray:
    ways = Ways.between(CHARGE_M, point_m, 100.0, NOTHING)
    return ways.shares(np.array(solids).reshape(-1, 5))[0]


@given(boxes=BOXES, more=st.tuples(st.floats(2.0, 16.0), st.floats(-6.0, 6.0), st.floats(0.5, 6.0)))
def test_more_barrier_never_opens_a_way_and_mirrors_change_nothing(
    boxes: list[tuple[float, float, float]], more: tuple[float, float, float]
) -> None:
    solids = [wall(x, y - 1.0, y + 1.0, height) for x, y, height in boxes]
    x, y, height = more
    found = shares(*solids)
    assert (shares(*solids, wall(x, y - 1.0, y + 1.0, height)) <= found + 1e-12).all()
    mirrored = [[left, -top, right, -bottom, h] for left, bottom, right, top, h in solids]
    assert shares(*mirrored) == pytest.approx(found, abs=1e-9)


@given(boxes=BOXES)
@example(boxes=[(8.6875, 0.0, 3.0)])  # a way clips its corner over less than 0.1 m
def test_what_is_open_is_the_weight_of_the_ways_that_meet_no_solid(
    boxes: list[tuple[float, float, float]],
) -> None:
    """Way by way, at many points of each: no slab, and no way spared for one below it.

    A way that meets a solid between two of those points comes as close as they are apart.
    """
    solids = np.array([wall(x, y - 1.0, y + 1.0, height) for x, y, height in boxes])
    grown = solids + APART_M * np.array([-1.0, -1.0, 1.0, 1.0, 1.0])
    found = shares(*solids.tolist())[:-1].reshape(len(STATIONS), len(FALLS_M))
    ways = Ways.between(CHARGE_M, POINT_M, 100.0, NOTHING)
    for station, _ in enumerate(STATIONS):
        weights, is_open, is_clear = [], [], []
        for (x_m, y_m), above_m in product(ways.by_m[0, station], ABOVE_M):
            corner_m = np.array([x_m, y_m, ways.by_height_m[0, station] + above_m])
            way_m = np.vstack((between(CHARGE_M, corner_m), between(corner_m, POINT_M[0])))
            detour_m = np.linalg.norm(corner_m - CHARGE_M) + np.linalg.norm(POINT_M[0] - corner_m)
            detour_m -= np.linalg.norm(POINT_M[0] - CHARGE_M)
            weights.append(np.exp(-detour_m / np.array(FALLS_M)))
            is_open.append(not is_inside(way_m, solids))
            is_clear.append(not is_inside(way_m, grown))
        share = np.array(weights) / np.sum(weights, axis=0)
        assert (found[station] <= share[is_open].sum(axis=0) + 1e-9).all()
        assert (found[station] >= share[is_clear].sum(axis=0) - 1e-9).all()


def between(start_m: np.ndarray, end_m: np.ndarray) -> np.ndarray:
    """Points on a line, less than `APART_M` apart (points, 3)."""
    count = 2 + int(np.linalg.norm(end_m - start_m) / APART_M)
    return np.linspace(start_m, end_m, count)


def is_inside(points_m: np.ndarray, solids: np.ndarray) -> bool:
    """Whether any of the points is inside any of the solids."""
    x, y, z = (point_m[:, np.newaxis] for point_m in points_m.T)
    inside = (solids[:, 0] < x) & (x < solids[:, 2]) & (solids[:, 1] < y)
    return bool((inside & (y < solids[:, 3]) & (z < solids[:, 4])).any())


def test_points_stand_for_the_walls_that_count() -> None:
    structure = load_scenario("visitor_entrance").structures[0]
    points = WallPoints.on([structure], 3.5)
    left, bottom, right, top = structure.rectangle_m
    lengths = {"west": top - bottom, "east": top - bottom}
    lengths |= {"south": right - left, "north": right - left}
    assert points.area_m2.sum() == pytest.approx(3.5 * sum(lengths[f] for f in structure.faces))
    assert (points.points_m[:, 2] < 3.5).all()
    assert points.to_roof_m + points.points_m[:, 2] == pytest.approx(3.5)
    assert len(points.points_m) == len(points.outward) == len(points.to_edge_m)


@given(boxes=BOXES)
def test_several_pieces_stop_what_the_one_stops_that_stops_most(
    boxes: list[tuple[float, float, float]],
) -> None:
    solids = np.array([wall(x, y - 1.0, y + 1.0, height) for x, y, height in boxes])
    point_m = np.array([[20.0, 0.0, 1.5], [20.0, 0.0, 3.0], [20.0, 4.0, 1.5]])
    stopped, is_open = Ways.between(CHARGE_M, point_m, 100.0, NOTHING).stopped_by(solids)
    together = Ways.between(CHARGE_M, point_m, 100.0, solids)
    assert (stopped.max(axis=0) == together.stopped).all()
    assert (is_open.all(axis=0) == together.is_straight_open).all()


OUTWARD = np.array([[-0.6, 0.8]])


def related(*solids: list[float], **changes: np.ndarray) -> np.ndarray:
    """Where solids stand for a point (solids, RELATIONS), with lengths in m."""
    where = {"start_m": CHARGE_M, "points_m": POINT_M, "outward": OUTWARD} | changes
    return solid_relations(**where, scale_m=1.0, solids=np.array(solids).reshape(-1, 5))[:, 0]


@given(boxes=BOXES)
def test_mirrors_and_quarter_turns_change_no_relation(
    boxes: list[tuple[float, float, float]],
) -> None:
    solids = np.array([wall(x, y - 1.0, y + 1.0, height) for x, y, height in boxes])
    found = related(*solids.tolist())
    mirrored = (solids * (1.0, -1.0, 1.0, -1.0, 1.0))[:, [0, 3, 2, 1, 4]]
    assert related(*mirrored.tolist(), outward=OUTWARD * (1.0, -1.0)) == pytest.approx(found)
    turned = (solids * (1.0, -1.0, 1.0, -1.0, 1.0))[:, [3, 0, 1, 2, 4]]
    turned_to = {"points_m": np.array([[0.0, 20.0, 1.5]]), "outward": OUTWARD[:, ::-1] * (-1, 1)}
    assert related(*turned.tolist(), **turned_to) == pytest.approx(found, abs=1e-9)


def test_relations_tell_how_a_wall_beside_the_way_is_turned_and_where_it_echoes() -> None:
    """Across and along the wall of the point, 45 degrees off: one was the mirror of the other."""
    where = {"points_m": np.array([[10.0, 10.0, 1.5]]), "outward": np.array([[-1.0, 0.0]])}
    centre_x, centre_y = 2.0, 8.0
    across = [centre_x - 2.0, centre_y - 0.25, centre_x + 2.0, centre_y + 0.25, 3.0]
    along = [centre_x - 0.25, centre_y - 2.0, centre_x + 0.25, centre_y + 2.0, 3.0]
    one, other = related(across, along, **where)
    assert one[[4, 5]] == pytest.approx(other[[4, 5]])
    assert one[17:19] == pytest.approx(other[17:19][::-1])
    # A wall behind the charge, 2 m away, sends the blast back; the image is 4 m farther away.
    (behind,) = related([-3.0, -20.0, -2.0, 20.0, 6.0], **where)
    assert behind[20] == pytest.approx(200.0**0.5 / 296.0**0.5, abs=1e-4)
    assert behind[22] == pytest.approx(2.0 / 14.0, abs=1e-4)
    assert behind[21] == behind[23] == 1.0
    assert behind[24] == 0.0
    # One beside the way does, too, where the image of the charge is seen in it.
    (beside,) = related([2.0, 12.0, 12.0, 13.0, 3.0], **where)
    assert beside[24] == pytest.approx(200.0**0.5 / 296.0**0.5, abs=1e-4)
    assert beside[25] == 1.0
    (short,) = related([10.0, 12.0, 12.0, 13.0, 3.0], **where)
    assert short[24] == beside[24]
    assert short[25] < 0.0


def traits(*pieces: list[float], solids: np.ndarray = NOTHING) -> np.ndarray:
    """How pieces stand to a charge and to each other (pieces, TRAITS), with lengths in m."""
    return piece_traits(CHARGE_M, 1.0, solids.reshape(-1, 5), np.array(pieces).reshape(-1, 5))


@given(boxes=BOXES)
def test_mirrors_and_quarter_turns_change_no_trait(boxes: list[tuple[float, float, float]]) -> None:
    pieces = np.array([wall(x, y - 1.0, y + 1.0, height) for x, y, height in boxes])
    solids = np.array(wall(18.0, -4.0, 4.0, 6.0))
    found = traits(*pieces.tolist(), solids=solids)
    turn = np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    for order in ([0, 3, 2, 1, 4], [3, 0, 1, 2, 4]):
        moved = traits(*(pieces * turn)[:, order].tolist(), solids=(solids * turn)[order])
        assert moved == pytest.approx(found, abs=1e-9)


def test_traits_tell_rows_behind_rows_and_what_joins() -> None:
    front, back = wall(4.0, -2.0, 2.0, 2.0), wall(8.0, -3.0, 3.0, 4.0)
    alone = traits(front)[0]
    shading, shaded = traits(front, back)
    # The way to the one behind leaves the front after 4.5 of 8.25 m, where it is 2 m high; the
    # charge is at 0.3 m. Places at its ends are seen past the front.
    shadow = (0.3 + 1.7 * 8.25 / 4.5) / 4.0
    assert shaded[0] == pytest.approx(shadow, rel=0.01)
    assert 0.0 < shaded[2] < shaded[0]
    assert shading[3] == pytest.approx(shaded[0])
    assert shading[0] == alone[0] == alone[3] == shaded[3] == 0.0
    # Gaps off long faces, to the charge and away from it: 3.5 m count as 2.
    assert shaded[14] == shading[15] == alone[15] == pytest.approx(np.log(2.05))
    near = traits(front, wall(5.0, -2.0, 2.0, 2.0))
    assert near[0, 15] == near[1, 14] == pytest.approx(np.log(0.55))
    # One that joins its end, half as high, and one across its other end.
    low, across = wall(4.0, 2.0, 4.0, 1.0), [4.5, -2.0, 6.5, -1.5, 3.0]
    joined = traits(front, low, across)[0]
    assert joined[4] == pytest.approx(np.log(0.05))
    assert joined[5] == pytest.approx(np.log(2.05))
    assert joined[6] == pytest.approx(0.5)
    assert joined[7] == 1.0
    assert joined[8] == 0.0
    house = np.array([2.0, -6.0, 8.0, -2.0, 6.0])
    assert traits(front, solids=house)[0, [6, 8]] == pytest.approx([1.0, 1.0])
