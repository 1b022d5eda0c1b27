"""The demonstration with a training of a second, and its verdict on known loads."""

import shutil
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from blast_agents.league import RandomLayout
from blast_agents.training.run_folder import RunFolder

from blast_env.errors import BlastEnvError
from blast_env.evaluation import SeedRange
from blast_env.export import SUFFIXES
from blast_env.scenario import Placement
from scripts.demo import AGENT, DemoSettings, demonstrate
from scripts.demo_comparison import Comparison
from tests.agents.league_cases import TRAINING, result, standings
from tests.agents.training_runs import SMALL, scenario_file, small_scenario


def tiny(folder: Path) -> DemoSettings:
    return DemoSettings(
        out=folder / "out",
        scenario=str(scenario_file(folder)),
        steps=32,
        changes=SMALL,
        evaluation_interval=1,
        evaluation_cases=2,
        threats=4,
        processes=1,
        film_width_px=640,
        frames_per_s=2.0,
    )


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[DemoSettings, Comparison, str]:
    """The settings of a demonstration, what it found and what it printed."""
    settings = tiny(tmp_path_factory.mktemp("demo"))
    with redirect_stdout(StringIO()) as printed:
        comparison = demonstrate(settings)
    return settings, comparison, printed.getvalue()


def test_it_trains_compares_and_films(first: tuple[DemoSettings, Comparison, str]) -> None:
    settings, comparison, printed = first
    assert comparison.verdict in printed
    assert [line.split()[1] for line in printed.splitlines() if line.startswith("  after")] == [
        "4",
        "8",
    ]
    names = [each.name for each in comparison.standings.results]
    assert names == [
        "no barrier",
        "random layout",
        "wall near the charge",
        "wall near the building",
        "most sight lines cut",
        AGENT,
    ]
    assert all(name in printed for name in names)
    files = ["run/learning_curve.png", "side_by_side.mp4", "collisions.xlsx"]
    files += [f"layout{suffix}" for suffix in SUFFIXES]
    for name in files:
        assert f"wrote {settings.out / name}" in printed
        assert (settings.out / name).stat().st_size > 0
    seeds = {case.threats[0].seed for case in comparison.standings.track.cases}
    assert len(seeds) == 4
    assert all(seed in SeedRange.JUDGEMENT.value for seed in seeds)
    for proposal in comparison.agent.proposals:
        assert set(Placement.of(small_scenario(), proposal.layout).cells) == set(proposal.layout)


def test_it_can_be_run_again_but_removes_nothing_of_others(
    tmp_path: Path, first: tuple[DemoSettings, Comparison, str]
) -> None:
    settings = replace(first[0], out=tmp_path / "out")
    shutil.copytree(first[0].out, settings.out)
    assert demonstrate(settings).verdict == first[1].verdict
    (RunFolder(settings.run).path / "config.yaml").unlink()
    with pytest.raises(BlastEnvError, match="must be empty"):
        demonstrate(settings)


def comparison_of(agent: list[float], random: list[float]) -> Comparison:
    """Loads by hand, a threat each; without a barrier it is 10 Pa s everywhere."""
    return Comparison(
        standings(
            [[10.0]] * len(agent),
            result(RandomLayout.name, [[each] for each in random]),
            result(AGENT, [[each] for each in agent], training=TRAINING),
        )
    )


def test_the_verdict_needs_intervals_that_do_not_overlap() -> None:
    clear = comparison_of([2.0, 2.1, 1.9, 2.0], [7.0, 7.2, 6.8, 7.0])
    assert clear.has_learnt
    assert "takes off 50.0 percentage points more" in clear.verdict
    # Better in every case, so the paired difference is sure, but no more than the scatter.
    close = comparison_of([1.0, 4.0, 2.0, 8.0], [1.5, 4.5, 2.5, 8.5])
    assert close.standings.difference(close.agent, close.random).low > 0.0
    assert not close.has_learnt
    assert close.verdict.startswith("Not shown that the agent has learnt")
    worse = comparison_of([7.0, 7.2, 6.8, 7.0], [2.0, 2.1, 1.9, 2.0])
    assert not worse.has_learnt
    assert "takes off -50.0 percentage points more" in worse.verdict
    assert comparison_of([2.0], [7.0]).verdict.startswith("No verdict")


def test_a_row_says_by_how_much_the_agent_is_ahead() -> None:
    """Paired: 20 points in every case leave no spread, however much the cases differ."""
    bare, random, agent = comparison_of([1.0, 4.0, 2.0, 6.0], [3.0, 6.0, 4.0, 8.0]).rows()
    assert bare[:5] == ("no barrier", "10", "0.0 %", "0.0 % to 0.0 %", "67.5 %")
    assert random[:3] == (RandomLayout.name, "5", "47.5 %")
    assert random[4:6] == ("20.0 %", "20.0 % to 20.0 %")
    assert agent[4:] == ("-", "-", "10.0")
