"""The page as a user without a browser meets it."""

import asyncio
import logging
import pickle
import signal
import sys
import tomllib
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from pathlib import Path
from time import sleep
from typing import Any

import pytest
from nicegui import Client, events, ui
from nicegui.elements.upload_files import SmallFileUpload
from nicegui.testing import User
from nicegui.testing.user_simulation import user_simulation

from blast_env.app import offers
from blast_env.app.edits import SiteThing, ThingKind
from blast_env.app.folder import WorkFolder
from blast_env.app.jobs import Workers
from blast_env.app.page import uploads
from blast_env.app.page.fields import fields_of
from blast_env.app.page.numbers import NumberField
from blast_env.app.page.plan_view import HEIGHT_PX, WIDTH_PX
from blast_env.app.plan import PixelView
from blast_env.app.server import add_pages
from blast_env.app.session import Sessions
from blast_env.app.work import read_status, write_status
from blast_env.errors import BlastEnvError
from blast_env.reading import Reading
from blast_env.site import Scenario, bundled_scenarios, load_scenario, save_scenario
from tests.app.here import Here
from tests.builders import block
from tests.gas_sites import WALL, glazed_hut, hut
from tests.io.importing.maps import BLOCK
from tests.test_terraces import TERRACE, terraced
from tests.vehicle_sites import gate_site

Story = Callable[[User, Sessions], Awaitable[None]]

PATIENCE_S = 60.0
"""How long a user waits for what he should see."""
PATIENCE = round(PATIENCE_S / 0.1)
"""The looks that he has in this time."""


@contextmanager
def modules_kept() -> Iterator[None]:
    """NiceGUI forgets the modules of pages after a simulation; all else here needs them."""
    before = dict(sys.modules)
    try:
        yield
    finally:
        sys.modules.update(before)


@asynccontextmanager
async def page(folder: Path) -> AsyncIterator[tuple[User, Sessions]]:
    """Yield a user who waits: on a busy machine a page takes longer than the 0.3 s of NiceGUI."""
    sessions = Sessions(WorkFolder(folder), Here())
    async with user_simulation(root=lambda: add_pages(sessions)) as user:
        add_pages(sessions)
        vars(user).update(
            should_see=partial(user.should_see, retries=PATIENCE),
            should_not_see=partial(user.should_not_see, retries=PATIENCE),
        )
        vars(user.download)["next"] = partial(user.download.next, timeout=PATIENCE_S)
        yield user, sessions


def play(folder: Path, story: Story) -> None:
    async def all_of_it() -> None:
        async with page(folder) as (user, sessions):
            await story(user, sessions)

    with modules_kept():
        asyncio.run(all_of_it())


async def opened(user: User, sessions: Sessions, scenario: Scenario) -> Any:
    session = sessions.new(scenario, "begin")
    await user.open(f"/design/{session.folder.design_id}")
    return session


async def until(happened: Callable[[], bool]) -> None:
    """Wait until something has happened, and fail if it does not."""
    for _ in range(PATIENCE):
        if happened():
            return
        await asyncio.sleep(0.1)
    pytest.fail("it did not happen")


def mouse(user: User, kind: str, x_px: float, y_px: float, button: int = 0) -> None:
    plan = user.find(kind=ui.interactive_image)
    args = {"mouse_event_type": kind, "image_x": x_px, "image_y": y_px, "button": button}
    plan.trigger("mouse", args | {"buttons": 1})


def choose(user: User, words: str) -> None:
    """Choose an entry of a menu."""
    items = user.find(kind=ui.menu_item).elements
    (entry,) = (item for item in items if words in {part.text for part in texts_in(item)})
    with user:
        for listener in entry._event_listeners.values():
            if listener.type == "click":
                events.handle_event(
                    listener.handler,
                    events.GenericEventArguments(sender=entry, client=entry.client, args=None),
                )


def texts_in(item: ui.element) -> list[Any]:
    return [descendant for descendant in item.descendants() if hasattr(descendant, "text")]


async def upload(user: User, name: str, content: bytes, times: int = 1) -> None:
    (element,) = user.find(kind=ui.upload).elements
    with user:
        file = SmallFileUpload(name=name, content_type="", _data=content)
        await element.handle_uploads([file] * times)


async def replace_site(user: User, path: Path) -> None:
    choose(user, "replace the site from a file")
    await upload(user, path.name, path.read_bytes())


def test_a_site_is_chosen_a_module_placed_and_taken_back(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        await user.open("/")
        user.find("courtyard").click()
        (entry,) = sessions.work.designs()
        await user.open(f"/design/{entry.design_id}")
        await user.should_see("0 of 16 modules")
        user.find("Place").click()
        mouse(user, "mousedown", 260.0, 400.0)
        mouse(user, "mouseup", 260.0, 400.0)
        await user.should_see("1 of 16 modules")
        user.find("Undo").click()
        await user.should_see("0 of 16 modules")
        user.find("Redo").click()
        await user.should_see("1 of 16 modules")
        # Another server, later: nothing is lost.
        again = Sessions(WorkFolder(tmp_path), Here()).of(entry.design_id)
        assert len(again.design.layout) == 1

    play(tmp_path, story)


def test_the_reason_is_said_while_the_mouse_is_there(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        await opened(user, sessions, load_scenario("courtyard"))
        x_px, y_px = PixelView.of(load_scenario("courtyard"), WIDTH_PX, HEIGHT_PX).pixel(28.0, 15.0)
        mouse(user, "mousemove", x_px, y_px)
        await user.should_see("select and move   building, protected")  # its name, before a click
        user.find("Place").click()
        mouse(user, "mousemove", 260.0, 280.0)
        await user.should_see("the path from the road to the door must stay open")

    play(tmp_path, story)


def test_blast_compare_and_take_a_proposal(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        session.cells = 0.5
        session.put("layout", session.design.with_layout(WALL))
        user.find(marker="blast").click()
        await user.should_see("layout A")

        def loads() -> ui.table:
            """Return the table of loads: there is one of verdicts as well."""
            tables = user.find(kind=ui.table).elements
            return next(table for table in tables if "reduction" in labels(table))

        def labels(table: ui.table) -> list[str]:
            return [column["label"] for column in table.columns]

        table = loads()
        reduction, engine = (str(labels(table).index(name)) for name in ("reduction", "engine"))
        assert [row["0"] for row in table.rows] == ["no barrier"] * 2 + ["A"] * 2
        assert all("%" in row[reduction] for row in table.rows[2:])
        assert {row[engine] for row in table.rows} == {"gas, cells of 0.5 m"}
        await user.open(f"/design/{session.folder.design_id}")  # a reload comes back to the results
        assert next(iter(user.find(kind=ui.tabs).elements)).value == "Results"
        selects = user.find(kind=ui.select).elements
        (proposer,) = (select for select in selects if select.props["label"] == "by")
        assert next(iter(proposer.options)) == offers.PACKAGED
        proposer.value = "wall_near_building"
        user.find(marker="propose").click()
        await user.should_see("use it")
        user.find("use it").click()
        assert session.design.layout not in ((), WALL)
        shown = loads().rows
        assert [row["0"] for row in shown] == ["no barrier"] * 2  # A is another one now

    play(tmp_path, story)


def test_a_report_is_followed_when_the_page_is_loaded_anew_and_fetched_at_the_end(
    tmp_path: Path,
) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        sessions.workers = Workers(most=0)  # nothing is done but what is written here
        session = await opened(user, sessions, hut())
        await user.should_see("nothing yet: press Blast")
        session.put("wall", session.design.with_layout(WALL))
        folder, report = session.report(tmp_path / "hut_A.html"), tmp_path / "hut_A.html"
        running = read_status(folder).model_copy(update={"state": "running", "share": 0.4})
        for blasts in (3, 4):
            write_status(running.model_copy(update={"text": f"{blasts} of 9 blasts"}), folder)
            await user.should_see("report hut_A.html")
            await user.should_see(f"{blasts} of 9 blasts")
            await user.open(f"/design/{session.folder.design_id}")
        await user.should_see("stop")
        (stop,) = user.find("stop").elements
        write_status(running.model_copy(update={"text": "5 of 9 blasts"}), folder)
        await user.should_see("5 of 9 blasts")
        assert user.find("stop").elements == {stop}  # it does not go from under the mouse
        report.write_text("loads")
        write_status(running.model_copy(update={"state": "done", "file": str(report)}), folder)
        await user.should_see("download")
        user.find("download").click()
        assert (await user.download.next()).url.path.endswith("hut_A.html")

    play(tmp_path, story)


def test_gas_results_have_maps_walls_and_gauges(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        session.blast([1])  # an empty one: no barrier
        await user.should_see("mean impulse on protected facades: ")
        (label,) = user.find("mean impulse on protected facades: ").elements
        assert "\N{PLUS-MINUS SIGN}" in str(getattr(label, "text", ""))
        await user.should_see("grid error, from the worst charge")
        pictures = next(
            element
            for element in user.find(kind=ui.select).elements
            if element.props["label"] == "picture"
        )
        for picture in (
            "film",
            "peak over the ground",
            "impulse on the walls of hut",
            "gauge front",
        ):
            assert picture in pictures.options
            pictures.value = picture
        response = await user.http_client.get(
            f"/blasts/{session.folder.design_id}/{session.shown(session.chosen_threats()[0])[0].key}"
            "/map_peak.png"
        )
        assert response.content.startswith(b"\x89PNG")

    play(tmp_path, story)


def choose_thing(user: User, thing: str) -> None:
    selects = user.find(kind=ui.select).elements
    next(select for select in selects if select.props["label"] == "selected").value = thing


def field_of(user: User, label: str) -> NumberField:
    fields = user.find(kind=NumberField).elements
    return next(field for field in fields if field.props["label"] == label)


def test_a_number_is_read_as_it_is_meant_or_refused(tmp_path: Path) -> None:
    """tests/test_documents.py has what is clear; what is not changes nothing."""

    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        choose_thing(user, "charge 0")
        mass = field_of(user, "mass (kg TNT)")

        def type_mass(text: str) -> None:
            mass.value = text
            user.find("mass (kg TNT)").trigger("blur")

        for typed, tnt_kg in ((" 1000 kg TNT ", 1000.0), ("50,5", 50.5)):
            type_mass(typed)
            assert session.scenario.charge[0].tnt_kg == tnt_kg
            assert (mass.value, mass.props["suffix"]) == (f"{tnt_kg:g}", "kg TNT")
        type_mass("1.000,5")
        assert session.scenario.charge[0].tnt_kg == 50.5
        assert mass.value == "50.5"
        await user.should_see("mass is '1.000,5'")

    play(tmp_path, story)


def test_fields_change_the_site_or_say_why_not(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        choose_thing(user, "structure 0")
        height = field_of(user, "height (m)")
        height.value = "3.5"
        user.find("height (m)").trigger("blur")
        assert session.scenario.structures[0].height_m == 3.5
        height.value = "0.1"
        user.find("height (m)").trigger("blur")
        assert session.scenario.structures[0].height_m == 3.5
        await user.should_see("greater than or equal to 0.5")
        windows = next(
            element
            for element in user.find(kind=ui.select).elements
            if element.props["label"] == "windows"
        )
        windows.value = "window_annealed_6"
        facade = session.scenario.structures[0].facade
        assert facade is not None
        assert facade.glazing == "window_annealed_6"
        windows.value = None
        assert session.scenario.structures[0].facade is None

    play(tmp_path, story)


def test_a_vehicle_has_fields_of_its_own(tmp_path: Path) -> None:
    """The fields of the site had stayed, and what was typed from then on had changed nothing."""

    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, gate_site())
        choose_thing(user, "charge 0")
        width = field_of(user, "width of the vehicle (m)")
        assert width.value == "2"
        width.value = "2.5"
        user.find("width of the vehicle (m)").trigger("blur")
        (vehicle,) = session.scenario.vehicles
        assert vehicle.width_m == 2.5
        assert session.scenario.site.width_m == 14.0

    play(tmp_path, story)


@pytest.mark.parametrize("name", bundled_scenarios())
def test_each_charge_of_a_site_has_fields(name: str) -> None:
    site = load_scenario(name)
    for number in range(len(site.charge)):
        fields = fields_of(site, SiteThing(ThingKind.CHARGE, number))
        assert len({field.label for field in fields}) == len(fields) > 4


def test_panels_of_one_side_are_chosen_in_the_fields(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, glazed_hut())

        def select(label: str) -> ui.select:
            found = user.find(kind=ui.select).elements
            return next(element for element in found if element.props.get("label") == label)

        select("selected").value = "structure 0"
        select("windows and walls of").value = "west"
        select("wall panels, west side").value = "concrete_200"
        facade = session.scenario.structures[0].facade
        assert facade is not None
        assert [(part.walls, part.wall) for part in facade.parts] == [(("west",), "concrete_200")]
        select("windows and walls of").value = ""
        assert select("wall panels").value == facade.wall != "concrete_200"

    play(tmp_path, story)


def test_a_terrace_and_a_canopy_survive_the_page(tmp_path: Path) -> None:
    """From a file, edited in the fields, and saved."""
    canopy = block("canopy", 2.0, 9.0, 2, 4, base_m=2.5, height_m=3.0)
    site = terraced(TERRACE, canopy)
    path = tmp_path / "site.toml"
    save_scenario(site, path)

    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        await replace_site(user, path)
        await user.should_see("podium")
        assert session.scenario == site
        fields = {field.label: field for field in fields_of(site, SiteThing(ThingKind.STRUCTURE))}
        for label in ("base height (m)", "terrace"):
            assert fields[label].hint

        def shown(kind: type[Any], label: str) -> Any:
            found = user.find(kind=kind).elements
            return next(
                element
                for element in found
                if label in (element.props.get("label"), getattr(element, "text", ""))
            )

        chooser = shown(ui.select, "selected")
        chooser.value = "structure 1"
        assert shown(ui.switch, "terrace").value is True
        shown(ui.switch, "terrace").value = False
        assert not session.scenario.structures[1].carries
        shown(ui.switch, "terrace").value = True
        chooser.value = "structure 2"
        assert shown(ui.switch, "terrace").value is False
        shown(ui.switch, "terrace").value = True
        await user.should_see("must be 0: a terrace is solid")
        begins = field_of(user, "base height (m)")
        assert begins.value == "2.5"
        begins.value = "2"
        user.find("base height (m)").trigger("blur")
        choose(user, "site: scenario file (.toml)")
        saved = (await user.download.next()).content.decode()
        assert Scenario.from_document(tomllib.loads(saved), "saved") == terraced(
            TERRACE, canopy | {"base_m": 2.0}
        )

    play(tmp_path / "designs", story)


def test_an_unknown_design_leads_to_the_list_with_a_message(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        await user.open("/design/nothing")
        await user.should_see("there is no design 'nothing'")
        await user.should_see("Start from a site of your own")
        response = await user.http_client.get("/blasts/nothing/key/000.jpg")
        assert response.status_code == 404

    play(tmp_path, story)


def test_a_broken_file_is_a_message_and_the_design_stays(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        before = session.design
        choose(user, "replace the site from a file")
        await upload(user, "bad.toml", b"schema_version = ")
        await user.should_see("line 1, column 18")
        await user.should_see("Nothing was changed")
        assert session.design == before

    play(tmp_path, story)


class ReadHere(Reading[Any]):
    """Reads in this process what would go to another and come back from it."""

    def __init__(self, what: str, function: Callable[..., Any], *arguments: Any) -> None:
        self._work = pickle.dumps((function, arguments))

    def result(self) -> Any:
        function, arguments = pickle.loads(self._work)
        return pickle.loads(pickle.dumps(function(*arguments)))

    def end(self) -> None:
        """End nothing."""

    def __exit__(self, *_: object) -> None:
        """Close nothing."""


def test_a_map_becomes_a_site_with_its_deviations_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "Reading", ReadHere)

    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        await replace_site(user, BLOCK)
        await user.should_see("protected buildings (names, separated by commas)")
        mass = field_of(user, "mass of a charge (kg TNT)")
        mass.value = "110 lb"
        user.find(marker="import").click()
        await user.should_see("mass of a charge is '110 lb', must be a number in kg TNT")
        mass.value = "50,5"
        user.find(marker="import").click()
        await user.should_see("no building is protected")
        user.find(marker="sketch").click()
        await user.should_see("Click the building to protect.")
        user.find("middle of the site, x, y of the file (or all of it)").type("7.5006, 54.80045")
        user.find("width, depth of the site (m), with its middle").type("60, 50")
        user.find("protected buildings (names, separated by commas)").type("Town Hall")
        user.find(marker="import").click()
        await user.should_see(marker="take-site")
        await user.should_see("of its outline")
        user.find(marker="take-site").click()
        assert session.scenario.georeference is not None
        assert {source.tnt_kg for source in session.scenario.charge} == {50.5}
        assert any(structure.protected for structure in session.scenario.structures)
        assert (session.scenario.site.width_m, session.scenario.site.height_m) == (60.0, 50.0)

    play(tmp_path, story)


def test_the_build_zone_of_a_map_is_kept_where_no_other_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "Reading", ReadHere)

    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        await replace_site(user, BLOCK)
        await user.should_see("protected buildings (names, separated by commas)")
        user.find("protected buildings (names, separated by commas)").type("Town Hall")
        field_of(user, "build zone around the protected buildings (m)").value = ""
        user.find(marker="import").click()
        await user.should_see(marker="take-site")
        user.find(marker="take-site").click()
        zone = session.scenario.zone
        assert (zone.rows, zone.columns) == (8, 64)  # of 32 m x 4 m on the map

    play(tmp_path, story)


def test_a_page_that_is_closed_while_a_file_is_read_leaves_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a traceback, nor a process that reads on, nor the open design."""

    started: list[Reading[Any]] = []

    class Noted(Reading[Any]):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            started.append(self)

    monkeypatch.setattr(uploads, "Reading", Noted)

    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        await replace_site(user, BLOCK)
        await user.should_see("protected buildings (names, separated by commas)")
        user.find("protected buildings (names, separated by commas)").type("Library")
        user.find(marker="import").click()
        await until(lambda: bool(started))
        (reading,) = started
        assert user.client is not None
        user.client.delete()
        assert reading._process.wait(PATIENCE_S) == -signal.SIGKILL
        await until(lambda: sessions.of(session.folder.design_id) is not session)  # opened anew

    play(tmp_path, story)
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


def test_not_all_files_are_read_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    at_work: list[int] = []

    class Counted:
        def __init__(self, *_: object) -> None:
            at_work.append(at_work[-1] + 1 if at_work else 1)

        def __enter__(self) -> "Counted":
            return self

        def result(self) -> Scenario:
            sleep(0.05)
            raise BlastEnvError("no site")

        def end(self) -> None:
            """End nothing."""

        def __exit__(self, *_: object) -> None:
            at_work.append(at_work[-1] - 1)

    monkeypatch.setattr(uploads, "Reading", Counted)

    async def story(user: User, sessions: Sessions) -> None:
        await user.open("/")
        await upload(user, "x.toml", b"x", times=5)
        await until(lambda: len(at_work) == 10)
        assert max(at_work) == 2
        assert at_work[-1] == 0

    play(tmp_path, story)


def test_so_many_pages_and_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    most = 3
    monkeypatch.setattr("blast_env.app.server.MOST_PAGES", most)

    async def story(user: User, sessions: Sessions) -> None:
        session = sessions.new(hut(), "begin")
        address = f"/design/{session.folder.design_id}"
        answers = [await user.http_client.get(address) for _ in range(most + 2)]
        assert [answer.status_code for answer in answers[-3:]] == [200, 503, 503]
        assert f"{most} pages are open, the most that may be is" in answers[-1].text
        assert len(Client.instances) == most
        next(iter(Client.instances.values())).delete()
        assert (await user.http_client.get(address)).status_code == 200

    play(tmp_path, story)


def test_a_design_is_open_as_long_as_a_page_shows_it(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        address = f"/design/{session.folder.design_id}"
        await user.http_client.get(address)
        first, second = Client.instances.values()
        first.delete()
        assert sessions.of(session.folder.design_id) is session
        second.delete()
        assert sessions.of(session.folder.design_id) is not session

    play(tmp_path, story)


def test_layouts_are_saved_in_every_form(tmp_path: Path) -> None:
    async def story(user: User, sessions: Sessions) -> None:
        session = await opened(user, sessions, hut())
        session.put("wall", session.design.with_layout(WALL))
        for suffix in (".json", ".csv", ".geojson", ".dxf"):
            choose(user, f"layout: {suffix}")
            response = await user.download.next()
            assert len(response.content) > 50

    play(tmp_path, story)
