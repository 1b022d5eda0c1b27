"""Sites whose facades count: the layouts found are theirs, and one where blasts are cheap.

And the test of a beam that the response is held against.
"""

from pathlib import Path

import pytest

from blast_env.bundled import REAL_SIZE
from blast_env.evaluation import draw_threats
from blast_env.evaluation.cases import one_of_each_charge
from blast_env.evaluation.consequences import consequences
from blast_env.evaluation.engines import find_engine
from blast_env.layout import LayoutState, load_layout
from blast_env.response.walls import DamageLevel
from blast_env.site import load_scenario
from studies.response import BEAM_DEFLECTION_MM, BEAM_STEEL_DEPTHS_M, beam_response

FOUND = Path(__file__).parents[2] / "docs" / "data" / "best_found"
SITES = ("clinic_front", "guard_post", "school_wing", "ministry_kerb")


@pytest.mark.parametrize("name", [*SITES, *sorted(REAL_SIZE)])
def test_what_was_found_is_for_the_site_as_it_is_and_within_its_budget(name: str) -> None:
    scenario = load_scenario(name)
    found = load_layout(FOUND / f"{name}.json", scenario)
    budget = scenario.zone.budget
    assert budget is not None
    assert 0.0 < LayoutState.of(scenario, found).cost <= budget
    assert all(each.facade is not None for each in scenario.structures if each.protected)


def test_the_guard_post_fails_empty_and_passes_with_what_was_found() -> None:
    scenario, engine = load_scenario("guard_post"), find_engine("gas", 0.5)
    found, target = load_layout(FOUND / "guard_post.json", scenario), scenario.objective.level
    charges = [each.charge for each in one_of_each_charge(draw_threats(scenario, range(16)))]
    assert len(charges) == 2
    assert target is not None
    assert not consequences(scenario, (), charges, engine).passes(target)
    assert consequences(scenario, found, charges, engine).passes(target)


@pytest.mark.parametrize("steel_depth_m", BEAM_STEEL_DEPTHS_M)
def test_a_beam_bends_as_far_as_the_tested_one(steel_depth_m: float) -> None:
    """Within a tenth of the test, from the measured load, wherever its steel lies exactly."""
    found = beam_response(steel_depth_m, 1.17)
    assert 1e3 * found.motion.peak_m[0] == pytest.approx(BEAM_DEFLECTION_MM, rel=0.1)
    assert 1e3 * found.motion.peak_time_s[0] == pytest.approx(8.0, abs=1.0)
    assert found.levels == [DamageLevel.MODERATE]
