"""What trainings on guesses pay: upper ends of intervals, and leads on the best rule."""

import numpy as np
import pytest

from blast_env import load_scenario
from blast_env.design.search import layouts_by_rule
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.contract import EngineBlast
from blast_env.surrogate import SurrogateEngine
from studies.first_hour import Judgement
from studies.paid_guesses import LeadOnRules, row, settings

SITE = "visitor_entrance"


def paid(env: LeadOnRules | BlastBarrierEnv, layout: object) -> tuple[float, float]:
    """Return the reward of a finished layout, and its reduction."""
    env.reset(seed=3, options={"layout": layout})
    own = env.unwrapped
    assert isinstance(own, BlastBarrierEnv)
    _, reward, ended, _, info = env.step(own.finish)
    assert ended
    return float(reward), info["reduction"]


def test_a_lead_is_the_reduction_less_that_of_the_best_rule() -> None:
    pays = settings(SITE)["the guess less that of the best rule"]
    env = pays.learning(seed=0)
    assert isinstance(env, LeadOnRules)
    env.reset(seed=3)
    own = env.unwrapped
    assert isinstance(own, BlastBarrierEnv)
    (charge,) = env.step(own.finish)[-1]["charges"]
    rules = layouts_by_rule(own.placement.scenario, charge).values()
    found = [paid(env, layout) for layout in rules]
    best = max(reduction for _, reduction in found)
    for reward, reduction in found:
        assert reward == pytest.approx(reduction - best, abs=1e-6)
    assert max(reward for reward, _ in found) == pytest.approx(0.0, abs=1e-6)
    assert paid(env, ())[0] == pytest.approx(-best, abs=1e-6)


def test_upper_ends_are_above_guesses_and_take_off_less_where_networks_disagree() -> None:
    scenario = load_scenario(SITE)
    charge = scenario.sample_charge(np.random.default_rng(0))
    layouts = [(), *layouts_by_rule(scenario, charge).values()]
    blasts = [EngineBlast(scenario, layout, charge, 0) for layout in layouts]
    plain, high = (
        np.array([sum(own.impulse_pa_s for own in found.protected) for found in loads])
        for loads in (
            SurrogateEngine().loads_at_once(blasts),
            settings(SITE)["the upper end of its interval"].training.loads_at_once(blasts),
        )
    )
    assert (high > plain).all()
    assert len(np.unique((high / plain).round(6))) > 1


@pytest.mark.parametrize(
    ("site", "why"), [("item_sites", "must be one site"), ("hotel_forecourt", "has a vehicle")]
)
def test_families_and_vehicles_have_no_leads(site: str, why: str) -> None:
    with pytest.raises(BlastEnvError, match=f"{site}: {why}"):
        settings(site)["the guess less that of the best rule"].learning(seed=0)


def test_a_row_has_means_over_trainings_and_leads() -> None:
    one, two = np.array([0.1, 0.3]), np.array([0.3, 0.5])
    trained = {"MaskablePPO, seed 0": one, "MaskablePPO, seed 1": two}
    judgement = Judgement(SITE, "gas", {"a": np.array([0.2, 0.2])}, one, trained)
    assert row(SITE, "the guess", [judgement]) == (
        *(SITE, "the guess", "30.0 (20.0 to 40.0)"),
        "+10.0 (-117.1 to 137.1)",
    )
