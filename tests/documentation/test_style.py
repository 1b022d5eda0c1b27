"""Pages are in plain English: short sentences, short lines, known words."""

from typing import Final

import pytest

from tests.documentation.pages import TEXTS
from tests.documentation.style import MOST_CHARACTERS, MOST_WORDS, faults, sentences

PAGE: Final = """# A title

A first sentence. A second one, with `code. That` ends, and [a link](page.md#part)!

- An item. It has two sentences.
- Another item
  goes on.

    blast-env bench   # no sentence. None.

| a table. | It has none. |
|---|---|

```python
print("No. Sentence.")
```
"""


def test_sentences_are_those_of_paragraphs_and_items() -> None:
    assert list(sentences(PAGE)) == [
        "A first sentence.",
        "A second one, with code ends, and a link!",
        "An item.",
        "It has two sentences.",
        "Another item goes on.",
    ]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("A " + "word " * 59 + "end.", "sentence of 61 words"),
        (("A " + "word " * 18 + "end.\n") * 3, "median sentence of 20 words"),
        ("It is likewise true.", "'likewise'"),
        ("word " * 30, "line of 150 characters"),
    ],
)
def test_each_fault_is_found(text: str, fault: str) -> None:
    assert [each for each in faults(text) if each.startswith(fault)]


def test_a_page_in_plain_english_has_no_fault() -> None:
    assert faults(PAGE) == []
    assert len(PAGE.splitlines()[2]) < MOST_CHARACTERS
    assert MOST_WORDS > 20


@pytest.mark.parametrize("page", sorted(TEXTS))
def test_a_page_is_in_plain_english(page: str) -> None:
    assert faults(TEXTS[page]) == []
