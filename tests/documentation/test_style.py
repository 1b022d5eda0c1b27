"""Pages are in plain English: short sentences, short lines, words of the field."""

import re
from collections.abc import Iterator
from typing import Final

import pytest

from tests.documentation.pages import ROOT, TEXTS
from tests.documentation.style import faults


@pytest.mark.parametrize("page", sorted(TEXTS))
def test_a_page_is_in_plain_english(page: str) -> None:
    assert faults(TEXTS[page]) == []


PAGES: Final = {**TEXTS, "CHANGELOG.md": (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")}
PHRASES: Final = ("told", "meets", "likewise", "of one's own", "as said", "as told")

_CODE: Final = re.compile(r"^(```|~~~).*?^\1|`[^`]*`", re.DOTALL | re.MULTILINE)


def prose() -> Iterator[tuple[str, str]]:
    """Yield each page with its text, without code."""
    for page, text in PAGES.items():
        yield page, _CODE.sub("", text)


@pytest.mark.parametrize("phrase", PHRASES)
def test_no_page_has_the_phrase(phrase: str) -> None:
    """Names of problems have hyphens: `control_room-known-v2`."""
    words = r"\s+".join(phrase.split())
    pattern = re.compile(rf"(?<![\w-]){words}(?![\w-])", re.IGNORECASE)
    assert [(page, found) for page, text in prose() for found in pattern.findall(text)] == []
