"""The rules of `blast_env.rules`, at the place where they were until November 2026."""

from blast_env.rules.walls import (
    NEAR_BUILDING,
    NEAR_CHARGE,
    expected_charge,
    hardening_alone,
    hardening_and_sight_lines,
    line_of_sight_wall,
    random_layout,
    ring_around_building,
    ring_around_charge,
    sight_lines,
    wall_in_middle,
    wall_near_building,
    wall_near_charge,
)

__all__ = [
    "NEAR_BUILDING",
    "NEAR_CHARGE",
    "expected_charge",
    "hardening_alone",
    "hardening_and_sight_lines",
    "line_of_sight_wall",
    "random_layout",
    "ring_around_building",
    "ring_around_charge",
    "sight_lines",
    "wall_in_middle",
    "wall_near_building",
    "wall_near_charge",
]
