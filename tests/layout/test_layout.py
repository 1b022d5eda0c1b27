import pytest

from blast_env.errors import LayoutError
from blast_env.geometry import Cell
from blast_env.layout import check_layout
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
        assert (x_m[cell], y_m[cell]) == zone.cell_centre_m(cell)
