"""What layouts can do, against counting it out."""

from itertools import combinations, pairwise

import numpy as np
import pytest

from blast_env.layout import LayoutState, usable_cells
from blast_env.site import Scenario
from blast_env.sites import SiteMeasures, Visibility, visibility_layout
from tests.site.test_removable import fenced
from tests.sites.cases import yard

SMALL = {"corner_m": (9.0, 9.0), "rows": 3, "columns": 2}


def shares(scenario: Scenario) -> SiteMeasures:
    return SiteMeasures.of(scenario)


@pytest.mark.parametrize("stock", [1, 2, 4])
def test_the_share_of_random_layouts_is_the_mean_over_all_of_them(stock: int) -> None:
    scenario = yard(**SMALL, stock=stock)
    lines = Visibility.of(scenario)
    cells = [(row, column) for row in range(3) for column in range(2)]
    every = [lines.cut_share(layout) for layout in combinations(cells, stock)]
    assert shares(scenario).random_share == pytest.approx(np.mean(every), abs=1e-9)


def test_random_layouts_are_as_large_as_the_budget_allows() -> None:
    costs = {"budget": 5.0, "module_cost": 2.0}
    assert (
        shares(yard(**SMALL, stock=4, **costs)).random_share
        == shares(yard(**SMALL, stock=2)).random_share
    )


@pytest.mark.parametrize("stock", [1, 2, 3])
def test_the_best_wall_is_the_best_of_all_straight_runs(stock: int) -> None:
    keep_out = {"corner_m": (9.0, 9.5), "size_m": (1.0, 0.5), "reason": "path"}
    scenario = yard(**SMALL, stock=stock, keep_outs=[keep_out])
    lines, usable = Visibility.of(scenario), usable_cells(scenario)
    grid = [[(row, column) for column in range(2)] for row in range(3)]
    runs = [
        line[first : first + stock]
        for line in (*grid, *map(list, zip(*grid, strict=True)))
        for first in range(len(line))
    ]
    every = [lines.cut_share([cell for cell in run if usable[cell]]) for run in runs]
    assert shares(scenario).wall_share == pytest.approx(max(every))


def test_the_visibility_layout_is_best_where_one_module_is_all() -> None:
    scenario = yard(stock=1)
    lines = Visibility.of(scenario)
    best = max(lines.cut_share([cell]) for cell in np.ndindex(8, 6))
    assert lines.cut_share(visibility_layout(scenario, lines)) == best


def test_it_ends_when_nothing_is_left_to_cut() -> None:
    scenario = yard(stock=40)
    lines = Visibility.of(scenario)
    layout = visibility_layout(scenario, lines)
    assert lines.cut_share(layout) == 1.0
    assert len(layout) < 10  # the lines are 2.3 m apart at the zone, five modules wide


def test_it_keeps_every_condition_and_each_module_adds_less(sites: tuple[Scenario, ...]) -> None:
    for site in sites[:12]:
        lines = Visibility.of(site)
        layout = visibility_layout(site, lines)
        LayoutState.of(site, layout)  # raises where a condition is broken
        zone = site.build_zone
        if zone is not None and zone.budget is None:
            cut = [lines.cut_share(layout[:count]) for count in range(len(layout) + 1)]
            gains = np.diff(cut)
            assert (gains > 0.0).all()
            if zone.access_way is None:
                assert all(later <= earlier + 1e-12 for earlier, later in pairwise(gains))


def test_dear_cells_are_used_last() -> None:
    dear = {"corner_m": (9.0, 8.0), "size_m": (3.0, 2.0), "reason": "duct", "module_cost": 9.0}
    scenario = yard(stock=2, cost_areas=[dear], budget=100.0)
    layout = visibility_layout(scenario, Visibility.of(scenario))
    assert all(element[0] >= 4 for element in layout)


def test_where_nothing_is_seen_the_rule_of_sight_lines_builds_nothing() -> None:
    """A wall that stands there already hides the building, before the lower walls on offer."""
    scenario = fenced()
    lines = Visibility.of(scenario)
    assert not len(lines.weight)
    assert visibility_layout(scenario, lines) == ()
    assert SiteMeasures.of(scenario).wall_share == 0.0
