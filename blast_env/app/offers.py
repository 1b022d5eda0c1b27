"""What can propose a layout, by name; without importing it, which takes seconds."""

from typing import Final

SIGHT_LINES: Final = "most sight lines cut"

PROPOSERS: Final = ("wall near the charge", "wall near the building", SIGHT_LINES)
"""Rules that propose a layout at once."""

METHODS: Final = ("genetic", "annealing", "greedy", "random")
"""Searches that the page offers."""
