"""Layouts and their files: what is in them is a layout for the scenario or a clear error."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError, LayoutError
from blast_env.geometry import Cell
from blast_env.layout import LayoutFile, LayoutState, check_layout, load_layout, write_layout
from blast_env.site import Scenario, load_scenario
from tests.site.documents import full_document


def scenario() -> Scenario:
    """A zone of 20 x 10 cells from (13, 8) m, with a path, half a house and a charge in it."""
    document = full_document()
    document["build_zone"]["corner_m"] = [17.0, 5.0]
    document["build_zone"]["keep_outs"][0].update(corner_m=[17.0, 5.0], size_m=[5.0, 1.0])
    for key in ("clearance_m", "cost_areas", "budget", "access_way"):
        del document["build_zone"][key]
    document["charge"][0]["position_m"] = [18.25, 12.25]
    return Scenario.from_document(document, "test")


@pytest.mark.parametrize(
    ("layout", "words"),
    [
        ([(3, 1), (20, 0)], r"cell \(20, 0\) is outside the build zone"),
        ([(10**5000, 0)], "cell .an integer of about 5000 digits, 0. is outside"),
        ([(6, 6)], r"cell \(6, 6\) overlaps the structure 'house'"),
        ([(0, 0)], r"cell \(0, 0\) must stay empty: path"),
        ([(3, 1), (4, 1), (3, 1)], r"cell \(3, 1\) is repeated"),
        ([(2 + i // 5, i % 5) for i in range(13)], "13 modules, must have at most 12"),
        ([(3, 1), (True, 1)], r"layout\[1\]: is \(true \(a truth value\), 1\), must be a pair"),
        ([3, 1], r"layout\[0\]: is 3, must be a pair"),
        (None, "layout is nothing, must be a list"),
    ],
)
def test_bad_layout_is_refused_by_its_cell(layout: list[Cell], words: str) -> None:
    with pytest.raises(LayoutError, match=words):
        check_layout(scenario(), layout)


def test_centres_of_cells_are_those_of_their_squares() -> None:
    zone = load_scenario("courtyard").zone
    x_m, y_m = zone.centres_m
    assert x_m.shape == zone.shape
    for cell in zone.cells():
        assert (x_m[cell], y_m[cell]) == zone.cell_rectangle_m(cell).centre


# --- Layout files: whatever is in them is either a layout for the scenario or a clear error.


CELLS = ((3, 1), (2, 0))
PROVENANCE = {
    "method": "random search",
    "command": 'a "quoted" command, ü',
    "seed": 3,
    "versions": {"blast_env": "0.1.0"},
    "blasts": [1, 2.5, None, True],
}


def test_a_file_says_what_it_is_for_and_how_it_was_made(tmp_path: Path) -> None:
    path = tmp_path / "layout.json"
    assert write_layout(path, scenario(), CELLS, PROVENANCE) == path
    file = LayoutFile.load(path)
    assert file == LayoutFile(CELLS, "full", scenario().site_hash, PROVENANCE)
    assert load_layout(path) == load_layout(path, scenario()) == CELLS
    content = json.loads(path.read_text())
    assert content["site_hash"] == scenario().site_hash
    assert '"cells": [[3, 1], [2, 0]],' in path.read_text()  # short enough to read


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=12,
)


@given(
    st.randoms(use_true_random=False),
    st.dictionaries(st.text(), JSON.filter(lambda value: "inf" not in repr(value)), max_size=3),
)
def test_every_layout_that_can_be_placed_comes_back(
    tmp_path_factory: pytest.TempPathFactory, random: Any, provenance: dict[str, Any]
) -> None:
    placement = LayoutState.empty(scenario())
    for _ in range(random.randint(0, 12)):
        free = list(zip(*(index.tolist() for index in placement.free.nonzero()), strict=True))
        placement = placement.place(random.choice(free))
    path = tmp_path_factory.getbasetemp() / "placed_layout.json"
    write_layout(path, scenario(), placement.cells, provenance)
    file = LayoutFile.load(path)
    assert file.layout_for(scenario()) == placement.cells
    assert file.provenance == provenance


@pytest.mark.parametrize("content", ["[[3, 1], [2, 0]]", '\ufeff{"cells": [[3, 1], [2, 0]]}'])
def test_a_plain_list_is_a_layout_for_whatever_it_fits(tmp_path: Path, content: str) -> None:
    path = tmp_path / "layout.json"
    path.write_text(content, encoding="utf-8")
    assert load_layout(path) == load_layout(str(path)) == CELLS
    assert load_layout(path, scenario()) == CELLS
    assert LayoutFile.load(path) == LayoutFile(CELLS)


def test_a_layout_for_another_scenario_is_refused_with_both_names(tmp_path: Path) -> None:
    """Also where all of its cells would fit."""
    path = tmp_path / "layout.json"
    write_layout(path, scenario(), CELLS)
    other = load_scenario("courtyard")
    with pytest.raises(LayoutError) as caught:
        load_layout(path, other)
    message = str(caught.value)
    saved, asked = scenario().site_hash[:12], other.site_hash[:12]
    assert message.startswith(f"{path}: the layout was saved for 'full' (hash {saved}), ")
    assert f"not for 'courtyard' (hash {asked}): load the scenario that it is for" in message
    assert "or save its cells anew for this one (blast_env.write_layout)" in message
    write_layout(path, other, load_layout(path))
    assert load_layout(path, other) == CELLS


def test_a_scenario_that_was_changed_since_is_another_one(tmp_path: Path) -> None:
    document = full_document() | {"description": "other words change nothing"}
    path = tmp_path / "layout.json"
    original = Scenario.from_document(document, "test")
    rows, columns = LayoutState.empty(original).free.nonzero()
    cell = (int(rows[0]), int(columns[0]))
    write_layout(path, original, [cell])
    renamed = Scenario.from_document(full_document(), "test")
    assert load_layout(path, renamed) == (cell,)
    of_other_questions = document | {
        "charge": [{"kind": "point", "position_m": [2.0, 2.0], "tnt_kg": 7.0}]
    }
    asked = Scenario.from_document(of_other_questions, "test")
    assert asked.content_hash != original.content_hash
    assert load_layout(path, asked) == (cell,)
    document["build_zone"]["stock"] += 1
    with pytest.raises(LayoutError, match="structures of 'full' have changed since"):
        load_layout(path, Scenario.from_document(document, "test"))


@pytest.mark.parametrize("with_hash", [True, False])
@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ([(6, 6)], "cell (6, 6) overlaps the structure 'house'"),
        (
            [(2 + i // 5, i % 5) for i in range(13)],
            "cell (4, 2) is beyond the stock: the layout has 13 modules, must have at most 12",
        ),
    ],
)
def test_a_cell_that_cannot_be_used_is_named_with_the_reason(
    tmp_path: Path, cells: list, words: str, with_hash: bool
) -> None:
    """Also with the right hash: a file may have been edited."""
    path = tmp_path / "layout.json"
    content: dict[str, Any] = {"cells": cells}
    if with_hash:
        content |= {"scenario": "full", "site_hash": scenario().site_hash}
    path.write_text(json.dumps(content))
    with pytest.raises(LayoutError) as caught:
        load_layout(path, scenario())
    assert str(caught.value).startswith(f"{path}: {words}")
    with pytest.raises(LayoutError) as caught:
        write_layout(tmp_path / "new.json", scenario(), cells)
    assert str(caught.value).startswith(words)
    assert not (tmp_path / "new.json").exists()


@pytest.mark.parametrize(
    ("provenance", "words"),
    [
        ({"path": Path("a")}, "provenance: JSON cannot hold it: .*not JSON serializable"),
        ({"value": float("nan")}, "provenance: JSON cannot hold it"),
        ({"text": "x" * 1_000_000}, "must have at most 1000000: shorten the provenance"),
        ({1: "one", "1": "two"}, "a key occurs twice"),
    ],
)
def test_a_file_that_could_not_be_read_back_is_not_written(
    tmp_path: Path, provenance: dict, words: str
) -> None:
    path = tmp_path / "layout.json"
    write_layout(path, scenario(), CELLS)
    old = path.read_bytes()
    with pytest.raises(LayoutError, match=words):
        write_layout(path, scenario(), CELLS, provenance)
    assert path.read_bytes() == old
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(BlastEnvError, match="there is no folder"):
        write_layout(tmp_path / "missing" / "layout.json", scenario(), CELLS)


@pytest.mark.parametrize(
    ("content", "place"),
    [
        (b"", "line 1, column 1"),
        (b"[[1, 2], [3, 4.0]]", r"\[1\]: is \(3, 4.0\)"),
        (b'{"cells": [[1, 2], [3]]}', r"cells\[1\]: has 1 values"),
        (b'{"cells": 3}', "cells: is 3, must be a list"),
        (b'{"cells": [], "seed": 1}', "seed: unknown key; known: cells, scenario, site_hash"),
        (b'{"cells": [], "scenario": "a"}', "site_hash: missing, but the scenario is 'a'"),
        (b'{"cells": [], "site_hash": "12"}', "site_hash: is '12' .a string., must be 64"),
        (b"[[1, 2],\n\xff]", "line 2: is not UTF-8"),
        (b" " * 1_000_001, "has 1000001 bytes, must have at most 1000000"),
    ],
)
def test_bad_layout_file_is_named_with_the_place(
    tmp_path: Path, content: bytes, place: str
) -> None:
    path = tmp_path / "layout.json"
    path.write_bytes(content)
    with pytest.raises(LayoutError, match=place) as caught:
        load_layout(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_layout_file_must_be_a_file(tmp_path: Path) -> None:
    with pytest.raises(LayoutError, match="is a folder"):
        load_layout(tmp_path)
    with pytest.raises(LayoutError, match="no such file"):
        load_layout(tmp_path / "missing.json")


KEYS = st.fixed_dictionaries(
    {"cells": JSON | st.lists(st.lists(st.integers(), min_size=2, max_size=2), max_size=3)},
    optional={"scenario": JSON, "site_hash": JSON, "provenance": JSON},
)


@given(st.one_of((JSON | KEYS).map(json.dumps).map(str.encode), st.binary(max_size=40)))
def test_any_layout_file_gives_cells_or_the_layout_error(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "any_layout.json"
    path.write_bytes(content)
    try:
        cells = load_layout(path)
    except LayoutError as error:
        message = str(error)
    else:
        assert all(len(cell) == 2 for cell in cells)
        return
    assert message.startswith(f"{path}: ")
