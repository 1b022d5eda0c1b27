"""Any vector of keys is a legal layout; choices a place say everything and check everything."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.benchmark import LayoutSpace, make
from blast_env.errors import BlastEnvError
from blast_env.geometry import Measure, Piece
from blast_env.layout import LayoutState
from blast_env.site import load_scenario
from tests.catalogue_sites import WALL
from tests.site.test_hardening import glazed_yard

SITES = ("control_room", "courtyard", "hotel_forecourt", "shopping_street", "perimeter_gate")


@pytest.mark.parametrize("site", SITES)
def test_any_keys_are_a_legal_layout(site: str) -> None:
    space = LayoutSpace(load_scenario(site))

    @settings(max_examples=20, deadline=None)
    @given(st.lists(st.floats(-3.0, 3.0), min_size=space.keys, max_size=space.keys))
    def check(keys: list[float]) -> None:
        layout = space.from_keys(keys)
        assert space.reasons_against(layout) == ()
        assert space.layout(space.choices_of(layout)) == tuple(
            sorted(layout, key=lambda each: (each[0], each[1]))
        )

    check()


def test_keys_reach_what_the_budget_pays_for() -> None:
    """The stock is nine walls, the budget pays for six low ones: 18 keys are enough."""
    space = LayoutSpace(load_scenario("control_room"))
    assert space.most_pieces == 6
    rng = np.random.default_rng(0)
    pieces = [len(space.from_keys(rng.random(space.keys))) for _ in range(50)]
    assert max(pieces) >= 4
    # Walls across the strip fit nowhere. Were they asked for, two things of five would be set down.
    assert np.mean(pieces) > 0.4 * space.most_pieces


def test_without_a_catalogue_each_free_cell_has_two_choices() -> None:
    yard = LayoutSpace(load_scenario("courtyard"))
    assert (yard.choices == 2).all()
    assert len(yard.places) == int(LayoutState.empty("courtyard").free.sum())


def test_every_measure_is_a_place_of_its_own() -> None:
    """All of them can be taken together, beside what stands on the cell (0, 0)."""
    space = LayoutSpace(glazed_yard())
    layout = (*WALL[:1], Measure.named("glass"), Measure.named("panels"))
    choices = space.choices_of(layout)
    assert choices[-2:].tolist() == [1, 1]
    assert space.choices[-2:].tolist() == [2, 2]
    assert sorted(space.layout(choices)) == sorted(layout)
    rng = np.random.default_rng(0)
    drawn = [space.from_keys(rng.random(space.keys)) for _ in range(30)]
    assert any(sum(isinstance(each, Measure) for each in own) == 2 for own in drawn)


def test_a_vector_of_use_to_nobody_is_refused() -> None:
    space = LayoutSpace(load_scenario("control_room"))
    with pytest.raises(BlastEnvError, match=r"keys: has the shape \(3,\), must have \(18,\)"):
        space.from_keys([0.0, 0.5, 1.0])
    with pytest.raises(BlastEnvError, match=r"keys\[1\] is NaN"):
        space.from_keys([0.0, np.nan, *[0.0] * 16])
    with pytest.raises(BlastEnvError, match=r"choices\[0\] is 9, must be 0 to 2"):
        space.layout([9] + [0] * (len(space.places) - 1))


def test_reasons_name_each_piece_that_cannot_stand() -> None:
    problem = make("control_room-known-v2")
    reasons = problem.check(
        [Piece(0, 0, "low_wall", True), Piece(0, 0, "low_wall", True), Piece(99, 0, "low_wall")]
    )
    assert len(reasons) == 2
    assert "is taken by" in reasons[0]
    assert "outside" in reasons[1]
    assert problem.check([]) == ()
