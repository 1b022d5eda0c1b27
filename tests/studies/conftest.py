"""Settings for the tests of studies."""

import pytest


@pytest.fixture(scope="package", autouse=True)
def _undrawn(undrawn: None) -> None:
    """Leave the figures of these tests empty, unless one asks for `drawn`."""
