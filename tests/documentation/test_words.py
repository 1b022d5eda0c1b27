"""Plain English: how often "what" stands in pages, docstrings and comments, and rare phrases."""

import ast
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Final

import pytest

from tests.documentation.pages import ROOT, TEXTS

SOURCES: Final = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for package in ("blast_env", "agents", "studies")
    for path in (ROOT / package).rglob("*.py")
}
PAGES: Final = {**TEXTS, "CHANGELOG.md": (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")}
PHRASES: Final = ("told", "meets", "likewise", "of one's own", "as said", "as told")
MOST_PER_1000: Final = {"pages": 3.0, "docstrings and comments": 1.5}
"""Most that "what" may stand in 1,000 words; in technical prose it stands 0 to 0.8 times."""

_CODE: Final = re.compile(r"^(```|~~~).*?^\1|`[^`]*`", re.DOTALL | re.MULTILINE)
_OPENING: Final = re.compile(r"(?:What|Return what)\b")
_DOCUMENTED: Final = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def counts(texts: Iterable[str]) -> Counter[str]:
    """Count the words of texts, in small letters."""
    return Counter(word for text in texts for word in re.findall(r"[a-z]+", text.lower()))


def prose() -> Iterator[tuple[str, str]]:
    """Yield each page with its text, without code."""
    for page, text in PAGES.items():
        yield page, _CODE.sub("", text)


def docstrings(source: str) -> Iterator[str]:
    """Yield the docstrings of a module: its own and those of its classes and functions."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, _DOCUMENTED) and (text := ast.get_docstring(node)):
            yield text


def comments(source: str) -> list[str]:
    """Return the comments of a module, as they are formatted."""
    return re.findall(r"^\s*# .*|  # .*", source, re.MULTILINE)


@cache
def docstrings_of_modules() -> list[tuple[str, str]]:
    """Return the docstrings of the packages, each with the path of its module."""
    return [(path, text) for path, source in SOURCES.items() for text in docstrings(source)]


def texts_of(kind: str) -> Iterator[str]:
    """Yield the texts of a kind, as `MOST_PER_1000` names it."""
    if kind == "pages":
        yield from (text for _, text in prose())
        return
    yield from (text for _, text in docstrings_of_modules())
    for source in SOURCES.values():
        yield from comments(source)


@pytest.mark.parametrize("kind", MOST_PER_1000)
def test_what_is_rare(kind: str) -> None:
    words = counts(texts_of(kind))
    assert words.total() > 10_000
    assert 1000 * words["what"] / words.total() <= MOST_PER_1000[kind]


def test_no_docstring_begins_with_what() -> None:
    assert [each for each in docstrings_of_modules() if _OPENING.match(each[1])] == []


@pytest.mark.parametrize("phrase", PHRASES)
def test_no_page_has_the_phrase(phrase: str) -> None:
    """Names of problems have hyphens: `control_room-known-v2`."""
    words = r"\s+".join(phrase.split())
    pattern = re.compile(rf"(?<![\w-]){words}(?![\w-])", re.IGNORECASE)
    assert [(page, found) for page, text in prose() for found in pattern.findall(text)] == []
