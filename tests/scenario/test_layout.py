import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.errors import LayoutError
from blast_env.scenario import (
    Cell,
    Scenario,
    bundled_scenarios,
    check_layout,
    load_layout,
    load_scenario,
    usable_cells,
)
from tests.scenario.documents import full_document, minimal_document


def scenario() -> Scenario:
    """A zone of 20 x 10 cells from (13, 8) m, with a path, half a house and a charge in it."""
    document = full_document()
    document["build_zone"]["corner_m"] = [17.0, 5.0]
    document["build_zone"]["keep_outs"][0].update(corner_m=[17.0, 5.0], size_m=[5.0, 1.0])
    for key in ("clearance_m", "cost_areas", "budget", "access_way"):
        del document["build_zone"][key]
    document["charge"][0]["position_m"] = [18.25, 12.25]
    return Scenario.from_document(document, "test")


def test_no_cell_is_usable_without_a_build_zone() -> None:
    without_zone = Scenario.from_document(minimal_document(), "test")
    assert usable_cells(without_zone).shape == (0, 0)
    assert check_layout(without_zone, []) == ()
    with pytest.raises(LayoutError, match="no build zone"):
        check_layout(without_zone, [(0, 0)])


@pytest.mark.parametrize("name", bundled_scenarios())
def test_mask_leaves_out_exactly_what_overlaps(name: str) -> None:
    """Against the rectangles' own `overlaps`; where the charge is, only that some is free."""
    bundled = load_scenario(name)
    zone = bundled.build_zone
    if zone is None:
        return
    usable = usable_cells(bundled)
    for cell in zone.cells():
        square = zone.cell_rectangle_m(cell)
        solid = [*bundled.structures, *zone.keep_outs]
        if any(square.overlaps(each.rectangle_m) for each in solid):
            assert not usable[cell], cell
    assert usable.sum() > 2 * zone.stock


def test_layout_keeps_its_order() -> None:
    layout = [(3, 1), (2, 0), (19, 9)]
    assert check_layout(scenario(), layout) == tuple(layout)


@pytest.mark.parametrize(
    "layout",
    [
        np.array([[3, 1], [2, 0]]),
        [np.array([3, 1]), np.array([2, 0])],
        [(np.int64(3), np.uint8(1)), [2, 0]],
        ((3, 1), (2, 0)),
    ],
)
def test_numpy_layouts_become_plain_integers(layout: list[Cell]) -> None:
    cells = check_layout(scenario(), layout)
    assert cells == ((3, 1), (2, 0))
    assert all(type(number) is int for cell in cells for number in cell)


@pytest.mark.parametrize(
    ("layout", "words"),
    [
        ([(3, 1), (20, 0)], r"cell \(20, 0\) is outside the build zone"),
        ([(3, 1), (-1, 0)], r"cell \(-1, 0\) is outside the build zone"),
        ([(10**5000, 0)], "cell .an integer of about 5000 digits, 0. is outside"),
        ([(6, 6)], r"cell \(6, 6\) overlaps the structure 'house'"),
        ([(0, 0)], r"cell \(0, 0\) must stay empty: path"),
        ([(3, 1), (4, 1), (3, 1)], r"cell \(3, 1\) is repeated"),
        ([(2 + i // 5, i % 5) for i in range(13)], "13 modules, must have at most 12"),
        ([(3.0, 1.0)], r"layout\[0\]: is \(3.0, 1.0\), must be a pair of integers"),
        (np.array([[3.0, 1.0]]), r"layout\[0\]: is \(3.0, 1.0\), must be a pair"),
        ([(3, 1), (True, 1)], r"layout\[1\]: is \(true \(a truth value\), 1\), must be a pair"),
        (np.array([[True, True]]), r"layout\[0\]: is \(true"),
        ([(3, 1, 2)], r"layout\[0\]: has 3 values, must be a pair"),
        ([()], r"layout\[0\]: has 0 values, must be a pair"),
        (["31"], r"layout\[0\]: is '31' \(a string\), must be a pair"),
        ([3, 1], r"layout\[0\]: is 3, must be a pair"),
        (np.array([3, 1]), r"layout\[0\]: is 3, must be a pair"),
        ([{3, 1}], r"layout\[0\]: is a set, must be a pair"),
        ([None], r"layout\[0\]: is nothing, must be a pair"),
        ([((1, 2), (3, 4))], r"layout\[0\]: is \(an array, an array\), must be a pair"),
        (None, "layout is nothing, must be a list"),
        ("abc", "layout is 'abc'"),
        ({(3, 1): 1}, "layout is a table, must be a list"),
    ],
)
def test_bad_layout_is_refused_by_its_cell(layout: list[Cell], words: str) -> None:
    with pytest.raises(LayoutError, match=words):
        check_layout(scenario(), layout)


@pytest.mark.parametrize("content", ["[[3, 1], [2, 0]]", '\ufeff{"cells": [[3, 1], [2, 0]]}'])
def test_layout_file_gives_its_cells(tmp_path: Path, content: str) -> None:
    path = tmp_path / "layout.json"
    path.write_text(content, encoding="utf-8")
    assert load_layout(path) == ((3, 1), (2, 0))
    assert load_layout(str(path)) == ((3, 1), (2, 0))


@pytest.mark.parametrize(
    ("content", "place"),
    [
        (b"", "line 1, column 1"),
        (b"[[1, 2],\n[3, 4", "line 2, column 6"),
        (b"[[1, 2], [3, 4.0]]", r"\[1\]: is \(3, 4.0\)"),
        (b'{"cells": [[1, 2], [3]]}', r"cells\[1\]: has 1 values"),
        (b'{"cells": [[1, true]]}', r"cells\[0\]: is \(1, true"),
        (b'{"cells": 3}', "cells: is 3, must be a list"),
        (b'{"cell": []}', "must have the key 'cells' and no other"),
        (b'{"cells": [], "seed": 1}', "must have the key 'cells' and no other"),
        (b'{"cells": [], "cells": [[1, 2]]}', "a key occurs twice"),
        (b"{}", "must have the key 'cells' and no other"),
        (b"null", "is nothing, must be a list"),
        (b'"text"', "is 'text' .a string., must be a list"),
        (b"[[1, NaN]]", r"\[0\]: is \(1, nan\)"),
        (b"[[1, " + b"9" * 5000 + b"]]", "9{57}... has 5000 digits"),
        (b"[" * 100_000, "nested too deeply"),
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


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=12,
)


@given(st.one_of(JSON.map(json.dumps).map(str.encode), st.binary(max_size=40)))
@settings(max_examples=300, deadline=None, derandomize=True)
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
