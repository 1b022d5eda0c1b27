"""Structures that begin above the ground: canopies, storeys over a passage, gates."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blast_env.app.solids import boxes
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import simulate
from blast_env.evaluation.engines.gas import GasEngine, GasResult
from blast_env.io.importing import ImportOptions, import_site
from blast_env.layout import LayoutState
from blast_env.plots import structure_features
from blast_env.site import Charge, Scenario
from blast_env.sites import Visibility
from blast_env.surrogate import packaged_surrogate, site_of
from tests.builders import block
from tests.gas_sites import site_document
from tests.io.importing.maps import charge, outline, rectangle, written
from tests.vehicle_sites import gate_site, vehicle_of

ENGINE = GasEngine(border_m=0.0)


def raised(
    base_m: float, height_m: float | None, corner_m: tuple[float, float], **keys: Any
) -> dict[str, Any]:
    """Return a structure, 2 m along y and half a metre along x unless said otherwise."""
    keys = {"name": "canopy", "rows": 4, "columns": 1, **keys}
    if height_m is not None:
        keys["height_m"] = height_m
    return block(x_m=corner_m[0], y_m=corner_m[1], base_m=base_m, **keys)


def hut_with(*structures: dict[str, Any], **changes: Any) -> Scenario:
    document = site_document(**changes)
    document["structures"] = [*document["structures"], *structures]
    return Scenario.from_document(document, "hut")


CANOPY = raised(2.5, 3.0, (1.0, 2.5), rows=6, columns=4, protected=True)
"""Over the charge, which lies on the ground at (2, 4) m."""


def blast(*structures: dict[str, Any], **changes: Any) -> GasResult:
    result = simulate(hut_with(*structures, **changes), engine=ENGINE)
    assert isinstance(result, GasResult)
    return result


def test_a_slab_in_the_air_is_loaded_from_below() -> None:
    walls = blast(CANOPY).walls
    load = walls[walls["structure"] == "canopy"].set_index("face")
    assert not load["counts"].to_dict()["underside"]
    for quantity in ("impulse_pa_s", "peak_pa"):
        on = load[quantity].to_dict()
        assert on["underside"] > 3.0 * on["roof"]
        assert on["west"] == pytest.approx(on["east"], rel=0.05)  # the charge is in the middle
        assert on["south"] == pytest.approx(on["north"], rel=0.05)
    assert "underside" not in set(walls[walls["structure"] == "hut"]["face"])


def hut_pa_s(result: GasResult) -> float:
    return result.impulse("hut").pa_s


def wall_with(*gate: dict[str, Any]) -> list[dict[str, Any]]:
    """Return a wall of 4 m between charge and hut, with what is in the gate of 2 m."""
    left = raised(0.0, 4.0, (4.5, 1.0), name="left")
    right = raised(0.0, 4.0, (4.5, 5.0), name="right")
    return [left, right, *gate]


def test_a_passage_lets_the_blast_through_and_a_filled_one_is_a_wall() -> None:
    over = raised(2.0, 4.0, (4.5, 3.0), name="over")
    below = raised(0.0, 2.0, (4.5, 3.0), name="below")
    whole = raised(0.0, 4.0, (4.5, 1.0), name="whole", rows=12)
    open_site, passage, filled, wall = (
        blast(*case, build_zone=None)
        for case in ([], wall_with(over), wall_with(over, below), [whole])
    )
    through = [
        float(case.structures["impulse_pa_s"].iloc[0]) for case in (open_site, passage, wall)
    ]
    assert through[0] > 1.1 * through[1] > 1.5 * through[2]
    # Cells have the owner that stands there, not that of their column; the gas is the same.
    assert hut_pa_s(filled) == through[2]
    faces = filled.faces[filled.faces["structure"].isin(["over", "below"])]
    assert (faces[faces["structure"] == "over"]["z_m"] > 2.0).all()
    assert (faces[faces["structure"] == "below"]["z_m"] < 2.0).all()
    assert len(filled.faces) == len(wall.faces)


def test_a_base_of_0_changes_nothing() -> None:
    plain, said = site_document(), site_document()
    said["structures"][0]["base_m"] = 0.0
    scenarios = [Scenario.from_document(case, "hut") for case in (plain, said)]
    assert scenarios[0].content_hash == scenarios[1].content_hash
    assert hut_with(CANOPY).content_hash != hut_with({**CANOPY, "base_m": 2.0}).content_hash


@pytest.mark.parametrize(
    ("structure", "changes", "words"),
    [
        (
            {**CANOPY, "base_m": 2.75},
            {},
            r"structures\[1\].base_m: is 2.75, must be .* height_m \(3\)",
        ),
        (raised(4.75, None, (1.0, 2.5)), {}, r"base_m: is 4.75, must be .* the air \(5\)"),
        ({**CANOPY, "corner_m": (6.0, 3.0), "base_m": 1.5}, {}, "overlaps"),
        ({**CANOPY, "base_m": 0.5}, {"height": 1.0}, "or be lower than its base_m of 0.5 m"),
    ],
)
def test_what_cannot_be_is_refused(
    structure: dict[str, Any], changes: dict[str, float], words: str
) -> None:
    source = {"kind": "point", "position_m": [2.0, 4.0], "tnt_kg": 5.0}
    source["height_m"] = changes.get("height", 0.0)
    with pytest.raises(BlastEnvError, match=words):
        hut_with(structure, charge=[source])


def test_gauges_may_be_below_but_not_inside() -> None:
    def gauge(z_m: float) -> list[dict[str, Any]]:
        return [{"name": "door", "position_m": [2.0, 4.0, z_m]}]

    hall = {**CANOPY, "base_m": 1.5, "height_m": 4.0}
    assert hut_with(hall, gauges=gauge(1.0)).gauges[0].name == "door"
    with pytest.raises(BlastEnvError, match="is 1 m deep inside"):
        hut_with({**hall, "rows": 8, "columns": 8, "corner_m": (0.0, 2.0)}, gauges=gauge(2.5))


def test_particles_refuse_it() -> None:
    with pytest.raises(BlastEnvError, match=r"base_m: is 2.5, must be 0 for particles: .*'gas'"):
        simulate(hut_with(CANOPY), engine="event")


def test_vehicles_and_people_pass_below_what_is_high_enough() -> None:
    def gate(base_m: float) -> Scenario:
        document = gate_site().model_dump(exclude_none=True)
        over = raised(base_m, 4.5, (9.0, 0.0), rows=16)
        document["structures"] = [*document["structures"], over]
        return Scenario.from_document(document, "gate")

    grounds = [case.vehicle_ground(vehicle_of(case)) for case in map(gate, (2.0, 1.5))]
    assert [rectangle.left for rectangle in grounds[0].standing_m] == [10.0]  # the hut alone
    below, before = (ground.worst_places().stand_off_m for ground in grounds)
    assert (before, below) == (2.0, 1.0)
    zone = {"corner_m": (3.5, 2.0), "rows": 8, "columns": 4, "stock": 4, "height_m": 1.5}
    zone["access_way"] = {"width_m": 1.0, "between": "left_right"}
    bridge = raised(2.5, 3.5, (4.0, 2.0), rows=8)
    over = LayoutState.empty(hut_with(bridge, build_zone=zone))
    assert not over.legal[0][:, 1].any()  # nothing is built below it
    assert over.legal.any()  # and the way goes on below it


def test_bays_begin_where_the_structure_does() -> None:
    facade = {"wall": "brick_215", "storey_m": 2.0}
    document = raised(1.0, 5.0, (1.0, 2.5), protected=True, facade=facade)
    found = hut_with(document).bays_with(())
    floors = sorted({(bay.bay.floor_m, bay.bay.top_m) for bay in found})
    assert floors == [(1.0, 3.0), (3.0, 5.0)]


def test_pictures_draw_it_above_the_ground() -> None:
    scenario = hut_with(CANOPY)
    hut, canopy = structure_features(scenario.structures)
    assert (hut.look.dashed, canopy.look.dashed) == (False, True)
    assert canopy.title == "protected structure above the ground"
    solid = next(box for box in boxes(scenario, ()) if box.name == "canopy")
    assert solid.centre_m[2] == pytest.approx(2.75)
    assert solid.size_m[2] == pytest.approx(0.5)


@pytest.mark.parametrize("tags", [{"min_height": 3.2}, {"building:min_level": "1"}])
def test_an_import_keeps_what_a_map_says(tags: dict[str, Any], tmp_path: Path) -> None:
    path = written(
        tmp_path,
        outline(rectangle(20.0, 0.0, 8.0, 6.0), name="Hall", height=9.0),
        outline(rectangle(20.0, 10.0, 8.0, 4.0), name="Bridge", height=6.0, **tags),
        charge(5.0, 5.0),
    )
    scenario = import_site(path, ImportOptions(protect=("Hall",))).scenario
    found = {
        structure.name: (structure.base_m, structure.height_m) for structure in scenario.structures
    }
    assert sorted(found.values()) == [(0.0, 9.0), (3.0, 6.0)]


def test_surrogate_and_lines_of_sight_take_it_as_absent() -> None:
    between = raised(2.0, 3.0, (4.0, 2.0), rows=8)
    plain, with_it = hut_with(), hut_with(between)
    charge_at, surrogate = Charge((2.0, 4.0), 5.0), packaged_surrogate()
    loads = [
        surrogate.guess(site_of(case), [()], [charge_at]).loads(site_of(case)).item()
        for case in (plain, with_it)
    ]
    assert loads[0] == loads[1]
    assert Visibility.of(with_it).open_share == Visibility.of(plain).open_share == 1.0
    approach = site_of(hut_with(CANOPY)).approach(charge_at)
    points_m = approach.ways.points_m[approach.points_of(1)]
    assert np.all((points_m[:, 2] > 2.5) & (points_m[:, 2] < 3.0))
