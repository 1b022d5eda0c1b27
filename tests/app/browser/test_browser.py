"""The page in a real browser: `make test-browser`. Screenshots are in out/app, to be looked at.

Chromium and its driver are Debian's packages chromium and chromium-driver. The server is the
command itself, in a process of its own.
"""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest
from selenium import webdriver
from selenium.common.exceptions import StaleElementReferenceException
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from blast_env.app.plan import PixelView
from blast_env.site import Scenario, load_scenario, save_scenario
from tests.office_park import office_park

WIDTH, HEIGHT = 1280, 800
REPOSITORY = Path(__file__).parents[3]
PICTURES, DATA = REPOSITORY / "out" / "app", REPOSITORY / "docs" / "data"
CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")

pytestmark = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None, reason="needs chromium and chromium-driver"
)


def high_courtyard() -> Scenario:
    """The courtyard with heights and a gauge."""
    document = load_scenario("courtyard").model_dump(mode="json", exclude_none=True)
    document |= {"schema_version": 2, "name": "courtyard_high"}
    document["structures"][0]["height_m"] = 6.0
    document["build_zone"]["height_m"] = 3.0
    document["gauges"] = [{"name": "door", "position_m": [26.75, 15.25, 1.25]}]
    return Scenario.from_document(document, "courtyard_high")


@dataclass
class Server:
    """The command, in a process of its own."""

    folder: Path
    port: int = 0
    process: "subprocess.Popen[str] | None" = field(default=None, init=False)
    token: str = field(default="", init=False)

    def start(self) -> None:
        if not self.port:
            with socket.socket() as probe:
                probe.bind(("127.0.0.1", 0))
                self.port = probe.getsockname()[1]
        command = [sys.executable, "-m", "blast_env", "app", "--port", str(self.port)]
        # NiceGUI would take the server for one of its own tests.
        own = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
        command += ["--folder", str(self.folder)]
        self.process = subprocess.Popen(command, text=True, env=own, stdout=subprocess.PIPE)
        assert self.process.stdout is not None
        self.token = self.process.stdout.readline().split("token=")[1].split()[0]
        until_s = monotonic() + 180.0
        while monotonic() < until_s:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            sleep(0.2)
        self.stop()
        raise AssertionError("the server does not answer")

    def stop(self, kind: signal.Signals = signal.SIGTERM) -> None:
        if self.process is not None:
            self.process.send_signal(kind)
            self.process.wait(60)
            if self.process.stdout is not None:
                self.process.stdout.close()
            self.process = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"


@dataclass
class Page:
    """A browser, in the words of somebody who sits before it."""

    driver: Any
    server: Server

    def open(self, path: str = "/") -> None:
        self.driver.get(f"{self.server.url}{path}?token={self.server.token}")
        self.until(lambda: "token" not in self.driver.current_url)
        sleep(1.0)

    def begin(self, name: str) -> None:
        self.open()
        self.button(name).click()
        self.until(lambda: "/design/" in self.driver.current_url)
        self.until(lambda: self.all(".be-plan svg text"))
        sleep(0.5)

    def all(self, css: str) -> list[Any]:
        found: list[Any] = self.driver.find_elements(By.CSS_SELECTOR, css)
        return found

    def upload(self, path: Path) -> None:
        """Give the start page a file."""
        self.until(lambda: self.all("input[type=file]"))[0].send_keys(str(path))

    def button(self, words: str) -> Any:
        def find() -> Any:
            for found in self.all("button, .q-tab, .q-item"):
                if found.is_displayed() and words in found.text.split("\n"):
                    return found
            return None

        return self.until(find)

    def text(self) -> str:
        return str(self.driver.find_element(By.TAG_NAME, "body").text)

    def until(self, what: Callable[[], Any], most_s: float = 60.0) -> Any:
        until_s = monotonic() + most_s
        while monotonic() < until_s:
            try:
                found = what()
            except StaleElementReferenceException:
                found = None
            if found:
                return found
            sleep(0.1)  # the browser, too, has to work
        self.shoot("failed")
        raise AssertionError(f"did not come within {most_s:g} s")

    def sees(self, words: str, most_s: float = 60.0) -> None:
        self.until(lambda: words in self.text(), most_s)

    def drag(self, scenario: Scenario, *places: tuple[float, float], hold: bool = True) -> None:
        """Move the mouse over places of the site, its button down from the first to the last."""
        plan = self.driver.find_element(By.CSS_SELECTOR, ".be-plan")
        width, height = plan.rect["width"], plan.rect["height"]
        view = PixelView.of(scenario, 680, 560)
        actions = ActionChains(self.driver, duration=30)
        for number, place in enumerate(places):
            x_px, y_px = view.pixel(*place)
            right, down = x_px * width / 680 - width / 2, y_px * height / 560 - height / 2
            actions.move_to_element_with_offset(plan, round(right), round(down))
            if hold and number == 0:
                actions.click_and_hold()
        if hold:
            actions.release()
        actions.perform()
        sleep(0.3)

    def choose(self, label: str, option: str) -> None:
        """Choose an option of a select by their words."""
        for found in self.all(".q-select"):
            if found.is_displayed() and label in found.text.split("\n"):
                found.click()
                break

        def find() -> Any:
            offered = [found for found in self.all(".q-menu .q-item") if found.is_displayed()]
            return next((found for found in offered if found.text.strip().startswith(option)), None)

        self.until(find).click()
        sleep(0.4)
        self.press(Keys.ESCAPE)

    def showing(self, words: str) -> Any:
        """Return the select or option that begins with some words; `None` if none is there yet."""
        for found in self.all(".q-menu .q-item, .q-dialog .q-select .q-field__native"):
            if found.is_displayed() and found.text.strip().startswith(words):
                return found
        return None

    def fill(self, label: str, text: str) -> None:
        """Write into the field of a label, in the place of what is there."""
        for found in self.all(".q-field"):
            if found.is_displayed() and label in found.text:
                field = found.find_element(By.TAG_NAME, "input")
                field.send_keys(Keys.CONTROL, "a")
                field.send_keys(text)
                return
        raise AssertionError(f"there is no field {label!r}")

    def press(self, *keys: str) -> None:
        ActionChains(self.driver).send_keys(*keys).perform()
        sleep(0.15)

    def picture_widths(self) -> list[int]:
        """Return how wide the pictures are that are shown; 0 for one that is still to come."""
        return [found.get_property("naturalWidth") for found in self.all(".be-card img")]

    def shoot(self, name: str) -> None:
        PICTURES.mkdir(parents=True, exist_ok=True)
        self.driver.save_screenshot(str(PICTURES / f"{name}.png"))

    def faults(self) -> list[str]:
        """Return what the browser complained about."""
        entries = self.driver.get_log("browser")
        return [entry["message"] for entry in entries if entry["level"] == "SEVERE"]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("designs"))
    server.start()
    yield server
    server.stop()


@pytest.fixture
def page(server: Server, tmp_path: Path) -> Iterator[Page]:
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM or ""
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--enable-unsafe-swiftshader",
        "--hide-scrollbars",
        f"--window-size={WIDTH},{HEIGHT}",
        f"--user-data-dir={tmp_path / 'profile'}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    downloads = {"download.default_directory": str(tmp_path / "downloads")}
    options.add_experimental_option("prefs", downloads)
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    size = {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        yield Page(driver, server)
    finally:
        driver.quit()


WALL_NEAR = [(13.25, 16.25 + 0.5 * k) for k in range(8)]
WALL_FAR = [(20.25, 16.25 + 0.5 * k) for k in range(8)]


def test_place_blast_and_compare(page: Page) -> None:
    courtyard = load_scenario("courtyard")
    page.open()
    page.shoot("start")
    page.begin("courtyard")
    page.button("Place").click()
    page.drag(courtyard, *WALL_NEAR)
    page.sees("8 of 16 modules")
    page.drag(courtyard, (15.25, 15.0), hold=False)
    page.sees("the path from the road to the door must stay open")
    page.shoot("plan")
    page.button("B").click()
    page.drag(courtyard, *WALL_FAR)
    page.sees("8 of 16 modules")

    page.choose("gas dynamics", "cells of 0.5 m")
    page.button("all").click()
    page.until(lambda: page.picture_widths() == [640, 640, 640], 1800.0)
    page.until(lambda: len(page.all(".q-table tbody tr")) == 6)
    page.shoot("results")
    assert not page.faults()


PLACES = """
const places = [".be-plan", ".be-status"].map((css) => {
  const { x, y, width, height } = document.querySelector(css).getBoundingClientRect();
  return [x, y, width, height];
});
return [...places, document.documentElement.scrollHeight];
"""


def test_the_plan_and_what_is_below_it_stay_in_place_when_a_message_comes(page: Page) -> None:
    courtyard = load_scenario("courtyard")
    page.begin("courtyard")
    page.button("Place").click()
    before = page.driver.execute_script(PLACES)
    page.drag(courtyard, (15.25, 15.0), hold=False)
    page.sees("the path from the road to the door must stay open")
    assert page.driver.execute_script(PLACES) == before
    page.drag(courtyard, (15.25, 15.0))  # pressed: it stays as a message
    assert "the path from the road to the door must stay open" in page.text()
    assert page.driver.execute_script(PLACES) == before


def test_the_view_in_3d_is_drawn_only_while_it_is_seen(page: Page) -> None:
    page.begin("courtyard")
    page.button("3-D").click()
    page.until(lambda: page.all(".nicegui-scene:not([data-initializing])"))
    keep = "const at = document.querySelector('.nicegui-scene');"
    keep += "window.scene3d = getElement(Number(at.id.slice(1)))"
    page.driver.execute_script(keep)

    def drawn() -> int:
        return int(page.driver.execute_script("return scene3d.renderer.info.render.frame"))

    begun = drawn()
    page.until(lambda: drawn() > begun + 3)
    page.button("Plan").click()
    page.until(lambda: not page.all(".nicegui-scene"))
    hidden = drawn()
    sleep(2.0)
    assert drawn() == hidden
    page.button("3-D").click()
    page.until(lambda: drawn() > hidden + 3)


def test_gas_with_heights_from_a_file_of_one_s_own(page: Page, tmp_path: Path) -> None:
    site = high_courtyard()
    save_scenario(site, tmp_path / "courtyard_high.toml")
    page.open()
    (tmp_path / "broken.toml").write_text("schema_version = 1\nname = 3\n")
    page.upload(tmp_path / "broken.toml")
    page.sees("This could not be done")
    sleep(0.5)  # until it does not shine through any more
    page.shoot("broken_file")
    page.button("close").click()
    sleep(0.5)
    page.upload(tmp_path / "courtyard_high.toml")
    page.until(lambda: "/design/" in page.driver.current_url)
    page.until(lambda: page.all(".be-plan svg text"))
    page.button("Place").click()
    page.drag(site, *[(13.25, 16.25 + 0.5 * k) for k in range(12)])
    page.sees("12 of 16 modules")
    page.button("3-D").click()
    sleep(2.5)
    page.shoot("solid")
    page.button("Blast").click()
    sleep(4.0)
    page.shoot("gas_running")
    page.until(lambda: len(page.all(".q-table tbody tr")) == 4, 1800.0)
    page.until(lambda: page.picture_widths() == [640, 640])
    # Films that begin together, so that they show the same moment, are from memory.
    films = "img.be-film"
    page.until(
        lambda: all(f"{found.get_attribute('src')}"[:5] == "blob:" for found in page.all(films))
    )
    sleep(2.0)
    page.shoot("results_gas_film")
    for number, picture in enumerate(("peak over", "impulse on the walls", "gauge door")):
        page.choose("picture", picture)
        sleep(1.5)
        page.shoot(("results_gas_map", "results_gas_walls", "results_gas_gauges")[number])
    assert "gas, cells of 0.25 m" in page.text()
    assert not page.faults()


def test_numbers_are_read_as_they_are_meant_or_refused(page: Page) -> None:
    """Number fields of browsers drop the comma and the unit, and keep the digits."""
    page.begin("courtyard")
    page.choose("selected", "charge")

    def shows_mass(shown: str) -> bool:
        for found in page.all(".q-field"):
            if found.is_displayed() and "mass (kg TNT)" in found.text:
                number = found.find_element(By.TAG_NAME, "input").get_attribute("value")
                unit = found.find_element(By.CSS_SELECTOR, ".q-field__suffix").text
                return f"{number} {unit}" == shown
        return False

    taken = ("50,5", "50.5 kg TNT"), ("36,2 kg", "36.2 kg TNT"), ("100", "100 kg TNT")
    for typed, shown in taken:
        page.fill("mass (kg TNT)", typed + Keys.TAB)
        page.until(partial(shows_mass, shown))
    for typed in ("1.000,5", "110 lb", "36,2 m", "1,000"):
        page.fill("mass (kg TNT)", typed + Keys.TAB)
        page.sees(f"mass is '{typed}'")
        page.until(partial(shows_mass, "100 kg TNT"))
    assert "height is" not in page.text()  # a field that was left as it was
    page.shoot("numbers")
    assert not page.faults()


def test_search_stop_keep_save_and_lose_nothing(page: Page, server: Server, tmp_path: Path) -> None:
    page.begin("courtyard")
    address = page.driver.current_url.removeprefix(server.url)
    page.choose("gas dynamics", "cells of 0.5 m")
    page.choose("by", "search: random")
    budget = next(
        found
        for found in page.all("input[inputmode=numeric]")
        if found.get_attribute("value") == "50"
    )
    budget.send_keys(Keys.CONTROL, "a")
    budget.send_keys("5000")
    page.button("Propose").click()
    page.sees("best reduction", 120.0)
    page.shoot("search")
    page.button("stop").click()
    page.sees("stopped")
    page.button("use it").click()
    page.sees("16 of 16 modules")
    page.button("Save as").click()
    sleep(0.5)
    page.button("layout: .json").click()
    saved = page.until(lambda: [*(tmp_path / "downloads").glob("*.json")])
    assert len(json.loads(saved[0].read_text())["cells"]) == 16

    page.driver.refresh()  # a reload
    page.sees("16 of 16 modules")
    server.stop(signal.SIGKILL)  # and the server killed, at once
    server.start()
    page.open(address)
    page.sees("16 of 16 modules")
    page.button("Undo").click()
    page.sees("0 of 16 modules")


def test_all_by_the_keyboard(page: Page) -> None:
    page.begin("courtyard")
    plan = page.driver.find_element(By.CSS_SELECTOR, ".be-plan")
    page.driver.execute_script("arguments[0].focus()", plan)
    page.press("p", Keys.ARROW_UP)
    for _ in range(4):
        page.press(Keys.ARROW_UP)
    page.press(Keys.ENTER)
    page.sees("1 of 16 modules")
    page.shoot("keyboard")
    page.press("b")
    page.sees("blast of A", 10.0)
    ActionChains(page.driver).key_down(Keys.CONTROL).send_keys("z").key_up(Keys.CONTROL).perform()
    page.sees("0 of 16 modules")
    reached: set[str] = set()
    for _ in range(90):
        page.press(Keys.TAB)
        active = page.driver.switch_to.active_element
        reached.add(active.text.split("\n")[-1] or active.get_attribute("aria-label") or "")
    wanted = {"Redo", "Results", "Blast", "Propose"}  # tabs go on by arrow keys
    assert wanted <= reached, sorted(reached)


def test_two_tabs_do_not_mix_and_a_second_server_is_refused(page: Page, server: Server) -> None:
    page.begin("courtyard")
    first = page.driver.current_url
    page.driver.switch_to.new_window("tab")
    page.begin("perimeter_gate")
    assert page.driver.current_url != first
    page.sees("perimeter_gate")
    page.driver.switch_to.window(page.driver.window_handles[0])
    assert "perimeter_gate" not in page.text().split("\n")[:3]
    for port, words in ((server.port, "cannot be used"), (server.port + 1, "is open already")):
        command = [sys.executable, "-m", "blast_env", "app", "--port", str(port)]
        done = subprocess.run(
            [*command, "--folder", str(server.folder)],
            capture_output=True,
            text=True,
            env={**os.environ, "COLUMNS": "300"},
        )
        assert done.returncode == 2
        assert words in done.stderr


def test_from_a_public_extract_to_the_verdict(page: Page) -> None:
    """A car park of OpenStreetMap by the page alone, on coarse cells; its seconds are written."""
    began_s = monotonic()
    stages: list[str] = []

    def reached(stage: str) -> None:
        stages.append(f"{monotonic() - began_s:.0f} s: {stage}")
        (PICTURES / "extract_to_verdict.txt").write_text("\n".join(stages) + "\n")

    PICTURES.mkdir(parents=True, exist_ok=True)
    page.open()
    page.upload(DATA / "car_park.osm")
    page.sees("protected buildings")
    for label in ("middle of the site", "or the building nearest to"):
        page.fill(label, "26.944, 60.5227")
    page.fill("width, depth of the site", "90, 90")
    page.button("import").click()
    page.sees("modules off by")
    page.button("use this site").click()
    page.until(lambda: "/design/" in page.driver.current_url)
    page.until(lambda: page.all(".be-plan svg text"))
    page.choose("selected", "building_1")
    page.choose("windows", "window, laminated, 3 + 3 mm")
    page.choose("wall panels", "reinforced concrete wall, 200 mm")
    reached("the site with its windows and walls")
    page.button("Screening").click()
    page.sees("worst place by damage", 300.0)
    reached("stand-offs")
    page.choose("gas dynamics", "coarse growing cells")
    page.button("Propose").click()
    page.sees("proposed by the package", 900.0)
    page.button("use it").click()
    page.until(lambda: re.search(r"[1-9]\d* of 20 modules", page.text()))
    reached("a proposal")
    page.button("Verdict").click()
    page.button("assess").click()
    page.sees("probability, layout A", 1800.0)
    page.shoot("extract_verdict")
    reached("the verdict of gas dynamics, with its probability")
    assert not page.faults()


def large_site() -> Scenario:
    """An office on 100 m, a charge, walls to choose from, and no word of windows yet."""
    document = office_park().model_dump(mode="json", exclude_none=True)
    document["charge"] = document["charge"][:1]
    wall = {"name": "t_wall", "from_catalogue": "t_wall_3_6", "cost": 900.0, "stock": 12}
    document["build_zone"] |= {"items": [wall], "budget": 20000.0}
    del document["build_zone"]["stock"]
    return Scenario.from_document(document, "office_park")


def on_a_phone(page: Page, name: str) -> None:
    """Leave pictures of the views and the work on the screen of a phone; none is wider."""
    for width, height in ((390, 844), (WIDTH, HEIGHT)):
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < WIDTH}
        page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        sleep(2.0)
        if width < WIDTH:
            for view in ("Plan", "Screening", "Verdict", "Results"):
                page.button(view).click()
                sleep(2.0)
                page.shoot(f"{name}_{view.lower()}")
                wide = "return document.documentElement.scrollWidth"
                assert page.driver.execute_script(wide) <= width, view
            page.driver.execute_script("window.scrollTo(0, document.body.scrollHeight)")
            sleep(1.0)
            page.shoot(f"{name}_work")


def test_no_view_is_wider_than_the_screen_of_a_phone(page: Page) -> None:
    page.begin("guard_post")
    on_a_phone(page, "narrow")


def test_the_road_of_an_engineer_on_a_site_of_100_m(page: Page, tmp_path: Path) -> None:
    """Windows, a layout, the verdict, better glass and a report by the page alone; with times."""
    began_s = monotonic()
    stages: list[str] = []

    def reached(stage: str) -> None:
        stages.append(f"{monotonic() - began_s:.0f} s: {stage}")
        PICTURES.mkdir(parents=True, exist_ok=True)
        (PICTURES / "site_of_100_m.txt").write_text("\n".join(stages) + "\n")

    def verdicts() -> list[str]:
        table = page.all(".be-results .q-table")[0]
        return [element.text for element in table.find_elements(By.CSS_SELECTOR, "tbody tr")]

    save_scenario(large_site(), tmp_path / "office_park.toml")
    page.open()
    page.upload(tmp_path / "office_park.toml")
    page.until(lambda: "/design/" in page.driver.current_url)
    page.until(lambda: page.all(".be-plan svg text"))
    reached("the site of the file")
    page.choose("selected", "office: office_west")
    page.until(
        lambda: "office_west" in [found.get_property("value") for found in page.all("input")]
    )
    page.choose("windows", "window, 6 mm annealed")
    page.until(lambda: any("6 mm annealed" in found.text for found in page.all(".q-select")))
    page.button("measure").click()
    page.sees("glass1, 1,000 cost units")
    page.shoot("large_measure")
    reached("its windows, and better glass as a measure")
    page.choose("by", "rule: wall near the building")
    page.button("Propose").click()
    page.button("use it").click()
    page.until(lambda: re.search(r"[1-9]\d* of 13 pieces", page.text()))
    page.shoot("large_plan")
    reached("a layout by rule")
    page.sees("4 blasts of gas: about")  # two layouts; each on two sizes of cells
    page.choose("gas dynamics", "coarse growing cells")
    page.sees("2 blasts of gas: about")
    page.button("Blast").click()
    page.until(lambda: re.search(r", [\d.]+ (s|min) left", page.text()), 300.0)
    page.shoot("large_running")
    page.until(lambda: len(verdicts()) == 2, 1800.0)
    page.until(lambda: page.picture_widths() == [640, 640])
    page.shoot("large_verdict")
    reached("the verdict of gas dynamics, without and with the layout")
    before = verdicts()
    next(found for found in page.all(".q-toggle") if "glass1" in found.text).click()
    page.until(lambda: len(verdicts()) == 2 and verdicts()[1] != before[1])
    assert verdicts()[0] == before[0]
    page.choose("picture", "damage of")
    page.until(lambda: all(page.picture_widths()))
    sleep(3.0)
    page.shoot("large_damage")
    reached("the verdict with better glass, without a blast")
    on_a_phone(page, "large_phone")
    page.button("Save as").click()
    sleep(0.5)
    page.button("report on this layout (.pdf)").click()
    page.sees("cells of gas dynamics")
    dialog = page.until(lambda: page.all(".q-dialog"))[0]
    before = dialog.text
    for words in ("coarse and fine", "coarse only"):  # Escape would close the dialog
        page.until(partial(page.showing, words)).click()
    next(found for found in page.all(".q-toggle") if "contribution" in found.text).click()
    page.until(lambda: dialog.text != before and "blasts of gas: about" in dialog.text)
    page.shoot("large_report_cost")
    page.button("begin").click()
    page.until(lambda: re.search(r", [\d.]+ (s|min) left", page.text()), 900.0)
    page.shoot("large_report_running")
    page.until(lambda: "wrote office_park_A.html and" in page.text(), 3600.0)
    page.button("download").click()
    (report,) = page.until(lambda: [*(tmp_path / "downloads").glob("*.pdf")])
    assert report.read_bytes().startswith(b"%PDF")
    shutil.copy(report, PICTURES / "large_report.pdf")
    reached("the report with coarse cells")
    assert not page.faults()


def test_a_closed_tab_leaves_its_work_running(page: Page) -> None:
    page.begin("courtyard")
    address = page.driver.current_url
    page.choose("gas dynamics", "cells of 0.5 m")
    page.choose("by", "search: random")
    page.button("Propose").click()
    page.sees("search", 120.0)
    page.driver.switch_to.new_window("tab")
    first, second = page.driver.window_handles
    page.driver.switch_to.window(first)
    page.driver.close()
    page.driver.switch_to.window(second)
    sleep(2.0)
    page.driver.get(address)
    page.sees("of 50 (gas", 1800.0)
    page.button("use it").click()
    page.sees("16 of 16 modules")


FORGOTTEN_S = 35.0
"""Longer than the server keeps a page whose browser is silent (30 s)."""


def test_a_report_goes_on_while_its_page_is_loaded_anew(page: Page) -> None:
    """By hand, and by the browser itself when the server has forgotten its page."""
    page.begin("visitor_entrance")
    page.choose("by", "rule: wall near the building")
    page.button("Propose").click()
    page.button("use it").click()
    page.sees("last: proposal")
    page.button("Save as").click()
    sleep(0.5)
    page.button("report on this layout (.html)").click()
    page.sees("blasts of gas: about")
    page.shoot("report_cost")
    page.button("begin").click()
    page.sees("report visitor_entrance_A.html")
    page.driver.refresh()
    page.sees("report visitor_entrance_A.html")
    page.button("stop")

    page.driver.execute_script("window.isOld = true; window.socket.disconnect()")
    sleep(FORGOTTEN_S)
    page.driver.execute_script("window.socket.connect()")
    page.until(lambda: not page.driver.execute_script("return window.isOld"))
    page.sees("report visitor_entrance_A.html")
    page.sees("6 of 18 pieces")
    page.shoot("loaded_anew")
    page.sees("wrote visitor_entrance_A.html", 300.0)  # soon on a fast computer
