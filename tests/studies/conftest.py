"""Settings for the tests of studies."""

from tests.figures import undrawn_package as undrawn_package
