"""docs/researchers/sites.md says what the code says."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from blast_env.sites import HELD_OUT_SITES, SiteRanges, VisibilityCriterion
from blast_env.sites.criterion import DIRECTIONS
from blast_env.sites.generate import MOST_TRIES

PAGE = Path(__file__).parents[2] / "docs" / "researchers" / "sites.md"
DOCUMENT = PAGE.read_text(encoding="utf-8")
ROWS = dict(re.findall(r"^\| `(\w+)` \| (.*?) \|", DOCUMENT, re.MULTILINE))


def written(value: object) -> str:
    if isinstance(value, tuple):
        return " to ".join(f"{each:g}" for each in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


@pytest.mark.parametrize("name", [field.name for field in fields(SiteRanges)])
def test_every_range_is_in_the_table_as_it_is(name: str) -> None:
    assert ROWS[name] == written(getattr(SiteRanges(), name))


def test_the_table_has_no_other_rows() -> None:
    assert set(ROWS) == {field.name for field in fields(SiteRanges)}


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
