"""Figures of these tests are not looked at."""

import pytest


@pytest.fixture(scope="package", autouse=True)
def _undrawn(undrawn: None) -> None:
    """Leave figures empty, unless a test asks for `drawn`."""
