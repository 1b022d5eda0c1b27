"""Figures of these tests are looked at where they ask for `drawn`."""

from tests.figures import undrawn_package as undrawn_package
