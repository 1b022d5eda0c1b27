"""Figures of these tests are not looked at."""

from collections.abc import Iterator

import pytest

from tests.figures import undrawn_figures


@pytest.fixture(scope="package", autouse=True)
def _undrawn() -> Iterator[None]:
    """Leave figures empty, unless a test asks for `drawn`."""
    with undrawn_figures():
        yield
