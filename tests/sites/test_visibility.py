"""Lines of sight of yards that can be told by hand."""

from math import atan2, degrees

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError
from blast_env.layout import LayoutState
from blast_env.site import Scenario, load_scenario
from blast_env.sites import Visibility, visibility_layout
from tests.builders import block
from tests.sites.cases import COLUMNS, ROWS, yard, yard_document

CELLS = st.tuples(st.integers(0, ROWS - 1), st.integers(0, COLUMNS - 1))
YARD_LINES = Visibility.of(yard())


def test_there_are_as_many_lines_as_the_house_has_degrees() -> None:
    # The house is 4 m wide, 14 m away, and a line leaves the charge every degree.
    assert len(YARD_LINES.weight) == pytest.approx(2.0 * degrees(atan2(2.0, 14.0)), abs=1.0)
    assert YARD_LINES.open_share == 1.0


def test_a_wall_across_the_zone_cuts_everything_and_nothing_cuts_nothing() -> None:
    # In the zone's first column, 7 m away, the lines are within 1.1 m of the middle.
    assert YARD_LINES.cut_share([(row, 0) for row in range(ROWS)]) == 1.0
    assert YARD_LINES.cut_share([(row, 0) for row in range(1, 7)]) == 1.0
    assert YARD_LINES.cut_share([(0, 0), (7, 0)]) == 0.0
    assert YARD_LINES.cut_share([]) == 0.0


def test_half_a_wall_cuts_half() -> None:
    assert YARD_LINES.cut_share([(row, 2) for row in range(ROWS // 2)]) == 0.5


def test_a_module_behind_the_house_or_before_the_charge_cuts_nothing() -> None:
    behind = Visibility.of(yard(corner_m=(18.0, 8.0), rows=8, columns=4, stock=1))
    before = Visibility.of(yard(corner_m=(0.0, 8.0), rows=8, columns=3, stock=1))
    assert not behind.cut.any()
    assert not before.cut.any()


def test_another_structure_stops_lines_and_one_behind_does_not() -> None:
    # Its lower half stands before the lower half of the house, seen from the charge.
    half = Visibility.of(yard(block("shed", 15.0, 7.5, 5, 1)))
    assert half.open_share == pytest.approx(0.5, abs=0.1)
    assert len(half.weight) == round(half.open_share * len(YARD_LINES.weight))
    assert Visibility.of(yard(block("shed", 18.0, 8.0, 8, 2))).open_share == 1.0


def test_a_house_that_is_hidden_has_no_lines() -> None:
    hidden = Visibility.of(yard(block("shed", 15.0, 5.0, 20, 1)))
    assert hidden.open_share == 0.0
    assert hidden.cut_share([(0, 0)]) == 0.0


def test_lines_count_by_the_weights_of_source_and_structure() -> None:
    document = yard_document()
    # A second charge of three times the weight that looks at the house from above the zone.
    document["charge"] += [
        {"kind": "point", "position_m": (17.0, 18.0), "tnt_kg": 100.0, "weight": 3.0}
    ]
    document["structures"][0]["weight"] = 2.0
    lines = Visibility.of(Scenario.model_validate(document))
    assert set(lines.weight) == {2.0, 6.0}
    of_first = lines.weight[lines.weight == 2.0].sum()
    wall = [(row, 0) for row in range(ROWS)]
    assert lines.cut_share(wall) == pytest.approx(of_first / lines.weight.sum())


@pytest.mark.parametrize(
    ("source", "places"),
    [
        ({"kind": "segment", "start_m": (2.0, 4.0), "end_m": (2.0, 16.0)}, 9),
        ({"kind": "rectangle", "corner_m": (2.0, 4.0), "size_m": (3.0, 12.0)}, 9),
    ],
)
def test_lines_leave_from_all_over_a_source(source: dict, places: int) -> None:
    document = yard_document()
    document["charge"] = [source | {"tnt_kg": 100.0}]
    lines = Visibility.of(Scenario.model_validate(document))
    # From further aside the house looks as wide or a little narrower.
    assert 0.6 * places < len(lines.weight) / len(YARD_LINES.weight) < 1.4 * places


@given(st.lists(CELLS, max_size=8), st.lists(CELLS, max_size=8))
def test_more_modules_never_cut_less_nor_more_than_they_do_apart(
    some: list[tuple[int, int]], others: list[tuple[int, int]]
) -> None:
    both = YARD_LINES.cut_share([*some, *others])
    apart = [YARD_LINES.cut_share(case) for case in (some, others)]
    assert max(apart) - 1e-12 <= both <= sum(apart) + 1e-12


def test_a_scenario_without_a_zone_is_an_error() -> None:
    with pytest.raises(BlastEnvError, match="'free_field' has no build zone"):
        Visibility.of(load_scenario("free_field"))


def test_the_first_piece_cuts_most_for_its_cost_of_all_that_may_stand() -> None:
    """Piece by piece, by the cells and the height of each."""
    scenario = load_scenario("visitor_entrance")
    lines, empty = Visibility.of(scenario), LayoutState.empty(scenario)
    worth = {}
    for action in np.flatnonzero(empty.legal).tolist():
        piece = empty.catalogue.element(action)
        height_m = empty.catalogue.variant(piece).height_m
        cells = empty.catalogue.cells(piece)
        cut = lines.cut_share(cells, [height_m] * len(cells))
        worth[piece] = cut / float(empty.costs.flat[action])
    first = visibility_layout(scenario, lines)[0]
    assert worth[first] == pytest.approx(max(worth.values()))
    assert worth[first] > 1.2 * float(np.median(list(worth.values())))
