"""Wrong files of every format that is read: refused as documented, quickly, or what they say.

Ten thousand of each: `make attack`; here a few.
"""

from pathlib import Path

import pytest

from tests.attack.formats import FORMATS
from tests.attack.run import attack

FILES = 20


@pytest.mark.parametrize("name", FORMATS)
def test_wrong_files_are_refused_or_read(name: str, tmp_path: Path) -> None:
    outcome = attack(FORMATS[name](tmp_path), FILES)
    assert list(outcome.failures) == []
    assert outcome.refused > 0
