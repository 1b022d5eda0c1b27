import numpy as np
import pytest

from blast_env.errors import LayoutError
from blast_env.geometry import Cell
from blast_env.layout import check_layout, usable_cells
from blast_env.site import Scenario, bundled_scenarios, load_scenario
from tests.site.documents import full_document, minimal_document


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


def test_centres_of_cells_are_those_of_their_squares() -> None:
    zone = load_scenario("courtyard").zone
    x_m, y_m = zone.centres_m
    assert x_m.shape == zone.shape
    for cell in zone.cells():
        assert (x_m[cell], y_m[cell]) == zone.cell_centre_m(cell)
