"""The training of the packaged agent, on a few small sites."""

from pathlib import Path

import numpy as np
from blast_agents import PackagedAgent, packaged_agent
from blast_agents.packaged import CandidateNetwork, load_packaged
from typer.testing import CliRunner

from blast_env.design.search import Guesses
from blast_env.design.search.learnt import case_for
from blast_env.site import save_scenario
from blast_env.surrogate import packaged_surrogate
from studies.packaged_agent import app, read_shown, shown_cases
from studies.packaged_training import charge_of, reinforced
from studies.site_names import scenario_of
from tests.vehicle_sites import gate_site, vehicle_document, vehicle_of

SITE = "close_sites/16/10000"


def run(*arguments: str) -> str:
    """Return the output of a command of the study."""
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    return result.output


def test_it_goes_on_with_its_layouts_and_learns_from_them(tmp_path: Path) -> None:
    shown, weights = tmp_path / "shown.jsonl", tmp_path / "agent.safetensors"
    options = ("show", "--out", str(shown), "--changes", "8")
    run(*options, "--count", "1", "--from-rules")
    begun = shown.read_text()
    run(*options, "--count", "2")
    assert shown.read_text().startswith(begun)
    cases = [*read_shown(shown)]
    assert [(case["site"], case["known"]) for case in cases] == shown_cases(2)
    assert all(case["shares"] == sorted(case["shares"], reverse=True) for case in cases)
    assert all(case["shares"][0] >= case["rule"] for case in cases)
    small = ("--visits", "4", "--checked", "1")
    printed = run("train", str(shown), "--out", str(weights), *small)
    assert "| 0 | imitation | 1 |" in printed
    assert "| 0 | draws on 4 cases | 1 |" in printed
    assert load_packaged(weights).digest != packaged_agent().digest


def test_its_own_draws_make_it_better_by_guesses() -> None:
    scenario = scenario_of(SITE)
    charge = charge_of(scenario, known=True)
    guesses = Guesses.of(packaged_surrogate(), case_for(scenario, charge))
    weights = dict(packaged_agent().network.weights)
    weights["score"] = np.zeros_like(weights["score"])  # all candidates alike

    def mean_load(agent: PackagedAgent) -> float:
        drawn = agent.sample(scenario, charge, 64)
        return float(guesses.loads([tuple(sorted(layout)) for layout in drawn]).mean())

    learnt = reinforced(weights, [(SITE, True)] * 48, packaged_surrogate(), seed=0)
    before, after = (mean_load(PackagedAgent(CandidateNetwork(own))) for own in (weights, learnt))
    assert after < 0.97 * before


def test_a_place_of_a_vehicle_is_judged_once_however_often_it_is_drawn(tmp_path: Path) -> None:
    """Again it is no further evidence, and had narrowed the interval of a lead."""
    vehicle = vehicle_document(places=2)
    assert vehicle_of(gate_site(vehicle)).places == 2
    save_scenario(gate_site(vehicle), tmp_path / "gate.toml")
    printed = run("judge", str(tmp_path / "gate.toml"), "--cache", str(tmp_path / "blasts"))
    assert "gate.toml | 2 |" in printed
