"""Bays under a blast: their histories are those of the walls, and loads stay as they were."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import blast_env
from blast_env.cli import app
from blast_env.errors import UnknownNameError
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.site import Scenario, save_scenario
from tests.blasts import consequences
from tests.gas_sites import glazed_hut

FACADE = {"storeys": 2, "glazing": "low", "wall": "brick_215"}
LOW = {"kind": "glazing", "title": "low window", "source": "made up", "thickness_mm": 3.78}
LOW |= {"width_m": 0.9, "height_m": 0.8, "sill_m": 0.5}
CHARGE = blast_env.Charge((2.0, 8.5), 5.0)
CHARGE_OF_HUT = blast_env.Charge((2.0, 4.0), 5.0)


def site(facade: dict[str, Any] | None) -> Scenario:
    document = blast_env.load_scenario("control_room").model_dump(mode="json")
    document["structures"][0]["facade"] = facade
    document["components"] = {"low": LOW}
    return Scenario.from_document(document, "test")


@pytest.fixture(scope="module")
def result() -> GasResult:
    return blast_env.simulate(site(FACADE), engine="gas", charge=CHARGE)


def test_bays_change_nothing_but_what_is_recorded(result: GasResult) -> None:
    """But for the time that they have to respond."""
    unprotected = blast_env.simulate(site(None), engine="gas", charge=CHARGE, until=result.time_s)
    assert result.digest == unprotected.digest
    assert len(unprotected.bays) == 0
    with pytest.raises(UnknownNameError, match="no bay"):
        unprotected.bay_history("control_room/west/1/1")


def test_the_bays_of_a_wall_have_its_load(result: GasResult) -> None:
    """Running impulses by area add up exactly."""
    bays = result.bays
    assert list(bays["storey"]) == [1, 1, 1, 2, 2, 2]
    faces = result.faces
    west = faces[(faces["structure"] == "control_room") & (faces["face"] == "west")]
    whole = west["net_impulse_pa_s"]
    loads = result.bay_loads
    sums = loads.recorder.history_pa @ loads.recorder.step_s
    in_bay = [
        whole[
            (west["y_m"] >= bay.bay.left_m)
            & (west["y_m"] < bay.bay.right_m)
            & (west["z_m"] >= bay.bay.floor_m)
            & (west["z_m"] < bay.bay.top_m)
        ].mean()
        for bay in loads.bays
    ]
    assert sums == pytest.approx(np.array(in_bay), rel=1e-4)


def test_the_middle_of_the_front_is_loaded_most(result: GasResult) -> None:
    lower = result.bays[result.bays["storey"] == 1].set_index("number")
    assert lower["impulse_pa_s"].idxmax() == 2
    assert (lower["break_probability"] > 0.5).all()
    history = result.bay_history("control_room/west/1/2")
    assert history["overpressure_pa"].max() == pytest.approx(lower["peak_pa"][2])


def test_unknown_bays_name_the_nearest(result: GasResult) -> None:
    with pytest.raises(UnknownNameError, match="control_room/west/1/1"):
        result.bay_history("control_room/west/1/9")


def test_a_run_that_has_begun_takes_no_recorder(result: GasResult) -> None:
    loads = result.bay_loads
    with pytest.raises(ValueError, match="record before the first"):
        result.run.record(loads.recorder)


@pytest.mark.parametrize("until_s", [1e-6, 1e-3])
def test_a_run_that_ends_before_the_blast_arrives_harms_nothing(until_s: float) -> None:
    early = blast_env.simulate(site(FACADE), engine=GasEngine(until=until_s), charge=CHARGE)
    assert len(early.bay_loads.recorder.time_s) < 3
    assert (early.bays["break_probability"].fillna(0.0) == 0.0).all()


def strips(**narrow: Any) -> Scenario:
    """Return the hut with a facade, and a strip of half a metre along its north without one."""
    document = glazed_hut().model_dump(mode="json", exclude_none=True)
    (hut,) = document["structures"]
    strip = {**hut, "name": "strip", "corner_m": [6.0, 5.0], "rows": 1} | narrow
    del strip["facade"]
    document["structures"] = [case | {"building": "hall"} for case in (hut, strip)]
    return Scenario.from_document(document, "strips")


def test_walls_of_a_strip_without_a_facade_are_named_with_their_area() -> None:
    """0.5 m in the west and east and 2 m in the north, 2 m high; the hut has three walls left."""
    engine = GasEngine(border_m=0.0, until=0.01)
    scenario = strips()
    found = GasBlast(scenario, engine=engine).run()
    (left,) = found.unjudged
    assert (left.building, left.structures) == ("hall", ("strip",))
    assert (left.area_m2, left.of_m2) == pytest.approx((6.0, 18.0))
    assert GasBlast(glazed_hut(), engine=engine).run().unjudged == ()
    (west,) = GasBlast(strips(faces=["west"]), engine=engine).run().unjudged
    assert (west.area_m2, west.of_m2) == pytest.approx((1.0, 13.0))
    judged = consequences(BlastEvaluator(scenario, engine), (), [CHARGE_OF_HUT] * 2)
    words = "hall: 6.0 of 18.0 m2 of its walls stand in no bay (strip): no verdict covers them"
    assert judged.notes.count(words) == 1


@pytest.mark.parametrize("command", ["assess", "simulate"])
def test_commands_name_walls_that_no_verdict_covers(command: str, tmp_path: Path) -> None:
    save_scenario(strips(), tmp_path / "strips.toml")
    shown = CliRunner().invoke(app, [command, str(tmp_path / "strips.toml"), "--cell", "0.5"])
    assert shown.exit_code == 0, shown.output
    assert shown.stdout.startswith("engine gas")
    assert "6.0 of 18.0 m2 of its walls stand in no bay (strip)" in " ".join(shown.output.split())
