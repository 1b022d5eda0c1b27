"""Neighbours, walls, crossovers: always legal, and they reach every layout."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env import load_scenario
from blast_env.design.rules import random_layout
from blast_env.design.search import Layout
from blast_env.design.search.moves import Moves, random_walls
from blast_env.design.search.operators import cut, repaired
from blast_env.layout import LayoutState
from tests.agents.sites import site

SITES = {name: load_scenario(name) for name in ("courtyard", "perimeter_gate", "street_junction")}
SITES["budget_and_way"] = site(
    budget=9.0,
    clearance_m=1.0,
    cost_areas=[
        {"corner_m": (20.0, 15.0), "size_m": (5.0, 10.0), "module_cost": 2.0, "reason": "rock"}
    ],
    access_way={"width_m": 4.0, "between": "left_right"},
)


@given(name=st.sampled_from(sorted(SITES)), seed=st.integers(0, 10_000))
@settings(max_examples=12, deadline=None, derandomize=True)
def test_every_neighbour_is_legal_and_close(name: str, seed: int) -> None:
    """A walk of many moves on sites with budgets and access ways.

    Where modules cost the same everywhere, their number changes by one at most.
    """
    scenario, rng = SITES[name], np.random.default_rng(seed)
    moves, layout = Moves(scenario, count_share=0.3), random_walls(scenario, rng)
    for _ in range(12):
        neighbour = moves.neighbour(layout, rng)
        assert LayoutState.of(scenario, neighbour).cells == neighbour
        assert len(neighbour) <= len(layout) + 1
        if name == "courtyard":
            assert len(neighbour) >= len(layout) - 1
        layout = neighbour


def test_a_whole_wall_can_move_at_once() -> None:
    scenario = site(stock=4)
    rng, moves = np.random.default_rng(0), Moves(scenario, count_share=0.0, wall_share=1.0)
    wall = ((8, 5), (9, 5), (10, 5), (11, 5))
    shifts = set()
    for _ in range(50):
        moved = sorted(moves.neighbour(wall, rng))
        steps = {(a[0] - b[0], a[1] - b[1]) for a, b in zip(moved, wall, strict=True)}
        if len(steps) == 1:
            shifts |= steps
    assert len(shifts) > 10


def test_random_walls_hang_together_more_than_random_modules() -> None:
    def neighbours(layout: Layout) -> int:
        return sum(
            max(abs(a[0] - b[0]), abs(a[1] - b[1])) == 1 for a in layout for b in layout if a < b
        )

    rng, scenario = np.random.default_rng(2), SITES["courtyard"]
    walls = sum(neighbours(random_walls(scenario, rng)) for _ in range(20))
    lone = sum(neighbours(random_layout(scenario, rng)) for _ in range(20))
    assert walls > 5 * lone


@given(seed=st.integers(0, 10_000))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_a_cut_takes_each_side_from_one_parent(seed: int) -> None:
    """Two columns side by side: one piece of the one, the complement of it of the other."""
    first, second = (tuple((row, column) for row in range(8)) for column in (0, 1))
    child = cut(first, second, np.random.default_rng(seed))
    assert len(child) == 8
    rows = sorted(each[0] for each in child if each[1] == 0)
    assert rows in (list(range(len(rows))), list(range(8 - len(rows), 8)))


def test_repair_keeps_a_legal_layout_as_it_is() -> None:
    scenario, rng = site(stock=3), np.random.default_rng(5)
    assert repaired(scenario, ((1, 1), (2, 2)), rng) == ((1, 1), (2, 2))
    assert len(repaired(scenario, tuple((1, column) for column in range(9)), rng)) == 3
