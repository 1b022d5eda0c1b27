"""Figures that are left empty, for tests of code around them; tests/plots draws each of them."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import pytest
from matplotlib.figure import Figure

DRAW: Final = Figure.draw


@contextmanager
def undrawn_figures() -> Iterator[None]:
    """Leave figures empty."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "draw", lambda *_: None)
        yield


@pytest.fixture(scope="package", autouse=True)
def undrawn_package() -> Iterator[None]:
    """Leave the figures of the package whose conftest imports this empty, but for `drawn`."""
    with undrawn_figures():
        yield
