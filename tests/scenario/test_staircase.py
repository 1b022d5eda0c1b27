"""Oblique walls, as modules show them: those of the study, plain buildings, and their loads."""

from collections.abc import Sequence
from math import cos, radians, sin
from typing import Any

import numpy as np
import pytest

from blast_env.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.evaluation import draw_threats
from blast_env.evaluation.consequences import consequences
from blast_env.physics.scene import WALLS
from blast_env.scenario import Scenario, bundled_scenarios, load_scenario
from blast_env.scenario.staircase import STEPPED, oblique_walls, stepped_buildings
from blast_env.units import MODULE_SIDE_M
from studies.gas.oblique import FACADE_M, turned_block
from tests.gas_sites import site_document
from tests.office_park import office_park


@pytest.mark.parametrize("angle_deg", [20.0, 30.0, 45.0, -20.0, 110.0])
def test_a_turned_block_is_stepped(angle_deg: float) -> None:
    """Its facade is the wall with the most modules, and looks back to the charge."""
    facade, *_ = [
        wall
        for wall in oblique_walls(turned_block(angle_deg).structures)
        if np.dot(wall.normal, (-cos(radians(angle_deg)), -sin(radians(angle_deg)))) > 0.999
    ]
    assert facade.building == "block"
    outwards = {"west": (-1, 0), "east": (1, 0), "south": (0, -1), "north": (0, 1)}
    length_m = MODULE_SIDE_M * sum(np.dot(outwards[e.wall], facade.normal) for e in facade.edges)
    assert length_m == pytest.approx(FACADE_M, abs=2.0)


@pytest.mark.parametrize("angle_deg", [20.0, 30.0, 45.0, -20.0, 110.0])
def test_no_edge_is_in_two_walls(angle_deg: float) -> None:
    walls = oblique_walls(turned_block(angle_deg).structures)
    assert len(frozenset.union(*(each.edges for each in walls))) == sum(
        len(each.edges) for each in walls
    )


def test_plain_buildings_are_not() -> None:
    sites = [turned_block(0.0), office_park(), *map(load_scenario, bundled_scenarios())]
    assert [stepped_buildings(each.structures) for each in sites] == [frozenset()] * len(sites)


def parts_of(*rectangles: Sequence[int]) -> Scenario:
    """Return one building of rectangles (column, row, columns, rows) on the ground of the hut."""
    document = site_document()
    keys: dict[str, Any] = {"kind": "ModularObstacle", "height_m": 2.0, "protected": True}
    document["structures"] = [
        {
            **keys,
            "name": f"part_{number}",
            "building": "hall",
            "corner_m": [6.0 + 0.5 * column, 1.0 + 0.5 * row],
            "columns": columns,
            "rows": rows,
        }
        for number, (column, row, columns, rows) in enumerate(rectangles)
    ]
    return Scenario.from_document(document, "hall")


STAIRS = [(0, 0, 5, 2), (1, 2, 4, 2), (2, 4, 3, 2), (3, 6, 2, 2)]


def test_steps_to_and_fro_are_bays_and_not_a_staircase() -> None:
    to_and_fro = [(0, 0, 5, 2), (1, 2, 4, 2), (0, 4, 5, 2), (1, 6, 4, 2), (0, 8, 5, 2)]
    two = STAIRS[:3]
    assert stepped_buildings(parts_of(*to_and_fro).structures) == frozenset()
    assert stepped_buildings(parts_of(*two).structures) == frozenset()
    assert stepped_buildings(parts_of(*STAIRS).structures) == {"hall"}


def test_tables_and_notes_say_it() -> None:
    engine = GasEngine(border_m=0.0, until=0.01)
    found = [
        GasBlast(each, engine=engine).run() for each in (parts_of(*STAIRS), parts_of(*STAIRS[:1]))
    ]
    assert [each.buildings["stepped"].tolist() for each in found] == [[True], [False]]
    assert [each.stepped_notes for each in found] == [(f"hall: {STEPPED}",), ()]


def test_an_assessment_says_it_of_a_building_with_a_facade() -> None:
    """A step is a bay of its own there; an oblique wall has no other."""
    stairs = parts_of(*STAIRS).model_dump(mode="json")
    for each in stairs["structures"]:
        each["facade"] = {"wall": "concrete_200"}
    scenario = Scenario.from_document(stairs, "stairs")
    engine = GasEngine(border_m=0.0, until=0.01)
    found = consequences(scenario, (), [draw_threats(scenario, [0])[0].charge], engine)
    assert found.notes[0].startswith(f"hall: {STEPPED}")


@pytest.fixture(scope="module")
def turned() -> GasResult:
    return GasBlast(turned_block(30.0), engine=GasEngine(border_m=0.0, until=0.03)).run()


def test_tables_have_the_area_and_the_load_of_the_real_wall(turned: GasResult) -> None:
    """Steps of a wall have more area than it, and their corners larger peaks."""
    block = turned.buildings.iloc[0]
    assert block["area_m2"] == pytest.approx(2 * (12.0 + 6.0) * 6.0, rel=0.02)
    assert len(turned.faces) * 0.25 > 1.2 * block["area_m2"]
    assert block["peak_pa"] < 0.85 * turned.faces["peak_pa"].max()
    assert turned.walls["peak_pa"].max() == block["peak_pa"]
    assert turned.loads().protected_peak_pa == block["peak_pa"]
    told = turned.structures.set_index("structure")["impulse_pa_s"]
    assert turned.impulse("part_9").pa_s == pytest.approx(told["part_9"])


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
    """Load times area is the momentum, on straight walls beside oblique ones, too."""
    oblique = turned.oblique
    assert oblique is not None
    is_wall = turned.faces["face"].isin(WALLS).to_numpy()
    raw = turned.run.loads.impulse_pa_s
    momentum = 0.25 * (oblique.share * raw)[is_wall].sum()
    for table in (turned.structures, turned.walls[turned.walls["counts"]], turned.buildings):
        load, area = table["impulse_pa_s"], table["area_m2"]
        assert (load * area).sum() == pytest.approx(momentum, rel=1e-12)
    loads = {each.name: each.impulse_pa_s for each in turned.loads().structures}
    told = turned.structures.set_index("structure")["impulse_pa_s"]
    assert loads == pytest.approx(told.to_dict())


def test_steps_of_a_bay_have_one_history(turned: GasResult) -> None:
    """Treads and risers of one bay of the wall bend as one."""
    bays = turned.bay_loads
    assert bays is not None
    first, *others = np.flatnonzero(bays.on_oblique == bays.on_oblique.max())
    assert others
    assert (bays.history_pa[others] == bays.history_pa[first]).all()
    assert not (bays.recorder.history_pa[others] == bays.recorder.history_pa[first]).all()


def test_a_wall_along_the_grid_has_the_loads_of_its_faces() -> None:
    straight = GasBlast(turned_block(0.0), engine=GasEngine(border_m=0.0, until=0.02)).run()
    assert straight.oblique is None
    assert straight.on_walls.drop(columns="share").equals(straight.faces)
    west = straight.faces["face"] == "west"
    assert straight.loads().protected_peak_pa == straight.faces["peak_pa"].max()
    assert straight.walls.set_index("face")["peak_pa"]["west"] == (
        straight.faces["peak_pa"][west].max()
    )
