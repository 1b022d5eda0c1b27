"""Small sites with a building, a charge and a build zone wherever a test wants them."""

from typing import Any

from blast_env.site import Scenario
from tests import builders
from tests.builders import point, square

SIDE_M = 40.0


def site(
    charge_m: tuple[float, float] = (5.0, 20.0),
    building_m: tuple[float, float] = (30.0, 18.0),
    **zone: Any,
) -> Scenario:
    """Return a site of 40 m x 40 m with a building of 4 m x 4 m and a zone of 10 m x 10 m."""
    building = square("building", *building_m, 8, protected=True)
    cells = builders.zone(15.0, 15.0, 20, 20, stock=12) | zone
    return builders.site("site", (SIDE_M, SIDE_M), point(*charge_m), building, build_zone=cells)
