"""The hand on the plan: strokes of the mouse and keys, as places in metres."""

import re
from pathlib import Path

import pytest

from blast_env.app import edits, placing
from blast_env.app.editor import Editor, Tool, reason_of
from blast_env.app.edits import SiteThing, ThingKind
from blast_env.app.folder import WorkFolder
from blast_env.app.jobs import Workers
from blast_env.app.page.fields import change_of, fields_of, value_of
from blast_env.app.plan import PixelView, plan_svg
from blast_env.app.session import Session
from blast_env.app.solids import boxes
from blast_env.app.sources import blank_site
from blast_env.app.threats import threats_of
from blast_env.geometry import Piece
from blast_env.plots import STRUCTURE
from blast_env.site import Scenario, ScenarioError, load_scenario
from tests.gas_sites import WALL, column, hut, site_document
from tests.test_terraces import terraced
from tests.vehicle_sites import POSTS, gate_site


@pytest.fixture
def editor(tmp_path: Path) -> Editor:
    return on(tmp_path, "courtyard")


def on(folder: Path, name: str) -> Editor:
    work = WorkFolder(folder)
    created = work.create(load_scenario(name), "begin")
    return Editor(Session.opened(created, work, Workers()))


def stroke(editor: Editor, *places: tuple[float, float]) -> None:
    editor.press(*places[0])
    for place in places[1:]:
        editor.move(*place)
    editor.release()


def test_a_stroke_of_modules_is_one_step(editor: Editor) -> None:
    editor.choose(Tool.PLACE)
    stroke(editor, (14.2, 6.2), (14.2, 6.7), (14.2, 7.2))
    assert editor.session.design.layout == ((2, 2), (3, 2), (4, 2))
    assert editor.session.history.present.label == "place 3"
    editor.session.undo()
    assert not editor.session.design.layout


def test_a_message_goes_when_its_reason_does(editor: Editor) -> None:
    editor.selected = SiteThing(ThingKind.STRUCTURE, 0)
    editor.nudge(500.0, 0.0)
    assert editor.message
    editor.nudge(0.5, 0.0)
    assert not editor.message
    editor.message = "nothing is selected"
    editor.choose(Tool.PLACE)
    assert not editor.message


def test_an_opened_design_has_its_engine_threats_and_view_again(tmp_path: Path) -> None:
    work = WorkFolder(tmp_path)
    document = site_document()
    points = [{**document["charge"][0], "position_m": [2.0, y]} for y in (2.0, 6.0)]
    created = work.create(hut(charge=points), "begin")
    session = Session.opened(created, work, Workers())
    first, second = (threat.name for threat in threats_of(session.scenario))
    assert session.engine.cell_m == 0.25
    session.cells, session.view = 0.5, "Results"
    for chosen in ((second,), (first,)):
        session.threats = chosen
        session.keep()
        again = Session.opened(work.open(created.design_id), work, Workers())
        assert (again.engine, again.threats, again.view) == (session.engine, chosen, "Results")


def test_a_zone_over_a_road_says_so(tmp_path: Path) -> None:
    road = {"kind": "segment", "start_m": [2.0, 1.0], "end_m": [2.0, 7.0], "tnt_kg": 5.0}
    work = WorkFolder(tmp_path)
    created = work.create(hut(charge=[road]), "begin")
    editor = Editor(Session.opened(created, work, Workers()))
    editor.choose(Tool.ZONE)
    stroke(editor, (4.0, 2.0), (5.5, 6.0))
    assert not editor.message
    stroke(editor, (1.0, 2.0), (5.5, 6.0))
    assert "the zone lies over a road" in editor.message


def test_a_facade_is_that_of_the_whole_building(tmp_path: Path) -> None:
    document = site_document()
    (west,) = document["structures"]
    west |= {"name": "west", "building": "office", "title": "Town Hall", "columns": 2}
    east = {**west, "name": "east", "corner_m": [7.0, 3.0], "title": ""}
    other = {**west, "name": "other", "corner_m": [8.5, 3.0]}
    del other["building"], other["title"]
    site = hut(structures=[west, east, other])
    thing = SiteThing(ThingKind.STRUCTURE, 1)
    facade = {"wall": "brick_215", "glazing": "window_annealed_6", "storeys": 1}
    facade |= {"pane_width_m": 0.6, "pane_height_m": 1.0}
    after = edits.with_values(site, thing, {"facade": facade})
    assert [structure.facade is not None for structure in after.structures] == [True, True, False]
    (width,) = (field for field in fields_of(after, thing) if field.key == "pane_width_m")
    after = edits.with_values(after, thing, change_of(edits.section_of(after, thing), width, 0.8))
    with pytest.raises(ScenarioError, match="must fit") as caught:
        edits.with_values(after, thing, change_of(edits.section_of(after, thing), width, 1.5))
    assert len(caught.value.problems) > 1
    assert reason_of(caught.value).count("must fit") == 1  # one message on the page
    panes = {(bay.glazing.width_m, bay.glazing.height_m) for bay in after.bays if bay.glazing}
    assert panes == {(0.8, 1.0)}
    assert {bay.bay.structure for bay in after.bays} == {"west", "east"}
    labels = [words for thing, words in edits.things(after) if thing.kind is ThingKind.STRUCTURE]
    assert labels[:2] == ["Town Hall, protected", "Town Hall: east, protected"]


def test_a_side_of_a_building_has_components_of_its_own() -> None:
    (west,) = site_document()["structures"]
    site = hut(structures=[west | {"facade": {"wall": "brick_215"}}])
    thing = SiteThing(ThingKind.STRUCTURE, 0)

    def put(site: Scenario, typed: str | None) -> Scenario:
        (panels,) = (
            field for field in fields_of(site, thing, "west") if field.side and field.key == "wall"
        )
        section = edits.section_of(site, thing)
        after = edits.with_values(site, thing, change_of(section, panels, typed))
        assert value_of(edits.section_of(after, thing), panels) == typed
        return after

    def walls(site: Scenario) -> dict[str, str | None]:
        return {bay.bay.wall: bay.wall for bay in site.named_bays()}

    assert set(walls(site).values()) == {"brick_215"}
    stronger = put(put(site, "concrete_150"), "concrete_200")
    others = {side: "brick_215" for side in walls(site) if side != "west"}
    assert walls(stronger) == others | {"west": "concrete_200"}
    assert put(stronger, None) == site


def test_a_blank_site_can_be_edited_at_once() -> None:
    site = blank_site(60.0, 40.0)
    assert (site.site.width_m, site.site.height_m) == (60.0, 40.0)
    zone, _ = edits.added(site, ThingKind.ZONE, (4.0, 4.0), (20.0, 10.0))
    assert zone.zone.columns == 32
    with pytest.raises(ScenarioError, match="width_m"):
        blank_site(1.0, 40.0)


def test_why_a_module_cannot_stand_is_shown_as_it_is_dragged(editor: Editor) -> None:
    editor.choose(Tool.PLACE)
    assert editor.move(14.2, 15.0)
    assert editor.ghost is not None
    assert "path from the road" in editor.ghost.reason
    stroke(editor, (14.2, 15.0))
    assert not editor.session.design.layout
    assert "path from the road" in editor.message


def test_the_stock_ends_a_stroke(editor: Editor) -> None:
    editor.choose(Tool.PLACE)
    stroke(editor, *((13.2, 5.2 + 0.5 * k) for k in range(18)))
    assert len(editor.session.design.layout) == 16
    assert "stock of 16 modules is used up" in editor.message


def test_a_module_is_moved_with_the_select_tool_and_erased_with_the_right_button(
    editor: Editor,
) -> None:
    editor.choose(Tool.PLACE)
    stroke(editor, (14.2, 6.2))
    editor.choose(Tool.SELECT)
    stroke(editor, (14.2, 6.2), (16.2, 15.0))
    assert editor.session.design.layout == ((2, 2),)  # put back: it may not stand there
    assert "path" in editor.message
    stroke(editor, (14.2, 6.2), (15.0, 15.0), (16.2, 8.2))
    assert editor.session.design.layout == ((6, 6),)
    editor.press(16.2, 8.2, erase=True)
    editor.release()
    assert not editor.session.design.layout


def test_a_structure_is_dragged_and_sized_and_put_back_where_it_cannot_be(editor: Editor) -> None:
    stroke(editor, (28.0, 15.0), (29.1, 15.0), (30.1, 15.0))
    assert editor.session.scenario.structures[0].corner_m == (29.0, 10.0)
    assert editor.selected == SiteThing(ThingKind.STRUCTURE)
    stroke(editor, (33.0, 20.0), (35.0, 22.0))  # its upper right corner
    assert editor.session.scenario.structures[0].rows == 24
    before = editor.session.scenario
    editor.press(30.0, 15.0)
    editor.move(38.0, 15.0)
    assert editor.ghost is not None
    assert "must lie inside the site" in editor.ghost.reason
    editor.release()
    assert editor.session.scenario == before


def test_a_vehicle_is_dragged_by_its_entry_or_the_page_says_why_not(tmp_path: Path) -> None:
    work = WorkFolder(tmp_path)
    editor = Editor(Session.opened(work.create(gate_site(), "begin"), work, Workers()))
    stroke(editor, (0.1, 4.0), (0.1, 5.5))
    (entry,) = editor.scenario.vehicles[0].entries
    assert (entry.start_m, entry.end_m) == ((0.0, 3.5), (0.0, 7.5))
    stroke(editor, (0.0, 7.4), (0.0, 6.4))  # at its end, where other things have a handle
    assert editor.scenario.vehicles[0].entries[0].end_m == (0.0, 6.5)
    stroke(editor, (0.1, 5.0), (4.0, 5.0))
    assert "along its side of the border" in editor.message
    assert editor.scenario.vehicles[0].entries[0].end_m == (0.0, 6.5)


def test_a_terrace_that_goes_lets_down_what_stood_on_it_and_says_so(tmp_path: Path) -> None:
    work = WorkFolder(tmp_path)
    editor = Editor(Session.opened(work.create(terraced(), "begin"), work, Workers()))
    editor.selected = SiteThing(ThingKind.STRUCTURE, 1)
    editor.delete()
    assert (editor.scenario.structures[0].base_m, editor.scenario.structures[0].height_m) == (
        0.0,
        3.0,
    )
    assert "hall stands on the ground below it, from 0 m (before: 1 m)" in editor.message


def test_tools_draw(editor: Editor) -> None:
    for tool, start, end in (
        (Tool.STRUCTURE, (35.0, 2.0), (37.0, 4.0)),
        (Tool.KEEP_OUT, (14.0, 20.0), (15.0, 21.0)),
        (Tool.CHARGE, (2.0, 2.0), (2.0, 2.0)),
        (Tool.CHARGE_AREA, (2.0, 26.0), (4.0, 28.0)),
        (Tool.GAUGE, (25.2, 15.2), (25.2, 15.2)),
        (Tool.ZONE, (13.0, 5.0), (22.0, 25.0)),
    ):
        editor.choose(tool)
        stroke(editor, start, end)
        assert not editor.message, tool
    scenario = editor.session.scenario
    assert len(scenario.structures) == 2
    assert len(scenario.zone.keep_outs) == 3
    assert [source.kind for source in scenario.charge] == ["segment", "point", "rectangle"]
    assert len(scenario.gauges) == 1
    assert scenario.zone.columns == 18
    assert len(editor.session.history.past) == 6


def test_the_keyboard_places_moves_and_deletes(editor: Editor) -> None:
    editor.choose(Tool.PLACE)
    editor.step_cursor(0, 0)
    for _ in range(4):
        editor.step_cursor(1, 0)
    assert editor.cursor == (24, 8)
    editor.toggle_at_cursor()
    assert editor.session.design.layout == ((24, 8),)
    editor.toggle_at_cursor()
    assert not editor.session.design.layout
    editor.selected = SiteThing(ThingKind.KEEP_OUT, 1)
    editor.nudge(0.5, 0.0)
    assert editor.session.scenario.zone.keep_outs[1].corner_m == (18.5, 19.5)
    editor.delete()
    assert len(editor.session.scenario.zone.keep_outs) == 1
    editor.selected = SiteThing(ThingKind.STRUCTURE)
    editor.delete()
    assert "structures" in editor.message  # the last protected one


def test_without_a_zone_there_is_a_message(tmp_path: Path) -> None:
    editor = on(tmp_path, "free_field")
    editor.choose(Tool.PLACE)
    stroke(editor, (2.0, 2.0))
    assert "no build zone" in editor.message
    editor.step_cursor(1, 0)
    assert "no build zone" in editor.message


def test_leaving_the_plan_puts_everything_back(editor: Editor) -> None:
    editor.press(28.0, 15.0)
    editor.move(29.0, 15.0)
    assert editor.scenario != editor.session.scenario
    editor.leave()
    editor.release()
    assert editor.scenario == editor.session.scenario == load_scenario("courtyard")


def test_pixels_and_metres_are_each_other_s_reverse() -> None:
    view = PixelView.of(load_scenario("courtyard"), 680, 560).zoomed(1.7).panned(0.1, -0.2)
    x_px, y_px = view.pixel(12.5, 7.0)
    assert view.metres(x_px, y_px) == pytest.approx((12.5, 7.0), abs=0.01)
    middle_m = view.metres(340.0, 280.0)
    assert view.zoomed(2.0).pixel(*middle_m) == pytest.approx((340.0, 280.0), abs=0.02)


def test_the_plan_says_nothing_that_a_browser_could_run() -> None:
    document = load_scenario("courtyard").model_dump(mode="json", exclude_none=True)
    document["build_zone"]["keep_outs"][0]["reason"] = "<script>alert(1)</script>"
    scenario = type(load_scenario("courtyard")).from_document(document, "x")
    view = PixelView.of(scenario, 600, 400)
    svg = plan_svg(view, scenario, ((0, 0),), SiteThing(ThingKind.STRUCTURE))
    assert svg.count("building") == 1
    assert "<script" not in svg


def test_the_plan_has_the_outline_of_a_polygon() -> None:
    silo = column("silo", 8.0, 1.5, 2.0)
    scenario = hut(structures=[*site_document()["structures"], silo])
    svg = plan_svg(PixelView.of(scenario, 600, 450), scenario, (), None)
    line = "#{:02x}{:02x}{:02x}".format(*STRUCTURE)
    (path,) = (match for match in re.findall("<path[^>]*>", svg) if f'stroke="{line}"' in match)
    assert (path.count("M"), path.count("L")) == (1, 7)


def test_the_plan_shows_where_a_vehicle_gets_to() -> None:
    site = gate_site()
    view = PixelView.of(site, 600, 400)
    unprotected, posts = (plan_svg(view, site, layout, None) for layout in ((), POSTS))
    assert "stand-off 1.0 m" in unprotected  # half of its width from the hut
    assert "stand-off 7.0 m" in posts
    assert "vehicle 1: 5 kg" in unprotected


def test_solids_have_the_heights_of_the_site() -> None:
    scenario = hut()
    solids = {box.name: box for box in boxes(scenario, WALL)}
    assert solids["hut"].size_m == (2.0, 2.0, 2.0)
    assert solids["hut"].opacity == 1.0
    assert all(box.centre_m[2] == 0.75 for name, box in solids.items() if name.startswith("cell"))
    open_air = {box.name: box for box in boxes(load_scenario("courtyard"), ())}
    assert open_air["building"].size_m[2] == 12.0
    assert open_air["building"].opacity < 1.0


CATALOGUE = {"name": "t_wall", "length_modules": 4, "height_m": 2.5, "cost": 10.0, "stock": 2}


def test_pieces_of_a_catalogue_are_placed_turned_moved_and_kept(tmp_path: Path) -> None:
    editor = on(tmp_path, "courtyard")
    editor.attempt(
        "catalogue",
        lambda site: edits.with_values(site, SiteThing(ThingKind.ZONE), {"items": [CATALOGUE]}),
    )
    assert [placeable.name for placeable in placing.palette(editor.scenario, ())] == ["t_wall"]
    editor.choose(Tool.PLACE)
    stroke(editor, (13.2, 6.2))
    editor.turned = True
    stroke(editor, (13.2, 8.2))
    assert editor.session.design.layout == (
        Piece(2, 0, "t_wall", False),
        Piece(6, 0, "t_wall", True),
    )
    stroke(editor, (16.2, 8.2))
    assert "stock of 2 pieces is used up" in editor.message
    editor.choose(Tool.SELECT)
    stroke(editor, (13.7, 6.2), (15.0, 6.8), (16.2, 7.2))
    assert editor.session.design.layout[-1] == Piece(4, 6, "t_wall", False)
    kept = WorkFolder(tmp_path).open(editor.session.folder.design_id).load()
    assert kept == editor.session.history
    solids = {box.name: box.size_m for box in boxes(editor.scenario, editor.layout)}
    assert solids["t_wall"] in ((2.0, 0.5, 2.5), (0.5, 2.0, 2.5))
    editor.selected = SiteThing(ThingKind.ITEM)
    editor.delete()  # of a catalogue nothing is left, and single modules are placed again
    assert not editor.session.design.layout
    assert "layout A: 2 removed" in editor.message
    editor.session.undo()
    assert len(editor.session.design.layout) == 2
