"""docs/researchers/sites.md says what the code says."""

from pathlib import Path

from blast_env.sites import HELD_OUT_SITES, VisibilityCriterion
from blast_env.sites.criterion import DIRECTIONS
from blast_env.sites.generate import MOST_TRIES

PAGE = Path(__file__).parents[2] / "docs" / "researchers" / "sites.md"
DOCUMENT = PAGE.read_text(encoding="utf-8")


def test_bounds_are_those_of_the_criterion() -> None:
    criterion = VisibilityCriterion()
    least, most = criterion.least_layout_share, criterion.most_layout_share
    for words in (
        f"at least {criterion.least_open_share:.0%} of",
        f"{least:.0%} to {most:.0%} cut",
        f"no more than {most:.0%} cut",
        f"{criterion.least_advantage:.0%} more cut",
    ):
        assert words.replace("%", " %") in DOCUMENT
    assert f"after {MOST_TRIES} sites" in DOCUMENT
    assert f"{DIRECTIONS} lines" in DOCUMENT
    assert f"Seeds 0 to {HELD_OUT_SITES - 1:,} are held out" in DOCUMENT
