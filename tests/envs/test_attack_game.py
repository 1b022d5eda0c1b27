"""The game of defender and attacker: PettingZoo's own test, payoffs, places in reach."""

import warnings
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from blast_env.envs.attack_game import ATTACKER, DEFENDER, AttackGame, env
from blast_env.errors import BlastEnvError
from tests.evaluation.engines.shade import ShadeEngine

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # of the examples that it imports
    from pettingzoo.test import api_test


def game(scenario: str) -> AttackGame:
    found = AttackGame(scenario, engine=ShadeEngine())
    found.reset(seed=0)
    return found


@pytest.mark.filterwarnings("ignore::UserWarning")  # advice on names and kinds of spaces
@pytest.mark.parametrize("scenario", ["courtyard", "hotel_forecourt"])
def test_the_test_of_the_library_passes(scenario: str, capsys: pytest.CaptureFixture[str]) -> None:
    api_test(env(scenario=scenario, engine=ShadeEngine()), num_cycles=40)
    assert "Passed API test" in capsys.readouterr().out


def test_without_a_barrier_the_best_response_is_worth_1() -> None:
    played = game("courtyard")
    played.step(played.placing.action_space.n - 1)  # type: ignore[attr-defined]
    assert played.agent_selection == ATTACKER
    shares = played.shares()
    assert shares.max() == 1.0
    best = played.best_response()
    assert shares[best] == 1.0
    played.step(best)
    assert played.rewards == {DEFENDER: -1.0, ATTACKER: 1.0}
    assert all(played.terminations.values())
    assert played.infos[ATTACKER] == {"load_share": 1.0}


def test_each_module_lowers_what_the_attacker_gets() -> None:
    played = game("courtyard")
    for action in (160, 176, 640):
        played.step(action)
    assert played.shares().max() == pytest.approx(0.9**2)
    played.step(played.best_response())
    assert played.rewards[ATTACKER] == pytest.approx(0.9**2)


def test_what_closes_the_drive_moves_the_places_of_the_vehicle() -> None:
    played = game("hotel_forecourt")
    before = played.observe(ATTACKER)["places"]
    mask = played.observe(DEFENDER)["action_mask"]
    while played.agent_selection == DEFENDER:
        legal = np.flatnonzero(played.observe(DEFENDER)["action_mask"])
        played.step(int(legal[0]))
    after = played.observe(ATTACKER)
    assert mask[-1] == 1
    assert (after["places"][:, 0] <= before[:, 0].max()).all()
    assert after["action_mask"][0] == 1
    space: Any = played.observation_space(ATTACKER)
    assert isinstance(space, spaces.Dict)
    assert space.contains(after)


def test_a_response_of_facades_may_be_what_the_attacker_wants() -> None:
    played = AttackGame("clinic_front", engine="surrogate")
    played.reset()
    assert played.scenario.objective.is_response
    played.step(int(played.placing.finish))
    played.step(played.best_response())
    assert played.rewards[ATTACKER] == 1.0


def test_a_site_without_a_build_zone_is_refused() -> None:
    with pytest.raises(BlastEnvError, match="build zone"):
        AttackGame("free_field")
