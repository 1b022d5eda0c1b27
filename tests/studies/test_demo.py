"""The demonstration with a training of a moment, and its verdict on known loads."""

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from blast_env.design.search import ProposerKind, proposers
from blast_env.evaluation import Evaluation, LoadCase, LoadCaseSet, SeedRange
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.engines import find_engine
from blast_env.evaluation.record import BlastRecord
from blast_env.io.export import SUFFIXES
from blast_env.layout import LayoutState
from blast_env.site import Charge, Scenario, save_scenario
from blast_env.surrogate import site_of
from studies.demo import (
    AGENT,
    NOTHING,
    PACKAGED,
    RANDOM,
    AgentComparison,
    DemoSettings,
    RewardCorrection,
    demonstrate,
)
from tests.catalogue_sites import WALL, yard_document
from tests.evaluation.cases import loads_of

POINT = {"kind": "point", "position_m": [2.0, 6.0], "tnt_kg": 1.0}
"""A small charge, whose blasts are soon over."""

CHARGE = Charge((2.0, 6.0), 1.0)
SITE = Scenario.from_document(yard_document() | {"charge": [POINT]}, "yard")


def test_it_trains_compares_and_films(tmp_path: Path) -> None:
    save_scenario(SITE, tmp_path / "yard.toml")
    settings = DemoSettings(
        out=tmp_path / "out",
        scenario=str(tmp_path / "yard.toml"),
        rounds=1,
        steps=8,
        draws=1,
        blasted=1,
        masses_kg=(0.5, 2.0),
        processes=1,
        film_width_px=480,
        frames_per_s=0.5,
    )
    with redirect_stdout(StringIO()) as output:
        comparison = demonstrate(settings)
    printed = output.getvalue()
    assert comparison.verdict in printed
    assert "judged by the engine gas" in printed
    assert sum(line.startswith("  after") for line in printed.splitlines()) == 2
    names = list(comparison.results)
    by_rule = [row.title for row in proposers(ProposerKind.RULE, suiting=[SITE]).values()]
    assert names == ["no barrier", "random layout", *by_rule, PACKAGED, AGENT]
    assert all(name in printed for name in (*names, "best rule for each case"))
    files = ["learning_curve.png", "side_by_side.mp4", "facade.png", "site.png", "loads.xlsx"]
    together = (suffix for suffix in SUFFIXES if suffix != ".ifc")  # its extra is large
    files += [*(f"layout{suffix}" for suffix in together), "agent.zip"]
    for name in files:
        assert f"wrote {settings.out / name}" in printed
        assert (settings.out / name).stat().st_size > 0
    cases = comparison.agent.cases
    assert [case.scenario.charge[0].tnt_kg for case in cases] == [0.5, 2.0]
    assert all(case.threats[0].seed in SeedRange.TEST.value for case in cases)
    for layout in comparison.agent.layouts:
        assert LayoutState.of(SITE, layout).layout == layout


def test_a_blast_corrects_the_guess_of_its_layout_and_less_those_of_others() -> None:
    reward, other = RewardCorrection(site_of(SITE)), WALL[2:]
    assert reward.corrected(WALL, 0.6) == 0.6
    reward.learn(WALL, guessed=0.6, reduction=0.4)
    reward.learn((), guessed=0.1, reduction=0.1)
    assert reward.corrected(WALL, 0.6) == pytest.approx(0.4, abs=0.02)
    assert reward.corrected(WALL, 0.6) < reward.corrected(WALL[:1], 0.6) < 0.6
    assert abs(reward.corrected(other, 0.1) - 0.1) < 0.2


def comparison_of(
    agent: list[float],
    random: list[float],
    rule: list[float] | None = None,
    other: list[float] | None = None,
) -> AgentComparison:
    """Loads by hand, a threat each; without a barrier it is 10 Pa s everywhere."""
    cases = tuple(LoadCaseSet(SITE, (LoadCase(CHARGE, seed),)) for seed in range(len(agent)))

    def of(loads: list[float]) -> Evaluation:
        layouts, engine = {"none": (), "layout": ()}, find_engine("gas")

        def blasts(case: LoadCaseSet, load: float) -> Blasts:
            sides = zip(layouts, (10.0, load), strict=True)
            records = {name: (BlastRecord(loads_of(SITE, pa_s)),) for name, pa_s in sides}
            return Blasts(case, layouts, records, engine)

        return Evaluation(tuple(map(blasts, cases, loads)))

    rules = {"wall near the charge": rule or random, "wall near the building": other or random}
    methods = {NOTHING: [10.0] * len(agent), RANDOM: random, **rules, AGENT: agent}
    results = {name: of(loads) for name, loads in methods.items()}
    return AgentComparison(results, tuple(rules), "gas")


def test_the_verdict_needs_an_interval_above_zero() -> None:
    ahead = comparison_of([2.0, 2.1, 1.9, 2.0], [7.0, 7.2, 6.8, 7.0])
    assert ahead.is_ahead
    assert "takes off 80.0 % of the load" in ahead.verdict
    assert "It is ahead of the rules: +50.0 points" in ahead.verdict
    close = comparison_of([1.0, 5.0, 2.0, 8.0], [1.5, 4.5, 2.5, 8.5])
    assert not close.is_ahead
    assert "It is not shown to be ahead of the rules" in close.verdict
    assert comparison_of([2.0], [7.0]).verdict.startswith("No verdict")


def test_the_best_rule_for_each_case_is_one_that_nobody_can_name_beforehand() -> None:
    """The two rules are best in two cases each; the agent is between them and the best."""
    rule, other = [2.0, 2.0, 6.0, 6.0], [6.0, 6.0, 2.0, 1.0]
    comparison = comparison_of([3.0, 3.0, 3.0, 3.0], [8.0, 8.0, 8.0, 8.0], rule, other)
    assert comparison.best_rule == "wall near the building"
    best = comparison.rows()[-2]
    assert best[:3] == ("best rule for each case", "2", "82.5 %")
    assert best[4] == "-12.5 %"
    assert "+7.5 points" in comparison.verdict
    assert not comparison.is_ahead
