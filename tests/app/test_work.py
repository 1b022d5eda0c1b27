"""Work in processes: what a task leaves behind, stopping, dying, and the table of results."""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from time import monotonic, sleep
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pydantic import TypeAdapter

from blast_env.answers import report
from blast_env.answers.compare import comparison, verdict_table
from blast_env.answers.report import StudyOptions
from blast_env.app import blasts, offers
from blast_env.app.blasts import PICTURES, BlastPictures
from blast_env.app.design import SLOTS
from blast_env.app.folder import WorkFolder
from blast_env.app.jobs import TaskRun, Workers, settle
from blast_env.app.kept import read_kept
from blast_env.app.session import Session, Sessions
from blast_env.app.threats import threats_of, usual_threats
from blast_env.app.work import Status, StatusWriter, read_status, write_status
from blast_env.design.search import ProposerKind, proposers
from blast_env.errors import BlastEnvError
from blast_env.evaluation import (
    BlastEvaluator,
    BlastKey,
    BlastLoads,
    LoadCase,
    LoadCaseSet,
    StructureLoad,
    evaluate_layout,
)
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.evaluation.record import BlastRecord
from blast_env.geometry import Layout
from blast_env.response import LevelOfProtection
from blast_env.site import Charge, Scenario, load_scenario
from tests import builders
from tests.app.here import Here, rows_of
from tests.blasts import consequences
from tests.gas_sites import WALL, glazed_hut, hut, site_document
from tests.vehicle_sites import gate_site, vehicle_document


def session_on(folder: Path, scenario: Scenario, workers: Workers | None = None) -> Session:
    """Return a session with larger cells, which take little time."""
    session = Sessions(WorkFolder(folder), workers or Here()).new(scenario, "begin")
    session.cells = 0.5
    return session


def state_of(session: Session) -> Status:
    return session.jobs()[0][1]


PLACES = (("near", 4.0), ("far", 1.5))


@pytest.fixture(scope="module")
def gas(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The hut with windows, blasted by gas with a wall."""
    session = session_on(tmp_path_factory.mktemp("gas"), glazed_hut())
    session.put("wall", session.design.with_layout(WALL))
    session.blast([0])
    return session


def test_the_table_holds_layouts_against_no_barrier(gas: Session) -> None:
    rows = rows_of(gas.comparison())
    assert [(row.layout, row.structure) for row in rows] == [
        ("no barrier", "all protected"),
        ("no barrier", "hut"),
        ("A", "all protected"),
        ("A", "hut"),
    ]
    values = [float(row.impulse.split()[0].replace(",", "")) for row in rows]
    share = float(rows[2].reduction.removesuffix(" %").replace("\N{MINUS SIGN}", "-"))
    assert share == pytest.approx(100.0 * (1.0 - values[2] / values[0]), abs=1.0)
    assert rows[0].reduction == "\N{EN DASH}"
    assert rows[2].cost == "6"
    assert {row.engine for row in rows} == {"gas, cells of 0.5 m"}


def test_the_table_counts_what_the_site_s_objective_says() -> None:
    """Peaks have weights of their own; with both, shares of the references are added up."""
    objective = {
        "quantity": "both",
        "reference_impulse_pa_s": 200.0,
        "reference_peak_pa": 50e3,
        "charges": "worst",
    }
    site = hut(objective=objective)
    site = site.model_copy(
        update={
            "structures": (
                site.structures[0].model_copy(update={"weight": 2.0, "peak_weight": 3.0}),
            )
        }
    )

    def blast(impulse_pa_s: float, peak_kpa: float) -> BlastRecord:
        load = StructureLoad.on(site.structures[0], impulse_pa_s, 1e3 * peak_kpa)
        return BlastRecord(BlastLoads((load,), np.zeros(0)))

    near, far = (LoadCase(Charge((2.0, y_m), 5.0), name=name) for name, y_m in PLACES)
    records = {
        "no barrier": (blast(400.0, 100.0), blast(100.0, 50.0)),
        "A": (blast(200.0, 50.0), blast(100.0, 100.0)),
    }
    case, engine = LoadCaseSet(site, (near, far)), GasEngine()
    layouts: dict[str, Layout] = {"no barrier": (), "A": WALL}
    bare = Blasts(case, {"no barrier": ()}, records, engine)
    both = Blasts(case, layouts, records, engine)
    table = comparison({"no barrier": (bare, 0.0), "A": (both, 6.0)}, ["near", "far"], site)
    rows = {(row.layout, row.threat): row for row in rows_of(table)}
    counted = {key: float(row.counts) for key, row in rows.items()}
    assert counted[("no barrier", "near")] == 2.0 * 2.0 + 3.0 * 2.0
    assert counted[("A", "near")] == 2.0 + 3.0
    assert counted[("A", "far")] == 1.0 + 6.0
    assert counted[("no barrier", "all 2: worst")] == 10.0
    assert counted[("A", "all 2: worst")] == 7.0
    assert rows[("A", "all 2: worst")].reduction == "30.0 %"
    assert rows[("A", "near")].reduction == "50.0 %"


@pytest.mark.usefixtures("without_pictures")
def test_a_building_of_several_parts_is_one_row(tmp_path: Path) -> None:
    document = site_document()
    (whole,) = document["structures"]
    halves = [
        whole | {"name": name, "rows": 2, "corner_m": [6.0, y_m], "building": "house"}
        for name, y_m in (("south_half", 3.0), ("north_half", 4.0))
    ]
    site = Scenario.from_document(document | {"structures": halves}, "halves")
    session = session_on(tmp_path, site)
    session.put("wall", session.design.with_layout(WALL))
    session.blast([0])
    rows = rows_of(session.comparison())
    assert [row.structure for row in rows] == ["all protected", "house"] * 2
    result = GasBlast(site, WALL).run()
    ((impulse_pa_s, peak_pa),) = result.buildings[["impulse_pa_s", "peak_pa"]].to_numpy()
    assert float(rows[3].impulse.replace(",", "")) == pytest.approx(impulse_pa_s, rel=5e-3)
    assert float(rows[3].peak) == pytest.approx(peak_pa / 1e3, rel=5e-3)
    assert rows[3].reduction == rows[2].reduction  # of both parts together


def test_an_edit_takes_results_away_and_undo_brings_them_back(gas: Session) -> None:
    before = gas.comparison().cells()
    gas.put("less", gas.design.with_layout(WALL[:5]))
    assert len(gas.comparison().rows) == 2  # no barrier alone
    gas.undo()
    assert gas.comparison().cells() == before


def test_a_gas_blast_has_pictures_gauges_and_the_loads_of_the_library(gas: Session) -> None:
    assert state_of(gas).state == "done"
    (threat,) = gas.chosen_threats()
    result = GasBlast(glazed_hut(), WALL).run()
    key = gas.shown(threat)[1].key
    record = read_kept(BlastPictures, gas.folder.blast_of(key) / PICTURES)
    assert record is not None
    loads = gas.results()["A"].records["A"][0].loads.structures
    load = next(load for load in loads if load.name == "hut")
    assert load.impulse_pa_s == pytest.approx(result.impulse("hut").pa_s)
    assert load.peak_pa == pytest.approx(float(result.structures["peak_pa"].iloc[0]))
    folder = gas.folder.blast_of(key)
    with Image.open(folder / "film.webp") as film:
        assert getattr(film, "n_frames", 1) == blasts.FRAMES
    assert {picture.label for picture in record.pictures} == {
        "film",
        *(f"gauge {gauge.name}" for gauge in glazed_hut().gauges),
        "peak over the ground",
        "impulse over the ground",
        "peak on the walls of hut",
        "impulse on the walls of hut",
    }
    assert all((folder / picture.file).stat().st_size > 1000 for picture in record.pictures)
    assert record.repeat["scenario hash"] == glazed_hut().content_hash


def test_the_table_of_buildings_says_what_the_library_says(gas: Session) -> None:
    (threat,) = gas.chosen_threats()
    rows = rows_of(verdict_table(gas.scenario, gas.verdicts()))
    assert [(row.layout, row.threat, row.building) for row in rows] == [
        ("no barrier", threat.name, "hut"),
        ("A", threat.name, "hut"),
    ]
    found = consequences(BlastEvaluator(glazed_hut(), "gas"), WALL, [threat.charge])
    (facade,) = (response.facade for response in found.of("hut"))
    assert rows[1].level_of_protection == found.level_words("hut")
    assert rows[1].panes_broken == f"{facade.broken_panes:.1f} of {facade.panes}"
    assert rows[1].worst_pane == facade.worst_condition.words
    assert rows[1].worst_wall_panel == facade.worst_damage.name.lower()
    assert "cells per m/kg^(1/3)" in rows[1].flags
    assert rows[1].flags == dict(found.unchecked)["hut"]


def test_of_several_threats_the_worst_comes_first(gas: Session) -> None:
    (threat,) = gas.chosen_threats()
    (judged,) = gas.judged(gas.shown(threat)[1], threat)
    site, (level, likely, panes, *others) = gas.scenario, judged.cells
    for severity, cells in (
        (replace(judged.severity, lost_levels=0), ("high", likely, "0", *others)),
        (replace(judged.severity, damage=0.0), (level, likely, "0", *others)),
    ):
        milder = judged._replace(cells=cells, severity=severity)
        table = verdict_table(site, [("A", "other", [milder]), ("A", threat.name, [judged])])
        rows = rows_of(table)
        assert [row.threat for row in rows] == ["worst of 2", "other", threat.name]
        assert rows[0].panes_broken == rows[2].panes_broken != rows[1].panes_broken == "0"
        assert rows[0].level_of_protection == rows[2].level_of_protection == level
    assert panes != "0"


def test_what_is_there_is_not_run_again(gas: Session) -> None:
    (threat,) = gas.chosen_threats()
    path = gas.folder.blast_of(gas.shown(threat)[1].key) / PICTURES
    before = path.stat().st_mtime_ns
    gas.blast([0])
    assert path.stat().st_mtime_ns == before
    assert state_of(gas).state == "done"


def test_of_many_sources_the_worst_are_blasted_unless_others_are_chosen() -> None:
    """Six charges at growing distances from the hut; all can be chosen."""
    places = [(5.5 - 0.5 * k, 4.0) for k in (3, 0, 5, 1, 4, 2)]
    charges = [{"kind": "point", "position_m": [*place], "tnt_kg": 1.0} for place in places]
    site = hut(charge=charges)
    named = {threat.name: threat.charge.position_m[0] for threat in threats_of(site)}  # type: ignore[union-attr]
    assert [named[usual_threat] for usual_threat in usual_threats(site)] == [4.0, 5.5, 5.0, 4.5]
    assert len(named) == 6


def test_keys_know_what_a_record_depends_on() -> None:
    charge = Charge((2.0, 4.0), 5.0)
    assert [threat.charge for threat in threats_of(hut())] == [charge]

    def key(
        site: Scenario, layout: Layout = WALL, charge: Charge = charge, **cells: Any
    ) -> BlastKey:
        return BlastEvaluator(site, GasEngine(**cells)).key(layout, LoadCase(charge))

    others = {
        key(hut(), WALL[:-1]),
        key(hut(), charge=charge._replace(tnt_kg=6.0)),
        key(hut(), cell_m=0.25),
        key(hut(), cells="coarse"),
        key(glazed_hut()),  # with bays
        key(hut(objective={"quantity": "peak"})),
    }
    assert key(hut(), WALL[::-1]) == key(hut())
    assert len(others | {key(hut())}) == 7


COURTYARD = load_scenario("courtyard")


@pytest.mark.parametrize("proposer", proposers(ProposerKind.RULE, suiting=[COURTYARD]))
def test_a_proposal_can_be_taken(tmp_path: Path, proposer: str) -> None:
    session = session_on(tmp_path, COURTYARD)
    session.search(proposer)
    status = state_of(session)
    assert status.state == "done"
    session.take(status, 1)
    assert len(session.design.layouts[1]) > 5
    assert session.history.present.label.endswith(f"into {SLOTS[1]}")


def test_what_is_best_is_offered_first(tmp_path: Path) -> None:
    session = Sessions(WorkFolder(tmp_path), Here()).new(hut(), "begin")
    assert session.cells == 0.25
    assert next(iter(offers.offered(hut()))) == offers.PACKAGED
    assert offers.offered(load_scenario("free_field")) == {}
    session.search(offers.PACKAGED)  # modules: the best rule by gas
    status = state_of(session)
    assert status.state == "done", status.text
    session.take(status, 0)
    assert session.design.layout


def test_a_search_says_how_good_its_layout_is(tmp_path: Path) -> None:
    session = session_on(tmp_path, hut())
    session.search("random", 4)
    status = state_of(session)
    assert (status.state, status.share) == ("done", 1.0)
    assert "% on the blasts of the search" in status.text
    session.take(status, 0)
    assert session.design.layout


@pytest.mark.usefixtures("without_pictures")
def test_a_blast_has_cells_that_grow(tmp_path: Path) -> None:
    session = session_on(tmp_path, glazed_hut())
    session.cells = "coarse"
    assert session.engine.words == "gas, coarse cells from 0.5 m"
    (threat,) = session.chosen_threats()
    (cost,) = session.cost([0])
    assert cost == GasEngine(cells="coarse").cost(session.scenario, threat.charge)
    session.blast([0])
    assert state_of(session).state == "done", state_of(session).text
    (record,) = session.results()["no barrier"].records["no barrier"]
    result = GasBlast(session.scenario, (), 0, GasEngine(cells="coarse"), threat.charge).run()
    load = next(structure for structure in record.loads.structures if structure.name == "hut")
    assert load.impulse_pa_s == pytest.approx(result.impulse("hut").pa_s, rel=1e-6)


@pytest.mark.usefixtures("without_pictures")
def test_a_blast_is_a_final_statement_with_the_error_of_its_cells(tmp_path: Path) -> None:
    """By default, beside each load and reduction; as `evaluate` has it for the same charge."""
    session = Sessions(WorkFolder(tmp_path), Here()).new(hut(), "begin")
    session.put("wall", session.design.with_layout(WALL))
    assert [len(session.cost([0])), len(session.cost_of_error([0]))] == [2, 2]
    session.blast([0])
    assert state_of(session).state == "done", state_of(session).text
    assert session.cost([0]) == session.cost_of_error([0]) == ()
    (threat,) = session.chosen_threats()
    expected = evaluate_layout(hut(), WALL, threats=[LoadCase(threat.charge, 0)])
    found = expected.to_dict()["result"]["grid_error"]
    rows = rows_of(session.comparison())
    assert all(row.impulse.count("\N{PLUS-MINUS SIGN}") == 1 for row in rows)
    unprotected, *_, protected = rows
    assert unprotected.impulse.endswith(f"\N{PLUS-MINUS SIGN} {found['unprotected_load']:.2g}")
    assert protected.impulse.endswith(f"\N{PLUS-MINUS SIGN} {found['load']:.2g}")
    assert protected.reduction.endswith(f"\N{PLUS-MINUS SIGN} {100.0 * found['reduction']:.1f}")
    (blast,) = session.cost_of_search(1)
    assert blast == GasEngine().cost(hut(), threat.charge)  # searches stay on larger cells


@pytest.mark.usefixtures("without_pictures")
def test_of_several_threats_the_worst_one_gives_the_error(tmp_path: Path) -> None:
    document = site_document()
    document["charge"][0] |= {"kind": "segment", "start_m": [2.0, 2.0], "end_m": [2.0, 4.0]}
    del document["charge"][0]["position_m"]
    session = Sessions(WorkFolder(tmp_path), Here()).new(
        Scenario.from_document(document, "line"), "begin"
    )
    start, end = (threat.name for threat in threats_of(session.scenario)[1:])
    session.threats = (start, end)
    session.blast([0])
    assert state_of(session).state == "done", state_of(session).text
    coarse = session.results()["no barrier"].coarse
    assert coarse is not None
    assert coarse.threats == (threats_of(session.scenario)[2],)  # nearest to the hut
    rows = rows_of(session.comparison())
    assert [row.threat.split(":")[0] for row in rows] == [start, start, end, end, "all 2"]
    assert all("\N{PLUS-MINUS SIGN}" in row.impulse for row in rows)


def test_a_site_too_large_for_memory_is_a_message(tmp_path: Path) -> None:
    document = hut().model_dump(mode="json", exclude_none=True)
    document["site"] = {"width_m": 2000.0, "height_m": 2000.0, "air_height_m": 2000.0}
    session = session_on(tmp_path, Scenario.from_document(document, "huge"))
    session.cells = 0.25
    session.blast([0])
    assert state_of(session).state == "failed"
    assert "would need" in state_of(session).text


def test_what_cannot_be_begun_is_refused_at_once(tmp_path: Path) -> None:
    session = session_on(tmp_path, load_scenario("free_field"))
    with pytest.raises(BlastEnvError, match="no build zone"):
        session.search("random", 10)
    with pytest.raises(BlastEnvError, match="no build zone"):
        session.search("wall_near_charge")
    courtyard = session_on(tmp_path, load_scenario("courtyard"))
    with pytest.raises(BlastEnvError, match="budget is 0"):
        courtyard.search("random", 0)
    with pytest.raises(BlastEnvError, match="no search method 'sorcery'"):
        courtyard.search("sorcery", 5)
    with pytest.raises(BlastEnvError, match="no layout to use"):
        courtyard.take(Status(title="x"), 0)


def test_threats_have_places_that_one_can_point_to() -> None:
    courtyard = threats_of(load_scenario("courtyard"))
    assert [threat.name for threat in courtyard] == [
        "charge 1, middle",
        "charge 1, start",
        "charge 1, end",
    ]
    assert courtyard[1].charge == Charge((5.0, 6.0), 100.0)
    assert [threat.name for threat in threats_of(hut())] == ["charge 1"]


def test_a_long_street_has_a_threat_where_it_passes_the_building(tmp_path: Path) -> None:
    """Its middle and its ends are 10 m and more farther away."""
    target = builders.block("office", 20.0, 20.0, 20, 20, height_m=6.0, protected=True)
    street = {"kind": "segment", "start_m": [3.0, 10.0], "end_m": [99.0, 10.0], "tnt_kg": 50.0}
    site = builders.site("street", (100.0, 40.0), street, target)
    names = {threat.name: threat.charge for threat in threats_of(site)}
    assert names["charge 1, as near as it comes"] == Charge((25.0, 10.0), 50.0)
    assert session_on(tmp_path, site).threats == ("charge 1, as near as it comes",)


@pytest.mark.usefixtures("without_pictures")
def test_a_vehicle_is_where_the_layout_lets_it_come(tmp_path: Path) -> None:
    """Rules against it are offered, and its blasts differ in the place."""
    site = gate_site(vehicle_document(places=2))
    nearest, second = threats_of(site)
    assert nearest.name == "charge 1, as near as it comes"
    session = session_on(tmp_path, site)
    assert session.threats == (nearest.name,)
    against = {"line_of_posts", "posts_and_wall"}
    assert against < set(offers.offered(site))
    assert not against & set(offers.offered(hut()))
    session.search("line_of_posts")
    session.take(state_of(session), 0)
    session.blast([0])
    assert state_of(session).state == "done", state_of(session).text
    blasts = session.results()["A"]
    assert blasts.charge("no barrier", 0).position_m == (9.0, 4.0)
    assert blasts.charge("A", 0).position_m[0] <= 3.0
    ((unprotected,), (posts,)) = blasts.records.values()
    assert posts.loads.protected_impulse_pa_s < 0.6 * unprotected.loads.protected_impulse_pa_s
    again = TypeAdapter(LoadCase).validate_json(TypeAdapter(LoadCase).dump_json(nearest))
    assert again.charge == nearest.charge != second.charge


# Processes.


@pytest.fixture
def workers() -> Iterator[Workers]:
    """One process, which loads no compiled code in advance."""
    workers = Workers(most=1)
    yield workers
    workers.close()


def wait(workers: Workers, folder: Path, *states: str, most_s: float = 60.0) -> Status:
    until_s = monotonic() + most_s
    while monotonic() < until_s:
        workers.tick()
        status = read_status(folder)
        if status.state in states:
            return status
        sleep(0.02)
    raise AssertionError(f"{folder}: {read_status(folder)} is none of {states}")


@pytest.mark.slow
def test_a_search_is_stopped_and_keeps_its_best_and_the_next_one_begins(
    tmp_path: Path, workers: Workers
) -> None:
    session = session_on(tmp_path, hut(), workers)
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as in the background of a script
    first, second = session.search("random", 100_000), session.search("random", 4)
    signal.signal(signal.SIGINT, before)
    while read_status(first).layout is None:
        wait(workers, first, "waiting", "running")
        sleep(0.02)
    assert read_status(second).state == "waiting"  # one process, one at a time
    workers.stop(first)
    stopped = wait(workers, first, "stopped")
    assert stopped.layout is not None
    assert "% on the blasts of the search" in stopped.text
    session.take(stopped, 0)
    assert wait(workers, second, "done").layout is not None

    third = session.search("random", 100_000)
    wait(workers, third, "running")
    workers.close()  # as when the server stops
    assert read_status(third).state == "stopped"


SERVER = """
import sys, time
from pathlib import Path
from blast_env.app.folder import WorkFolder
from blast_env.app.jobs import Workers
from blast_env.app.session import Sessions
from tests.gas_sites import hut

if __name__ == "__main__":
    session = Sessions(WorkFolder(Path(sys.argv[1])), Workers()).new(hut(), "begin")
    session.cells = 0.5
    print(session.search("random", 100_000), flush=True)
    time.sleep(600.0)
"""


@pytest.mark.slow
def test_work_ends_with_a_server_that_is_killed_and_keeps_its_best(tmp_path: Path) -> None:
    script = tmp_path / "server.py"
    script.write_text(SERVER)
    command = [sys.executable, str(script), str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        folder = Path(server.stdout.readline().strip())
        wait(Workers(most=0), folder, "running")
        while read_status(folder).layout is None:
            sleep(0.1)
        server.kill()
    assert wait(Workers(most=0), folder, "stopped").layout is not None


def sleeping(_: StatusWriter) -> None:
    """Stand for work that lasts."""
    sleep(60.0)


def started(workers: Workers, folder: Path) -> TaskRun:
    """Return a task that lasts, at work in a folder."""
    folder.mkdir()
    write_status(Status(), folder)
    running = TaskRun.started(folder, sleeping)
    workers._running.append(running)
    wait(workers, folder, "running")
    return running


def test_work_whose_process_is_killed_has_failed(tmp_path: Path) -> None:
    workers, folder = Workers(), tmp_path / "job"
    process = started(workers, folder).process
    process.kill()
    process.join()
    workers.tick()
    assert "ended unexpectedly" in read_status(folder).text
    assert not workers.is_known(folder)


def test_work_waits_until_modules_and_compiled_code_are_loaded(
    tmp_path: Path, workers: Workers
) -> None:
    workers.prepare()
    folder = session_on(tmp_path, hut(), workers).search("random", 2)
    assert read_status(folder).state == "waiting"
    wait(workers, folder, "done")


def test_work_that_waits_is_stopped_at_once(tmp_path: Path) -> None:
    session = session_on(tmp_path, hut(), Workers(most=0))
    folder = session.blast([0])
    session.workers.stop(folder)
    assert read_status(folder).state == "stopped"


def test_work_of_a_server_that_was_killed_is_not_shown_as_going_on(tmp_path: Path) -> None:
    session = session_on(tmp_path, hut(), Workers(most=0))
    folder = session.blast([0])
    write_status(read_status(folder).model_copy(update={"state": "running"}), folder)
    settle(session.folder.jobs, Workers(most=0))
    assert read_status(folder).state == "stopped"
    assert "server stopped" in read_status(folder).text


def test_tabs_on_one_design_share_it_and_designs_are_apart(tmp_path: Path) -> None:
    sessions = Sessions(WorkFolder(tmp_path), Here())
    one, other = sessions.new(hut(), "begin"), sessions.new(hut(), "begin")
    assert sessions.of(one.folder.design_id) is one
    heard: list[int] = []
    stop = one.listen(lambda: heard.append(len(one.design.layout)))
    one.put("wall", one.design.with_layout(WALL))
    assert heard == [6]
    assert other.design.layout == ()
    stop()
    one.undo()
    assert heard == [6]
    assert Sessions(WorkFolder(tmp_path), Here()).of(one.folder.design_id).design == one.design


def test_a_report_is_of_the_layout_and_the_chosen_threats(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: dict[str, object] = {}
    seen: list[float] = []
    stopped = ""

    def study(
        scenario: Scenario, layout: Layout, options: StudyOptions, tell: Callable[..., None]
    ) -> SimpleNamespace:
        asked.update(scenario=scenario, layout=layout, options=options)
        for label in ("T1, cells of 0.5 m", "other places", "stopped before: nothing"):
            sleep(0.11)  # more often nobody is told
            tell(label, 0.5)
            status = state_of(session)
            seen.append(status.share)
            assert (status.text, status.grace_s) == (label, 300.0)
        return SimpleNamespace(study=SimpleNamespace(stopped=stopped))

    def write(_: object, page: Path, pdf: Path | None) -> list[Path]:
        return [page] if pdf is None else [page, pdf]

    monkeypatch.setattr(report, "run_report", study)
    monkeypatch.setattr(report, "write_report", write)
    session = session_on(tmp_path, hut())
    with pytest.raises(BlastEnvError, match="layout A is empty"):
        session.report(tmp_path / "r.html")
    session.put("wall", session.design.with_layout(WALL))
    contents = {"cells": (0.5, 0.5), "items": False, "target": LevelOfProtection.MEDIUM}
    session.report(tmp_path / "r.html", tmp_path / "r.pdf", **contents)
    cost = session.cost_of_report(**contents)
    shares = [cost.share("T1, cells of 0.5 m", 0.5), cost.share("other places", 0.5)]
    assert seen == [*shares, shares[-1]]  # of the whole, and what is no part changes nothing
    status = state_of(session)
    assert (status.state, status.file) == ("done", str(tmp_path / "r.pdf"))
    assert status.text == "wrote r.html and r.pdf"
    charges = tuple(threat.charge for threat in session.chosen_threats())
    options = StudyOptions(
        charges=charges,
        cells=(0.5, 0.5),
        items=False,
        target=LevelOfProtection.MEDIUM,
        cache=session.work.cache,
    )
    assert asked == {"scenario": session.scenario, "layout": WALL, "options": options}
    stopped = "other places"
    session.report(tmp_path / "r.html")
    status = state_of(session)
    assert (status.state, status.file) == ("stopped", str(tmp_path / "r.html"))
    assert status.text == "stopped before: other places; wrote r.html with the finished parts"


def test_a_report_that_is_stopped_may_take_time_to_write(tmp_path: Path) -> None:
    workers, folder = Workers(), tmp_path / "job"
    running = started(workers, folder)
    for grace_s in (5.0, 300.0):
        write_status(Status(state="running", grace_s=grace_s), folder)
        running.stop_by_s = None
        before_s = monotonic()
        workers.stop(folder)
        assert running.stop_by_s is not None
        assert before_s + grace_s <= running.stop_by_s <= monotonic() + grace_s
    workers.close()
    assert read_status(folder).state == "stopped"


WARM_CODE = """
import sys
from numba.core.dispatcher import Dispatcher
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from tests.gas_sites import glazed_hut

def loaded():
    physics = [vars(own) for name, own in sys.modules.items() if "env.gas" in name]
    kernels = [item for own in physics for item in own.values() if isinstance(item, Dispatcher)]
    return {(kernel.__name__, *kernel.signatures) for kernel in kernels if kernel.signatures}

import blast_env.app.warm
warm = loaded()
GasBlast(glazed_hut(), engine=GasEngine(cells="coarse")).run()
print(len(warm), *loaded() - warm)
"""


def test_a_worker_has_loaded_all_gas_kernels_before_its_first_task() -> None:
    """In a process of its own, because other tests load the kernels into this one."""
    done = subprocess.run([sys.executable, "-c", WARM_CODE], capture_output=True, text=True)
    count, *later = done.stdout.split()
    assert int(count) > 8, done.stderr
    assert later == []
