"""What work costs, told before it begins."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blast_env.app.blasts import PICTURES, BlastPictures, Picture
from blast_env.app.folder import WorkFolder
from blast_env.app.kept import write_kept
from blast_env.app.session import Sessions
from blast_env.app.threats import threats_of
from blast_env.app.work import Status
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.evaluation.study import StudyOptions, StudyPlan
from blast_env.gas import CostGuess, cost_words, time_words
from blast_env.site import load_scenario
from tests.app.here import Here
from tests.gas_sites import WALL, hut


@pytest.mark.parametrize("site", ["visitor_entrance", "hotel_forecourt", "guard_post"])
def test_steps_are_about_those_of_a_blast(site: str) -> None:
    """Within a third, of a vehicle's charge too; of the seconds a clock would have to say."""
    scenario = load_scenario(site)
    charge = threats_of(scenario)[0].charge
    estimate = GasEngine().cost(scenario, charge)
    run = GasBlast(scenario, (), 0, GasEngine(), charge).run()
    assert estimate.steps == pytest.approx(run.steps, rel=0.33)
    assert estimate.cells == pytest.approx(np.prod(run.run.grid.array_shape), rel=0.01)
    assert estimate.moved == pytest.approx(run.run.solver.cell_updates, rel=0.33)


def test_half_the_cells_cost_sixteen_times_as_much_inside() -> None:
    scenario = load_scenario("courtyard")
    charge = threats_of(scenario)[0].charge
    coarse, fine = (GasEngine(cell_m=value).cost(scenario, charge) for value in (0.5, 0.25))
    assert 8.0 < fine.seconds / coarse.seconds < 16.0  # the skirt does not grow as much
    assert fine.memory_bytes > coarse.memory_bytes


def test_only_what_is_not_there_is_counted(tmp_path: Path) -> None:
    session = Sessions(WorkFolder(tmp_path), Here()).new(hut(), "begin")
    session.put("wall", session.design.with_layout(WALL))
    assert len(session.cost([0])) == 2  # and no barrier
    (threat,) = session.chosen_threats()
    there = session.folder.blast_of(session.key((), threat))
    there.mkdir()
    record = BlastPictures(
        pictures=(Picture(file="a.png", label="a", kind="map"),), seconds=1.0, repeat={}
    )
    write_kept(record, there / PICTURES)
    assert len(session.cost([0])) == 2  # its record is not there
    evaluator = BlastEvaluator(session.scenario, session.engine, cache=session.work.cache)
    evaluator.records_of_many([((), threat)])
    assert len(session.cost([0])) == 1
    assert len(session.cost_of_search(50)) == 50


def test_a_report_costs_its_blasts_and_its_parts_are_shares_of_that() -> None:
    options = StudyOptions(charges=(threats_of(hut())[0].charge,))
    cost = StudyPlan(hut(), WALL, options).cost()
    sizes = [blast.cells for blasts in cost.parts.values() for blast in blasts]
    assert len(sizes) == 4 + len(WALL)  # the one other place is the threat's
    assert cost.drawn == 2
    assert sum(size == max(sizes) for size in sizes) == 2
    shares = [cost.share(label, share) or 0.0 for label in cost.parts for share in (0.0, 1.0)]
    assert shares[0] == 0.0
    assert shares[-1] == pytest.approx(1.0)
    assert shares == sorted(shares)
    assert cost.share("no part", 0.5) is None
    one = StudyPlan(hut(), WALL, replace(options, cells=(0.5, 0.5), items=False)).cost()
    assert sum(map(len, one.parts.values())) == 2


def test_words() -> None:
    cost = CostGuess(cells=2_000_000, steps=750, memory_bytes=0.5e9, moved=3.5e9)
    assert cost_words([cost]) == "a blast of gas: about 2 min on a busy core, 0.5 GB"
    assert "50 blasts of gas: about 1.9 h" in cost_words([cost] * 50)
    assert "nothing to run" in cost_words([])
    assert [time_words(value) for value in (0.2, 7.1, 44.0, 600.0, 7200.0)] == [
        *("1 s", "8 s", "45 s", "10 min", "2.0 h")
    ]


def test_what_is_left_follows_from_what_is_done() -> None:
    running = Status(state="running", share=0.25, began_s=100.0)
    assert running.left_s(110.0) == pytest.approx(30.0)
    assert running.model_copy(update={"share": 0.01}).left_s(110.0) is None
    assert running.model_copy(update={"state": "done"}).left_s(110.0) is None
