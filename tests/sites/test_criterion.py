"""Which yards the criterion refuses, and what it says."""

import pytest

from blast_env.site import load_scenario
from blast_env.sites import (
    ItemSiteRanges,
    KerbSiteRanges,
    Objection,
    SiteMeasures,
    SiteRanges,
    Visibility,
    VisibilityCriterion,
    criterion,
)
from tests.builders import block
from tests.sites.cases import yard

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


def test_rounding_of_an_open_share_refuses_no_site(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the families do, whose seeds were drawn so; their sites stay what they are."""
    above = SiteMeasures(
        open_share=1.0 + 2.0**-52, layout_share=0.8, wall_share=0.7, random_share=0.2
    )
    monkeypatch.setattr(SiteMeasures, "of", lambda _: above)
    site = yard()
    assert VisibilityCriterion().objection(site) is None
    for ranges in (SiteRanges, ItemSiteRanges, KerbSiteRanges):
        refused = ranges.criterion.objection(site)
        assert refused is not None
        assert refused.rule == "open share of the lines of sight: must be at most 1"


def test_a_wall_that_cuts_everything_is_refused() -> None:
    # Money for one cheap module; with enough of it, a wall would do.
    objection = VisibilityCriterion(0.0, 0.0, 0.95, 0.0).objection(yard(stock=8, budget=1.0))
    assert objection == Objection(
        "share cut by the best straight wall: must be at most 0.95", "is 1.000"
    )


def test_lines_of_many_sources_are_thinned_to_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """A large zone and many sources would take gigabytes; the shares stay nearly the same."""
    site = load_scenario("courtyard")
    whole = Visibility.of(site)
    cells = site.zone.rows * site.zone.columns
    monkeypatch.setattr(criterion, "MOST_CROSSINGS", 100 * cells)
    thinned = Visibility.of(site)
    assert len(thinned.weight) == 100 < len(whole.weight)
    assert thinned.open_share == pytest.approx(whole.open_share)
    wall = [(row, 0) for row in range(14, 26)]
    assert thinned.cut_share(wall) == pytest.approx(whole.cut_share(wall), abs=0.05)
