"""What a charge sees of walls: half spaces, and lines past solids."""

import numpy as np

from blast_env.geometry import Layout
from blast_env.layout import build_site
from blast_env.site import OUTWARDS, Charge, in_sight
from tests.gas_sites import WALL, hut

FRONT = np.array([(6.0, y_m, 1.0) for y_m in (3.25, 4.0, 4.75)])


def seen(points_m: np.ndarray, wall: str, layout: Layout, height_m: float = 0.0) -> list[bool]:
    site = build_site(hut(), layout, charge=Charge((2.0, 4.0), 5.0, height_m))
    outward = np.tile([*OUTWARDS[wall], 0.0], (len(points_m), 1))
    found: list[bool] = in_sight(site, points_m, outward).tolist()
    return found


def test_only_walls_that_look_to_the_charge_are_seen() -> None:
    assert seen(FRONT, "west", ()) == [True] * 3
    assert seen(FRONT + [2.0, 0.0, 0.0], "east", ()) == [False] * 3
    # The north wall, a metre beyond the height of the charge, looks away from it.
    assert seen(np.array([(6.5, 5.0, 1.0)]), "north", ()) == [False]


def test_a_wall_hides_what_it_is_before_and_a_module_its_part_alone() -> None:
    assert seen(FRONT, "west", WALL) == [False] * 3
    assert seen(FRONT[[0, 2]], "west", WALL[:3]) == [False, True]


def test_a_charge_sees_over_a_wall_from_above() -> None:
    """From 3 m, over the wall of 1.5 m 2.5 m away, down to 0.6 m on a front 4 m away."""
    points_m = np.array([(6.0, 4.0, 0.5), (6.0, 4.0, 0.75)])
    assert seen(points_m, "west", WALL, height_m=3.0) == [False, True]
