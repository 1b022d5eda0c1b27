"""`blast-env judge --run`, the score of a trained agent, run in this process."""

import importlib
import sys
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
from blast_env.site import AnyCharge, AnyScenario, Charge, load_scenario, save_scenario
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


@pytest.mark.parametrize(("learnt", "judged"), [("hidden", "visible"), ("visible", "hidden")])
def test_an_agent_of_other_threats_is_judged_with_a_word_on_it(
    tmp_path: Path, learnt: str, judged: str
) -> None:
    site = scenario_file(tmp_path)
    train(settings(site, steps=16, threat=learnt), hyperparameters(), tmp_path / "run")
    options = ("--run", tmp_path / "run", "--scenario", site, "--budget", 0, "--cell", 0.5)
    told = {}
    for threat in (learnt, judged):
        result = run("judge", *options, "--cases", 1, "--threat", threat)
        assert result.exit_code == 0, result.output
        told[threat] = "is judged on problems of the other kind" in " ".join(result.stdout.split())
    assert told == {learnt: False, judged: True}


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


# --- Kept runs are those of the same method on the same site, and names tell entries apart.


CHEAP = ("--cases", 1, "--budget", 0, "--cell", 0.5)


HEAVY = "2 if problem.case.charge.tnt_kg == 31.0 else 1"


def place_at(row: int | str, name: str = "mine") -> None:
    """Write a method that places one module in a row, as an edit of its file would leave it."""
    body = f"def go(problem, seed):\n    return (({row}, 0),)\n"
    Path(f"{name}.py").write_text(body, "utf-8")
    sys.modules.pop(name, None)
    importlib.invalidate_caches()


def rows_of(method: str, site: Path) -> tuple[list[int], str]:
    """Return the rows of what a method places, by its judged file, and what the command prints."""
    result = run("judge", "--method", method, "--scenario", site, *CHEAP, "--out", "out")
    assert result.exit_code == 0, result.output
    found = SubmissionJudgement.load(Path("out") / f"judged_{method.partition(':')[2]}.json")
    return [played.layout[0][0] for played in found.runs], result.stdout


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    return scenario_file(tmp_path)


def test_a_method_that_was_edited_runs_again(site: Path) -> None:
    """Else its author would compare the layouts of two versions and find no difference."""
    place_at(1)
    first, said = rows_of("mine:go", site)
    assert (first, "earlier call" in said) == ([1], False)
    again, said = rows_of("mine:go", site)
    assert (again, "1 of 1 runs of mine:go are those of an earlier call" in said) == ([1], True)
    place_at(2)
    edited, said = rows_of("mine:go", site)
    assert (edited, "earlier call" in said) == ([2], False)


def test_a_site_that_was_edited_is_played_again(site: Path) -> None:
    place_at(HEAVY)
    assert rows_of("mine:go", site)[0] == [1]
    save_scenario(load_scenario(site).with_charge(Charge((5.5, 6.5), 31.0)), site)
    assert rows_of("mine:go", site)[0] == [2]


def test_two_methods_with_one_name_do_not_share_their_runs(site: Path) -> None:
    """Nor is the file of one written over that of the other."""
    place_at(1)
    place_at(2, "other")
    assert rows_of("mine:go", site)[0] == [1]
    assert rows_of("other:go", site)[0] == [2]
    both = ("--method", "mine:go", "--method", "other:go", "--scenario", site, *CHEAP)
    result = run("judge", *both, "--out", "both")
    assert result.exit_code == 2
    assert "'go' and 'go' would be one file in both" in " ".join(result.output.split())
    assert not list(Path("both").glob("*.json"))
    assert run("judge", *both).exit_code == 0


def test_two_sites_with_one_name_are_told_apart(site: Path) -> None:
    """One of them was left out, without a word."""
    Path("elsewhere").mkdir()
    twin = Path("elsewhere") / site.name
    save_scenario(load_scenario(site).with_charge(Charge((5.5, 6.5), 31.0)), twin)
    place_at(1)
    options = ("--method", "mine:go", "--scenario", site, "--scenario", twin, *CHEAP)
    result = run("judge", *options)
    assert result.exit_code == 2
    assert "one of the files needs another name" in " ".join(result.output.split())


def test_a_site_of_ones_own_has_no_name_of_the_benchmark(site: Path) -> None:
    own = site.with_name("control_room.toml")
    save_scenario(load_scenario(site), own)
    place_at(1)
    result = run("judge", "--method", "mine:go", "--scenario", own, *CHEAP)
    assert result.exit_code == 2
    assert "give the file another name" in " ".join(result.output.split())
