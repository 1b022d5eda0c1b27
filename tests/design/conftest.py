"""Figures of these tests are not looked at."""

from tests.figures import undrawn_package as undrawn_package
