"""Which yards the criterion refuses, and what it says."""

import pytest

from blast_env.sites import Objection, VisibilityCriterion
from tests.sites.cases import block, yard

ANY = VisibilityCriterion(0.0, 0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("criterion", "rule"),
    [
        (
            VisibilityCriterion(least_layout_share=0.99),
            "share cut by the visibility layout: must be at least 0.99",
        ),
        (
            VisibilityCriterion(most_layout_share=0.61),
            "share cut by the visibility layout: must be at most 0.61",
        ),
        (
            VisibilityCriterion(most_layout_share=1.0, least_advantage=0.99),
            "advantage over random layouts: must be at least 0.99",
        ),
    ],
)
def test_every_bound_can_fail(criterion: VisibilityCriterion, rule: str) -> None:
    objection = criterion.objection(yard(stock=3))
    assert isinstance(objection, Objection)
    assert objection.rule == rule
    assert objection.found.startswith("is 0.")


def test_a_hidden_house_is_refused() -> None:
    hidden = yard(block("shed", 15.0, 7.5, 6, 1))
    assert ANY.objection(hidden) is None
    objection = VisibilityCriterion().objection(hidden)
    assert objection is not None
    assert objection.rule == "open share of the lines of sight: must be at least 0.6"


def test_a_wall_that_cuts_everything_is_refused() -> None:
    # Money for one cheap module; with enough of it, a wall would do.
    objection = VisibilityCriterion(0.0, 0.0, 0.95, 0.0).objection(yard(stock=8, budget=1.0))
    assert objection == Objection(
        "share cut by the best straight wall: must be at most 0.95", "is 1.000"
    )
