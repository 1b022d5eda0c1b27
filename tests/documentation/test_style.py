"""Pages are in plain English: short sentences, short lines, known words."""

from typing import Final

import pytest

from tests.documentation.pages import TEXTS
from tests.documentation.style import faults

PAGE: Final = """# A title

A first sentence. A second one, with `code. That` ends, and [a link](page.md#part)!

- An item. It has two sentences.
- Another item
  goes on.

    python -m studies.bench   # no sentence. None.

| a table. | It has none. |
|---|---|

```python
print("No. Sentence.")
```
"""


@pytest.mark.parametrize("page", sorted(TEXTS))
def test_a_page_is_in_plain_english(page: str) -> None:
    assert faults(TEXTS[page]) == []
