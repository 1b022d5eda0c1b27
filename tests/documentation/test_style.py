"""Pages are in plain English: short sentences, short lines, known words."""

import pytest

from tests.documentation.pages import TEXTS
from tests.documentation.style import faults


@pytest.mark.parametrize("page", sorted(TEXTS))
def test_a_page_is_in_plain_english(page: str) -> None:
    assert faults(TEXTS[page]) == []
