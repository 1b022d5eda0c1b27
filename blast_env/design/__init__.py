"""The choice of a layout: rules and optimisers."""

from blast_env.rules import (
    NEAR_BUILDING,
    NEAR_CHARGE,
    expected_charge,
    hardening_alone,
    hardening_and_sight_lines,
    line_of_posts,
    line_of_sight_wall,
    posts_and_wall,
    random_layout,
    ring_around_building,
    ring_around_charge,
    wall_near_building,
    wall_near_charge,
    why_no_wall,
)

__all__ = [
    "NEAR_BUILDING",
    "NEAR_CHARGE",
    "expected_charge",
    "hardening_alone",
    "hardening_and_sight_lines",
    "line_of_posts",
    "line_of_sight_wall",
    "posts_and_wall",
    "random_layout",
    "ring_around_building",
    "ring_around_charge",
    "wall_near_building",
    "wall_near_charge",
    "why_no_wall",
]
