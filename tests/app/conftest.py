"""Films of the page that take little time to draw."""

from collections.abc import Iterator

import pytest

from blast_env.app import blasts


@pytest.fixture(scope="session", autouse=True)
def short_films() -> Iterator[None]:
    """Draw few frames, yet more than after which a film can begin."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blasts, "FRAMES", 8)
        yield
