"""Charges that are too large for the balls of the particle model are no problem of gas dynamics."""

import pytest

from blast_env import simulate
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.engines.gas import GasBlast
from blast_env.site import Scenario, ScenarioError
from tests.gas_sites import site_document

HEAVY_KG = 90_000.0


@pytest.fixture(scope="module")
def heavy() -> Scenario:
    document = site_document(
        charge=[{"kind": "point", "position_m": [2.0, 4.0], "tnt_kg": HEAVY_KG}],
        simulation={"preset": "collisional", "overrides": {"explosive": {"ball_count": 20_000}}},
    )
    return Scenario.from_document(document, "heavy")


def test_the_scenario_loads_and_gas_can_be_laid_out(heavy: Scenario) -> None:
    assert GasBlast(heavy).site.charge.tnt_kg == HEAVY_KG
    assert BlastEvaluator(heavy, "gas").scenario is heavy


def test_particles_say_that_they_do_not_reach_so_far(heavy: Scenario) -> None:
    (problem,) = heavy.particle_problems
    assert problem.key == "charge[0].tnt_kg"
    assert "is 90000: the parameters, which are for 100 kg, do not reach so far" in problem.message
    with pytest.raises(ScenarioError, match="do not reach so far"):
        BlastEvaluator(heavy, "event")
    with pytest.raises(BlastEnvError, match="tnt_kg is 90000: the parameters"):
        simulate(heavy, engine="event")
