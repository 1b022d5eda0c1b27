"""Buildings with a facade that other structures or pieces hide: no door drops them in silence.

A front looks west at a charge. A porch touches all of it, or another building leaves a gap before
it, which two walls fill. On some sites a house beside it can be judged.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import gymnasium as gym
import numpy as np
import pytest
from blast_agents.training.imitation import best_by_rule
from typer.testing import CliRunner

from blast_env.answers import Document, Line, Table, assess, compare
from blast_env.answers.report import Limit, Report, StudyOptions, report_document, run_report
from blast_env.benchmark import Definition, make
from blast_env.cli import app
from blast_env.design.search import (
    DesignProblem,
    MeasureKind,
    PopulationAnnealingSearch,
    RandomSearch,
    advise,
)
from blast_env.design.search.advised import site_with_target
from blast_env.envs.attack_game import ATTACKER, DEFENDER, AttackGame
from blast_env.errors import BlastEnvError
from blast_env.evaluation import (
    BlastEvaluator,
    BlastStore,
    Evaluators,
    LoadCase,
    LoadCaseSet,
    evaluate_layout,
)
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.questions import capacity
from blast_env.evaluation.questions.probability import scaled_to
from blast_env.evaluation.questions.verdict import (
    Consequences,
    consequences_by_layout,
    consequences_of,
)
from blast_env.geometry import Layout, Piece
from blast_env.layout import write_layout
from blast_env.response import LevelOfProtection
from blast_env.rules import layouts_by_rule
from blast_env.site import Charge, Scenario, save_scenario
from tests import builders
from tests.builders import block, point
from tests.figures import undrawn_figures

CHARGE: Final = Charge((1.0, 4.0), 20.0)
ENGINE: Final = GasEngine.with_cells("coarse")
FACADE: Final = {"bay_m": 2.0, "glazing": "window_laminated_6", "wall": "concrete_200"}
GLAZED: Final = {"height_m": 3.0, "protected": True, "faces": ["west"], "facade": FACADE}
OTHERS: Final = {
    "porch": block("porch", 5.5, 2.0, 8, 1, height_m=3.0),
    "other": block("other", 4.5, 2.0, 8, 2, height_m=3.0),
    "annex": block("annex", 7.0, 2.0, 8, 2, **GLAZED, building="front"),
    "kiosk": {
        "kind": "polygon",
        "name": "kiosk",
        "outline_m": [[8.0, 3.0], [9.0, 3.0], [9.0, 4.0], [8.0, 4.0]],
        "height_m": 3.0,
        "protected": True,
        "facade": {"bay_m": 4.0, "glazing": "window_laminated_6"},
    },
    "house": block("house", 8.0, 2.0, 8, 2, **GLAZED),
}
WALLS: Final[Layout] = tuple(Piece(row, 1, "wall", True) for row in (0, 4))
HIDDEN: Final = "front: no air touches its assessed walls (front): no verdict covers it"
FILLED: Final = (
    "front: 12.0 of 12.0 m2 of its assessed walls have no load, since pieces fill the gap before"
)


def site(*others: str, **sections: Any) -> Scenario:
    """Return the front, other structures, and a zone of 1 m before it for walls of 2 m."""
    items = [{"name": "wall", "length_modules": 4, "height_m": 3.0, "cost": 1.0, "stock": 2}]
    zone = builders.zone(5.0, 2.0, 8, 2, items=items)
    charge = point(*CHARGE.position_m, CHARGE.tnt_kg)
    own = block("front", 6.0, 2.0, 8, 2, **GLAZED), *(OTHERS[name] for name in others)
    return builders.site("lane", (10.0, 8.0, 5.0), charge, *own, build_zone=zone, **sections)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of all blasts: most tests ask for the same ones."""
    return tmp_path_factory.mktemp("blasts")


def blasts_of(scenario: Scenario, layout: Layout, cache: Path) -> Blasts:
    layouts: dict[str, Layout] = {"no barrier": ()} | ({"layout": layout} if layout else {})
    return Campaign.on(scenario, layouts, [LoadCase(CHARGE)], ENGINE, None, cache).run()


@pytest.mark.parametrize(("other", "layout"), [("porch", ()), ("other", WALLS)])
def test_where_nothing_can_be_judged_the_error_names_buildings_and_reasons(
    other: str, layout: Layout, tmp_path: Path, cache: Path
) -> None:
    scenario, options = site(other), ["--cells", "coarse", "--cache", str(cache)]
    save_scenario(scenario, tmp_path / "site.toml")
    if layout:
        write_layout(tmp_path / "layout.json", scenario, layout, {})
        options += ["--layout", str(tmp_path / "layout.json")]
    done = CliRunner().invoke(app, ["assess", str(tmp_path / "site.toml"), *options])
    said = " ".join(done.output.split())
    assert done.exit_code == 2
    assert f"error: there is no level of protection: {HIDDEN}" in said
    assert "COMPLIES" not in said
    assert (FILLED in said) == bool(layout)
    evaluator = BlastEvaluator(scenario, ENGINE, cache=cache)
    with pytest.raises(BlastEnvError, match="there is no level of protection: front: no air"):
        capacity.capacity(evaluator, {"": layout}, [CHARGE])


def test_a_verdict_on_the_others_is_flagged_with_the_building(cache: Path) -> None:
    blasts = blasts_of(site("porch", "house"), (), cache)
    found = consequences_by_layout(blasts)
    judged = found["no barrier"]
    assert judged.buildings == ("house",)
    assert replace(judged, responses=(), unchecked=()).is_flagged
    parts = Document.of(assess.assessment(blasts, found, LevelOfProtection.LOW, 0.1)).parts
    assert f"flag: {HIDDEN}" in [part.text() for part in parts if isinstance(part, Line)]


def test_a_facade_whose_walls_are_too_short_for_a_bay_is_named(cache: Path) -> None:
    """Walls of a polygon that are shorter than half a bay have no windows."""
    judged = consequences_of(blasts_of(site("kiosk"), (), cache))
    assert judged.buildings == ("front",)
    words = "kiosk: 12.0 of 12.0 m2 of its walls stand in no bay (kiosk): no verdict covers them"
    assert words in judged.notes


def test_the_table_of_buildings_has_a_row_without_a_verdict(cache: Path) -> None:
    """As the page shows it."""
    scenario = site("porch", "house")
    verdicts = compare.building_verdicts(consequences_of(blasts_of(scenario, (), cache)))
    table = compare.verdict_table(scenario, [("A", "T1", verdicts), ("A", "T2", verdicts)])
    rows = [row for row in table.cells() if row[2] == "front"]
    assert [row[1] for row in rows] == ["worst of 2", "T1", "T2"]
    assert all(row[3] == "no verdict" for row in rows)
    assert all(HIDDEN.removeprefix("front: ") in row[-1] for row in rows)


def test_a_report_names_it_and_shows_its_bays_without_the_layout(cache: Path) -> None:
    scenario = site("other", "house")
    options = StudyOptions(
        charges=(CHARGE,),
        cells=("coarse", "coarse"),
        items=False,
        places=1,
        limits=(Limit("front", peak_pa=1e9), Limit("house", peak_pa=1e9)),
        cache=cache,
    )
    with undrawn_figures():
        document = report_document(Report(run_report(scenario, WALLS, options).study))
    said = [part for part in document.parts if isinstance(part, Line)]
    flags = [line.text() for line in said if line.kind == "flag"]
    assert f"{HIDDEN}." in flags
    assert any(flag.startswith(FILLED) for flag in flags)
    assert "front: it has no load, and its limit is not checked." in flags
    tables = [part for part in document.parts if isinstance(part, Table)]
    (bays,) = (table for table in tables if table.title.startswith("Bay by bay: front"))
    for _, without, _, _, *behind in bays.cells():
        assert without.endswith("%")
        assert set(behind) <= {"-", "\N{EN DASH}"}


def test_walls_behind_a_gap_that_a_piece_fills_are_named_wherever_a_verdict_is(
    cache: Path,
) -> None:
    """One of the two walls: half of the front has no load, and the rest has a verdict."""
    scenario = site("other", "house")
    blasts = blasts_of(scenario, WALLS[:1], cache)
    found = consequences_by_layout(blasts)
    judged, words = found["layout"], FILLED.replace("12.0", "6.0", 1)
    parts = Document.of(assess.assessment(blasts, found, LevelOfProtection.LOW, 0.1)).parts
    said = [part.text() for part in parts if isinstance(part, Line)]
    assert sum(words in line for line in said) == 1
    assert any(line.startswith(f"flag: {words}") for line in said)
    verdicts = compare.building_verdicts(judged)
    table = compare.verdict_table(scenario, [("A", "T1", verdicts)])
    own, words = words.split(": ")
    assert [row[2] for row in table.cells() if words in row[-1]] == [own]
    assert f"{own}: {words}" in " ".join(scaled_to(judged, CHARGE).notes)
    bare = compare.building_verdicts(found["no barrier"])
    assert not any("have no load" in flag for own in bare for flag in own.flags)


def test_the_response_of_a_hidden_building_is_no_number_as_is_its_load(cache: Path) -> None:
    """That of a part of a building counts as 0, and that is said."""
    scenario = site("other", objective={"kind": "response"})
    found = evaluate_layout(scenario, WALLS, threats=[LoadCase(CHARGE)], engine=ENGINE, cache=cache)
    assert np.isnan(found.loads).all()
    assert any(note.startswith(FILLED) for note in found.notes)
    part = site("annex", objective={"kind": "response"})
    found = evaluate_layout(part, (), threats=[LoadCase(CHARGE)], engine=ENGINE, cache=cache)
    assert (found.loads > 0.0).all()
    assert "annex: no bay of its facade has a load: its response counts as 0" in found.notes
    hidden = site("porch", objective={"kind": "response"})
    with pytest.raises(BlastEnvError, match="lane: no load without a barrier on front: no air"):
        evaluate_layout(hidden, (), threats=[LoadCase(CHARGE)], engine=ENGINE, cache=cache)


def test_the_peak_of_a_hidden_building_is_no_number_as_is_its_load(cache: Path) -> None:
    """It was 0, so that a layout that hides the building was the best one."""
    peak: dict[str, Any] = {"objective": {"kind": "load", "quantity": "peak"}}
    threats = [LoadCase(CHARGE)]
    for others in (("other",), ("other", "house")):
        scenario = site(*others, **peak)
        found = evaluate_layout(scenario, WALLS, threats=threats, engine=ENGINE, cache=cache)
        assert np.isnan([found.load, found.mean_reduction, found.worst.peak_pa]).all()
        assert found.unprotected_load > 0.0
        assert np.isnan(found.table.set_index("structure")["peak_pa"]["front"])
    with pytest.raises(BlastEnvError, match="lane: no load without a barrier on front: no air"):
        evaluate_layout(site("porch", "house", **peak), (), threats=threats, engine=ENGINE)
    part = evaluate_layout(site("annex", **peak), (), threats=threats, engine=ENGINE)
    assert part.load == part.building_table["peak_pa"].item() > 0.0


def test_a_building_of_parts_that_are_all_hidden_has_no_load_either(cache: Path) -> None:
    """The mean over its walls, which are none, had been an error of Python."""
    scenario = site("annex", "porch")
    with pytest.raises(BlastEnvError, match="lane: no load without a barrier on front: no air"):
        evaluate_layout(scenario, (), threats=[LoadCase(CHARGE)], engine=ENGINE, cache=cache)


def test_json_has_null_where_pieces_hide_a_building(tmp_path: Path, cache: Path) -> None:
    scenario = site("other")
    found = evaluate_layout(scenario, WALLS, threats=[LoadCase(CHARGE)], engine=ENGINE, cache=cache)
    written = json.loads(found.to_json(tmp_path / "evaluation.json").read_text())
    assert written["result"]["cvar"] is None
    assert written["result"]["objective"]["load"] is None
    save_scenario(scenario, tmp_path / "site.toml")
    write_layout(tmp_path / "layout.json", scenario, WALLS, {})
    files = str(tmp_path / "site.toml"), "--layout", str(tmp_path / "layout.json")
    done = CliRunner().invoke(app, ["simulate", *files, "--engine", "gas", "--json"])
    assert json.loads(done.stdout)["impulse"]["front"]["pa_s"] is None


def test_the_worst_charge_is_found_where_a_building_is_hidden_under_another(cache: Path) -> None:
    """As by pieces that stand under one charge and fall under the other."""
    scenario, heavier = site("other", "house"), CHARGE._replace(tnt_kg=40.0)
    threats = [LoadCase(CHARGE), LoadCase(heavier)]
    campaign = Campaign.on(scenario, {"no barrier": ()}, threats, ENGINE, None, cache)
    judged = consequences_of(campaign.run())
    assert judged.worst_number == 1
    hidden = replace(judged, responses=judged.responses[1:])
    assert hidden.worst_number == 1
    assert hidden.under(0).buildings == ("house",)
    assert hidden.under(1).buildings == ("front", "house")


def test_no_more_panes_break_than_there_are_where_pieces_hide_some_under_one_charge(
    cache: Path,
) -> None:
    """As by pieces that fall under the other; the first charge had the number of panes."""
    scenario = site("other")
    half, bare = (consequences_of(blasts_of(scenario, layout, cache)) for layout in (WALLS[:1], ()))
    whole = Consequences.together((half, bare)).summary("front")
    assert half.summary("front").panes < bare.summary("front").panes == whole.panes
    assert whole.panels == bare.summary("front").panels
    assert whole.failed <= whole.panels


@pytest.mark.parametrize("method", [RandomSearch(initial=(WALLS,)), PopulationAnnealingSearch()])
def test_no_search_ends_at_a_layout_that_hides_a_building(
    method: RandomSearch | PopulationAnnealingSearch, cache: Path
) -> None:
    """Its load is not a number, which is no better than any."""
    evaluator = BlastEvaluator(site("other"), ENGINE, cache=cache)
    problem = DesignProblem(evaluator, LoadCaseSet(evaluator.scenario, (LoadCase(CHARGE),)))
    found = method.propose(problem, 6)
    assert found.blasts > 1
    assert found.load is not None
    assert problem.load(found.layout) == found.load
    assert np.isnan(problem.load(WALLS))


@pytest.mark.parametrize("reward", ["terminal", "incremental", "relative"])
def test_no_reward_is_paid_for_hiding_a_building(reward: str) -> None:
    env = gym.make("BlastBarrierGas-v0", scenario=site("other"), reward=reward)
    env.reset(seed=0, options={"layout": WALLS})
    _, paid, ended, _, info = env.step(env.get_wrapper_attr("finish"))
    assert ended
    assert np.isnan(info["impulse_pa_s"])
    assert info["reduction"] == 0.0
    assert paid == {"terminal": -1.0, "incremental": -1.0, "relative": 0.0}[reward]


def test_no_game_pays_for_hiding_a_building(cache: Path) -> None:
    """The payoffs of both had been no numbers; they are those without a barrier."""
    game = AttackGame(site("other"), ENGINE, cache)
    game.reset(options={"layout": WALLS})
    game.step(int(game.observe(DEFENDER)["action_mask"].argmax()))
    game.step(game.best_response())
    assert game.rewards == {DEFENDER: -1.0, ATTACKER: 1.0}


def test_a_hidden_building_has_no_high_level_of_protection() -> None:
    """It has no bay that could be damaged: its level had been high, and its damage 0."""
    scenario = site("other", objective={"kind": "response"})
    env = gym.make("BlastBarrierGas-v0", scenario=scenario)
    env.reset(seed=0, options={"layout": WALLS})
    *_, info = env.step(env.get_wrapper_attr("finish"))
    assert np.isnan(info["response"])
    assert info["level_of_protection"] == "below standards"


def test_no_advice_takes_a_hidden_building_for_one_without_damage(cache: Path) -> None:
    scenario = site_with_target(site("other", "house"), LevelOfProtection.LOW, None, 10.0)
    evaluator = BlastEvaluator(scenario, ENGINE, cache=cache)
    problem = DesignProblem(evaluator, LoadCaseSet(scenario, (LoadCase(CHARGE),)))
    found = advise(problem, MeasureKind.SHIELD, 4, begin_with=(WALLS,))
    hiding = [trial for trial in found.tried if set(WALLS) <= {*trial.layout}]
    assert hiding
    assert all(trial.damage == 5.0 for trial in hiding)
    assert not any(trial.worth <= found.worth for trial in hiding)


def test_no_episode_ends_where_a_building_is_hidden_without_a_barrier() -> None:
    env = gym.make("BlastBarrierGas-v0", scenario=site("porch"))
    env.reset(seed=0)
    with pytest.raises(BlastEnvError, match="lane: no load without a barrier on front"):
        env.step(env.get_wrapper_attr("finish"))


def test_the_benchmark_counts_a_layout_that_hides_a_building_as_nothing(cache: Path) -> None:
    definition = Definition("lane", "known")
    vars(definition)["scenario"] = site("other")
    problem = make(definition, 4, engine=ENGINE, cache=cache)
    assert problem.evaluate(WALLS) == 1.0
    problem.evaluate(WALLS[:1])
    assert problem.best is not None
    assert np.isfinite(problem.best.share)


def test_no_policy_is_shown_a_layout_that_hides_a_building(cache: Path) -> None:
    """The best one had been the first without a number, before any that helps; none does here."""
    scenario = site("other")
    evaluators = Evaluators(ENGINE, BlastStore(cache))
    case = LoadCaseSet(scenario, (LoadCase(CHARGE),), charge=CHARGE)
    assert layouts_by_rule(scenario, CHARGE)["wall near the charge"] == WALLS
    assert best_by_rule(evaluators, [case]) == [((), 0.0)]
