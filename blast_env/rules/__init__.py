"""Rules of thumb, which place by the site alone, and the table of them."""

from blast_env.rules.posts import line_of_posts, posts_and_wall
from blast_env.rules.proposals import Proposals, proposals_for
from blast_env.rules.table import RULES, Need, Rule, RuleRow, layouts_by_rule
from blast_env.rules.walls import (
    NEAR_BUILDING,
    NEAR_CHARGE,
    expected_charge,
    hardening_alone,
    hardening_and_sight_lines,
    line_of_sight_wall,
    random_element,
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
    "RULES",
    "Need",
    "Proposals",
    "Rule",
    "RuleRow",
    "expected_charge",
    "hardening_alone",
    "hardening_and_sight_lines",
    "layouts_by_rule",
    "line_of_posts",
    "line_of_sight_wall",
    "posts_and_wall",
    "proposals_for",
    "random_element",
    "random_layout",
    "ring_around_building",
    "ring_around_charge",
    "wall_near_building",
    "wall_near_charge",
    "why_no_wall",
]
