"""The statistics of the comparison of the engines, on data whose answer is known."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from blast_env import load_scenario, simulate
from studies.particles.agreement.loads import (
    DIFFERENCE_HEADERS,
    QUANTITIES,
    BlastSet,
    Comparison,
    Difference,
    EngineScene,
    collisions_of,
    compare_scenes,
    convergence_figure,
    difference_rows,
    engine_scenes,
    longest_close_step,
    relative_difference,
    step_rows,
    totals,
    weighted_distance,
)

SMALL = EngineScene(
    "small",
    load_scenario("free_field")
    .at_stand_off(8.0)
    .with_simulation(overrides={"explosive": {"ball_count": 60}, "air": {"spacing_units": 0.0}}),
    steps_radii=(0.5, 0.25),
)
"""Balls that meet nothing but the facade, on which the engines agree almost exactly."""


def comparison(step_radii: float, impulse: Difference, transferred: Difference) -> Comparison:
    differences = dict.fromkeys(QUANTITIES, Difference(0.0, 0.0))
    differences |= {"impulse": impulse, "transferred": transferred}
    numbers: Mapping[str, float] = dict.fromkeys(QUANTITIES, 0.0)
    return Comparison(
        "scene", "building", step_radii, 9, differences, numbers, numbers, numbers, numbers
    )


class TestRelativeDifference:
    def test_interval_holds_the_truth_19_times_in_20(self) -> None:
        """For correlated loads whose means differ by 4 %."""
        rng, held = np.random.default_rng(5), 0
        for _ in range(400):
            common, own = rng.normal(size=200), rng.normal(size=(2, 200))
            event = 100.0 + 10.0 * common + 10.0 * own[0]
            pymunk = (104.0 + 12.0 * common + 9.0 * own[1])[:50]
            difference = relative_difference(pymunk, event)
            held += abs(difference.value - 0.04) < difference.half_width
        assert 0.92 < held / 400 < 0.98

    def test_what_seeds_share_narrows_the_interval(self) -> None:
        rng = np.random.default_rng(6)
        event = rng.normal(100.0, 10.0, 400)
        same = relative_difference(1.02 * event[:100] + rng.normal(0.0, 1.0, 100), event)
        other = relative_difference(rng.normal(102.0, 10.2, 100), event)
        assert same.value == pytest.approx(0.02, abs=0.005)
        assert same.half_width < 0.3 * other.half_width

    def test_blasts_without_a_value_are_left_out_with_their_partners(self) -> None:
        event = np.array([1.0, 2.0, np.nan, 4.0, 5.0, 6.0])
        difference = relative_difference(np.array([2.0, np.nan, 9.0, 8.0, 10.0]), event)
        assert difference.value == pytest.approx(1.0)  # all others have just doubled
        assert difference.half_width == pytest.approx(0.0, abs=1e-9)


class TestLongestCloseStep:
    CLOSE, WIDE = Difference(0.01, 0.02), Difference(0.01, 0.06)
    FAR = Difference(-0.08, 0.01)

    def test_longest_with_both_intervals_within_5_percent(self) -> None:
        steps = [
            comparison(0.5, self.FAR, self.CLOSE),
            comparison(0.25, self.CLOSE, self.CLOSE),
            comparison(0.1, self.CLOSE, self.CLOSE),
        ]
        assert longest_close_step(steps) == 0.25

    def test_a_wide_interval_shows_nothing_but_does_not_contradict(self) -> None:
        steps = [
            comparison(0.5, self.CLOSE, self.CLOSE),
            comparison(0.25, self.WIDE, self.CLOSE),
        ]
        assert longest_close_step(steps) == 0.5
        assert longest_close_step(steps[1:]) is None

    def test_a_shorter_step_outside_contradicts(self) -> None:
        steps = [
            comparison(0.5, self.CLOSE, self.CLOSE),
            comparison(0.25, self.CLOSE, self.FAR),
            comparison(0.1, self.CLOSE, self.CLOSE),
        ]
        assert longest_close_step(steps) == 0.1

    def test_an_interval_that_touches_the_bound_is_not_within(self) -> None:
        assert not Difference(-0.03, 0.02).is_close
        assert Difference(-0.03, 0.019).is_close


class TestTotals:
    COLLISIONS = pd.DataFrame(
        {
            "seed": [0, 0, 2, 2],
            "structure": ["building", "building", "building", "barrier"],
            "time_ms": [12.0, 10.0, 30.0, 1.0],
            "angle_deg": [0.0, 40.0, 20.0, 90.0],
            "impulse": [3.0, 1.0, 5.0, 100.0],
            "transferred": [4.0, 1.5, 6.0, 100.0],
        }
    )

    def test_sums_and_first_arrival_of_each_blast(self) -> None:
        table = totals(self.COLLISIONS, "building", 3)
        assert table.impulse.tolist() == [4.0, 0.0, 5.0]
        assert table.transferred.tolist() == [5.5, 0.0, 6.0]
        assert table.hits.tolist() == [2, 0, 1]
        assert table.arrival_ms[[0, 2]].tolist() == [10.0, 30.0]
        assert table.angle_deg[[0, 2]].tolist() == [10.0, 20.0]  # weighted by the impulse

    def test_a_blast_without_a_hit_counts_with_no_load_but_has_no_arrival(self) -> None:
        table = totals(self.COLLISIONS, "building", 3)
        assert table.loc[1, ["arrival_ms", "angle_deg"]].isna().all()


class TestWeightedDistance:
    def frame(self, times: list[float], weights: list[float]) -> pd.DataFrame:
        return pd.DataFrame({"time_ms": times, "transferred": weights})

    def test_a_push_that_counts_twice_changes_nothing(self) -> None:
        whole = self.frame([1.0, 2.0], [4.0, 1.0])
        parts = self.frame([1.0, 1.0, 2.0], [1.0, 3.0, 1.0])
        assert weighted_distance(whole, parts, "time_ms") == pytest.approx(0.0)

    def test_largest_gap_of_the_two_distributions(self) -> None:
        one, other = self.frame([1.0, 3.0], [1.0, 1.0]), self.frame([2.0, 3.0], [3.0, 1.0])
        assert weighted_distance(one, other, "time_ms") == pytest.approx(0.5)
        late = self.frame([9.0], [1.0])
        assert weighted_distance(one, late, "time_ms") == pytest.approx(1.0)


class TestBlasts:
    def test_collisions_add_up_to_the_loads(self) -> None:
        scene = next(scene for scene in engine_scenes() if scene.name == "courtyard, wall")
        collisions = BlastSet(scene, "event", 5).collisions(4)
        result = simulate(scene.scenario, scene.layout, 4, "event")
        for name in scene.structures:
            expected = result.obstacle(name)
            own = collisions[collisions.structure == name]
            assert own.impulse.sum() == pytest.approx(expected.impulse, rel=1e-12)
            assert len(own) == expected.hits

    def test_finished_blasts_are_not_run_again(self, tmp_path: Path) -> None:
        blasts = BlastSet(SMALL, "event", 3)
        once = collisions_of(blasts, 1, tmp_path)
        once.assign(impulse=1.0).to_parquet(blasts.path(tmp_path))
        assert (collisions_of(blasts, 1, tmp_path).impulse == 1.0).all()

    def test_other_blasts_have_another_file(self, tmp_path: Path) -> None:
        blasts = BlastSet(SMALL, "pymunk", 3, 0.5)
        others = [
            replace(blasts, seeds=4),
            replace(blasts, step_radii=0.25),
            replace(blasts, engine="event"),
            replace(blasts, scene=replace(SMALL, scenario=load_scenario("courtyard"))),
            replace(blasts, scene=replace(SMALL, layout=((2, 0),))),
        ]
        paths = {each.path(tmp_path) for each in [blasts, *others]}
        assert len(paths) == 6


def test_the_engines_agree_where_balls_only_meet_a_facade(tmp_path: Path) -> None:
    """The whole study on a small scene, with its tables and its figure."""
    collisions = partial(collisions_of, processes=1, folder=tmp_path)
    comparisons = list(compare_scenes([SMALL], (20, 30), collisions))
    assert [each.step_radii for each in comparisons] == [0.5, 0.25]
    for each in comparisons:
        assert each.is_close
        assert abs(each.differences["transferred"].value) < 0.01
        assert abs(each.differences["arrival_ms"].value) < 0.02
    assert {len(row) for row in difference_rows(comparisons)} == {len(DIFFERENCE_HEADERS)}
    assert list(step_rows(comparisons)) == [("small: building", "0.5")]
    panels = convergence_figure(comparisons, 30).axes
    assert [axes.get_title() for axes in panels[:2]] == ["Impulse m|v|", "Transferred impulse"]
