"""`blast-env league`, run in this process, and the agents of run folders in it."""

import re
from pathlib import Path

import pandas as pd
import pytest
from blast_agents.league import find_tracks, hidden_track, known_track, sites_track
from blast_agents.league.trained import TrainedRun, check_runs
from blast_agents.training import train
from typer.testing import CliRunner, Result

from blast_env.cli import app
from blast_env.errors import BlastEnvError
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.site import load_scenario, save_scenario
from blast_env.sites import SiteSource
from tests.agents.training_runs import (
    hyperparameters,
    scenario_file,
    settings,
    small_scenario,
)
from tests.design.test_surrogate import by_hand as surrogate_by_hand
from tests.gas_sites import hut

SMALL = ("--cases", 2, "--seeds", 2, "--budgets", "4,8", "--methods", "random,genetic")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A training on the small scenario, with known threats."""
    folder = tmp_path_factory.mktemp("training")
    train(settings(scenario_file(folder)), hyperparameters(), folder / "agent")
    return folder / "agent"


def league(*arguments: str | Path | int) -> Result:
    return CliRunner().invoke(app, ["league", *(str(argument) for argument in arguments)])


def test_it_has_help_and_is_listed() -> None:
    assert "league" in CliRunner().invoke(app, ["--help"]).stdout
    result = league("--help")
    assert result.exit_code == 0
    words = result.stdout.replace("│", " ").split()
    assert "known, hidden, vehicle, sites, item_sites, large_sites or all" in " ".join(words)


def test_all_enter_and_all_is_written(run: Path, tmp_path: Path) -> None:
    out, scenario = tmp_path / "out", run / "scenario.toml"
    result = league(*SMALL, "--scenario", scenario, "--run", run, "--out", out)
    assert result.exit_code == 0, result.output
    assert "known_small: up to 48 blasts of searches and" in result.stdout
    summary = pd.read_csv(out / "known_small_summary.csv")
    assert list(summary["entry"]) == [
        "no barrier",
        "random layout",
        "wall near the charge",
        "wall in the middle",
        "wall near the building",
        "most sight lines cut",
        "random, 4 blasts",
        "random, 8 blasts",
        "genetic, 4 blasts",
        "genetic, 8 blasts",
        "MaskablePPO (agent)",
    ]
    assert (summary["cases"] == 2).all()
    assert len(pd.read_csv(out / "known_small_cases.csv")) == 22
    for name in ("league.md", "known_small.png"):
        assert f"wrote {out / name}" in result.stdout
    for other in ("wall near the", "(random|genetic), [48] blasts"):
        assert re.search(rf"\(agent\) minus {other}", " ".join(result.stdout.split()))


def test_a_surrogate_enters_by_itself_as_a_search_and_behind_an_agent(
    run: Path, tmp_path: Path
) -> None:
    path = surrogate_by_hand().save(tmp_path / "surrogate.json")
    few = ("--cases", 1, "--seeds", 2, "--methods", "", "--agent-search", 6)
    site = ("--scenario", run / "scenario.toml", "--out", tmp_path / "out")
    result = league(*few, *site, "--surrogate", path, "--run", run)
    assert result.exit_code == 0, result.output
    summary = pd.read_csv(tmp_path / "out" / "known_small_summary.csv")
    blasts = dict(zip(summary["entry"].tolist(), summary["blasts"].tolist(), strict=True))
    assert blasts["surrogate"] == surrogate_by_hand().fit.blasts
    assert 0 < blasts["surrogate, 6 blasts"] <= 6
    assert 0 < blasts["MaskablePPO (agent) with search by the surrogate, 6 blasts"] <= 6
    ranked = blasts["MaskablePPO (agent), ranked by the surrogate"]
    assert ranked == blasts["MaskablePPO (agent)"] + surrogate_by_hand().fit.blasts
    result = league(*few, *site, "--surrogate", tmp_path / "none.json")
    assert result.exit_code == 2
    assert "none.json: there is no such file" in " ".join(result.output.split())


@pytest.mark.parametrize("text", ["0", "-3", "50,50", "a", "1.5"])
@pytest.mark.parametrize("flag", ["--budgets", "--agent-search"])
def test_budgets_that_are_none(flag: str, text: str, tmp_path: Path) -> None:
    site = ("--scenario", scenario_file(tmp_path), "--out", tmp_path / "out")
    result = league(*SMALL, *site, f"{flag}={text}")
    assert result.exit_code == 2
    expected = f"{flag} is {text!r}, must be different whole numbers from 1 on with commas between"
    assert expected in " ".join(result.output.split())


def test_called_again_it_has_nothing_left_to_simulate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = scenario_file(tmp_path)
    arguments = (*SMALL, "--track", "hidden", "--scenario", path, "--out", tmp_path / "out")
    first = league(*arguments)
    assert first.exit_code == 0, first.output
    assert (
        "Reduction of the impulse: one case; intervals and worst case are over its 8"
        in first.stdout
    )

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a blast is simulated")

    monkeypatch.setattr(BlastEvaluator, "loads_of_many", refuse)
    second = league(*arguments)
    assert second.exit_code == 0, second.output
    assert "up to 0 blasts in all" in second.stdout
    assert "4 of 4 searches are complete already" in second.stdout


def test_a_run_says_what_it_is_for_and_what_it_cost(run: Path) -> None:
    trained = TrainedRun.load(run)
    scenario = small_scenario()
    assert trained.is_for(known_track(scenario, 1, 1))
    assert not trained.is_for(hidden_track(scenario, 1))
    assert not trained.is_for(sites_track([next(iter(SiteSource.held_out(1)))], 1))
    rollouts, evaluations = (pd.read_csv(run / f"{n}.csv") for n in ("rollouts", "evaluations"))
    selection = (len(evaluations) + 1) * 2  # two cases each, and the same without a barrier
    assert trained.training.blasts == rollouts["blasts"].iloc[-1] + selection
    assert trained.training.seconds > 0.0


def test_an_agent_for_none_of_the_tracks_is_refused(run: Path, tmp_path: Path) -> None:
    changed = tmp_path / "changed.toml"
    save_scenario(small_scenario(stock=5), changed)
    tracks = find_tracks("known", 1, 1, scenarios=[str(changed)])
    with pytest.raises(BlastEnvError, match=r"trained for a visible threat on .*\(known_small\)"):
        check_runs([TrainedRun.load(run)], tracks)
    check_runs(
        [TrainedRun.load(run)], [*tracks, known_track(load_scenario(run / "scenario.toml"), 1, 1)]
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--track", "knwon"), "did you mean 'known'"),
        (("--methods", "genetik"), "did you mean 'genetic'"),
        (("--budgets", "50;200"), "must be different whole numbers from 1 on with commas"),
        (("--cases", "0"), "cases is 0"),
        (("--scenario", "cortyard"), "did you mean 'courtyard'"),
        (("--engine", "evnt"), "did you mean 'event'"),
        (("--run", "nowhere"), "nowhere: is no run folder"),
        (("--out", "file"), "cannot be a folder"),
    ],
)
def test_bad_input_is_one_clear_message(
    arguments: tuple[str, ...], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    scenario_file(tmp_path)
    few = ("--scenario", "small.toml") if "--scenario" not in arguments else ()
    result = league("--out", "out", "--cases", 1, "--seeds", 1, *few, *arguments)
    assert result.exit_code == 2
    assert words in " ".join(result.stderr.split())
    assert "Traceback" not in result.output


def test_a_league_says_that_there_are_fewer_cases(tmp_path: Path) -> None:
    """Blasts of gas dynamics have no noise, so that a fixed charge is one case."""
    save_scenario(hut(), tmp_path / "hut.toml")
    result = league(
        *("--cases", 8, "--seeds", 1, "--methods", "random", "--budgets", 1, "--engine", "gas"),
        *("--scenario", tmp_path / "hut.toml", "--out", tmp_path / "out"),
    )
    assert result.exit_code == 0, result.output
    shown = " ".join(result.stdout.split())
    assert "note: cases of known_hut: 1, not 8: the scenario has no more charges" in shown
    assert "Known threat at the only place: hut" in shown
    assert "these are all fixed charges of the site" in shown
