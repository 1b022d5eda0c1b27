"""Measures that harden facades, on the page: cost and verdict follow without a new blast."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from nicegui import ui
from nicegui.testing import User

from blast_env.answers import Number
from blast_env.answers.compare import verdict_table
from blast_env.answers.document import AnyCell
from blast_env.app import blasts, edits, placing, session
from blast_env.app.edits import SiteThing, ThingKind
from blast_env.app.folder import WorkFolder
from blast_env.app.session import Session, Sessions
from blast_env.errors import LayoutError
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.questions.verdict import BuildingResponse
from blast_env.geometry import Layout, Measure, Piece
from blast_env.site import Scenario, ScenarioError
from tests.app.here import Here, rows_of
from tests.app.test_page import opened, play
from tests.blasts import consequences
from tests.gas_sites import glazed_hut, hut

WALL: Layout = (Piece(0, 0, "wall", True), Piece(3, 0, "wall", True))
GLASS = Measure.named("glass")


def hardened_hut() -> Scenario:
    """Return the hut with windows in brick walls, and what could be had instead."""
    document: dict[str, Any] = glazed_hut().model_dump(mode="json", exclude_none=True)
    wall = {"name": "wall", "length_modules": 3, "height_m": 1.5, "cost": 10.0, "stock": 2}
    zone = document["build_zone"] | {
        "items": [wall],
        "budget": 100.0,
        "hardening": [
            {"name": "glass", "glazing": "window_laminated_6", "cost": 50.0},
            {"name": "panels", "wall": "concrete_150", "cost": 45.0, "walls": ["west"]},
        ],
    }
    del zone["height_m"], zone["stock"]
    return Scenario.from_document(document | {"build_zone": zone}, "hut")


def verdict_rows(session: Session) -> list[SimpleNamespace]:
    """Return the rows of the table of buildings."""
    return rows_of(verdict_table(session.scenario, session.verdicts()))


def number_of(cell: AnyCell) -> float:
    assert isinstance(cell, Number)
    return cell.value


@pytest.fixture(scope="module")
def blasted(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The hut behind a wall, blasted by gas, without pictures."""
    folder = WorkFolder(tmp_path_factory.mktemp("measures"))
    session = Sessions(folder, Here()).new(hardened_hut(), "begin")
    session.cells = 0.5
    session.put("wall", session.design.with_layout(WALL))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blasts, "_pictures", lambda *_: ())
        session.blast([0])
    return session


def test_a_measure_changes_cost_and_verdict_but_no_blast(blasted: Session) -> None:
    (threat,) = blasted.chosen_threats()
    unprotected, before = verdict_rows(blasted)
    there = blasted.folder.blasts_there()
    blasted.harden("glass", taken=True)
    _, after = verdict_rows(blasted)
    found = consequences(BlastEvaluator(blasted.scenario, "gas"), (*WALL, GLASS), [threat.charge])
    facade = found.responses[0].facade
    assert after.panes_broken == f"{facade.broken_panes:.1f} of {facade.panes}"
    assert after.worst_pane == facade.worst_condition.words
    words = found.level_words(found.buildings[0])
    assert after.level_of_protection == words != before.level_of_protection
    likely = before.its_probability
    assert likely == "\N{EN DASH}" or 0.0 < float(likely.split()[-1]) <= 1.0
    assert after.validation_of_the_load.startswith("approximate (3.4 cells per m/kg^(1/3)")
    assert after.worst_wall_panel == before.worst_wall_panel  # its walls are as they were
    assert verdict_rows(blasted)[0] == unprotected
    assert {row.cost for row in rows_of(blasted.comparison())} == {"0", "70"}
    assert blasted.cost([0]) == ()
    assert blasted.folder.blasts_there() == there
    blasted.undo()
    assert verdict_rows(blasted) == [unprotected, before]


def test_a_measure_alone_is_shown_with_the_blast_without_a_barrier(blasted: Session) -> None:
    blasted.put("none", blasted.design.with_layout((GLASS,)))
    (threat,) = blasted.chosen_threats()
    unprotected, own = blasted.shown(threat)
    assert own.key == unprotected.key
    assert [row.layout for row in verdict_rows(blasted)] == ["no barrier", own.name]
    (without,), (with_glass,) = (blasted.judged(load, threat) for load in (unprotected, own))
    # Under this charge both break all panes; better ones less far.
    assert number_of(with_glass.cells[2]) <= number_of(without.cells[2])
    assert with_glass.severity < without.severity
    blasted.undo()


def test_other_windows_need_no_blast_and_other_bays_do(blasted: Session) -> None:
    blasted.put("wall", blasted.design.with_layout(WALL))
    house = next(case for case, _ in edits.things(blasted.scenario) if case.kind == "structure")
    facade = {"bay_m": 1.0, "glazing": "window_laminated_6", "wall": "brick_215"}
    with pytest.raises(ScenarioError, match="must fit"):  # the catalogue's are larger
        edits.with_values(blasted.scenario, house, {"facade": facade})
    before = verdict_rows(blasted)
    facade |= {"glazing": "small_window", "wall": "concrete_200"}
    blasted.put_site("walls", edits.with_values(blasted.scenario, house, {"facade": facade}))
    after = verdict_rows(blasted)
    assert [row.panes_broken for row in after] == [row.panes_broken for row in before]
    assert [row.worst_wall_panel for row in after] != [row.worst_wall_panel for row in before]
    assert blasted.cost([0]) == ()
    facade["bay_m"] = 2.0
    blasted.put_site("bays", edits.with_values(blasted.scenario, house, {"facade": facade}))
    assert not blasted.verdicts()
    assert len(blasted.cost([0])) == 2
    blasted.undo()
    blasted.undo()


def test_the_picture_of_the_damage_is_of_what_stands_there_now(
    blasted: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    blasted.put("wall", blasted.design.with_layout(WALL))
    (threat,) = blasted.chosen_threats()

    def picture(building: str = "hut") -> bytes | None:
        return blasted.damage_png(blasted.shown(threat)[1], threat, building)

    assert (picture() or b"").startswith(b"\x89PNG")
    assert picture("shed") is None
    drawn: list[str] = []

    def draw(building_response: BuildingResponse) -> bytes:
        drawn.append(building_response.facade.level_of_protection.label)
        return b""

    monkeypatch.setattr(session, "damage_png", draw)
    picture()
    blasted.harden("glass", taken=True)
    picture()
    assert drawn[0] != drawn[1]
    blasted.undo()


def test_a_layout_over_the_budget_can_be_looked_at_but_not_reported(blasted: Session) -> None:
    blasted.put("wall", blasted.design.with_layout((*WALL, GLASS)))
    (threat,) = blasted.chosen_threats()
    before = [case.key for case in blasted.shown(threat)]
    blasted.harden("panels", taken=True)
    assert len(blasted.design.layout) == len(WALL) + 2
    words = placing.counted(blasted.scenario, blasted.design.layout)
    assert words.endswith("115 of 100 cost units: 15 over the budget")
    assert [case.key for case in blasted.shown(threat)] == before  # no load depends on costs
    with pytest.raises(LayoutError, match="budget"):
        blasted.report(Path("a.html"))
    blasted.undo()
    known = {
        measure.name: measure
        for measure in placing.measures(blasted.scenario, blasted.design.layout)
    }
    assert known["glass"].is_taken
    assert not known["panels"].is_taken
    assert known["panels"].words == "reinforced concrete wall, 150 mm on all structures, west"


def test_a_measure_is_added_to_a_site_with_items_and_windows() -> None:
    site, thing = edits.added(hardened_hut(), ThingKind.MEASURE, (0.0, 0.0), (0.0, 0.0))
    assert thing.number == 2
    assert site.zone.stock == hardened_hut().zone.stock + 1  # or it could not be taken
    fewer = edits.with_values(site, SiteThing(ThingKind.ZONE), {"stock": 3})
    assert edits.added(fewer, ThingKind.MEASURE, (0.0, 0.0), (0.0, 0.0))[0].zone.stock == 3
    dearer = edits.with_values(site, thing, {"cost": 12.0, "wall": "concrete_200"})
    assert (dearer.zone.hardening[2].cost, dearer.zone.hardening[2].wall) == (12.0, "concrete_200")
    assert len(edits.removed(dearer, thing).zone.hardening) == 2
    with pytest.raises(ScenarioError, match=r"no build_zone\.items"):
        edits.added(hut(), ThingKind.MEASURE, (0.0, 0.0), (0.0, 0.0))


def test_a_switch_on_the_page_takes_a_measure(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hardened_hut())

        def switch(words: str) -> Any:
            switches = user.find(kind=ui.switch).elements
            return next(switch for switch in switches if getattr(switch, "text", "") == words)

        switch("glass, 50 cost units").value = True
        assert session.design.layout == (GLASS,)
        await user.should_see("50 of 100 cost units")
        switch("panels, 45 cost units").value = True
        assert len(session.design.layout) == 2
        session.undo()
        assert not switch("panels, 45 cost units").value
        session.put("wall", session.design.with_layout((GLASS, *WALL)))
        switch("panels, 45 cost units").value = True
        await user.should_see("15 over the budget")

    play(tmp_path, story)
