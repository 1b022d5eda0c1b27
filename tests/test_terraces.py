"""Terraces: raised ground on which barriers and other structures stand."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.typing import NDArray

from blast_env.app.solids import boxes
from blast_env.envs.planes import GridObservation
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.evaluation.engines import simulate
from blast_env.evaluation.engines.gas import GasEngine, GasResult
from blast_env.geometry import Layout, Piece
from blast_env.io.export import LayoutPlan, drawing, export_layout
from blast_env.io.importing import ImportOptions, import_site
from blast_env.layout import LayoutState, build_site, vehicle_drive
from blast_env.plots import Kinds, on_levels, site_features
from blast_env.site import Charge, Scenario, ScenarioError, highest_top_m
from blast_env.sites import Visibility
from blast_env.surrogate import packaged_surrogate, site_of
from tests import builders
from tests.builders import block, point, zone
from tests.catalogue_sites import item
from tests.gas_sites import column, net_on_modules
from tests.io.importing.maps import charge, outline, rectangle, written
from tests.vehicle_sites import gate_site, vehicle_document, vehicle_of
from tests.vehicles.test_driving import LORRY

ENGINE = GasEngine(border_m=0.0)

TERRACE = block("podium", 6.0, 2.0, 16, 14, height_m=1.0, carries=True)
"""Under the eastern half of the zone."""

HALL = block("hall", 8.5, 3.5, 10, 8, base_m=1.0, height_m=4.0, protected=True)
"""On the terrace."""

WALL: Layout = (Piece(3, 4, "wall", True), Piece(7, 4, "wall", True))
"""A metre high, 4 m long, along the edge of the terrace."""


RATING = {"mass_kg": LORRY["mass_kg"], "speed_km_h": 10.0}
"""Of what gives way."""


def site_document(*structures: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """A charge of 5 kg in the west, a zone of 14 x 8 cells, all symmetric about y = 6 m."""
    items = [item("wall", 4, 1, 1.0, stock=4), item("post", 1, 1, 1.5, stock=4)]
    charge, cells = point(2.0, 6.0, 5.0), zone(4.0, 2.5, 14, 8, items=items)
    found = builders.site_document(
        "terraced", (14.0, 12.0, 6.0), charge, HALL, *(structures or (TERRACE,)), build_zone=cells
    )
    return found | changes


def terraced(*structures: dict[str, Any], **changes: Any) -> Scenario:
    return Scenario.from_document(site_document(*structures, **changes), "terraced")


def blast(scenario: Scenario, layout: Layout = ()) -> GasResult:
    result = simulate(scenario, layout, engine=ENGINE)
    assert isinstance(result, GasResult)
    return result


def faces_of(result: GasResult, structure: str) -> NDArray[np.float64]:
    """Return place and loads of the faces of a structure, in one order."""
    table = result.faces[result.faces["structure"] == structure]
    table = table.sort_values(["x_m", "y_m", "z_m", "face"])
    return table.select_dtypes("number").drop(columns=["row", "column"], errors="ignore").to_numpy()


# --- The gas.


@pytest.fixture(scope="module")
def protected() -> GasResult:
    return blast(terraced(), WALL)


@pytest.mark.parametrize(
    "structures",
    [
        (TERRACE, block("parapet", 6.0, 4.0, 8, 1, base_m=1.0, height_m=2.0)),
        (
            TERRACE | {"corner_m": [6.5, 2.0], "columns": 13},
            TERRACE | {"name": "south", "rows": 4, "columns": 1},
            TERRACE | {"name": "north", "corner_m": [6.0, 8.0], "rows": 4, "columns": 1},
            block("parapet", 6.0, 4.0, 8, 1, height_m=2.0),
        ),
    ],
    ids=["a structure on the terrace", "a structure of 2 m beside it"],
)
def test_a_wall_of_1_m_on_1_m_of_ground_is_a_wall_of_2_m(
    protected: GasResult, structures: tuple[dict[str, Any], ...]
) -> None:
    """Bit for bit: the same air, whatever the solids are called."""
    other = blast(terraced(*structures))
    assert np.array_equal(faces_of(protected, "hall"), faces_of(other, "hall"))
    assert protected.impulse("hall") == other.impulse("hall")
    assert len(protected.faces) == len(other.faces)


def test_a_wall_protects_more_on_the_terrace_than_before_it(protected: GasResult) -> None:
    below = (Piece(3, 3, "wall", True), Piece(7, 3, "wall", True))
    loads = [blast(terraced(), layout).impulse("hall").pa_s for layout in ((), below)]
    assert protected.impulse("hall").pa_s < 0.97 * min(loads)


def test_faces_belong_to_what_stands_there(protected: GasResult) -> None:
    faces = protected.faces
    assert (faces[faces["structure"] == "barrier"]["z_m"] > 1.0).all()
    assert (faces[faces["structure"] == "podium"]["z_m"] <= 1.0).all()
    roof = faces[(faces["structure"] == "podium") & (faces["face"] == "roof")]
    on_it = 4.0 * 5.0 + 4.0 * 0.5  # hall and wall, m2
    assert len(roof) * 0.25 == pytest.approx(7.0 * 8.0 - on_it)


@pytest.mark.parametrize(("height_m", "own_m"), [(1.0, 1.0), (1.25, 1.0), (0.8, 0.8)])
def test_there_is_no_gap_below_what_stands_on_a_terrace(height_m: float, own_m: float) -> None:
    """Also where its top is at the middle of a cell, and where layers round up below and above."""
    document = site_document(TERRACE | {"height_m": height_m})
    document["structures"][0] = HALL | {"base_m": height_m}
    document["build_zone"]["items"] = [item("wall", 4, 1, own_m, stock=4)]
    result = blast(Scenario.from_document(document, "terraced"), WALL)
    assert "underside" not in set(result.faces["face"])
    grid = result.run.grid
    column, row = grid.cell_at((6.25, 6.0, 0.25))[:2]
    below = grid.centres_m(2) < height_m + own_m
    assert np.array_equal(grid.solid[column, row], below)
    loads = result.piece_loads
    assert loads is not None
    for way in loads.ways:  # the recorder has as many faces as a free side of the piece
        west = int(loads.patches[way.piece, way.low])
        assert loads.recorder.faces[west] == way.faces


def test_pieces_are_pushed_by_what_their_sides_took(protected: GasResult) -> None:
    faces, loads = net_on_modules(protected), protected.piece_loads
    assert loads is not None
    for row, way in enumerate(loads.ways):
        own = faces[faces["piece"] == loads.names[way.piece]]
        whole = own["net_pa_s"]
        west, east = (whole[own["face"] == side].mean() for side in ("west", "east"))
        net = float(loads.pushes[row] @ loads.recorder.step_s)
        assert net == pytest.approx(west - east, rel=1e-3)
    assert set(protected.pieces["height_m"]) == {1.0}


def test_modules_without_a_catalogue_stand_on_it_too() -> None:
    zone = {"corner_m": [4.0, 2.5], "rows": 14, "columns": 8, "stock": 9, "height_m": 1.5}
    for high_m, top_m in ((1.5, 2.5), (None, None)):
        of_height = {key: value for key, value in zone.items() if key != "height_m" or high_m}
        site = build_site(terraced(build_zone=of_height), ((0, 0), (0, 4)))
        below, above = site.structures[-1].blocks
        assert (below.base_m, below.height_m) == (0.0, high_m)
        assert (above.base_m, above.height_m) == (1.0, top_m)


def test_the_air_is_high_enough_for_what_stands_on_it() -> None:
    document = site_document(TERRACE | {"height_m": 8.0})
    document["structures"][0] = HALL | {"base_m": 8.0, "height_m": 9.0}
    del document["site"]["air_height_m"]
    assert Scenario.from_document(document, "high").air_height_m == 8.0 + 1.5 + 6.0


@pytest.mark.parametrize(
    ("columns", "keep_outs", "tops_m"),
    [
        (14, [], (8.0 + 5.0, 8.0 + 1.5)),
        (1, [], (5.0, 8.0 + 1.5)),  # too narrow for the block
        (14, [{"corner_m": [6.0, 2.0], "size_m": [2.0, 8.0], "reason": "pipes"}], (5.0, 1.5)),
    ],
)
def test_the_air_is_as_high_as_what_can_stand_there_needs(
    columns: int, keep_outs: list[dict[str, Any]], tops_m: tuple[float, float]
) -> None:
    terrace = TERRACE | {"height_m": 8.0, "columns": columns}
    document = site_document(terrace)
    document["structures"][0] = HALL | {"base_m": 8.0, "height_m": 8.5}
    document["build_zone"] |= {
        "items": [item("block", 2, 2, 5.0), item("post", 1, 1, 1.5)],
        "keep_outs": keep_outs,
    }
    del document["site"]["air_height_m"]
    scenario = Scenario.from_document(document, "high")
    assert highest_top_m(scenario.zone, scenario.structures) == max(tops_m)
    assert scenario.air_height_m == max(*tops_m, 8.5) + 6.0
    document["site"]["air_height_m"] = max(*tops_m, 8.5) - 0.25
    with pytest.raises(ScenarioError) as error:
        Scenario.from_document(document, "low")
    highest = tops_m.index(max(tops_m))
    too_high = [f"items[{number}].height_m" in str(error.value) for number in range(2)]
    assert too_high == [number == highest and max(tops_m) > 8.5 for number in range(2)]


# --- Where something may stand.


def test_the_zone_has_two_levels_and_no_piece_is_on_both() -> None:
    placement = LayoutState.empty(terraced())
    assert placement.usable.all()
    assert placement.empty_zone.ground_m.tolist() == [[0.0] * 4 + [1.0] * 4] * 14
    across, along, post = placement.legal
    assert np.flatnonzero(across.any(axis=0)).tolist() == [0, 4]
    assert along.any(axis=0).all()
    assert post.all()
    words = "'wall' at cell (0, 2) would straddle the edge of a terrace"
    assert placement.explain(Piece(0, 2, "wall", False)) == words
    with pytest.raises(LayoutError, match="would straddle the edge of a terrace"):
        simulate(terraced(), [Piece(0, 2, "wall", False)], engine=ENGINE)


def test_a_cell_on_the_edge_takes_nothing() -> None:
    placement = LayoutState.empty(terraced(TERRACE | {"corner_m": [6.25, 2.0], "columns": 13}))
    assert np.flatnonzero(~placement.usable.any(axis=0)).tolist() == [4]
    words = "would stand on cell (0, 4), which lies only partly on the terrace 'podium'"
    assert placement.explain(Piece(0, 4, "post", False)) == f"'post' at cell (0, 4) {words}"


def test_terraces_of_one_height_side_by_side_are_one() -> None:
    halves = (
        TERRACE | {"columns": 3},
        TERRACE | {"name": "rest", "corner_m": [7.5, 2.0], "columns": 11},
    )
    assert np.array_equal(
        LayoutState.empty(terraced(*halves)).legal, LayoutState.empty(terraced()).legal
    )


def test_a_terrace_of_any_outline_carries_what_lies_wholly_on_it() -> None:
    disc = column("mound", 6.0, 6.0, 4.0)
    flat = {key: value for key, value in HALL.items() if key != "base_m"}
    scenario = terraced(structures=[flat, disc | {"height_m": 1.0, "carries": True}])
    ground = LayoutState.empty(scenario).empty_zone.ground_m
    modules = sum(structure.modules for structure in scenario.structures if structure.carries)
    assert int(ground.sum()) == modules


def test_clearance_is_kept_from_the_wall_of_a_terrace_but_not_on_it() -> None:
    document = site_document()
    document["build_zone"]["clearance_m"] = 1.0
    usable = LayoutState.empty(Scenario.from_document(document, "clear")).usable
    assert np.flatnonzero(usable.any(axis=0)).tolist() == [0, 1, 4, 5, 6]  # 7 is 0.5 m off the hall


def test_nobody_crosses_it() -> None:
    document = site_document()
    document["build_zone"]["access_way"] = {"width_m": 1.0, "between": "left_right"}
    with pytest.raises(ScenarioError, match="the structures leave no access way of 1 m"):
        Scenario.from_document(document, "closed")


@pytest.mark.parametrize("rated", [False, True])
def test_vehicles_stop_at_it_and_meet_nothing_on_it(rated: bool) -> None:
    post = item("post", 1, 1, 1.0, stock=40, **({"crash_rating": RATING} if rated else {}))
    zone = {"corner_m": [4.0, 0.0], "rows": 16, "columns": 4, "items": [post]}
    motion = {"motion": LORRY | {"max_speed_km_h": 60.0, "entry_speed_km_h": 50.0}} if rated else {}
    strip = block("strip", 5.0, 0.0, 16, 4, height_m=0.5, carries=True)
    document = gate_site().model_dump(exclude_none=True)
    document["structures"] = [*document["structures"], strip | {"rows": 12}]
    document |= {"build_zone": zone, "charge": [vehicle_document(**motion)]}
    scenario = Scenario.from_document(document, "gate")
    vehicle = vehicle_of(scenario)
    ground = scenario.vehicle_ground(vehicle)
    assert strip["corner_m"][0] in [rectangle.left for rectangle in ground.standing_m]
    layout = tuple(Piece(row, 2, "post", False) for row in range(0, 12, 2))
    placed, drive = LayoutState.of(scenario, layout), vehicle_drive(scenario, vehicle, layout)
    assert placed.explain_vehicles() == LayoutState.empty(scenario).explain_vehicles()
    assert drive.held == drive.broken == ()


# --- Files and errors.


@pytest.mark.parametrize(
    ("structures", "changes", "words"),
    [
        (
            [TERRACE | {"height_m": None}],
            {},
            r"structures\[1\].carries: is true, needs the structure's height_m",
        ),
        (
            [TERRACE | {"base_m": 0.5}],
            {},
            r"structures\[1\].base_m: is 0.5, must be 0: a terrace is solid",
        ),
        ([TERRACE | {"height_m": 1.5}], {}, r"'podium' .* overlaps structures\[0\], 'hall'"),
        (
            [TERRACE],
            {"site": {"width_m": 14.0, "height_m": 12.0, "air_height_m": 2.25}},
            r"items\[1\].height_m: is 1.5 on a terrace of 1, must be at most 2.25",
        ),
        (
            [TERRACE],
            {"charge": [{"kind": "point", "position_m": [7.0, 6.0], "tnt_kg": 5.0}]},
            r"'podium' .* must keep clear of it by 0.5 m, .* or be higher than its 1 m",
        ),
    ],
)
def test_what_cannot_be_is_refused(
    structures: list[dict[str, Any]], changes: dict[str, Any], words: str
) -> None:
    written = [
        {key: structure[key] for key in structure if structure[key] is not None}
        for structure in structures
    ]
    with pytest.raises(ScenarioError, match=words):
        terraced(*written, **changes)


def test_a_terrace_cannot_be_taken_away() -> None:
    document = site_document()
    removable = {"name": "dig", "structures": ["podium"], "cost": 1.0}
    document["build_zone"]["removable"] = [removable]
    with pytest.raises(ScenarioError, match="is 'podium', a terrace: it cannot be removed"):
        Scenario.from_document(document, "dug")


def test_a_charge_may_be_above_it() -> None:
    source = {"kind": "point", "position_m": [7.0, 6.0], "tnt_kg": 0.5, "height_m": 2.0}
    result = blast(terraced(charge=[source]))
    roof = result.walls.set_index(["structure", "face"])["impulse_pa_s"]
    assert roof["podium", "roof"] > roof["podium", "east"] > 0.0


def test_particles_refuse_it() -> None:
    flat = {key: value for key, value in HALL.items() if key != "base_m"} | {"corner_m": [2.0, 8.5]}
    flat |= {"rows": 4, "columns": 4}
    scenario = terraced(structures=[flat, TERRACE])
    with pytest.raises(BlastEnvError, match=r"carries: is true, must be false for .*'gas' takes"):
        simulate(scenario, engine="event")


# --- What draws it, and what guesses.


def test_pictures_draw_what_stands_on_it_at_its_height() -> None:
    features = {site_feature.name: site_feature for site_feature in site_features(terraced(), WALL)}
    podium, hall = features["podium"], features["hall"]
    assert podium.kind is Kinds.TERRACE
    assert podium.kind.level < Kinds.BUILD_ZONE.level  # which is drawn over it
    assert not hall.look.dashed
    assert hall.title == Kinds.PROTECTED_STRUCTURE.words
    walls = [box for box in boxes(terraced(), WALL) if box.name == "wall"]
    assert [wall.centre_m[2] for wall in walls] == [1.5, 1.5]
    assert [wall.size_m[2] for wall in walls] == [1.0, 1.0]


def test_the_zone_is_cut_where_the_ground_changes_its_height() -> None:
    higher = TERRACE | {"name": "upper", "corner_m": [7.0, 2.0], "columns": 3, "rows": 4}
    document = site_document(TERRACE | {"rows": 12, "corner_m": [6.0, 4.0]}, higher)
    document["structures"][2] |= {"height_m": 2.0}
    document["build_zone"]["keep_outs"] = [
        {"corner_m": [7.0, 3.0], "size_m": [1.0, 2.0], "reason": "pit"}
    ]
    scenario = Scenario.from_document(document, "terraced")
    areas: dict[tuple[str, float], float] = {}
    for part in on_levels(site_features(scenario), scenario.structures):
        if part.kind in (Kinds.BUILD_ZONE, Kinds.KEEP_OUT):
            left, bottom, right, top = part.bounds_m
            key = part.kind.name, part.base_m
            areas[key] = areas.get(key, 0.0) + (right - left) * (top - bottom)
    high, low = 1.0 * 1.5, 2.0 * 5.5
    zone = {0.0: 4.0 * 7.0 - high - low, 1.0: low, 2.0: high}
    expected = {("build_zone", height_m): area for height_m, area in zone.items()}
    assert areas == expected | {("keep_out", 1.0): 1.0, ("keep_out", 2.0): 1.0}


def test_a_drawing_has_the_zone_on_the_terrace_that_it_lies_wholly_on(tmp_path: Path) -> None:
    document = site_document()
    for corner_m, elevation_m in (([6.0, 2.5], 1.0), ([4.0, 2.5], 0.0)):
        document["build_zone"] |= {"corner_m": corner_m, "columns": 4 if elevation_m else 8}
        scenario = Scenario.from_document(document, "terraced")
        (zone,) = drawing(LayoutPlan(scenario, ())).query('LWPOLYLINE[layer=="BUILD_ZONE"]')
        assert zone.dxf.elevation == elevation_m


def test_planes_show_tops_of_structures_and_heights_of_pieces() -> None:
    env = gym.make("BlastBarrierGas-v0", scenario=terraced(), observation="grid", action="place")
    env.reset(seed=0)
    catalogue = LayoutState.empty(terraced()).catalogue
    planes = env.step(catalogue.action(WALL[0]))[0]
    channels = GridObservation().channels_of(terraced())
    height, barrier = (
        planes[channels.index(f"{name}_height")] for name in ("structure", "barrier")
    )
    heights_m = [12.0 * height[row, column] for row, column in ((0, 0), (5, 13), (10, 20))]
    assert heights_m == pytest.approx([0.0, 1.0, 4.0], abs=0.05)
    assert 12.0 * barrier[9, 12] == pytest.approx(1.0, abs=0.05)
    env.close()


@pytest.mark.parametrize("name", ["plan.dxf", "plan.geojson"])
def test_what_is_exported_comes_back(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    export_layout(LayoutPlan(terraced(), WALL), path)
    again = import_site(path, ImportOptions(stock=6)).scenario
    found = {
        (structure.carries, structure.base_m, structure.height_m, structure.rows)
        for structure in again.structures
    }
    assert found == {(True, 0.0, 1.0, 16), (False, 1.0, 4.0, 10)}


@pytest.mark.parametrize("said", [True, "yes"])
def test_a_map_says_what_is_a_terrace_in_the_words_of_the_format(said: Any, tmp_path: Path) -> None:
    hall = outline(rectangle(20.0, 0.0, 8.0, 6.0), height_m=9.0, base_m=1.0, protected=True)
    podium = outline(rectangle(16.0, -2.0, 14.0, 10.0), carries=said, height_m=1.0)
    topless = outline(rectangle(16.0, 12.0, 14.0, 4.0), carries=said)
    imported = import_site(written(tmp_path, hall, podium, topless, charge(5.0, 5.0)))
    found = {
        (structure.carries, structure.base_m, structure.height_m)
        for structure in imported.scenario.structures
    }
    assert found == {(False, 1.0, 9.0), (True, 0.0, 1.0), (False, 0.0, 6.0)}
    words = "guessed: terraces without a height, on which nothing stands: 1 (features[2])"
    assert words in imported.notes


def test_a_building_on_it_is_imported_again_as_on_the_ground(tmp_path: Path) -> None:
    """An L of two rectangles is one building."""
    wing = {"name": "wing", "rows": 4, "columns": 4, "corner_m": [10.5, 3.5]}
    found = []
    for base_m, terraces in ((1.0, [TERRACE]), (0.0, [])):
        parts = [HALL | {"base_m": base_m, "building": "l", "columns": 4}]
        parts.append(parts[0] | wing)
        path = tmp_path / "plan.geojson"
        scenario = terraced(structures=[*parts, *terraces])
        export_layout(LayoutPlan(scenario, ()), path)
        again = import_site(path, ImportOptions(stock=6)).scenario
        own = [structure for structure in again.structures if structure.protected]
        assert {structure.base_m for structure in own} == {base_m}
        assert len({structure.building for structure in own} - {None}) == 1
        assert sum(structure.weight for structure in own) == pytest.approx(1.0)
        modules = sum(structure.modules for structure in scenario.structures if structure.protected)
        assert sum(structure.modules for structure in own) == modules
        found.append([structure.boxes_m for structure in own])
    assert found[0] == found[1]


def test_lines_of_sight_go_over_it_or_stop_at_it() -> None:
    """They rise from the charge to 1/6, 1/2 and 5/6 of the hall, 6.5 m away; its edge is at 4 m."""
    seen = {}
    for high_m in (0.5, 1.0, 3.0):
        scenario = terraced(structures=[HALL | {"base_m": high_m}, TERRACE | {"height_m": high_m}])
        seen[high_m] = Visibility.of(scenario)
    shares = [case.open_share for case in seen.values()]
    assert shares == pytest.approx([1.0, 2.0 / 3.0, 0.0], abs=1e-9)
    # At the wall on the edge the others are 0.63 and 1.29 m above the terrace.
    wall = [(row, 4) for row in range(14)]
    cut = [seen[1.0].cut_share(wall, [own_m] * 14) for own_m in (0.5, 1.0, 1.5)]
    assert cut == pytest.approx([0.0, 0.5, 1.0])


def test_the_surrogate_meets_boxes_from_the_ground_up() -> None:
    site, charge = site_of(terraced()), Charge((2.0, 6.0), 50.0)
    assert site.barrier(WALL)[:, 4].tolist() == [2.0, 2.0]
    open_pa_s, behind_pa_s = packaged_surrogate().guess(site, [(), WALL], [charge] * 2).loads(site)
    assert 0.0 < behind_pa_s < open_pa_s
