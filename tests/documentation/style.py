"""Plain English: how long sentences and lines of the pages are, and words that few readers know."""

import re
from collections.abc import Iterator
from statistics import median
from typing import Final

MEDIAN_WORDS: Final = 18
"""Words of a page's sentences, at most, on the median."""

MOST_WORDS: Final = 45
"""Words of a sentence, at most."""

MOST_CHARACTERS: Final = 130
"""Characters of a line of text, at most; lines of tables and of code may be longer."""

IDIOMS: Final = (
    *("likewise", "as given", "the former", "the latter", "in vain", "so to speak", "as it were"),
    *("heed", "heeds", "hither", "thereby", "whence", "lest", "times by how much"),
)
"""Phrases that readers who learnt English at school stumble over."""

_IDIOM: Final = re.compile(rf"\b(?:{'|'.join(IDIOMS)})\b", re.IGNORECASE)
_FENCE: Final = re.compile(r"^(```|~~~|:::).*?^\1[^\n]*$", re.DOTALL | re.MULTILINE)
_FRONT_MATTER: Final = re.compile(r"\A---\n.*?^---\n", re.DOTALL | re.MULTILINE)
_ITEM: Final = re.compile(r"(?:[-*]|\d+\.)\s+")
_LINK: Final = re.compile(r"!?\[([^\]]*)\](?:\([^)]*\))?")
_CODE: Final = re.compile(r"`[^`]*`")
_END: Final = re.compile(r"(?<=[.!?])[*\")]*\s+(?=[\"(*`\[]*[A-Z\d`*])")
_NO_TEXT: Final = ("#", "|", "![", "<", ":", ">>>", "...")


def faults(text: str) -> list[str]:
    """Return what is wrong with the style of a page, one line each.

    Args:
        text: The page, in Markdown.
    """
    found = [
        f"line of {len(line)} characters: {line[:60]} ..."
        for line in _lines(text)
        if len(_LINK.sub(r"\1", line)) > MOST_CHARACTERS
    ]
    every = list(sentences(text))
    lengths = [len(_words(thing)) for thing in every]
    if lengths and median(lengths) > MEDIAN_WORDS:
        found.append(f"median sentence of {median(lengths):g} words")
    for sentence, length in zip(every, lengths, strict=True):
        if length > MOST_WORDS:
            found.append(f"sentence of {length} words: {sentence[:60]} ...")
        found += [f"{idiom!r}: {sentence[:60]} ..." for idiom in _IDIOM.findall(sentence)]
    return found


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a page: those of its paragraphs and items, without tables and code."""
    for paragraph in _paragraphs(text):
        yield from _END.split(_CODE.sub("`code`", _LINK.sub(r"\1", paragraph)))


def _words(sentence: str) -> list[str]:
    return [word for word in sentence.split() if re.search(r"\w", word)]


def _paragraphs(text: str) -> Iterator[str]:
    part: list[str] = []
    for line in [*_lines(text), ""]:
        item = _ITEM.match(line.strip())
        if part and (not line.strip() or item):
            yield " ".join(part)
            part = []
        if line.strip():
            part.append(line.strip()[item.end() if item else 0 :])


def _lines(text: str) -> Iterator[str]:
    """Yield the lines of a page that are text, and empty ones in the place of others."""
    text = _FENCE.sub("", _FRONT_MATTER.sub("", text))
    before = ""
    for line in text.splitlines():
        is_code = line.startswith(("    ", "\t")) and not before.strip()
        yield "" if is_code or line.lstrip().startswith(_NO_TEXT) else line
        before = "" if is_code else line
