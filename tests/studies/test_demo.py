"""The demonstration with a training of a second, and its verdict on known loads."""

import shutil
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from blast_env.design.search import ProposerKind, proposers
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Case, Comparison, SeedRange, Threat
from blast_env.io.export import SUFFIXES
from blast_env.layout import Placement
from blast_env.site import save_scenario
from blast_env.site.scene import Charge
from studies.demo import (
    AGENT,
    NOTHING,
    RANDOM,
    AgentComparison,
    DemoSettings,
    clear,
    demonstrate,
)
from tests.agents.test_self_labelling import SMALL, wide_yard

SITE = wide_yard(tnt_kg=1.0)
"""A small charge, whose blasts are soon over."""
CHARGE = Charge((1.7, 5.2), 5.0)


def tiny(folder: Path) -> DemoSettings:
    save_scenario(SITE, folder / "yard.toml")
    return DemoSettings(
        out=folder / "out",
        scenario=str(folder / "yard.toml"),
        steps=21,  # the rules, and one round
        changes={**SMALL, "cases": 2, "samples": 0, "neighbours": 1, "borrowed": 0},
        evaluation_cases=2,
        threats=2,
        processes=1,
        film_width_px=640,
        frames_per_s=2.0,
    )


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[DemoSettings, AgentComparison, str]:
    """The settings of a demonstration, what it found and what it printed."""
    settings = tiny(tmp_path_factory.mktemp("demo"))
    with redirect_stdout(StringIO()) as printed:
        comparison = demonstrate(settings)
    return settings, comparison, printed.getvalue()


def test_it_trains_compares_and_films(first: tuple[DemoSettings, AgentComparison, str]) -> None:
    settings, comparison, printed = first
    assert comparison.verdict in printed
    assert "judged by the engine gas" in printed
    assert sum(line.startswith("  after") for line in printed.splitlines()) == 2
    names = list(comparison.results)
    by_rule = [
        row.title for row in proposers(ProposerKind.RULE).values() if "posts" not in row.title
    ]
    assert names == ["no barrier", "random layout", *by_rule, AGENT]
    assert all(name in printed for name in (*names, "best rule for each case"))
    files = ["run/learning_curve.png", "side_by_side.mp4", "facade.png", "site.png", "loads.xlsx"]
    files += [f"layout{suffix}" for suffix in SUFFIXES]
    for name in files:
        assert f"wrote {settings.out / name}" in printed
        assert (settings.out / name).stat().st_size > 0
    seeds = {case.threats[0].seed for case in comparison.agent.cases}
    assert len(seeds) == 2
    assert all(seed in SeedRange.JUDGEMENT.value for seed in seeds)
    for layout in comparison.agent.layouts:
        assert Placement.of(SITE, layout).layout == layout


def test_it_clears_its_own_run_and_nothing_of_others(
    tmp_path: Path, first: tuple[DemoSettings, AgentComparison, str]
) -> None:
    settings = replace(first[0], out=tmp_path / "out")
    shutil.copytree(first[0].out, settings.out)
    clear(settings.run)
    assert not settings.run.exists()
    settings.run.mkdir()
    (settings.run / "letter.txt").write_text("mine")
    with pytest.raises(BlastEnvError, match="must be empty"):
        demonstrate(settings)
    assert (settings.run / "letter.txt").read_text() == "mine"


def comparison_of(
    agent: list[float],
    random: list[float],
    rule: list[float] | None = None,
    other: list[float] | None = None,
) -> AgentComparison:
    """Loads by hand, a threat each; without a barrier it is 10 Pa s everywhere."""
    cases = tuple(Case(SITE, (Threat(CHARGE, seed),)) for seed in range(len(agent)))
    bare = np.full((len(agent), 1), 10.0)

    def of(loads: list[float]) -> Comparison:
        layouts = ((),) * len(agent)
        return Comparison(cases, layouts, np.array(loads)[:, None], bare, np.ones_like(bare, bool))

    rules = {"wall near the charge": rule or random, "wall near the building": other or random}
    methods = {NOTHING: [10.0] * len(agent), RANDOM: random, **rules, AGENT: agent}
    results = {name: of(loads) for name, loads in methods.items()}
    return AgentComparison(results, tuple(rules), "gas")


def test_the_verdict_needs_intervals_that_do_not_overlap() -> None:
    clear = comparison_of([2.0, 2.1, 1.9, 2.0], [7.0, 7.2, 6.8, 7.0])
    assert clear.has_learnt
    assert "takes off 50.0 percentage points more" in clear.verdict
    # Better in every case, so the paired difference is sure, but no more than the scatter.
    close = comparison_of([1.0, 4.0, 2.0, 8.0], [1.5, 4.5, 2.5, 8.5])
    assert close.agent.difference(close.results[RANDOM]).low > 0.0
    assert not close.has_learnt
    assert close.verdict.startswith("Not shown that the agent has learnt")
    worse = comparison_of([7.0, 7.2, 6.8, 7.0], [2.0, 2.1, 1.9, 2.0])
    assert not worse.has_learnt
    assert "takes off -50.0 percentage points more" in worse.verdict
    assert comparison_of([2.0], [7.0]).verdict.startswith("No verdict")


def test_a_row_says_by_how_much_the_agent_is_ahead() -> None:
    """Paired: 20 points in every case leave no spread, however much the cases differ."""
    bare, random, *_, agent = comparison_of([1.0, 4.0, 2.0, 6.0], [3.0, 6.0, 4.0, 8.0]).rows()
    assert bare[:5] == ("no barrier", "10", "0.0 %", "0.0 % to 0.0 %", "67.5 %")
    assert random[:3] == (RANDOM, "5", "47.5 %")
    assert random[4:6] == ("20.0 %", "20.0 % to 20.0 %")
    assert agent[4:] == ("-", "-")


def test_the_best_rule_for_each_case_is_one_that_nobody_can_name_beforehand() -> None:
    """The two rules are best in two cases each; the agent is between them and the best."""
    rule, other = [2.0, 2.0, 6.0, 6.0], [6.0, 6.0, 2.0, 1.0]
    comparison = comparison_of([3.0, 3.0, 3.0, 3.0], [8.0, 8.0, 8.0, 8.0], rule, other)
    assert comparison.best_rule == "wall near the building"
    best = comparison.rows()[-2]
    assert best[:3] == ("best rule for each case", "2", "82.5 %")
    assert best[4] == "-12.5 %"
    assert "+7.5 points beside the best rule, 'wall near the building'" in comparison.verdict
