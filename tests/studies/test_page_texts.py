"""Pages that repeat docstrings have the present ones."""

from pathlib import Path

import pytest

from studies.page_texts import pages, with_texts


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.stem)
def test_a_page_has_the_present_docstrings(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert with_texts(text) == text, "run `python -m studies.page_texts`"


def test_the_page_of_the_environments_has_all_five() -> None:
    (page,) = (page for page in pages() if page.stem == "environment")
    assert page.read_text(encoding="utf-8").count("<!-- docstring of ") == 5
