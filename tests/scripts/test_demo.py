"""The demonstration with a training of a second, and its verdict on known loads."""

from pathlib import Path

import numpy as np
import pytest

from agents.evaluation import CaseOutcome, CasesEvaluation
from agents.proposal import Layout
from agents.training.held_out import Case
from agents.training.run_folder import RunFolder
from agents.unseen_cases import FIRST_SEED
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, ThreatOutcome, draw_threats
from blast_env.export import SUFFIXES
from blast_env.scenario import Charge, Placement, Scenario
from scripts.demo import DemoSettings, demonstrate
from scripts.demo_comparison import AGENT, RANDOM, Comparison, Entry, compare
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


def test_it_trains_compares_and_films(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = tiny(tmp_path)
    comparison = demonstrate(settings)
    printed = capsys.readouterr().out
    assert comparison.verdict in printed
    assert [line.split()[1] for line in printed.splitlines() if line.startswith("  after")] == [
        "4",
        "8",
    ]
    for words in ("no barrier", AGENT, RANDOM, "wall near the charge", "wall near the building"):
        assert words in printed
    files = ["run/learning_curve.png", "side_by_side.mp4", "collisions.xlsx"]
    files += [f"layout{suffix}" for suffix in SUFFIXES]
    for name in files:
        assert f"wrote {settings.out / name}" in printed
        assert (settings.out / name).stat().st_size > 0
    seeds = [each.case.threat.seed for each in comparison.agent.evaluation.outcomes]
    assert seeds == [FIRST_SEED + number for number in range(4)]


def test_it_can_be_run_again_but_removes_nothing_of_others(tmp_path: Path) -> None:
    settings = tiny(tmp_path)
    first, second = demonstrate(settings), demonstrate(settings)
    assert first.verdict == second.verdict
    (RunFolder(settings.run).path / "config.yaml").unlink()
    with pytest.raises(BlastEnvError, match="must be empty"):
        demonstrate(settings)


class _Nothing:
    """An agent that builds nothing, whatever it is asked."""

    def propose(self, scenario: Scenario, charge: Charge | None = None) -> Layout:
        return Placement.empty(scenario if charge is None else scenario.with_charge(charge)).cells


def cases(count: int) -> list[Case]:
    scenario = small_scenario()
    evaluator = BlastEvaluator(scenario, "event")
    return [Case(evaluator, threat, True) for threat in draw_threats(scenario, range(count))]


def test_all_methods_meet_the_same_blasts() -> None:
    shares: list[float] = []
    comparison = compare(_Nothing(), cases(3), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    for entry in comparison.entries:
        for own, other in zip(
            entry.evaluation.outcomes, comparison.agent.evaluation.outcomes, strict=True
        ):
            assert own.case is other.case
            assert own.outcome.unprotected_impulse_psi_s == other.outcome.unprotected_impulse_psi_s
            assert Placement.of(small_scenario(), own.layout).cells == own.layout
    layouts = [each.layout for each in comparison.random.evaluation.outcomes]
    assert len(set(layouts)) == 3
    assert comparison.agent.evaluation.reduction == (0.0, 0.0, 0.0)
    assert not comparison.has_learnt
    assert comparison.verdict.startswith("Not shown that the agent has learnt")


def evaluation(impulses: list[float], own: list[Case]) -> CasesEvaluation:
    """Loads by hand; without a barrier it is 10 psi s everywhere."""
    outcomes = [
        CaseOutcome(case, (), ThreatOutcome(case.threat, impulse, 10.0, True))
        for case, impulse in zip(own, impulses, strict=True)
    ]
    return CasesEvaluation(tuple(outcomes), 0.8)


def comparison_of(agent: list[float], random: list[float]) -> Comparison:
    own = cases(len(agent))
    return Comparison(
        (Entry(AGENT, evaluation(agent, own), 1.0), Entry(RANDOM, evaluation(random, own), 1.0))
    )


def test_the_verdict_needs_intervals_that_do_not_overlap() -> None:
    clear = comparison_of([2.0, 2.1, 1.9, 2.0], [7.0, 7.2, 6.8, 7.0])
    assert clear.has_learnt
    assert "takes off 50.0 percentage points more" in clear.verdict
    # Better in every case, so the paired difference is sure, but no more than the scatter.
    close = comparison_of([1.0, 4.0, 2.0, 8.0], [1.5, 4.5, 2.5, 8.5])
    assert close.gain_over(close.random).low > 0.0
    assert not close.has_learnt
    worse = comparison_of([7.0, 7.2, 6.8, 7.0], [2.0, 2.1, 1.9, 2.0])
    assert not worse.has_learnt
    assert "takes off -50.0 percentage points more" in worse.verdict
    assert comparison_of([2.0], [7.0]).verdict.startswith("No verdict")


def test_a_gain_is_the_paired_difference_of_the_reductions() -> None:
    agent, random = [1.0, 4.0, 2.0, 8.0], [2.0, 6.0, 3.0, 9.0]
    comparison = comparison_of(agent, random)
    gain = comparison.gain_over(comparison.random)
    difference = np.subtract(random, agent) / 10.0
    assert gain.value == pytest.approx(difference.mean())
    half = 3.182446 * difference.std(ddof=1) / 2.0  # Student's t with 3 degrees of freedom
    assert (gain.low, gain.high) == pytest.approx((gain.value - half, gain.value + half), rel=1e-5)
    with pytest.raises(BlastEnvError, match="must have the same ones"):
        comparison.agent.evaluation.gain_over(evaluation(agent, cases(4)))
