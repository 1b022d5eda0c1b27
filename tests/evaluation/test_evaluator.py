"""Loads are those of `simulate`, however and however often they are asked for."""

import multiprocessing
import pickle
from dataclasses import replace

import joblib
import numpy as np
import pytest

from blast_env import Charge, load_scenario, simulate
from blast_env.calibration import CalibrationError
from blast_env.errors import BlastEnvError, LayoutError, UnknownNameError
from blast_env.evaluation import BlastEvaluator, BlastLoads, LoadCase, StructureLoad
from blast_env.site import Scenario, ScenarioError
from tests.evaluation.cases import COURTYARD, FEW, THREATS, WALL
from tests.scenarios import BALLISTIC_COURTYARD


def same(one: BlastLoads, other: BlastLoads) -> bool:
    """Whether two loads are equal to the last bit."""
    modules = np.array_equal(one.module_impulse_sim, other.module_impulse_sim)
    return modules and one.structures == other.structures


@pytest.mark.parametrize(
    ("scenario", "engine"), [(COURTYARD, "event"), (BALLISTIC_COURTYARD, "pymunk")]
)
def test_loads_are_those_of_simulate(scenario: Scenario, engine: str) -> None:
    loads = BlastEvaluator(scenario, engine).loads(WALL, THREATS[0])
    result = simulate(scenario, WALL, THREATS[0].seed, engine)
    (building,) = loads.structures
    assert building.impulse_sim == result.impulse_sim("building")
    scaled = result.impulse("building")
    assert building.impulse_pa_s == scaled.pa_s == pytest.approx(6894.757293168 * scaled.psi_s)
    assert (building.in_range, building.notes) == (True, ())
    modules = result.modules[result.modules.structure == "building"]
    assert loads.module_impulse_sim.tolist() == modules.impulse_sim.tolist()


def test_notes_say_what_the_calibration_was_not_made_for() -> None:
    evaluator = BlastEvaluator(load_scenario("courtyard"), "event")
    light = evaluator.loads((), LoadCase(Charge((10.0, 15.0), 15.0), 0))
    assert not light.in_range
    assert light.structures[0].notes == ("charge 15 kg TNT is not between 20 and 1000 kg",)


def test_protected_structures_count_by_their_weights_and_others_not_at_all() -> None:
    load = StructureLoad("a", True, 2.0, 0.1, None, 2.0, True, (), "a", impulse_sim=10.0)
    other = replace(load, name="b", weight=3.0, impulse_sim=1.0, impulse_pa_s=0.01)
    bystander = replace(load, name="c", protected=False, in_range=False)
    loads = BlastLoads((load, bystander, other), np.zeros(3))
    assert loads.protected_impulse_sim == 23.0
    assert loads.protected_impulse_pa_s == pytest.approx(0.23)
    assert loads.in_range
    assert not replace(loads, structures=(replace(load, in_range=False),)).in_range


def test_parallel_and_serial_are_the_same(evaluator: BlastEvaluator) -> None:
    pairs = [(layout, threat) for layout in (FEW, (), WALL) for threat in THREATS[:2]]
    parallel = BlastEvaluator(COURTYARD, "event")
    for one, other in zip(
        parallel.loads_of_many(pairs, processes=2), evaluator.loads_of_many(pairs), strict=True
    ):
        assert same(one, other)
    assert parallel.counts.blasts == len(pairs)
    parallel.loads_of_many(pairs)
    assert (parallel.counts.blasts, parallel.counts.cache_hits) == (len(pairs), len(pairs))


def test_equal_blasts_are_simulated_once() -> None:
    evaluator = BlastEvaluator(COURTYARD, "event")
    threat = THREATS[0]
    pairs = [(FEW, threat), ((), threat), (FEW[::-1], threat)]
    first, unprotected, again = evaluator.loads_of_many(pairs)
    assert (evaluator.counts.blasts, evaluator.counts.cache_hits) == (2, 1)
    assert first is again
    assert not same(first, unprotected)
    assert evaluator.loads((), threat) is unprotected
    assert (evaluator.counts.blasts, evaluator.counts.cache_hits) == (2, 2)


def test_loads_that_are_given_out_twice_cannot_be_changed(evaluator: BlastEvaluator) -> None:
    for loads in evaluator.loads_of_many([(FEW, threat) for threat in THREATS], processes=2):
        with pytest.raises(ValueError, match="read-only"):
            loads.module_impulse_sim[0] = 0.0


def protected_impulse(evaluator: BlastEvaluator) -> tuple[float, int]:
    return evaluator.loads(FEW, THREATS[0]).protected_impulse_pa_s, evaluator.counts.blasts


def test_an_evaluator_works_in_a_spawned_process_and_keeps_what_it_remembers() -> None:
    evaluator = BlastEvaluator(COURTYARD, "event")
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        there, _ = pool.apply(protected_impulse, (evaluator,))
    assert (there, 1) == protected_impulse(evaluator)
    copy = pickle.loads(pickle.dumps(evaluator))
    assert protected_impulse(copy) == (there, 1)


def test_scenarios_that_no_calibration_fits_are_refused_at_once() -> None:
    document = COURTYARD.model_dump() | {"calibration": None, "name": "bare"}
    with pytest.raises(CalibrationError, match="'bare' names no calibration: set calibration to"):
        BlastEvaluator(Scenario.from_document(document, "bare"), "event")
    other = COURTYARD.with_simulation(overrides={"air": {"mass": 0.5}})
    with pytest.raises(CalibrationError, match="the simulation has others"):
        BlastEvaluator(other, "event")
    with pytest.raises(UnknownNameError, match="did you mean 'pymunk'"):
        BlastEvaluator(COURTYARD, engine="pymonk")


def test_layouts_and_process_counts_are_checked_before_any_blast() -> None:
    evaluator = BlastEvaluator(COURTYARD, "event")
    with pytest.raises(LayoutError, match=r"\(0, 99\)"):
        evaluator.loads_of_many([((), THREATS[0]), ([(0, 99)], THREATS[0])])
    with pytest.raises(BlastEnvError, match="processes is 0, must be a whole number of at least 1"):
        evaluator.loads_of_many([((), THREATS[0])], processes=0)
    assert evaluator.counts.blasts == 0


def test_a_charge_in_a_building_is_refused_wherever_its_blast_runs() -> None:
    """Threads stand for processes, which an error would end: the next tests would wait for new."""
    inside = [((), LoadCase(Charge((29.0, 15.0), 100.0), seed)) for seed in range(2)]
    with pytest.raises(ScenarioError, match="building") as here:
        BlastEvaluator(COURTYARD, "event").loads_of_many(inside)
    with (
        joblib.parallel_config("threading", n_jobs=2),
        pytest.raises(ScenarioError, match="building") as there,
    ):
        BlastEvaluator(COURTYARD, "event").loads_of_many(inside)
    from_process = pickle.loads(pickle.dumps(there.value))
    assert type(from_process) is ScenarioError
    assert str(from_process) == str(there.value) == str(here.value)
