"""Settings for the tests of studies."""

from collections.abc import Iterator

import pytest

from tests.figures import undrawn_figures


@pytest.fixture(scope="package", autouse=True)
def _undrawn() -> Iterator[None]:
    """Leave the figures of these tests empty, unless one asks for `drawn`."""
    with undrawn_figures():
        yield
