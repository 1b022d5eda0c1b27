"""Loads on the oblique walls of polygons: those of the study, and plain buildings."""

from typing import Any

import numpy as np
import pytest

from blast_env.evaluation import BlastEvaluator, draw_threats
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.gas import STEPPED, stepped_buildings
from blast_env.site import WALLS, Scenario, bundled_scenarios, load_scenario
from studies.gas.oblique import turned_block
from tests.blasts import consequences
from tests.gas_sites import site_document
from tests.office_park import office_park

SLANTED = [(6.0, 1.0), (8.5, 1.0), (8.5, 5.0), (7.5, 5.0)]
STRAIGHT = [(6.0, 1.0), (8.5, 1.0), (8.5, 5.0), (6.0, 5.0)]


def hall(outline_m: list[tuple[float, float]], **keys: Any) -> Scenario:
    """Return the site of the hut with a hall in its place."""
    document = site_document()
    section = {"kind": "polygon", "name": "hall", "height_m": 2.0, "protected": True}
    document["structures"] = [{**section, "outline_m": outline_m, **keys}]
    return Scenario.from_document(document, "hall")


def test_only_buildings_with_oblique_walls_are_stepped() -> None:
    assert stepped_buildings(turned_block(20.0).structures) == {"block"}
    sites = [turned_block(0.0), office_park(), *map(load_scenario, bundled_scenarios())]
    assert [stepped_buildings(site.structures) for site in sites] == [frozenset()] * len(sites)


def test_tables_and_notes_say_it() -> None:
    engine = GasEngine(border_m=0.0, until=0.01)
    found = [GasBlast(hall(case), engine=engine).run() for case in (SLANTED, STRAIGHT)]
    assert [consequence.buildings["stepped"].tolist() for consequence in found] == [[True], [False]]
    assert [consequence.stepped_notes for consequence in found] == [(f"hall: {STEPPED}",), ()]


def test_an_assessment_says_it_of_a_building_with_a_facade() -> None:
    scenario = hall(SLANTED, facade={"wall": "concrete_200"})
    engine = GasEngine(border_m=0.0, until=0.01)
    found = consequences(
        BlastEvaluator(scenario, engine), (), [draw_threats(scenario, [0])[0].charge]
    )
    assert found.notes[0].startswith(f"hall: {STEPPED}")
    assert not found.unjudged


@pytest.fixture(scope="module")
def turned() -> GasResult:
    return GasBlast(turned_block(30.0), engine=GasEngine(border_m=0.0, until=0.03)).run()


@pytest.fixture(scope="module")
def straight() -> GasResult:
    return GasBlast(turned_block(0.0), engine=GasEngine(border_m=0.0, until=0.03)).run()


def test_the_load_is_that_of_a_straight_block(turned: GasResult, straight: GasResult) -> None:
    """The same block at the same place before the charge: 2 % apart, as cells resolve it."""
    loads = [case.impulse("block").pa_s for case in (turned, straight)]
    assert loads[0] == pytest.approx(loads[1], rel=0.04)


def test_tables_have_the_area_and_the_load_of_the_real_wall(turned: GasResult) -> None:
    """Steps of a wall have more area than it, and their corners larger peaks."""
    block = turned.buildings.iloc[0]
    assert block["area_m2"] == pytest.approx(2 * (12.0 + 6.0) * 6.0, rel=0.02)
    assert len(turned.faces) * 0.25 > 1.2 * block["area_m2"]
    assert block["peak_pa"] < 0.85 * turned.faces["peak_pa"].max()
    assert turned.walls["peak_pa"].max() == block["peak_pa"]
    assert turned.loads().protected_peak_pa == block["peak_pa"]
    of_structures_pa_s = turned.structures.set_index("structure")["impulse_pa_s"]
    assert turned.impulse("block").pa_s == pytest.approx(of_structures_pa_s["block"])


def test_each_wall_has_its_length_on_the_side_that_it_faces(turned: GasResult) -> None:
    area_m2 = turned.walls.set_index("face")["area_m2"]
    for side in ("west", "east"):
        assert area_m2[side] == pytest.approx(12.0 * 6.0, rel=0.05)
    for side in ("south", "north"):
        assert area_m2[side] == pytest.approx(6.0 * 6.0, rel=0.05)


def test_momentum_along_the_normal_is_kept(turned: GasResult) -> None:
    oblique = turned.oblique
    assert oblique is not None
    own, share = oblique.members, oblique.share
    raw = turned.run.loads.impulse_pa_s
    assert 0.0 < share[own].min() < share[own].max() <= 1.0
    assert (share * raw)[own].sum() == pytest.approx(
        (share * oblique.along_normals(raw))[own].sum(), rel=1e-12
    )
    assert (oblique.along_normals(raw)[~own] == raw[~own]).all()


def test_means_are_over_the_area_of_the_real_walls(turned: GasResult) -> None:
    """Load times area is the momentum."""
    oblique = turned.oblique
    assert oblique is not None
    is_wall = turned.faces["face"].isin(WALLS).to_numpy()
    raw = turned.run.loads.impulse_pa_s
    momentum = 0.25 * (oblique.share * raw)[is_wall].sum()
    for table in (turned.structures, turned.walls[turned.walls["counts"]], turned.buildings):
        load, area = table["impulse_pa_s"], table["area_m2"]
        assert (load * area).sum() == pytest.approx(momentum, rel=1e-12)
    loads = {structure.name: structure.impulse_pa_s for structure in turned.loads().structures}
    of_structures_pa_s = turned.structures.set_index("structure")["impulse_pa_s"]
    assert loads == pytest.approx(of_structures_pa_s.to_dict())


def test_bays_are_as_wide_as_the_facade_says_on_every_wall(turned: GasResult) -> None:
    """Windows are set once for a building; treads and risers of a bay bend as one."""
    bays = turned.bays
    counts = bays.groupby("wall")["number"].nunique().to_dict()
    assert counts == {"west": 4, "east": 4, "south": 2, "north": 2}
    np.testing.assert_allclose(bays["area_m2"], 9.0, rtol=1e-6)
    assert not turned.unjudged


def test_a_wall_along_the_grid_has_the_loads_of_its_faces(straight: GasResult) -> None:
    assert straight.oblique is None
    assert straight.on_walls.equals(straight.faces)
    west = straight.faces["face"] == "west"
    assert straight.loads().protected_peak_pa == straight.faces["peak_pa"].max()
    assert straight.walls.set_index("face")["peak_pa"]["west"] == (
        straight.faces["peak_pa"][west].max()
    )


def test_a_rectangle_is_the_plain_case_of_a_polygon(straight: GasResult) -> None:
    """To the last bit."""
    document = turned_block(0.0).model_dump(mode="json")
    (block,) = document["structures"]
    outline = np.array(block.pop("outline_m"))
    block.pop("courtyards_m", None)
    corner, size = outline.min(axis=0), np.ptp(outline, axis=0)
    block |= {"kind": "ModularObstacle", "corner_m": corner.tolist()}
    block |= dict(zip(("columns", "rows"), (2 * size).astype(int).tolist(), strict=True))
    rectangle = Scenario.from_document(document, "block")
    found = GasBlast(rectangle, engine=GasEngine(border_m=0.0, until=0.03)).run()
    assert found.digest == straight.digest
    for one, other in zip(found.loads().structures, straight.loads().structures, strict=True):
        assert one == other
    own = [case.bays.sort_values(["wall", "impulse_pa_s"]) for case in (found, straight)]
    assert own[0]["impulse_pa_s"].tolist() == own[1]["impulse_pa_s"].tolist()
