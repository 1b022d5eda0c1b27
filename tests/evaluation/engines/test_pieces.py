"""Pieces of a barrier under a blast: they are pushed by what their sides took, and move by it."""

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import blast_env
from blast_env.errors import BlastEnvError, LayoutError, UnknownNameError
from blast_env.evaluation import LoadCase, StructureLoad, evaluate_layout
from blast_env.evaluation.engines.gas import GasEngine, GasResult
from blast_env.evaluation.record import BlastRecord
from blast_env.geometry import Piece
from blast_env.layout import LayoutState
from blast_env.site import Charge, Scenario
from tests import builders
from tests.builders import Document, block, point
from tests.catalogue_sites import ITEMS, WALL, yard
from tests.gas_sites import WALL as MODULES
from tests.gas_sites import hut, net_on_modules


def yard_with(**keys: Any) -> GasResult:
    """Return a blast before two walls and a post, the walls with other keys."""
    items = [ITEMS[0] | keys, *ITEMS[1:]]
    return blast_env.simulate(yard(items=items), WALL, engine="gas")


@pytest.fixture(scope="module")
def result() -> GasResult:
    return yard_with()


def test_the_push_is_what_the_two_sides_took(result: GasResult) -> None:
    """Over all time: west less east, by the faces of the modules of the piece."""
    faces = net_on_modules(result)
    for name in result.pieces["piece"]:
        own = faces[faces["piece"] == name]
        whole = own["net_pa_s"]
        west, east = (whole[own["face"] == side].mean() for side in ("west", "east"))
        loads = result.piece_loads
        assert loads is not None
        row = next(
            k for k, way in enumerate(loads.ways) if loads.names[way.piece] == name and way.low == 0
        )
        net = float(loads.pushes[row] @ loads.recorder.step_s)
        assert net == pytest.approx(west - east, rel=1e-3)


def test_a_wall_is_pushed_across_its_length_and_a_post_both_ways(result: GasResult) -> None:
    wall, _, post = result.pieces["piece"]
    assert list(result.piece_history(wall)) == ["time_s", "west_pa", "east_pa"]
    # The wall north of the post leaves no air there.
    sides = ["west_pa", "east_pa", "south_pa"]
    assert list(result.piece_history(post)) == ["time_s", *sides]
    with pytest.raises(UnknownNameError, match="no piece"):
        result.piece_history("wall_x1.000_y1.000")


def test_a_block_of_concrete_unless_the_file_says_otherwise(result: GasResult) -> None:
    wall = result.pieces.iloc[0]
    assert wall["mass_kg"] == pytest.approx(2400.0 * 1.5 * 0.5 * 2.0)
    assert (wall["base_m"], wall["friction"], wall["anchorage_n"]) == (0.5, 0.5, 0.0)
    assert wall["outcome"] != "overturns"


def test_a_light_wall_falls_and_a_foot_or_an_anchor_holds_it() -> None:
    light = yard_with(mass_kg=500.0).pieces.iloc[0]
    footed = yard_with(mass_kg=500.0, base_width_m=4.0).pieces.iloc[0]
    anchored = yard_with(mass_kg=500.0, anchorage_n=3e6).pieces.iloc[0]
    assert light["outcome"] == "overturns"
    # It is still on its way when the blast is over.
    assert not light["falls_in_blast"]
    assert light["overturn_s"] < 2.0
    assert footed["outcome"] in ("slides", "rocks")
    assert footed["tilt"] < 0.5
    assert (anchored["outcome"], anchored["anchors_hold"]) == ("stands", True)


def test_no_load_depends_on_what_holds_a_piece(result: GasResult) -> None:
    other = yard_with(mass_kg=300.0, friction=0.2)
    assert other.digest == result.digest
    scenarios = (other.blast.scenario, result.blast.scenario)
    assert len({scenario.content_hash for scenario in scenarios}) == 1


def test_modules_are_pieces_and_walls_as_high_as_the_air_are_none() -> None:
    pieces = blast_env.simulate(hut(), MODULES, engine="gas").pieces
    assert len(pieces) == len(MODULES)
    assert np.allclose(pieces["slide_m"], pieces["slide_m"][::-1], rtol=0.01)  # mirrored
    zone = hut().zone.model_dump() | {"height_m": None}
    endless = blast_env.simulate(hut(build_zone=zone), MODULES, engine="gas")
    assert len(endless.pieces) == 0
    with pytest.raises(BlastEnvError, match="no piece"):
        endless.piece_history("x4.250_y2.750")


def lane(*others: Document, outline: bool = False) -> Scenario:
    """Return a front of 4 m, a zone of 1 m before it, walls of 2 m, and other structures.

    `outline` makes the front a polygon.
    """
    items = [
        {"name": f"{name}wall", "length_modules": 4, "height_m": height_m, "cost": 1.0, "stock": 3}
        for name, height_m in (("", 3.0), ("low_", 1.5))
    ]
    zone = builders.zone(5.0, 2.0, 8, 2, items=items)
    keys = {"height_m": 3.0, "protected": True}
    front = block("front", 6.0, 2.0, 8, 4, **keys, faces=["west"])
    if outline:
        corners = [[6.0, 2.0], [8.0, 2.0], [8.0, 6.0], [6.0, 6.0]]
        front = {
            "kind": "polygon",
            "name": "front",
            "outline_m": corners,
            **keys,
            "faces": ["west"],
        }
    where = (9.0, 8.0, 6.0), point(1.0, 4.0, 60.0)
    return builders.site("leaning", *where, front, *others, build_zone=zone)


def blasted(site: Scenario, *layout: Piece) -> GasResult:
    return GasEngine().blast(site, layout, 0, Charge((1.0, 4.0), 60.0)).run()


def on_front(result: GasResult) -> StructureLoad:
    return next(load for load in result.structure_loads if load.name == "front")


def upright(row: int, column: int, name: str = "wall") -> Piece:
    return Piece(row, column, name, True)


def test_walls_that_lean_on_a_whole_front_hand_their_load_to_it() -> None:
    """No face of the front touches air then; the walls stand 0.5 m nearer to the charge."""
    bare, before, leaning = (
        on_front(blasted(lane(), *(upright(row, column) for row in rows)))
        for rows, column in (((), 0), ((0, 4), 0), ((0, 4), 1))
    )
    assert leaning.area_m2 == bare.area_m2 == before.area_m2 == 12.0
    assert 1.0 < leaning.impulse_pa_s / bare.impulse_pa_s < 1.3
    assert leaning.peak_pa is not None
    assert bare.peak_pa is not None
    assert leaning.peak_pa > bare.peak_pa
    assert before.impulse_pa_s < 0.8 * bare.impulse_pa_s  # with air behind them they protect


@pytest.mark.parametrize("outline", [False, True])
def test_what_leans_on_a_part_of_a_front_hands_its_load_to_that_part(outline: bool) -> None:
    """A low wall on the half of a front leaves no part of it out of the mean."""
    site = lane(outline=outline)
    bare, leaning = on_front(blasted(site)), blasted(site, upright(0, 1, "low_wall"))
    on_it = on_front(leaning)
    assert on_it.area_m2 == bare.area_m2 == 12.0
    # The half of the height of a half of the width.
    west = leaning.faces[leaning.faces["face"] == "west"]
    of_wall, of_front = (
        west[(west["structure"] == name) & (west["y_m"] < 4.0) & (west["z_m"] < 1.5)]
        for name in ("barrier", "front")
    )
    assert len(of_front) == len(of_wall) == 12
    handed = of_front.sort_values(["y_m", "z_m"])["impulse_pa_s"].tolist()
    assert handed == of_wall.sort_values(["y_m", "z_m"])["impulse_pa_s"].tolist()
    assert on_it.impulse_pa_s == pytest.approx(bare.impulse_pa_s, rel=0.05)


def test_pieces_hand_on_what_pieces_before_them_take() -> None:
    """Two walls, one behind the other, are as good as solid."""
    result = blasted(lane(), upright(0, 0), upright(0, 1))
    west = result.faces[result.faces["face"] == "west"]
    front, pieces = (west[west["structure"] == name] for name in ("front", "barrier"))
    hidden = front[front["y_m"] < 4.0]
    assert hidden["x_m"].unique().tolist() == [5.0]
    assert hidden["impulse_pa_s"].mean() == pytest.approx(pieces["impulse_pa_s"].mean(), rel=1e-6)


OTHER = block("other", 4.5, 2.0, 4, 2, height_m=3.0)
"""A building that leaves a gap of the width of a wall before a half of the front."""
WORDS = "6.0 of 12.0 m2 of its assessed walls have no load, since pieces fill the gap before them"


def test_what_stands_between_two_buildings_hands_on_nothing() -> None:
    """There is no air before the wall: as if the two buildings touched. It is named."""
    blast = GasEngine().blast(lane(OTHER), (upright(0, 1),), 0, Charge((1.0, 4.0), 60.0))
    found = blast.recorded()
    load = on_front(found.result)
    assert (load.area_m2, load.unloaded_m2) == (6.0, 6.0)
    assert load.unloaded_words == WORDS
    record = found.record
    assert f"front: {WORDS}" in record.complete.notes
    assert BlastRecord.decoded(record.encoded()).loads.structures == record.loads.structures


def test_walls_that_take_their_load_from_pieces_are_not_named() -> None:
    for layout in ((), (upright(0, 1),), (upright(0, 0), upright(0, 1))):
        begun = GasEngine(until=1e-4).blast(lane(), layout, 0).run()
        assert [load.unloaded_words for load in begun.structure_loads if load.unloaded_m2] == []


def test_an_evaluation_names_walls_without_a_load() -> None:
    threats = [LoadCase(Charge((1.0, 4.0), 60.0), 0)]
    found = evaluate_layout(lane(OTHER), (upright(0, 1),), threats=threats, engine="gas")
    assert f"front: {WORDS}" in found.to_dict()["notes"]


@given(st.lists(st.sampled_from([upright(row, column) for row in (0, 2, 4) for column in (0, 1)])))
@settings(max_examples=8)
def test_no_layout_makes_the_front_smaller(layout: list[Piece]) -> None:
    site, standing = lane(), LayoutState.empty(lane())
    for piece in layout:
        with suppress(LayoutError):
            standing = standing.place(piece)
    begun = GasEngine(until=1e-4).blast(site, standing.layout, 0).run()
    assert on_front(begun).area_m2 == 12.0
