"""Threats are the charges that `simulate` would draw; every purpose has seeds of its own."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from blast_env import Blast, Charge, load_scenario
from blast_env.errors import BlastEnvError
from blast_env.evaluation import LoadCase, LoadCaseSet, SeedRange, draw_threats, evaluate_layout
from blast_env.evaluation.cases import are_all, fixed_charges, in_turn, search_set
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.layout import write_layout
from blast_env.site import ConditionalValueAtRisk, PointSource, Scenario, save_scenario
from tests.cli.running import run
from tests.evaluation.cases import COURTYARD, SEEDS
from tests.gas_sites import WALL, hut


def test_a_seed_draws_the_charge_of_its_blast() -> None:
    for seed, threat in zip(SEEDS, draw_threats(COURTYARD, SEEDS), strict=True):
        assert threat.seed == seed
        assert threat.charge == Blast(COURTYARD, seed=seed).scene.charge


def test_numbers_of_other_types_make_the_same_threat() -> None:
    """They become keys of a cache and go into JSON files."""
    plain = LoadCase(Charge((5.0, 15.0), 100.0), 3)
    numpy_charge: Any = (np.array([5, 15]), np.float32(100.0))
    numpy_seed: Any = np.int64(3)
    other = LoadCase(numpy_charge, numpy_seed)
    assert other == plain
    assert hash(other) == hash(plain)
    assert type(other.seed) is int
    assert draw_threats(COURTYARD, np.arange(2)) == draw_threats(COURTYARD, range(2))


@pytest.mark.parametrize(
    ("seeds", "words"),
    [
        ([], "there are none, must be at least one"),
        ([4, 2, 4], r"seeds\[2\] is 4, appears twice"),
        ([0, -7], r"seeds\[1\] is -7, must be an integer from 0"),
        ([0.5], r"seeds\[0\] is 0.5, must be an integer"),
        ([True], r"seeds\[0\] is true, must be an integer"),
    ],
)
def test_unusable_seeds_are_named(seeds: list, words: str) -> None:
    with pytest.raises(BlastEnvError, match=words):
        draw_threats(COURTYARD, seeds)


@pytest.mark.parametrize("charge", [5.0, ((1.0, 2.0, 3.0), 1.0), (("left", 1.0), 1.0)])
def test_unusable_charges_are_named(charge: Any) -> None:
    with pytest.raises(BlastEnvError, match="must be"):
        LoadCase(charge, 0)
    with pytest.raises(BlastEnvError, match="seed is -1, must be an integer from 0"):
        LoadCase(Charge((5.0, 15.0), 100.0), -1)


def test_ranges_of_seeds_are_disjoint() -> None:
    """Training, choice of weights, search and judgement never share a blast."""
    ranges = sorted((seeds.value.start, seeds.value.stop) for seeds in SeedRange)
    assert all(len(range(*case)) >= 2**31 for case in ranges)
    assert all(low[1] <= high[0] for low, high in pairwise(ranges))


@pytest.mark.parametrize("purpose", SeedRange)
def test_seeds_stay_in_their_range(purpose: SeedRange) -> None:
    rng = np.random.default_rng(0)
    drawn = [*purpose.draw(rng, (3, 2)).ravel().tolist(), *purpose.draw_distinct(rng, 5)]
    assert all(seed in purpose.value for seed in drawn)
    first = purpose.seeds(3, 2)
    assert list(first) == [purpose.value.start + 3, purpose.value.start + 4]
    with pytest.raises(BlastEnvError, match="must be at least one, from 0 to"):
        purpose.seeds(len(purpose.value) - 1, 2)
    with pytest.raises(BlastEnvError, match="must be at least one"):
        purpose.seeds(0, 0)


def test_an_environment_draws_seeds_for_training() -> None:
    env = gym.make("BlastBarrier-v0", action="place", disable_env_checker=True)
    env.reset(seed=0)
    assert isinstance(env.action_space, gym.spaces.Discrete)
    finish = env.action_space.n - 1
    info = env.step(finish)[4]
    assert all(
        seed in SeedRange.TRAINING.value
        for blast_seed in info["blast_seeds"]
        for seed in blast_seed
    )


def test_a_search_meets_none_of_the_threats_that_judge() -> None:
    scenario = load_scenario("courtyard")
    drawn = search_set(scenario, None, 2, seed=1, charges=3)
    assert all(threat.seed in SeedRange.SEARCH.value for threat in drawn.threats)
    with pytest.raises(BlastEnvError, match="a search may not use"):
        LoadCaseSet(scenario, drawn.threats[:1], search_set=drawn)


def test_realisations_are_averaged_before_the_risk() -> None:
    """Three charges, two realisations: charge by charge, then again; the risk sees means."""
    scenario = load_scenario("courtyard")
    charges = [Charge((5.0, y_m), 100.0) for y_m in (10.0, 15.0, 20.0)]
    threats = tuple(LoadCase(charges[k % 3], k) for k in range(6))
    worst = ConditionalValueAtRisk(0.9)
    impulses = [1.0, 2.0, 6.0, 3.0, 4.0, 2.0]
    assert LoadCaseSet(scenario, threats, 2).combined(impulses) == pytest.approx(3.0)
    assert LoadCaseSet(scenario, threats, 2, worst).combined(impulses) == pytest.approx(4.0)
    assert LoadCaseSet(scenario, threats, 2, worst).combined(impulses[:2]) == pytest.approx(2.0)


def test_a_charge_that_is_drawn_twice_counts_twice() -> None:
    """A risk over draws, not over places: a likely place weighs more."""
    scenario = load_scenario("courtyard")
    same, other = Charge((5.0, 10.0), 100.0), Charge((5.0, 20.0), 100.0)
    case = LoadCaseSet(scenario, (LoadCase(same, 1), LoadCase(same, 2), LoadCase(other, 3)))
    assert case.combined([1.0, 2.0, 6.0]) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("charge", "words"),
    [
        (((-1.0, 15.0), 100.0), r"position_m\[0\]: is -1"),
        (((5.0, 15.0), 0.0), "tnt_kg: is 0"),
        (((29.0, 15.0), 100.0), "must keep clear of it"),
        (((500.0, 15.0), 100.0), "must lie inside the site"),
        ((5.0, 15.0), "must be .* in m, kg of TNT"),
    ],
)
def test_a_known_charge_that_could_not_be_there_is_refused(charge: Any, words: str) -> None:
    """Before a search or a proposal, also by guesses, which no engine would refuse."""
    with pytest.raises(BlastEnvError, match=words):
        search_set(COURTYARD, charge)


def test_a_known_charge_may_be_written_in_numbers() -> None:
    plain: Any = (np.array([4, 15]), 20)
    case = search_set(COURTYARD, plain)
    assert case.charge == Charge((4.0, 15.0), 20.0)
    assert case.threats == search_set(COURTYARD, case.charge).threats


def test_threats_out_of_order_are_refused() -> None:
    scenario = load_scenario("courtyard")
    first, second = Charge((5.0, 10.0), 100.0), Charge((5.0, 20.0), 100.0)
    threats = (LoadCase(first, 1), LoadCase(first, 2), LoadCase(second, 3), LoadCase(second, 4))
    with pytest.raises(BlastEnvError, match=r"threats\[2\] .* in the order of the charges"):
        LoadCaseSet(scenario, threats, realisations=2)
    with pytest.raises(BlastEnvError, match="2 realisations of each charge"):
        LoadCaseSet(scenario, threats[:3], realisations=2)


# --- Fixed charges.


def points(*places_m: tuple[float, float]) -> Scenario:
    sources = (PointSource(kind="point", position_m=place_m, tnt_kg=50.0) for place_m in places_m)
    return COURTYARD.model_copy(update={"charge": tuple(sources)})


@pytest.mark.parametrize("first", [0, 1, 17])
def test_every_fixed_charge_comes_once_before_any_comes_again(first: int) -> None:
    scenario = points((3.0, 8.0), (3.0, 12.0), (3.0, 20.0))
    threats = in_turn(scenario, draw_threats(scenario, range(first, first + 7)))
    charges = [threat.charge for threat in threats]
    assert set(charges[:3]) == set(charges[3:6]) == set(fixed_charges(scenario))
    assert charges[6] == charges[0]
    assert [threat.seed for threat in threats] == [*range(first, first + 7)]
    assert are_all(scenario, charges[:3])
    assert not are_all(scenario, charges[:2])


def test_their_order_depends_on_the_seed() -> None:
    scenario = points((3.0, 8.0), (3.0, 12.0), (3.0, 20.0))
    firsts = {in_turn(scenario, draw_threats(scenario, [seed]))[0].charge for seed in range(20)}
    assert firsts == set(fixed_charges(scenario))


def test_charges_along_a_line_are_as_drawn() -> None:
    threats = draw_threats(COURTYARD, range(3))
    assert in_turn(COURTYARD, threats) == threats
    assert fixed_charges(COURTYARD) == ()
    assert not are_all(COURTYARD, [threat.charge for threat in threats])


def test_a_blast_that_draws_repeat_is_no_further_evidence() -> None:
    """Python and the command say the same of fixed charges: an interval had counted copies."""
    first = {"kind": "point", "position_m": [2.0, 4.0], "tnt_kg": 5.0}
    fixed = hut(charge=[first | {"position_m": [2.0, y_m]} for y_m in (3.0, 4.0, 5.0)])
    engine = GasEngine(border_m=0.0, until=0.02)
    few, many = (evaluate_layout(fixed, WALL, range(n), engine=engine) for n in (3, 16))
    assert len(many.threats) == 3
    assert sorted(few.loads[0]) == sorted(many.loads[0])
    assert np.ptp(many.ci95) == pytest.approx(np.ptp(few.ci95))


def test_draws_keep_the_weights_of_sources_where_places_are_without_number(tmp_path: Path) -> None:
    """Nine of ten draws are the point: it had counted once, as each of the others."""
    often = {"kind": "point", "position_m": [2.0, 4.0], "tnt_kg": 5.0, "weight": 9.0}
    along = {"kind": "segment", "start_m": [2.0, 1.0], "end_m": [2.0, 7.0], "tnt_kg": 1.0}
    site = hut(charge=[often, along])
    found = evaluate_layout(site, WALL, range(32), engine=GasEngine(border_m=0.0, until=0.02))
    assert len(found.threats) == 32
    masses = [threat.charge.tnt_kg for threat in found.threats]
    assert 24 < masses.count(5.0) < 32
    save_scenario(site, tmp_path / "site.toml")
    write_layout(tmp_path / "layout.json", site, WALL, {})
    files = ("--scenario", tmp_path / "site.toml", "--layout", tmp_path / "layout.json")
    done = run("evaluate", *files, "--cell", 0.5, "--seeds", 32, "--first-seed", 0, "--json")
    record = json.loads(done.stdout)
    assert record["cache"]["blasts"] == 2 * (33 - masses.count(5.0))
    again = evaluate_layout(site, WALL, range(32), cell_m=0.5)
    assert record["result"]["load"]["value"] == again.mean.value
