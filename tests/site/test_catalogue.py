"""Build zones with a catalogue: what a file says, what pieces cover, and where they may stand."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.errors import LayoutError
from blast_env.evaluation.engines import simulate
from blast_env.geometry import Piece, Rectangle
from blast_env.layout import LayoutFile, LayoutState, build_site, load_layout, write_layout
from blast_env.particles import build_scene, obstacle_of
from blast_env.site import Scenario, ScenarioError, load_scenario, save_scenario, stock_barriers
from tests.catalogue_sites import ITEMS, WALL, item, yard, yard_document
from tests.site.documents import Document
from tests.site.zones import buildable, catalogue_documents, pieces_may_stand


def lines_for(**zone: Any) -> list[str]:
    """Return the problems of the yard with other keys of the build zone."""
    with pytest.raises(ScenarioError) as caught:
        yard(**zone)
    return str(caught.value).splitlines()


# --- The file.


AREA: Document = {"corner_m": (3.5, 2.5), "size_m": (1.0, 1.0), "reason": "duct"}


def changed(index: int, **keys: Any) -> list[Document]:
    """Return the items with other keys in one of them."""
    return [{**item, **(keys if number == index else {})} for number, item in enumerate(ITEMS)]


TWO_COSTS = {**AREA, "module_cost": 2.0, "cost_factor": 2.0}
BAD: list[tuple[Document, str]] = [
    ({"items": changed(1, name="wall")}, "items[1].name: is 'wall', already the name of build_zo"),
    ({"items": changed(0, height_m=6.0)}, "items[0].height_m: is 6, must be at most 5, the heigh"),
    ({"items": changed(0, length_modules=15)}, "items[0]: 'wall' of 15 x 1 modules does not fit "),
    (
        {"items": changed(0, length_modules=7, rotatable=False)},
        "items[0]: 'wall' of 7 x 1 modules does not fit into the zone of 6 columns and 14 rows"
        " without turning it",
    ),
    (
        {
            "items": changed(0, length_modules=14),
            "keep_outs": [{**AREA, "corner_m": (3.5, 5.0), "size_m": (3.0, 0.5)}],
        },
        "items[0]: 'wall' of 14 x 1 modules fits nowhere on usable cells in either orientation",
    ),
    ({"items": [item("wall", 3, 1, 2.0, stock=0)]}, "items: none is in stock, at least one must "),
    ({"budget": 0.5}, "budget: is 0.5, must be at least 1, the cost of the cheapest piece at its"),
    ({"stock": 10}, "stock: is 10, must be at most 9, the number of pieces of all items"),
    ({"module_cost": 2.0}, "module_cost: is 2, must be left out: each item has its own cost"),
    ({"height_m": 2.0}, "height_m: is 2, must be left out: each item has its own height"),
    ({"cost_areas": [AREA]}, "cost_areas[0].cost_factor: missing"),
    ({"cost_areas": [TWO_COSTS]}, "cost_areas[0].module_cost: must be left out: with a catalogue"),
    ({"items": [], "stock": 1, "cost_areas": [AREA]}, "cost_areas[0].module_cost: missing"),
    ({"items": [], "stock": 1, "cost_areas": [TWO_COSTS]}, "cost_areas[0].cost_factor: must be l"),
    ({"items": []}, "stock: missing"),
    ({"items": changed(0, length=2)}, "items[0].length: unknown key, did you mean 'length_modules"),
    (
        {"access_way": {"width_m": 3.0, "between": "bottom_top"}},
        "access_way: a piece at any place would close the access way of 3 m from bottom to top",
    ),
]


@pytest.mark.parametrize(("zone", "words"), BAD, ids=[words.split(":")[0] for _, words in BAD])
def test_bad_catalogues_are_named(zone: Document, words: str) -> None:
    lines = lines_for(**zone)
    assert any(line.startswith(f"yard: build_zone.{words}") for line in lines), lines


def test_everything_wrong_with_a_catalogue_is_named_at_once() -> None:
    lines = lines_for(
        items=[*changed(0, length_modules=15, height_m=7.0), item("post", 1, 1, 1.0)],
        budget=0.5,
        module_cost=3.0,
        stock=50,
    )
    keys = [line.split(": ")[1].removeprefix("build_zone.") for line in lines]
    assert sorted(keys) == sorted(
        ["items[0]", "items[0].height_m", "items[3].name", "budget", "module_cost", "stock"]
    )


# --- What pieces are.


def test_pieces_cover_cells_and_have_heights() -> None:
    placement = LayoutState.of(yard(), WALL)
    assert placement.cells[:3] == ((5, 1), (6, 1), (7, 1))
    assert [module.height_m for module in placement.modules] == [2.0] * 6 + [1.0]
    names = {module.piece for module in placement.modules}
    assert names == {"wall_x4.250_y5.750", "wall_x4.250_y7.250", "post_x4.250_y4.750"}
    lying = yard().zone.element_rectangle_m(Piece(2, 1, "basket"))
    assert lying == Rectangle(4.0, 3.5, 5.0, 4.5)


def test_actions_number_every_variant_on_every_cell() -> None:
    catalogue = yard().zone.catalogue
    assert [(variant.name, variant.turned) for variant in catalogue.variants] == [
        ("wall", False),
        ("wall", True),
        ("basket", False),
        ("post", False),
    ]
    assert catalogue.finish == 4 * 14 * 6
    elements = [catalogue.element(action) for action in range(catalogue.finish)]
    assert len(set(elements)) == catalogue.finish
    assert [catalogue.action(element) for element in elements] == list(range(catalogue.finish))
    assert catalogue.element(14 * 6 + 6 * 2 + 3) == Piece(2, 3, "wall", True)


def test_without_a_catalogue_actions_are_cells() -> None:
    catalogue = load_scenario("courtyard").zone.catalogue
    assert catalogue.finish == 40 * 16
    assert catalogue.element(16 * 3 + 5) == (3, 5)
    assert catalogue.action((3, 5)) == 16 * 3 + 5


def test_a_cost_area_raises_the_share_of_a_piece_inside() -> None:
    """Two of three modules on ground that costs twice as much: five thirds."""
    placement = LayoutState.of(
        yard(cost_areas=[{**AREA, "cost_factor": 2.0}]), [Piece(0, 0, "wall"), Piece(5, 0, "post")]
    )
    assert placement.cost == pytest.approx(6.0 * 5.0 / 3.0 + 1.0, rel=1e-15)


def test_the_stock_of_the_zone_bounds_all_items_together() -> None:
    placement = LayoutState.of(yard(stock=2), WALL[:2])
    assert (placement.stock_left, placement.stocks_left, placement.is_full) == (0, (0, 0, 0), True)
    assert placement.explain(WALL[2]) == "the stock of 2 pieces is used up"


# --- Where they may stand.


@given(catalogue_documents(), st.integers(0, 10**6))
def test_mask_explanation_and_rules_agree(document: Document, seed: int) -> None:
    """In every state on the way to a full zone, for every piece there could be."""
    scenario = buildable(document)
    rng = np.random.default_rng(seed)
    placement = LayoutState.empty(scenario)
    catalogue = placement.catalogue
    while not placement.is_full:
        legal = placement.legal.ravel()
        for action in range(catalogue.finish):
            piece = catalogue.element(action)
            assert isinstance(piece, Piece)
            assert legal[action] == (placement.explain(piece) is None), (placement.layout, piece)
        pieces = [element for element in placement.layout if isinstance(element, Piece)]
        for action in rng.integers(catalogue.finish, size=12).tolist():
            piece = catalogue.element(action)
            assert isinstance(piece, Piece)
            assert legal[action] == pieces_may_stand(scenario, [*pieces, piece])
        before = placement
        placement = before.place(catalogue.element(int(rng.choice(np.flatnonzero(legal)))))
        assert (placement.legal <= before.legal).all()
    shuffled = [placement.layout[i] for i in rng.permutation(len(placement.layout))]
    again = LayoutState.of(scenario, shuffled)
    assert (again.legal == placement.legal).all()
    assert again.cost == placement.cost


@pytest.mark.parametrize(
    ("piece", "words"),
    [
        (Piece(0, 9, "wall"), "is outside the build zone of 14 rows and 6 columns"),
        (Piece(0, 4, "wall"), "sticks out of the build zone of 14 rows and 6 columns"),
        (Piece(0, 0, "wal"), "is not in the catalogue, did you mean 'wall'?"),
        (Piece(0, 0, "post", True), "is as long as it is thick: it is not turned"),
        (Piece(11, 0, "wall", True), "would stand on cell (13, 0), which must stay empty: a tree"),
        (Piece(5, 3, "basket"), "would stand on cell (5, 4), which is taken by 'basket' at cell"),
        (Piece(8, 5, "post"), "costs 1, but only 0.5 of the budget of 3.5 is left"),
    ],
)
def test_explanations_name_piece_cell_and_reason(piece: Piece, words: str) -> None:
    scenario = yard(keep_outs=[{**AREA, "corner_m": (3.5, 9.0), "reason": "a tree"}], budget=3.5)
    placement = LayoutState.of(scenario, [Piece(5, 4, "basket")])
    turned = ", turned," if piece.turned else ""
    expected = f"{piece.item!r} at cell ({piece.row}, {piece.column}){turned} {words}"
    assert (placement.explain(piece) or "").startswith(expected)
    with pytest.raises(LayoutError, match=f"^{re.escape(expected)}"):
        placement.place(piece)


def test_an_item_that_may_not_be_turned_is_not() -> None:
    placement = LayoutState.empty(yard(items=changed(0, rotatable=False)))
    assert placement.explain(Piece(0, 0, "wall", True)) == (
        "'wall' at cell (0, 0), turned, may not be turned: it is not rotatable"
    )


def test_a_piece_that_closes_the_way_is_refused() -> None:
    scenario = yard(access_way={"width_m": 1.0, "between": "left_right"}, budget=100.0)
    walls = [Piece(row, 2, "wall", True) for row in (0, 3, 6)]
    placement = LayoutState.of(scenario, [*walls, Piece(12, 2, "basket")])
    assert placement.explain(Piece(9, 2, "post")) is None
    closing = Piece(10, 2, "post")
    words = "would close the access way of 1 m from left to right"
    assert placement.explain(closing) == f"'post' at cell (10, 2) {words}"
    with pytest.raises(LayoutError, match=f"'basket' at cell \\(12, 2\\) {words}"):
        LayoutState.of(scenario, [*walls, closing, Piece(12, 2, "basket")])


@pytest.mark.parametrize(
    ("layout", "words"),
    [
        ([(0, 0)], "layout[0]: has 2 values, must be (row, column, item, turned), two integers"),
        ({(0, 0, "wall")}, "layout is a set, must be a list of (row, column, item, turned)"),
        ([WALL[0], WALL[0]], "'wall' at cell (5, 1), turned, is repeated"),
        (
            [Piece(row, 0, "post") for row in range(5)],
            "'post' at cell (4, 0) is beyond the stock: the layout has 5 of 'post', must have at"
            " most 4",
        ),
        (
            [Piece(0, 0, "basket"), Piece(1, 1, "basket")],
            "'basket' at cell (1, 1) would stand on cell (1, 1), which is taken by 'basket' at",
        ),
    ],
)
def test_what_is_no_layout_is_refused(layout: Any, words: str) -> None:
    with pytest.raises(LayoutError, match=f"^{re.escape(words)}"):
        LayoutState.of(yard(), layout)


# --- Layout files.


def test_layout_files_name_items_and_cells(tmp_path: Path) -> None:
    path = write_layout(tmp_path / "layout.json", yard(), WALL, {"seed": 3})
    assert load_layout(path) == load_layout(path, yard()) == WALL
    content = json.loads(path.read_text())
    assert (content["version"], content["scenario"]) == (1, "walled_yard")
    assert content["pieces"][0] == {"item": "wall", "row": 5, "column": 1, "turned": True}
    assert content["pieces"][2] == {"item": "post", "row": 4, "column": 1}
    assert LayoutFile.load(path).provenance == {"seed": 3}
    with pytest.raises(LayoutError, match="the layout was saved for 'walled_yard'"):
        load_layout(path, yard(stock=3))


PIECE = {"item": "wall", "row": 5, "column": 1, "turned": True}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"version": 4, "pieces": []}, "version: is 4, must be 1"),
        ({"pieces": {}}, "pieces: is a table, must be a list of tables"),
        ({"pieces": [{**PIECE, "turned": 1}]}, "pieces[0]: turned: is 1, must be tr"),
        ({"pieces": [{**PIECE, "item": "fence"}]}, "'fence' at cell (5, 1), turned,"),
        ({"cells": [[5, 1]]}, "layout[0]: has 2 values, must be (row, column, item, turned)"),
    ],
)
def test_bad_layout_files_are_named(tmp_path: Path, content: Document, words: str) -> None:
    path = tmp_path / "layout.json"
    path.write_text(json.dumps(content))
    with pytest.raises(LayoutError, match=f"^{re.escape(f'{path}: {words}')}"):
        load_layout(path, yard())


# --- The site of a blast.


def test_the_barrier_of_a_site_has_the_heights_of_its_pieces() -> None:
    barrier = build_site(yard(), WALL).structures[-1]
    assert barrier.cells == LayoutState.of(yard(), WALL).cells
    assert barrier.heights_m == (2.0,) * 6 + (1.0,)
    assert barrier.height_m == 2.0
    pieces = [part.piece for part in obstacle_of(barrier).parts]
    assert pieces == ["wall_x4.250_y5.750"] * 3 + ["wall_x4.250_y7.250"] * 3 + [
        "post_x4.250_y4.750"
    ]


def test_particles_meet_the_modules_of_pieces() -> None:
    scene = build_scene(yard(), WALL)
    assert len(scene.obstacles()[-1].parts) == 7
    assert len(yard().height_notes) == 1


def test_gas_goes_over_each_piece_at_its_own_height() -> None:
    """In 0.2 s: faces up to the height of the item, and results by piece."""
    result = simulate(yard(), WALL, engine="gas")
    barrier = result.faces[result.faces["structure"] == "barrier"]
    tops = barrier[barrier["face"] == "roof"].groupby(["row", "column"])["z_m"].max()
    assert {cell: tops[cell] for cell in ((5, 1), (10, 1), (4, 1))} == {
        (5, 1): 2.0,
        (10, 1): 2.0,
        (4, 1): 1.0,
    }
    of_structure = dict(iter(result.modules.groupby("structure")["piece"]))
    pieces = {module.piece for module in LayoutState.of(yard(), WALL).modules}
    assert set(of_structure["barrier"]) == pieces
    assert set(of_structure["hut"]) == {""}
    unprotected = simulate(yard(), engine="gas").impulse("hut").pa_s
    low = yard(items=changed(0, height_m=0.5))
    behind = [simulate(case, WALL[:2], engine="gas").impulse("hut").pa_s for case in (yard(), low)]
    assert behind[0] < 0.9 * unprotected
    assert behind[0] < 0.95 * behind[1]


def test_the_air_is_high_enough_for_the_highest_item() -> None:
    document = yard_document(items=changed(0, height_m=9.0))
    del document["site"]["air_height_m"]
    assert Scenario.from_document(document, "yard").air_height_m == 15.0


# --- The stock list.

PLANTER = {"from_catalogue": "planter"}


@pytest.mark.parametrize("name", stock_barriers())
def test_every_barrier_of_the_stock_list_can_be_taken_by_name(name: str) -> None:
    scenario = yard(items=[{"from_catalogue": name, "stock": 2}], budget=None)
    (taken,), barrier = scenario.zone.items, stock_barriers()[name]
    assert (taken.name, taken.stock, taken.from_catalogue) == (name, 2, None)
    known = barrier.model_dump(exclude={"source"}, exclude_none=True)
    assert taken.model_dump(exclude={"name", "stock"}) == known
    assert len(barrier.source) > 50
    written = yard(items=[taken.model_dump()], budget=None)
    assert written == scenario
    assert written.content_hash == scenario.content_hash


def test_cost_name_and_words_of_the_stock_list_can_be_changed(tmp_path: Path) -> None:
    changes = {"name": "wall", "cost": 7.5, "rotatable": False, "description": "ours", "stock": 3}
    scenario = yard(items=[{"from_catalogue": "t_wall_3_6", **changes}])
    (taken,) = scenario.zone.items
    assert taken.model_dump(include=set(changes)) == changes
    assert (taken.length_modules, taken.height_m) == (3, 3.6)
    save_scenario(scenario, tmp_path / "yard.toml")
    assert load_scenario(tmp_path / "yard.toml") == scenario
    assert "from_catalogue" not in (tmp_path / "yard.toml").read_text()


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        (
            {"from_catalogue": "t_wall_36"},
            "from_catalogue: is 't_wall_36', there is no such barrie",
        ),
        ({"from_catalog": "planter"}, "from_catalog: unknown key, did you mean 'from_catalogue'?"),
        ({**PLANTER, "height_m": 2.0}, "height_m: must be left out: 'planter' has 1"),
    ],
)
def test_bad_use_of_the_stock_list_is_named(keys: Document, words: str) -> None:
    lines = lines_for(items=[{"stock": 1, **keys}])
    assert any(line.startswith(f"yard: build_zone.items[0].{words}") for line in lines), lines


def test_what_the_stock_list_needs_beside_the_name_is_the_stock() -> None:
    assert lines_for(items=[PLANTER])[0] == "yard: build_zone.items[0].stock: missing"


def test_the_catalogue_of_a_changed_zone_is_its_own() -> None:
    zone = yard().zone
    first = zone.catalogue
    fewer = zone.model_copy(update={"items": zone.items[:1]})
    taller = zone.model_copy(update={"rows": zone.rows + 1})
    assert fewer.catalogue.names == first.names[:1]
    assert taller.catalogue.shape == (zone.rows + 1, zone.columns)
    assert zone.catalogue == first
