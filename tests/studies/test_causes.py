"""What kept plain PPO from learning: the former reward, and heaps in the place of walls."""

import numpy as np
import pytest

from blast_env.units import PA_PER_PSI
from studies.causes import Deposit, heaped, repeated, settings
from studies.first_hour import Judgement, Setting, by_rules, different_threats
from tests.evaluation.engines.shade import ShadeEngine

FLAT = Setting("courtyard", action="place")


@pytest.mark.parametrize("in_psi_s", [True, False])
def test_the_deposit_comes_back_and_the_sum_is_minus_the_load(in_psi_s: bool) -> None:
    setting = Setting("courtyard", reward=Deposit(2.0, in_psi_s=in_psi_s))
    env = setting.environment(ShadeEngine())
    env.reset(seed=0)
    first, last = env.step((0, 10, 0))[1], env.step(env.finish)
    load, bare = last[4]["impulse_pa_s"], last[4]["unprotected_impulse_pa_s"]
    unit = PA_PER_PSI if in_psi_s else bare
    assert first == pytest.approx(-2.0 * bare / unit)
    assert first + last[1] == pytest.approx(-load / unit)


def test_each_cause_is_taken_away_alone() -> None:
    former, *without, present = settings("courtyard", "event").values()
    changes = [
        {name for name in ("reward", "action") if getattr(item, name) != getattr(former, name)}
        for item in without
    ]
    assert changes == [{"reward"}, {"reward"}, {"action"}]
    assert present == Setting("courtyard", "event")


def test_what_is_repeated_is_a_heap_or_a_wall() -> None:
    env = FLAT.environment(ShadeEngine())
    heap = np.array(heaped(env, 20 * 16 + 8))
    assert np.ptp(heap, axis=0).max() < 8
    env.reset(seed=0)
    ended = False
    while not ended:
        ended = env.step(20 * 16 + 8)[2]
    high, wide = np.ptp(np.array(env.placement.cells), axis=0).tolist()
    assert (high >= 15, wide) == (True, 0)
    found = repeated(env, [0], lines=1)
    assert found["heaps"].value == found["walls"].value == pytest.approx(1.0 - 0.9**16)


def test_a_row_of_the_table_has_leads_over_random_and_over_the_best_rule() -> None:
    one, two = np.array([0.1, 0.3]), np.array([0.3, 0.3])
    trained = {"PPO, seed 0, 1 CPU s": two, "PPO, seed 1, 1 CPU s": one}
    found = Judgement("courtyard", "gas", {"a": one, "b": two}, np.zeros(2), trained)
    assert found.row() == (
        *("courtyard", "gas", "0.0", ""),
        *("25.0 (20.0 to 30.0)", "+25.0"),
        *("30.0", "", ""),
    )


def test_threats_that_are_drawn_again_are_told() -> None:
    one = np.array([0.1, 0.3])
    found = Judgement("control_room", "gas", {"a": one}, one, {}, charges=1)
    assert next(found.lines()) == "control_room, judged by gas on 2 threats, of which 1 differ"
    env = Setting("control_room", engine="surrogate", action="place").environment(ShadeEngine())
    assert different_threats(env, range(24)) == 3


def test_leads_are_on_the_best_rule_of_all_and_of_each() -> None:
    one, two = np.array([0.1, 0.3]), np.array([0.4, 0.2])
    found = Judgement("item_sites", "gas", {"a": one, "b": two}, np.zeros(2), {"PPO, seed 0": two})
    assert found.best_of_each.tolist() == [0.4, 0.3]
    *_, line = found.lines()
    assert "+0.0 points (0.0 to 0.0) on the best rule; -5.0 points" in line


def test_a_family_is_learnt_on_its_training_sites_and_judged_on_held_out_ones() -> None:
    setting = Setting("item_sites", "surrogate", action="suggestion", envs=2)
    envs = setting.learning(seed=0)
    held_out = setting.environment(ShadeEngine())
    assert (envs.action_space, envs.observation_space) == (
        held_out.action_space,
        held_out.observation_space,
    )
    learnt = envs.envs.one.task.source  # type: ignore[union-attr]
    judged = held_out.task.source
    assert judged.first_seed + judged.count <= learnt.first_seed  # type: ignore[attr-defined]


def test_rules_know_a_vehicle_that_goes_to_the_worst_place_left() -> None:
    """Against a charge that stays 1 m before the hotel, walls across the drive place nothing."""
    env = Setting("hotel_forecourt", action="place").environment(ShadeEngine())
    rules = dict(by_rules(env, range(2)))
    assert rules["wall in the middle"].min() > 0.0
