"""One building has one load: in tables, objective, evaluation, report, page and benchmark.

The building has two protected parts, one of them with oblique walls, and a wing that nobody
protects. Its load is the mean of the peak specific impulse over the area of the walls that
count of its protected parts.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from blast_env.answers.compare import comparison
from blast_env.cli import app
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, LoadCase, LoadCaseSet, evaluate_layout
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.evaluation.record import BlastRecord
from blast_env.gas import stepped_buildings
from blast_env.geometry import Layout
from blast_env.site import Charge, Scenario, save_scenario
from tests.app.here import rows_of
from tests.builders import block
from tests.gas_sites import hut, site_document

CHARGE = Charge((2.0, 4.0), 5.0)
ENGINE = GasEngine(border_m=0.0)
PARTS = (
    ([(6.0, 1.0), (8.5, 1.0), (8.5, 2.0), (6.5, 2.0)], 0.5),
    ([(6.5, 2.0), (8.5, 2.0), (8.5, 3.0), (7.0, 3.0)], 0.5),
    ([(7.5, 4.0), (8.5, 4.0), (8.5, 5.0), (7.5, 5.0)], 1.0),
)
"""Outline and weight of each part; the last one is the wing."""


@pytest.fixture(scope="module")
def hall() -> Scenario:
    document = site_document()
    keys: dict[str, Any] = {"kind": "polygon", "height_m": 2.0, "building": "hall"}
    document["structures"] = [
        {
            **keys,
            "name": f"part_{number}",
            "outline_m": outline_m,
            "protected": number < 2,
            "weight": weight,
        }
        for number, (outline_m, weight) in enumerate(PARTS)
    ]
    return Scenario.from_document(document, "hall")


@pytest.fixture(scope="module")
def result(hall: Scenario) -> GasResult:
    return GasBlast(hall, engine=ENGINE, charge=CHARGE).run()


@pytest.fixture(scope="module")
def load_pa_s(result: GasResult) -> float:
    """The definition, from the faces of cells."""
    faces = result.on_walls
    walls = faces[
        faces["structure"].isin(["part_0", "part_1"])
        & faces["face"].isin(["west", "east", "south", "north"])
    ]
    return float(np.average(walls["impulse_pa_s"], weights=walls["share"]))


def test_the_parts_differ_and_have_an_oblique_wall(hall: Scenario, result: GasResult) -> None:
    """Else a mean by weight, or with the wing, would be the same."""
    assert stepped_buildings(hall.structures) == {"hall"}
    loads = result.structures["impulse_pa_s"]
    assert loads.max() > 1.1 * loads.min()
    areas = result.structures["area_m2"].to_numpy()[:2]
    assert not np.allclose(areas / areas.sum(), (0.5, 0.5), atol=0.02)


def test_tables_and_the_objective(result: GasResult, hall: Scenario, load_pa_s: float) -> None:
    (row,) = result.buildings.to_dict("records")
    assert row["impulse_pa_s"] == pytest.approx(load_pa_s)
    loads = result.loads()
    assert loads.protected_impulse_pa_s == pytest.approx(load_pa_s)  # weights add up to 1
    assert loads.load(hall.objective) == pytest.approx(load_pa_s)


def test_evaluation_and_benchmark(hall: Scenario, load_pa_s: float) -> None:
    threat = LoadCase(CHARGE, 0)
    found = evaluate_layout(hall, (), threats=[threat], engine=ENGINE)
    (row,) = found.building_table.to_dict("records")
    assert row["impulse_pa_s"] == pytest.approx(load_pa_s)
    assert found.impulse_pa_s.value == pytest.approx(load_pa_s)
    evaluator = BlastEvaluator(hall, ENGINE)
    assert evaluator.loads((), threat).load(hall.objective) == pytest.approx(load_pa_s)


def test_the_report(hall: Scenario, load_pa_s: float) -> None:
    record = GasBlast(hall, engine=ENGINE, charge=CHARGE).recorded().record
    assert record.complete.buildings["hall"].impulse_pa_s == pytest.approx(load_pa_s)


def test_the_page(hall: Scenario, result: GasResult, load_pa_s: float) -> None:
    record, threat = BlastRecord(result.loads()), LoadCase(CHARGE, name="T1")
    layouts: dict[str, Layout] = {"no barrier": ()}
    blasts = Blasts(LoadCaseSet(hall, (threat,)), layouts, {"no barrier": (record,)}, ENGINE)
    table = comparison({"no barrier": (blasts, 0.0)}, ["T1"], hall)
    together, building = rows_of(table)
    assert building.structure == "hall"
    for row in (together, building):
        assert float(row.impulse.replace(",", "")) == pytest.approx(load_pa_s, rel=5e-3)


def two_parts(building: str) -> Scenario:
    """Return the hut in two halves; none of the counted walls of the eastern one is in the air."""
    west = block("west", 6.0, 3.0, 4, 2, height_m=2.0, protected=True, faces=["west"])
    east = west | {"name": "east", "corner_m": [7.0, 3.0]}
    halves = [west | {"building": "hut"}, east | {"building": building}]
    return hut(structures=halves)


def test_a_part_that_no_air_touches_leaves_the_building_its_load(tmp_path: Path) -> None:
    """It had made the load of the building NaN, and of its blasts ones that no store gave back."""
    site, threat = two_parts("hut"), LoadCase(CHARGE, 0)
    evaluators = [BlastEvaluator(site, ENGINE, cache=tmp_path) for _ in range(2)]
    first, again = (own.loads((), threat) for own in evaluators)
    alone = BlastEvaluator(hut(structures=[site.structures[0].model_dump()]), ENGINE)
    west = alone.loads((), threat).structures[0].impulse_pa_s
    assert first.structures[0].impulse_pa_s == pytest.approx(west, rel=0.1)
    assert np.isnan(first.structures[1].impulse_pa_s)
    for loads in (first, again):
        assert loads.protected_impulse_pa_s == 2.0 * loads.structures[0].impulse_pa_s
        assert loads.load(site.objective) == loads.protected_impulse_pa_s
    assert [own.counts.blasts for own in evaluators] == [1, 0]


def test_a_building_that_no_air_touches_has_no_load_and_that_is_said(tmp_path: Path) -> None:
    site, threats = two_parts("other"), [LoadCase(CHARGE, 0)]
    save_scenario(site, tmp_path / "site.toml")
    said = CliRunner().invoke(app, ["simulate", str(tmp_path / "site.toml")]).stdout
    assert "other: no air touches its assessed walls (west): it has no load" in said
    assert "nan" not in said
    with pytest.raises(BlastEnvError, match=r"hut: no load without a barrier on other: no air"):
        evaluate_layout(site, (), threats=threats, engine=ENGINE)
