"""Scores between best rule and best known; what was submitted is played again."""

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from blast_env.benchmark import (
    BenchmarkProblem,
    ReferenceLayout,
    Run,
    RunJudgement,
    ScoreReference,
    Submission,
    SubmissionJudgement,
    judge,
    make,
    shipped_standings,
    site_problems,
    standings_page,
    standings_tables,
    stored_references,
)
from blast_env.benchmark.judging import read_submission
from blast_env.cli import app
from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout, Piece
from blast_env.site import Scenario
from blast_env.sites import kerb_site, street_site
from tests.benchmark.row import RowEngine

NAME = "control_room-known-v2"


def wall(row: int) -> tuple[Piece, ...]:
    return (Piece(row, 0, "low_wall", True),)


REFERENCES = {
    NAME: ScoreReference(
        "", "row 1", {}, ReferenceLayout("rule", wall(16)), ReferenceLayout("best", wall(12))
    )
}


def judged(*runs: Run) -> SubmissionJudgement:
    return judge(Submission("own", runs), None, engine=RowEngine(), references=REFERENCES)


def run(row: int, budget: int = 0, seed: int = 0) -> Run:
    return Run(NAME, budget, seed, budget, wall(row))


def test_the_best_rule_scores_nothing_and_the_best_known_all() -> None:
    """1 - 0.1 / (1 + distance) of the row: 0.98 for the rule, 0.9 for the best."""
    scores = [judged(run(row)).score(0).value for row in (16, 20, 12, 13)]
    assert scores[:3] == pytest.approx([0.0, 0.0, 1.0])
    assert scores[3] == pytest.approx((0.98 - 0.95) / (0.98 - 0.9))


def test_the_interval_is_over_the_seeds() -> None:
    """Scores 0 and 1, Student's t with one degree of freedom: 0.5 +- 12.706 * 0.5."""
    score = judged(run(16, 50, 0), run(12, 50, 1)).score(50)
    assert score.value == pytest.approx(0.5)
    assert score.high - score.value == pytest.approx(12.706 * 0.5, rel=1e-4)
    assert judged(run(12, 50)).score(50).low != judged(run(12, 50)).score(50).low  # NaN


def test_a_layout_that_is_better_than_the_best_known_shows() -> None:
    best = RunJudgement(NAME, 0, 0, 0, wall(12), 0.5, 0.7, 0.6)
    assert best.score == pytest.approx(2.0)
    assert replace(best, best=0.7, share=0.7).score == 1.0
    assert replace(best, best=0.7, share=0.71).score == 0.0


@pytest.mark.parametrize(
    ("runs", "message"),
    [
        ((run(99),), "runs\\[0\\]: control_room-known-v2: .*outside"),
        ((run(1), run(2)), "appears twice"),
        ((replace(run(1), blasts=1),), "1 blasts were spent, the budget is 0"),
        ((replace(run(1), problem="none-v1"),), "there is no problem 'none-v1'"),
    ],
)
def test_a_submission_of_no_use_is_refused(
    runs: tuple[Run, ...], message: str, tmp_path: Path
) -> None:
    with pytest.raises(BlastEnvError, match=message):
        judged(*runs)
    path = Submission("own", runs).save(tmp_path / "own.json")
    with pytest.raises(BlastEnvError, match=message):
        Submission.load(path)


def test_what_was_judged_is_read_back_and_can_be_judged_again(tmp_path: Path) -> None:
    own = judged(run(13), run(14, 50))
    assert SubmissionJudgement.load(own.save(tmp_path / "own.json")) == own
    assert judge(own.submission, None, engine=RowEngine(), references=REFERENCES) == own
    (tmp_path / "own.json").write_text('{"method": "own", "runs": []}')
    with pytest.raises(BlastEnvError, match=r"own\.json: "):
        SubmissionJudgement.load(tmp_path / "own.json")


def test_tables_have_the_best_method_first_and_what_it_takes_off() -> None:
    """Shares of 0.967 and 0.9 behind the walls, 0.98 behind the rule's."""
    few = replace(judged(run(14, 50), run(14, 50, 1)), method="few")
    best = replace(judged(run(12, 50)), method="best")
    (table,) = standings_tables((few, best))
    assert [(row[0], *row[3:]) for row in table.rows] == [
        ("best known", "10.0", "+8.0", "", "1.00"),
        ("best", "10.0", "+8.0", "1.000", "1.00"),
        ("few", "3.3", "+1.3", "1.000", "0.17 (0.17 to 0.17)"),
        ("best rule", "2.0", "+0.0", "", "0.00"),
    ]
    page = standings_page((replace(few, note="a | b"), best))
    assert r"| few | a \| b |" in page
    assert f"{NAME}; cells of 0.5 m" in page


def test_the_best_rule_has_the_score_of_an_entry_with_the_same_layout() -> None:
    """Where no better one is known that is 1: beside a best rule with 0 it looked like a lead."""
    same = replace(judged(run(16)).runs[0], best=0.98)
    entry = replace(judged(run(16)), runs=(same,))
    (table,) = standings_tables((entry,))
    assert {(row[4], row[6]) for row in table.rows} == {("+0.0", "1.00")}


def test_the_command_takes_both_kinds_of_files_and_writes_the_page(tmp_path: Path) -> None:
    own = judged(run(13), run(14, 50))
    for path in (own.save(tmp_path / "judged.json"), own.submission.save(tmp_path / "own.json")):
        assert read_submission(path) == own.submission
    page = tmp_path / "page.md"
    result = CliRunner().invoke(app, ["judge", "--page", str(page)])
    assert result.exit_code == 0, result.output
    assert page.read_text("utf-8") == standings_page(shipped_standings())


def test_standings_that_come_with_the_package_are_of_its_problems() -> None:
    known = stored_references()
    for shipped_standing in shipped_standings():
        assert set(shipped_standing.problems) <= set(known)
        assert all(0 <= made.blasts <= made.budget for made in shipped_standing.runs)


def test_the_page_of_the_documentation_shows_them() -> None:
    page = Path(__file__).parents[2] / "docs/researchers/standings.md"
    assert page.read_text("utf-8") == standings_page(shipped_standings())


def test_pages_for_researchers_say_what_the_standings_say() -> None:
    """The search that the packaged agent begins, by its points and scores, and who found what."""
    entries = {entry.method: entry for entry in shipped_standings()}
    begun, folder = entries["surrogate_from_agent"], Path(__file__).parents[2] / "docs/researchers"
    pages = {name: (folder / f"{name}.md").read_text("utf-8") for name in ("index", "benchmark")}
    texts = {name: " ".join(page.split()) for name, page in pages.items()}
    lead = 100.0 * begun.lead(50).value
    assert f"takes off {lead:.1f} points more than the best rule" in texts["index"]
    lead = 100.0 * entries["population_annealing"].lead(50).value
    assert f"takes off {lead:.1f} more" in texts["index"]
    ends = []
    for budget in (50, 0):
        gains = [100.0 * (run.rule - run.share) for run in begun.runs if run.budget == budget]
        ahead = [gain for gain in gains if gain > 1.0]
        assert len(ahead) == len(gains) == 11
        ends += [f"{min(ahead):.0f} to {max(ahead):.0f}"]
        assert begun.lead_p_value(budget) < 0.001
    said = f"by {ends[0]} points**, and without a blast, too, by {ends[1]}."
    assert said in texts["benchmark"]
    scores = [f"{begun.score(budget).value:.2f}" for budget in (50, 0)]
    assert f"is {' and '.join(scores)}." in texts["benchmark"]
    found = Counter(known.best.method.split(",")[0] for known in stored_references().values())
    assert found == {"surrogate_from_agent": 8, "agent": 2, "imitation_then_ppo": 1}
    said = "`surrogate_from_agent` eight, `agent` two, `imitation` with PPO one"
    assert said in texts["benchmark"]
    (version,) = {entry.engine.split()[1] for entry in entries.values()}
    assert f"**Which version judged?** Version {version} of gas dynamics" in texts["benchmark"]


def test_reductions_and_leads_are_over_the_problems() -> None:
    """Shares of 0.95 and 0.9 of two problems, whose best rules leave 0.98 and 0.95."""
    runs = (
        RunJudgement(NAME, 0, 0, 0, wall(13), 0.95, 0.98, 0.9),
        RunJudgement("other", 0, 0, 0, wall(12), 0.9, 0.95, 0.9),
    )
    both = SubmissionJudgement("own", 0.5, "row 1", runs)
    assert both.reduction(0).value == pytest.approx(0.075)
    assert both.lead(0).value == pytest.approx(0.04)
    assert both.lead(0).high - 0.04 == pytest.approx(12.706 * 0.01, rel=1e-4)
    assert both.lead_p_value(0) == pytest.approx(2.0 * np.arctan(1.0 / 4.0) / np.pi)
    assert both.score(50).value == both.reduction(50).value == 0.0
    (table,) = standings_tables([both])
    assert table.rows[1][3:6] == ("7.5", "+4.0 (-8.7 to 16.7)", "0.156")


def test_losses_rank_a_method_behind_one_that_never_loses() -> None:
    """The clipped score forgets them: 1 and -7 halves of the way are 0.5, twice a third 0.33."""

    def of(method: str, *shares: float) -> SubmissionJudgement:
        runs = (
            RunJudgement(name, 0, 0, 0, wall(12), share, 0.8, 0.7)
            for name, share in zip((NAME, "other"), shares, strict=True)
        )
        return SubmissionJudgement(method, 0.5, "row 1", tuple(runs))

    gambler, steady = of("gambler", 0.7, 1.0), of("steady", 0.77, 0.77)
    assert gambler.score(0).value > steady.score(0).value
    (table,) = standings_tables([gambler, steady])
    assert [row[0] for row in table.rows] == ["best known", "steady", "best rule", "gambler"]


def test_leads_of_many_methods_are_corrected_for_their_number() -> None:
    """Holm: the least of three p values counts three times, the next twice, none below the last."""

    def entry(method: str, *leads: float) -> SubmissionJudgement:
        runs = (
            RunJudgement(f"problem {place}", 0, 0, 0, wall(12), 0.8 - lead, 0.8, 0.6)
            for place, lead in enumerate(leads)
        )
        return SubmissionJudgement(method, 0.5, "row 1", tuple(runs))

    entries = [
        entry("clear", 0.05, 0.06, 0.05, 0.07),
        entry("likely", 0.01, 0.02, 0.03, 0.04),
        entry("equal", 0.01, -0.01, 0.02, -0.02),
    ]
    clear, likely, equal = (of.lead_p_value(0) for of in entries)
    (table,) = standings_tables(entries)
    chances = {row[0]: row[5] for row in table.rows}
    assert (clear < 0.01, likely < 0.05, equal) == (True, True, 1.0)
    assert chances["clear"] == f"{3.0 * clear:.3f}"
    assert chances["likely"] == f"{2.0 * likely:.3f}"
    assert chances["equal"] == "1.000"


@pytest.mark.parametrize(("most", "places"), [(2, 2), (16, 3)])
def test_fixed_charges_of_ones_own_site_are_problems_once_each(most: int, places: int) -> None:
    found = site_problems("control_room", most)
    assert [site_problem.place for site_problem in found] == list(range(1, places + 1))
    charges = [site_problem.case.charge for site_problem in found]
    assert len(set(charges)) == places
    (hidden,) = site_problems("control_room", is_hidden=True)
    assert set(hidden.case.charges) == set(charges) or most == 2


@pytest.mark.parametrize(
    ("kind", "made"), [("kerb_sites", kerb_site), ("street_sites", street_site)]
)
def test_sites_of_any_size_are_problems_too(kind: str, made: Callable[[int], Scenario]) -> None:
    found = site_problems(kind, 2)
    assert [site_problem.scenario for site_problem in found] == [made(0), made(1)]


def test_charges_on_a_line_are_drawn_at_different_places() -> None:
    found = site_problems("courtyard", 3)
    assert len({site_problem.case.charge for site_problem in found}) == 3
    assert len({site_problem.case.threats[0].seed for site_problem in found}) == 3


@pytest.mark.parametrize(
    ("site", "problems"),
    [("hotel_forecourt", 1), ("government_forecourt", 2), ("perimeter_gate", 7)],
)
def test_a_charge_is_one_problem_however_often_it_is_drawn(site: str, problems: int) -> None:
    """The same problem again would narrow the interval over the problems by no evidence."""
    found = site_problems(site, 7)
    assert len(found) == problems
    assert len({site_problem.case.charge for site_problem in found}) == problems


def test_cells_that_the_judge_does_not_have_are_refused_before_a_method_runs(
    tmp_path: Path,
) -> None:
    method = f"{__name__}:never_asked"
    entry = ["judge", "--method", method, "--cell", "1.0", "--out", str(tmp_path / "entry")]
    result = CliRunner().invoke(app, entry)
    assert result.exit_code == 2
    assert "cell_m is 1, must be 0.5 m, the side of a module, divided by" in result.output
    assert not (tmp_path / "entry").exists()


def never_asked(problem: BenchmarkProblem, seed: int) -> Layout:
    """Fail where a method runs that should not."""
    raise AssertionError(f"{problem.name}, {seed}")


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("budget", 10**18, "less than or equal to 1000"),
        ("budget", True, "valid integer"),
        ("budget", 1.0, "valid integer"),
        ("seed", 2**63, "less than or equal to"),
        ("blasts", "1", "valid integer"),
        ("layout", [["16", 0, "low_wall", True]], "valid integer"),
        ("layout", [[16.0, 0, "low_wall", True]], "valid integer"),
        ("layout", [[16, 0, "low_wall", 1]], "valid boolean"),
    ],
)
def test_values_of_a_submission_are_not_converted(
    tmp_path: Path, key: str, value: object, words: str
) -> None:
    path = Submission("own", (run(16, 50),)).save(tmp_path / "own.json")
    assert read_submission(path) == Submission("own", (run(16, 50),))
    content = json.loads(path.read_text())
    content["runs"][0][key] = value
    path.write_text(json.dumps(content))
    with pytest.raises(BlastEnvError) as caught:
        read_submission(path)
    assert f"runs[0].{key}" in str(caught.value)
    assert words in str(caught.value)


@pytest.mark.usefixtures("apart")
def test_so_many_runs_and_no_more_before_any_is_looked_at(tmp_path: Path) -> None:
    path = tmp_path / "many.json"
    path.write_text(json.dumps({"runs": [0] * 10_001}))
    with pytest.raises(
        BlastEnvError, match=r"many\.json: has 10,001 runs, must have at most 10,000"
    ):
        read_submission(path)


def test_a_problem_has_no_budget_that_counts_for_no_score() -> None:
    with pytest.raises(BlastEnvError, match="budget is 1001, must be an integer from 0 to 1000"):
        make(NAME, 1001, engine=RowEngine())


def test_shares_of_another_version_of_the_engine_are_judged_again() -> None:
    """Stored shares are of the load that the version had."""
    cells = {"": 0.123}
    stored = ScoreReference(
        "",
        "row 1",
        {},
        ReferenceLayout("rule", wall(16), cells),
        ReferenceLayout("best", wall(12), cells),
    )
    runs = Submission("own", (run(14, 50),))

    def rule(reference: ScoreReference) -> float:
        (run,) = judge(runs, None, engine=RowEngine(), references={NAME: reference}).runs
        return run.rule

    assert rule(stored) == 0.123
    assert rule(replace(stored, engine="row 0")) != 0.123
