"""A design: always legal, every step can be undone, and all of it comes back from the folder."""

import json
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.app import edits
from blast_env.app.design import MOST_STEPS, Design, DesignStep, History
from blast_env.app.edits import SiteThing, ThingKind
from blast_env.app.folder import WorkFolder
from blast_env.app.sources import imported_site
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.io.importing import ImportOptions
from blast_env.site import load_scenario
from tests.gas_sites import WALL, hut

COURTYARD = load_scenario("courtyard")


def begun() -> History:
    return History(DesignStep("begin", Design(hut())))


def test_a_layout_that_is_not_legal_is_no_design() -> None:
    with pytest.raises(LayoutError, match="outside the build zone"):
        Design(hut()).with_layout(((99, 0),))


def test_layouts_are_apart() -> None:
    design = Design(hut()).with_layout(WALL).with_layout(WALL[:2], 2)
    assert design.layouts == (WALL, (), WALL[:2], ())


def test_what_cannot_stand_on_a_changed_site_falls_away_with_its_reason() -> None:
    design = Design(COURTYARD).with_layout(((0, 0), (39, 0)))
    after, notes = design.with_scenario(
        edits.added(COURTYARD, ThingKind.KEEP_OUT, (13.0, 5.0), (14.0, 6.0))[0]
    )
    assert after.layouts[0] == ((39, 0),)
    assert notes == ("layout A: 1 removed: cell (0, 0) must stay empty: must stay free",)


@given(st.lists(st.sampled_from("+u<>"), max_size=30))
def test_undo_and_redo_are_each_other_s_reverse(moves: list[str]) -> None:
    """Against a plain list of states with a place in it."""
    history = begun()
    states, at = [history.design], 0
    for number, move in enumerate(moves):
        if move in "+u":
            size = 2.0 + 0.5 * (number % 6)
            site = edits.with_values(hut(), SiteThing(ThingKind.STRUCTURE), {"height_m": size})
            design = Design(site).with_layout(WALL if move == "+" else ())
            history = history.then(str(number), design)
            if design != states[at]:
                states, at = [*states[: at + 1], design], at + 1
        elif move == "<":
            history, at = history.undone(), max(at - 1, 0)
        else:
            history, at = history.redone(), min(at + 1, len(states) - 1)
        assert history.design == states[at]
        assert len(history.past) == at
        assert len(history.future) == len(states) - 1 - at


def test_the_oldest_steps_go_when_there_are_too_many() -> None:
    history = begun()
    for number in range(MOST_STEPS + 5):
        history = history.then(str(number), history.design.with_layout(WALL[: 1 + number % 2]))
    assert len(history.past) == MOST_STEPS


def test_a_step_that_changes_nothing_is_none_and_looking_at_another_layout_too() -> None:
    history = begun()
    assert history.then("again", history.design) is history
    shown = history.showing(2)
    assert shown.design.active == 2
    assert shown.past == ()


def test_all_steps_come_back_from_the_folder(tmp_path: Path) -> None:
    folder = WorkFolder(tmp_path).create(hut(), "begin")
    history = folder.load().then("wall", Design(hut()).with_layout(WALL))
    history = history.then("half", history.design.with_layout(WALL[:3])).undone()
    folder.save(history)
    assert WorkFolder(tmp_path).open(folder.design_id).load() == history
    kept = json.loads((folder.path / "design.json").read_text())
    assert len(kept["sites"]) == 1  # once, however many steps


def test_designs_are_listed_and_a_damaged_one_says_so(tmp_path: Path) -> None:
    work = WorkFolder(tmp_path)
    good, bad = work.create(hut(), "begin"), work.create(COURTYARD, "begin")
    (bad.path / "design.json").write_text('{"present"')
    by_id = {design.design_id: design for design in work.designs()}
    assert by_id[good.design_id].title == "hut"
    assert "cannot be read" in by_id[bad.design_id].problem
    with pytest.raises(BlastEnvError, match="cannot be read"):
        bad.load()


def test_a_design_that_was_never_finished_is_none(tmp_path: Path) -> None:
    """As a kill leaves it between the folder and its file."""
    work = WorkFolder(tmp_path)
    good, unfinished = work.create(hut(), "begin"), work.create(hut(), "begin")
    (unfinished.path / "design.json").unlink()
    assert [design.design_id for design in work.designs()] == [good.design_id]


@pytest.mark.parametrize("content", ["[]", "{}", '{"present": 3, "sites": []}'])
def test_what_is_no_design_is_refused(tmp_path: Path, content: str) -> None:
    folder = WorkFolder(tmp_path).create(hut(), "begin")
    (folder.path / "design.json").write_text(content)
    with pytest.raises(BlastEnvError, match="is not a design"):
        folder.load()


@pytest.mark.parametrize("name", ["..", "../other", "a/b", "", "nothing", "a" * 5000, "a\n"])
def test_a_name_leads_nowhere_else(tmp_path: Path, name: str) -> None:
    with pytest.raises(BlastEnvError, match=r"is no name|no design"):
        WorkFolder(tmp_path).open(name)


def test_a_folder_is_for_one_server(tmp_path: Path) -> None:
    work = WorkFolder(tmp_path)
    with (
        work.held("http://here:1"),
        pytest.raises(BlastEnvError, match="open already at http://here:1"),
        WorkFolder(tmp_path).held("http://here:2"),
    ):
        pass
    with work.held("http://here:3"):
        pass


def test_a_folder_that_a_killed_server_held_is_free(tmp_path: Path) -> None:
    child = os.fork()
    if child == 0:
        with WorkFolder(tmp_path).held("http://gone"):
            os._exit(0)
    os.waitpid(child, 0)
    with WorkFolder(tmp_path).held("http://here"):
        pass


def test_a_build_zone_of_a_map_comes_before_one_around_what_is_protected(tmp_path: Path) -> None:
    path = Path(__file__).parents[2] / "docs" / "data" / "pump_house.geojson"
    options = ImportOptions(protect=("Pump House",), zone_around_m=10.0, stock=8, wall_height_m=3.0)
    zone = imported_site(path, options).scenario.zone
    assert (zone.corner_m, zone.rows, zone.columns) == ((8.0, 4.0), 20, 8)
    document = json.loads(path.read_text())
    document["features"] = [
        feature
        for feature in document["features"]
        if feature["properties"].get("kind") != "build_zone"
    ]
    without = tmp_path / path.name
    without.write_text(json.dumps(document))
    around = imported_site(without, options).scenario.zone
    assert around.rows > 20
