"""The packaged laws of the atlas: limits, order, continuity, ranges, and two blasts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.arrays import FloatArray
from blast_env.atlas import (
    Factors,
    around_of,
    fronts_among,
    numbers_between,
    numbers_of_echoes,
    packaged_laws,
    rows_between,
)
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.site import Scenario
from tests import builders
from tests.gas_sites import site_document

CHARGE = np.zeros(3)
BAYS = np.array([[2.2, 0.0, 0.3], [2.2, 0.7, 0.3], [2.2, 0.0, 0.9]])
TOWARDS = np.array([-1.0, 0.0, 0.0])
HIGH = np.full(len(BAYS), 1.3)
NOTHING = np.zeros((0, 6))


def wall(high: float, at: float = 0.7, long: float = 4.0, thick: float = 0.1) -> FloatArray:
    return np.array([[at, -0.5 * long, at + thick, 0.5 * long, 0.0, high]])


def behind(
    boxes: FloatArray,
    charge: FloatArray = CHARGE,
    bays: FloatArray = BAYS,
    houses: FloatArray = NOTHING,
) -> Factors:
    """Return what the rows of some pieces, and of houses, do, in and out of range."""
    high, every = np.full(len(bays), 1.3), np.concatenate([houses, boxes])
    everything, buildings = (
        numbers_of_echoes(charge, bays, TOWARDS, own, high) for own in (every, houses)
    )
    rows = rows_between(charge, bays, TOWARDS, every)
    if not rows:
        return Factors.none(len(bays))
    is_house = np.arange(len(every)) < len(houses)
    around = around_of(bays, TOWARDS, every, is_house, ~is_house)
    fronts = fronts_among(everything, buildings)
    numbers = numbers_between(rows, charge, bays, TOWARDS, high, fronts, everything, around)
    return packaged_laws().between.factors(numbers).where_known()


def test_without_an_obstacle_the_factor_is_exactly_one() -> None:
    far_behind = wall(1.0) + np.array([5.0, 0.0, 5.0, 0.0, 0.0, 0.0])
    for boxes in (NOTHING, far_behind):
        found = behind(boxes)
        assert (found.low == 1.0).all()
        assert (found.high == 1.0).all()
    numbers = numbers_of_echoes(CHARGE, BAYS, TOWARDS, NOTHING, HIGH)
    for law in (packaged_laws().opposite, packaged_laws().beside):
        found = law.factors(numbers)
        assert np.stack(found[:3]) == pytest.approx(1.0, abs=1e-12)
        assert found.in_range.all()


def test_a_vanishing_wall_does_nothing() -> None:
    found = behind(wall(0.001))
    assert found.middle == pytest.approx(1.0, abs=0.01)
    assert (found.high - found.low).max() < 0.08


@given(st.floats(0.05, 1.4), st.floats(0.5, 4.0), st.floats(0.01, 0.5))
def test_a_larger_wall_takes_more_of_every_bell(high: float, long: float, more: float) -> None:
    (row,) = rows_between(CHARGE, BAYS, TOWARDS, wall(high, long=long))
    for larger in (wall(high + more, long=long), wall(high, long=long + more)):
        (other,) = rows_between(CHARGE, BAYS, TOWARDS, larger)
        assert (other.taken >= row.taken - 1e-12).all()


def test_higher_walls_protect_more_and_gaps_less() -> None:
    left = [float(behind(wall(high)).middle[:, 0].mean()) for high in (0.2, 0.4, 0.65, 0.9)]
    assert left == sorted(left, reverse=True)
    assert left[-1] < 0.6 < 0.7 < left[0] < 0.9
    half = wall(0.65)
    lower, upper = half.copy(), half.copy()
    lower[0, 3], upper[0, 1] = -0.25, 0.25
    assert behind(np.concatenate([lower, upper])).middle[0, 0] > left[2] + 0.05


def test_a_wall_of_two_heights_protects_between_both() -> None:
    both = np.concatenate([wall(0.9), wall(0.3)])
    both[0, 3] = both[1, 1] = 0.1  # high on the right of the first bay, low on its left
    low, found, high = (behind(boxes).middle[:, 0] for boxes in (wall(0.3), both, wall(0.9)))
    assert (high < found + 0.03).all()
    assert (found < low + 0.03).all()
    assert low.mean() - high.mean() > 0.2


def test_rows_count_in_any_order_and_a_second_one_does_not_harm() -> None:
    near, far = wall(0.6, at=0.5), wall(0.4, at=1.4)
    first, second = (behind(np.concatenate(pair)) for pair in ((near, far), (far, near)))
    assert first.middle == pytest.approx(second.middle, rel=1e-12)
    assert first.middle[:, 0].mean() < behind(near).middle[:, 0].mean() + 0.02


def test_pieces_that_hide_each_other_count_once() -> None:
    """Two walls just one behind the other take hardly more of the way than one of them."""
    (one,) = rows_between(CHARGE, BAYS, TOWARDS, wall(0.6))
    (two,) = rows_between(
        CHARGE, BAYS, TOWARDS, np.concatenate([wall(0.6, at=0.6), wall(0.6, at=0.8)])
    )
    assert (two.taken < 1.1 * one.taken + 0.01).all()
    (parts,) = rows_between(CHARGE, BAYS, TOWARDS, halves(wall(0.6)))
    assert parts.taken == pytest.approx(one.taken, abs=0.01)


def halves(box: FloatArray) -> FloatArray:
    """Return a wall as two pieces, side by side."""
    lower, upper = box.copy(), box.copy()
    lower[0, 3] = upper[0, 1] = 0.3
    return np.concatenate([lower, upper])


def test_intervals_are_wider_among_buildings() -> None:
    """There waves go to and fro, on ways that the law does not know."""
    houses = np.array([[-0.9, -2.0, -0.5, 2.0, 0.0, 1.2], [0.6, 1.2, 2.2, 1.5, 0.0, 1.2]])
    alone, among = behind(wall(0.65, long=2.0)), behind(wall(0.65, long=2.0), houses=houses)
    width = [np.log(found.high / found.middle)[:, 0] for found in (alone, among)]
    assert (width[1] > width[0]).all()
    assert width[1].mean() > 1.2 * width[0].mean()


def test_a_wall_across_the_way_along_a_front_shields_it() -> None:
    """The wave comes along the facade, which no blast of straight ways shows."""
    charge, across = np.array([1.8, -2.4, 0.0]), np.array([[1.2, -1.3, 2.2, -1.2, 0.0, 0.7]])
    found = behind(across, charge)
    assert found.in_range.all()
    assert found.middle[:2, 0].max() < 0.9
    grazing = np.array([2.1, -8.0, 0.0])  # steeper than any blast
    assert not behind(across + np.array([0.0, -4.0, 0.0, -4.0, 0.0, 0.0]), grazing).in_range.any()


def test_factors_are_continuous() -> None:
    heights = np.linspace(0.05, 1.4, 60)
    found = np.log([behind(wall(float(high))).middle[:, 0] for high in heights])
    assert np.abs(np.diff(found, axis=0)).max() < 0.1


def test_intervals_hold_the_estimate_and_the_counted_load_is_on_the_safe_side() -> None:
    found = behind(wall(0.65))
    assert (found.low < found.middle).all()
    assert (found.middle < found.high).all()
    assert (found.counted >= found.middle).all()
    assert (found.counted[:, 1] == found.high[:, 1]).all()


def test_outside_its_range_the_law_takes_nothing_off() -> None:
    raised = np.array([0.0, 0.0, 4.0])
    found = behind(wall(6.0), raised)
    assert not found.in_range.any()
    assert (found.middle == 1.0).all()


@pytest.mark.parametrize(("law", "boxes"), [
    ("opposite", [[-0.9, -3.0, -0.5, 3.0, 0.0, 1.5]]),
    ("beside", [[-0.5, 0.9, 2.2, 1.3, 0.0, 1.5], [-0.5, -1.3, 2.2, -0.9, 0.0, 1.5]]),
])  # fmt: skip
def test_fronts_throw_waves_back(law: str, boxes: list[list[float]]) -> None:
    numbers = numbers_of_echoes(CHARGE, BAYS[:1], TOWARDS, np.array(boxes), HIGH[:1])
    found = getattr(packaged_laws(), law).factors(numbers)
    assert found.middle[0, 0] > 1.1
    lower = np.array(boxes) * np.array([1, 1, 1, 1, 1, 0.02])
    low = getattr(packaged_laws(), law).factors(
        numbers_of_echoes(CHARGE, BAYS[:1], TOWARDS, lower, HIGH[:1])
    )
    assert low.middle[0, 0] < 1.06


def test_the_errors_of_the_fit_are_in_the_file() -> None:
    """Each law explains most of what its families do; walls far away do hardly anything."""
    laws = packaged_laws()
    for law in (laws.between, laws.opposite, laws.shadow, laws.attached):
        for name, family in law.families.items():
            if name in ("far", "distant"):
                assert max(family.before[0], family.error[0]) < 0.1
            else:
                assert family.error[0] < 0.6 * family.before[0]


def house(with_wall: bool) -> Scenario:
    """Return 100 kg, 10 m before a house of 6 m, with a wall of 3 m at 3 m or without."""
    front = {"height_m": 6.0, "protected": True, "faces": ["west"]}
    structures = [builders.block("house", 14.0, 8.0, 24, 4, **front)]
    if with_wall:
        structures.append(builders.block("wall", 7.0, 4.0, 40, 1, height_m=3.0))
    document = site_document(
        site={"width_m": 20.0, "height_m": 28.0, "air_height_m": 12.0},
        charge=[builders.point(4.0, 14.0, 100.0)],
        structures=structures,
        gauges=[],
    )
    del document["build_zone"]
    return Scenario.from_document(document, "house")


def test_a_wall_by_gas_lies_in_the_interval_of_the_law() -> None:
    engine = GasEngine(cell_m=0.5)
    alone, behind_it = (
        GasBlast(house(own), engine=engine).run().impulse("house").pa_s for own in (False, True)
    )
    scale = 100.0 ** (1 / 3)
    bays = np.array([[10.0, y, z] for y in (-4.5, -1.5, 1.5, 4.5) for z in (1.5, 4.5)]) / scale
    box = np.array([[3.0, -10.0, 3.5, 10.0, 0.0, 3.0]]) / scale
    found = behind(box, bays=bays)
    low, high = (float(part[:, 0].mean()) for part in (found.low, found.high))
    assert low < behind_it / alone < high
    assert high / low < 2.2
