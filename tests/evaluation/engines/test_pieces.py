"""Pieces of a barrier under a blast: they are pushed by what their sides took, and move by it."""

from typing import Any

import numpy as np
import pytest

import blast_env
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import StructureLoad
from blast_env.evaluation.engines.gas import GasEngine, GasResult
from blast_env.geometry import Piece
from blast_env.site import Charge
from tests import builders
from tests.builders import block, point
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


def front_behind(layout: list[Piece]) -> StructureLoad:
    """Return the load on a front of 4 m behind walls, which in the second column lean on it."""
    wall = {"name": "wall", "length_modules": 4, "height_m": 3.0, "cost": 1.0, "stock": 3}
    zone = builders.zone(5.0, 2.0, 8, 2, items=[wall])
    front = block("front", 6.0, 2.0, 8, 4, height_m=3.0, protected=True, faces=["west"])
    site = builders.site("leaning", (9.0, 8.0, 6.0), point(1.0, 4.0, 60.0), front, build_zone=zone)
    (load,) = GasEngine().loads(site, layout, Charge((1.0, 4.0), 60.0), 0).structures
    return load


def test_walls_that_lean_on_a_whole_front_hand_their_load_to_it() -> None:
    """No face of the front touches air then; the walls stand 0.5 m nearer to the charge."""
    bare, before, leaning = (
        front_behind([Piece(row, column, "wall", True) for row in rows])
        for rows, column in (((), 0), ((0, 4), 0), ((0, 4), 1))
    )
    assert leaning.area_m2 == bare.area_m2 == before.area_m2 == 12.0
    assert 1.0 < leaning.impulse_pa_s / bare.impulse_pa_s < 1.3
    assert leaning.peak_pa is not None
    assert bare.peak_pa is not None
    assert leaning.peak_pa > bare.peak_pa
    assert before.impulse_pa_s < 0.8 * bare.impulse_pa_s  # with air behind them they protect
