"""Conversion between metres and the simulation's dimensionless units.

The paper's scaling ratio (Martyniuk & Kochkarov, equation 4): one metre is four units.
Positions, radii and speeds in a `Scene` are in units and units per second; all input and output
is in metres.
"""

from typing import Final

UNITS_PER_M: Final = 4.0
"""Simulation units in one metre (equation 4)."""


MODULE_SIDE_UNITS: Final = 2.0
"""Side of a square `ModularPart` (section 2.7)."""

MODULE_SIDE_M: Final = MODULE_SIDE_UNITS / UNITS_PER_M
"""Side of a square `ModularPart` in metres: 0.5 m."""

MS_PER_S: Final = 1000.0
"""Milliseconds in a second."""

PA_PER_PSI: Final = 6894.757293168
"""Pascals in a pound-force per square inch; also Pa s in a psi s."""

PA_PER_KPA: Final = 1000.0
"""Pascals in a kilopascal."""
