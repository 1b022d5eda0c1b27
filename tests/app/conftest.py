"""Films of the page that take little time to draw, and probabilities of few draws."""

from collections.abc import Iterator

import pytest

from blast_env.answers import compare
from blast_env.app import blasts
from tests.figures import undrawn_package as undrawn_package


@pytest.fixture(scope="session", autouse=True)
def short_films() -> Iterator[None]:
    """Draw few frames, and few of the uncertain quantities."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blasts, "FRAMES", 3)
        patch.setattr(compare, "_DRAWS", 20)
        yield


@pytest.fixture
def without_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Spare a blast of gas its pictures, which take longer than it."""
    monkeypatch.setattr(blasts, "_pictures", lambda *_: ())
