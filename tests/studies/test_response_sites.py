"""Facades: what was found for sites where they count, a tested beam, the plate solver."""

from pathlib import Path

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, draw_threats
from blast_env.evaluation.cases import one_per_charge
from blast_env.evaluation.engines import find_engine
from blast_env.layout import LayoutState, load_layout
from blast_env.response import DamageLevel, plate_curve
from blast_env.site import load_scenario
from studies.plates import POISSON_RATIO, Plate, curve_values
from studies.response import BEAM_DEFLECTION_MM, BEAM_STEEL_DEPTHS_M, beam_response
from tests.blasts import consequences

FOUND = Path(__file__).parents[2] / "docs" / "data" / "best_found"
SITES = ("clinic_front", "guard_post", "school_wing", "ministry_kerb")
REAL_SIZE = ("campus", "car_park", "government_forecourt", "street_front")


@pytest.mark.parametrize("name", [*SITES, *REAL_SIZE])
def test_what_was_found_is_for_the_site_as_it_is_and_within_its_budget(name: str) -> None:
    scenario = load_scenario(name)
    found = load_layout(FOUND / f"{name}.json", scenario)
    budget = scenario.zone.budget
    assert budget is not None
    assert 0.0 < LayoutState.of(scenario, found).cost <= budget
    assert all(
        structure.facade is not None for structure in scenario.structures if structure.protected
    )


def test_the_guard_post_fails_empty_and_passes_with_what_was_found() -> None:
    scenario = load_scenario("guard_post")
    evaluator = BlastEvaluator(scenario, find_engine("gas", 0.5))
    found, target = load_layout(FOUND / "guard_post.json", scenario), scenario.objective.level
    charges = [load_case.charge for load_case in one_per_charge(draw_threats(scenario, range(16)))]
    assert len(charges) == 2
    assert target is not None
    assert not consequences(evaluator, (), charges).passes(target)
    assert consequences(evaluator, found, charges).passes(target)


@pytest.mark.parametrize("steel_depth_m", BEAM_STEEL_DEPTHS_M)
def test_a_beam_bends_as_far_as_the_tested_one(steel_depth_m: float) -> None:
    """Within a tenth of the test, from the measured load, wherever its steel lies exactly."""
    found = beam_response(steel_depth_m, 1.17)
    assert 1e3 * found.motion.peak_m[0] == pytest.approx(BEAM_DEFLECTION_MM, rel=0.1)
    assert 1e3 * found.motion.peak_time_s[0] == pytest.approx(8.0, abs=1.0)
    assert found.levels == [DamageLevel.MODERATE]


# --- The plate solver: thin-plate limit, E1300's deflections, and the table of the package.


def test_small_deflections_are_those_of_thin_plates() -> None:
    """Timoshenko & Woinowsky-Krieger, table 8: 0.00406 q b^4 / D in the middle of a square."""
    (state,) = Plate(1.0).states(np.array([0.01]))
    factor = 12.0 * (1.0 - POISSON_RATIO**2)
    assert state.deflection / state.load == pytest.approx(0.00406 * factor, rel=2e-3)


@pytest.mark.parametrize("ratio", [1.0, 1.5, 2.0])
def test_deflections_are_those_of_e1300(ratio: float) -> None:
    """Its appendix gives ln(w / h) as a square of ln ln(q (ab)^2 / (E h^4)): a fit of its own."""
    load = np.array([20.0, 100.0, 500.0])
    states = Plate(ratio).states(np.concatenate([np.geomspace(0.1, 15.0, 12), load]))[-3:]
    r = ratio ** np.arange(4)
    r0 = r @ [0.553, -3.83, 1.11, -0.0969]
    r1 = r @ [-2.29, 5.83, -2.17, 0.2067]
    r2 = r @ [1.485, -1.908, 0.815, -0.0822]
    x = np.log(np.log(load * ratio**2))
    expected = np.exp(r0 + r1 * x + r2 * x**2)
    assert [state.deflection for state in states] == pytest.approx(expected, rel=0.05)


@pytest.mark.slow
def test_the_table_is_what_the_equations_give() -> None:
    """The shipped file against the solver, for one of its aspect ratios."""
    values = curve_values(1.5)
    curve = plate_curve(1.5)
    assert curve.load == pytest.approx(values[:, 0], rel=1e-3)
    assert curve.risk == pytest.approx(values[:, 1], rel=1e-2)
    assert curve.load_mass_factor == pytest.approx(values[:, 2], rel=1e-3)


@pytest.mark.parametrize("ratio", [0.9, 5.1, float("nan")])
def test_aspect_ratios_out_of_bounds(ratio: float) -> None:
    with pytest.raises(BlastEnvError, match=r"aspect ratio is .*, must be from 1 to 5"):
        Plate(ratio)
