"""The study behind docs/studies/scenarios.md: figures, criteria, tables that are up to date."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer import Typer
from typer.testing import CliRunner

from blast_env import load_scenario
from blast_env.arrays import FloatArray
from blast_env.evaluation import SeedRange, evaluate_against
from studies.difficulty import __main__ as scenario_difficulty
from studies.difficulty.__main__ import (
    PICTURES,
    TABLES,
    picture_path,
    studied_scenarios,
    tables_path,
)
from studies.difficulty.figure import difficulty_figure
from studies.difficulty.study import RULES, DifficultyStudy, Effort, TaskResult, WayOutcome
from studies.difficulty.verdict import difficulty_criteria
from tests.design.search_cases import ballistic

REPOSITORY = Path(__file__).parents[2]
SMALL = Effort(
    layouts=3,
    seeds=3,
    charges=2,
    realisations=2,
    finalists=2,
    hidden_round=1,
    visible_round=1,
    random_hidden=2,
    random_visible=2,
)
THREATS = 12
BARE = np.linspace(90.0, 110.0, THREATS)


def outcome(*left: float, scatter: float = 0.01) -> WayOutcome:
    """Return an outcome of layouts that leave such shares of the impulse, the same each time."""
    rng = np.random.default_rng([round(1000.0 * each) for each in left])
    shares = np.array(left)[:, None] + scatter * rng.normal(size=(len(left), THREATS))
    return WayOutcome("made up", ((),) * len(left), shares * BARE, BARE)


def result(
    walls: tuple[float, float, float], searched: float, random: tuple[float, ...]
) -> TaskResult:
    return TaskResult(
        bare=WayOutcome("no barrier", ((),), BARE[np.newaxis], BARE),
        random=outcome(*random),
        rules=tuple(outcome(each) for each in walls),
        searched=outcome(searched),
    )


HARD = {"walls": (0.4, 0.6, 0.7), "searched": 0.5, "random": (0.7, 0.75, 0.8, 0.9)}


@pytest.fixture(scope="module")
def study() -> DifficultyStudy:
    return DifficultyStudy(ballistic("courtyard"), SMALL, "event", processes=1)


@pytest.fixture(scope="module")
def hidden(study: DifficultyStudy) -> TaskResult:
    return study.hidden()


@pytest.fixture(scope="module")
def visible(study: DifficultyStudy) -> TaskResult:
    return study.visible()


def test_one_layout_for_all_is_judged_as_evaluate_layout_judges_it(
    study: DifficultyStudy, hidden: TaskResult
) -> None:
    for row in (*hidden.rules, hidden.searched):
        expected = evaluate_against(study.evaluator, row.layouts[0], study.held_out)
        assert row.reduction == pytest.approx(expected.reduction)
        assert row.mean_pa_s == pytest.approx(expected.impulse_pa_s)
        assert row.worst_pa_s == pytest.approx(expected.worst.impulse_pa_s)
        assert row.cvar_pa_s == pytest.approx(expected.cvar_pa_s)
        assert row.modules == len(row.layouts[0])
    assert hidden.bare.reduction == (0.0, 0.0, 0.0)


def test_every_visible_charge_gets_a_wall_of_its_own(
    study: DifficultyStudy, visible: TaskResult
) -> None:
    scenario, charges = study.evaluator.scenario, [each.charge for each in study._tried]
    for wall, (name, rule) in zip(visible.rules, RULES.items(), strict=True):
        assert wall.name == name
        assert list(wall.layouts) == [rule(scenario, at) for at in charges]
        assert wall.impulse_pa_s.shape == (1, SMALL.charges)
    assert visible.random.impulse_pa_s.shape == (SMALL.random_visible, SMALL.charges)


def test_it_costs_what_it_says(
    study: DifficultyStudy, hidden: TaskResult, visible: TaskResult
) -> None:
    """Fewer blasts only where a layout comes up twice: the best one was tried already."""
    assert 0.8 * SMALL.blasts <= study.evaluator.blasts <= SMALL.blasts


def test_held_out_seeds_are_not_those_of_training(study: DifficultyStudy) -> None:
    assert all(threat.seed in SeedRange.JUDGEMENT.value for threat in study.held_out)
    tried = (*study._tried, *study._again(study._tried[0].charge))
    assert all(threat.seed in SeedRange.SEARCH.value for threat in tried)


def test_the_search_prefers_what_does_best_on_training(monkeypatch: pytest.MonkeyPatch) -> None:
    """With impulses that fall with the layout's number, the last one must win both rounds."""
    study = DifficultyStudy(
        load_scenario("courtyard"), replace(SMALL, layouts=6), "event", processes=1
    )
    pool = study._pool

    def numbered(self: DifficultyStudy, layouts: list, threats: list) -> FloatArray:
        return np.array([[-float(pool.index(layout))] * len(threats) for layout in layouts])

    monkeypatch.setattr(DifficultyStudy, "_impulses", numbered)
    assert study._best_of_pool(numbered(study, pool, [0]), study.held_out) == pool[-1]


def test_a_gain_is_the_difference_of_the_reductions() -> None:
    better, worse = outcome(0.3), outcome(0.5)
    gain = better.better_by(worse)
    assert gain.value == pytest.approx(better.reduction.value - worse.reduction.value)
    assert gain.low < gain.value < gain.high
    assert worse.better_by(better).value == pytest.approx(-gain.value)


def test_random_layouts_are_averaged_and_their_spread_is_told() -> None:
    several = outcome(0.6, 0.8, scatter=0.0)
    assert several.reduction.value == pytest.approx(0.3)
    assert several.spread == pytest.approx(0.1 * 2.0**0.5)
    assert several.worst_pa_s == pytest.approx(0.7 * BARE.max())
    assert outcome(0.5).spread == 0.0


def unmet(hidden: dict, visible: dict) -> list[int]:
    """Return which criteria are not met when the tasks differ from hard ones."""
    criteria = difficulty_criteria(result(**(HARD | hidden)), result(**(HARD | visible)))
    return [number for number, each in enumerate(criteria) if not each.met]


def test_a_hard_scenario_meets_every_criterion() -> None:
    assert unmet({}, {}) == []


TRIVIAL = {"walls": (0.05, 0.6, 0.7)}
HOPELESS = {"walls": (0.9, 0.95, 1.0), "searched": 0.99, "random": (1.0, 1.1, 1.2, 1.3)}
ANY_LAYOUT = {"random": (0.4, 0.45, 0.5, 0.6)}
ANY_DISTANCE = {"walls": (0.4, 0.4, 0.4)}
NO_DIFFERENCE = {"searched": 0.4}


@pytest.mark.parametrize(("number", "lack"), [(0, TRIVIAL), (0, HOPELESS), (1, ANY_LAYOUT)])
def test_what_must_hold_in_both_tasks(number: int, lack: dict) -> None:
    assert unmet(lack, {}) == unmet({}, lack) == unmet(lack, lack) == [number]


@pytest.mark.parametrize(("number", "lack"), [(2, ANY_DISTANCE), (3, NO_DIFFERENCE)])
def test_what_must_hold_in_one_task(number: int, lack: dict) -> None:
    assert unmet(lack, {}) == unmet({}, lack) == []
    assert unmet(lack, lack) == [number]


def test_layouts_that_luck_alone_tells_apart_are_found() -> None:
    assert unmet({"random": (0.8, 0.8, 0.8, 0.8)}, {}) == [4]


def test_the_picture_shows_both_plans(study: DifficultyStudy, hidden: TaskResult) -> None:
    evaluation = evaluate_against(study.evaluator, hidden.best.layouts[0], study.held_out)
    figure = difficulty_figure(evaluation, "a wall")
    titles = [axes.get_title() for axes in figure.axes[:2]]
    assert titles[0].startswith("no barrier: ")
    assert titles[1].startswith("a wall, 16 modules: ")


def tables_of(name: str) -> str:
    return tables_path(REPOSITORY / TABLES, name).read_text("utf-8")


@pytest.mark.parametrize("name", studied_scenarios())
def test_the_tables_were_made_with_the_scenario_as_it_is(name: str) -> None:
    """Otherwise run `python -m studies.difficulty`."""
    assert f"scenario hash `{load_scenario(name).content_hash[:12]}`" in tables_of(name)
    assert picture_path(REPOSITORY / PICTURES, name).is_file()


IN_OVERVIEW = [name for name in studied_scenarios() if name != "shopping_street"]
"""The rules of that one's table leave out the best one."""


@pytest.mark.parametrize("name", IN_OVERVIEW)
def test_the_overview_says_what_the_tables_say(name: str) -> None:
    """Random layouts, the best rule, and the best of all, where one layout meets every place."""
    overview = (REPOSITORY / "docs" / "studies" / "scenarios.md").read_text("utf-8")
    (row,) = re.findall(rf"^\| \[{name}\].*$", overview, re.MULTILINE)
    random, rule, best = re.findall(r"[\d.]+(?= %)", row)
    hidden = tables_of(name).partition("**Charge visible")[0].partition("A layout for one")[0]
    found = dict(re.findall(r"^\| (\w[^|]+) \|.*?\| (-?[\d.]+) %", hidden, re.MULTILINE))
    rules = {line: value for line, value in found.items() if re.match("high|long|ring|wall", line)}
    rules |= {line: value for line, value in found.items() if "posts" in line}
    assert random == found["random layouts (mean)"]
    assert rule == max(rules.values(), key=float)
    assert next(line for line in rules if rules[line] == rule) in row
    assert best == max(found.values(), key=float)


def run_command(*arguments: str) -> tuple[int, str]:
    app = Typer()
    app.command()(scenario_difficulty.main)
    answer = CliRunner().invoke(app, arguments)
    return answer.exit_code, answer.output


def test_the_command_prints_and_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenario_difficulty, "load_scenario", ballistic)
    tables, pictures = tmp_path / "tables", tmp_path / "pictures"
    small = ("--layouts=2", "--seeds=2", "--charges=2", "--realisations=1", "--processes=1")
    folders = (f"--tables={tables}", f"--pictures={pictures}")
    exit_code, output = run_command("courtyard", *small, *folders)
    assert exit_code == 0, output
    text = (tables / "scenario_courtyard.txt").read_text()
    for words in ("Charge hidden", "Charge visible", "wall near the building", "best of 2 random"):
        assert words in text
    assert text.count("| no barrier | 0 |") == 2
    assert "criteria are met" in output
    assert (pictures / "scenario_courtyard.png").read_bytes().startswith(b"\x89PNG")


def test_a_folder_that_cannot_be_is_refused_before_any_blast(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    exit_code, output = run_command("courtyard", "--tables", str(file))
    assert exit_code == 2
    assert "error" in output
