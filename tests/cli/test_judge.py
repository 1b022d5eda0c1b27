"""`blast-env judge --run`, the score of a trained agent, run in this process."""

from pathlib import Path
from typing import Any

import pytest
from blast_agents.training import train
from blast_agents.training.agent import PolicyAgent

from blast_env.benchmark import SubmissionJudgement, site_problems
from blast_env.evaluation import BlastLoads
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.geometry import Layout
from blast_env.layout import check_layout
from blast_env.site import AnyCharge, AnyScenario
from tests.agents.training_runs import hyperparameters, scenario_file, settings
from tests.cli.running import run
from tests.evaluation.engines.shade import ShadeEngine


@pytest.fixture(autouse=True)
def _loads_by_a_formula(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the loads of gas from a formula: what is done with them is looked at."""
    shade = ShadeEngine()

    def loads(_: GasEngine, *blast: Any) -> BlastLoads:
        return shade.loads(*blast)

    monkeypatch.setattr(GasEngine, "loads", loads)
    monkeypatch.setattr(GasEngine, "record", Engine.record)


def judged_agent(folder: Path, site: Path, *given: Any, **changes: Any) -> SubmissionJudgement:
    """Train an agent and judge it by gas dynamics, without a search; return its runs."""
    train(settings(site, steps=16, **changes), hyperparameters(), folder / "run")
    options = ("--run", folder / "run", "--scenario", site, "--budget", 0, "--cell", 0.5)
    result = run("judge", *options, *given, "--out", folder / "out")
    assert result.exit_code == 0, result.output
    assert "best rule" in result.stdout
    found = SubmissionJudgement.load(folder / "out" / "judged_agent_run.json")
    assert found.reduction(0).low <= found.reduction(0).value <= found.reduction(0).high
    return found


def test_an_agent_of_visible_charges_gets_each_charge_as_a_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it proposes is looked at as it does: a twin may decide ties by another rounding."""
    site = scenario_file(tmp_path)
    propose, proposed = PolicyAgent.propose, dict[AnyCharge | None, Layout]()

    def watched(
        agent: PolicyAgent, scenario: AnyScenario, charge: AnyCharge | None = None
    ) -> Layout:
        proposed[charge] = propose(agent, scenario, charge)
        return proposed[charge]

    monkeypatch.setattr(PolicyAgent, "propose", watched)
    found = judged_agent(tmp_path, site, "--cases", 2)
    problems = site_problems(site, 2)
    assert [played.problem for played in found.runs] == [problem.name for problem in problems]
    for played, problem in zip(found.runs, problems, strict=True):
        assert played.layout == tuple(sorted(proposed[problem.case.charge]))
        assert played.blasts == 0


def test_generated_sites_are_held_out_from_training(tmp_path: Path) -> None:
    """A budget that is given twice counts once."""
    found = judged_agent(tmp_path, Path("sites"), "--cases", 2, "--budget", 0)
    assert len(found.runs) == 2
    problems = {site_problem.name: site_problem for site_problem in site_problems("sites", 2)}
    assert [*found.problems] == [*problems]
    for played in found.runs:
        assert check_layout(problems[played.problem].scenario, played.layout)


def test_an_entry_that_the_packaged_agent_begins_says_so(tmp_path: Path) -> None:
    options = ("--scenario", "item_sites", "--cases", 1, "--budget", 0, "--cell", 0.5)
    result = run("judge", "--method", "surrogate", *options, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    assert SubmissionJudgement.load(tmp_path / "judged_surrogate_from_agent.json").runs
