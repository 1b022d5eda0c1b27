"""A site on which a report takes seconds."""

from typing import Any

from blast_env.scenario import Scenario
from tests.gas_sites import WALL, hut

LAYOUT = WALL[1:5]


def small_hut(**changes: Any) -> Scenario:
    """Return the hut of `tests.gas_sites` with less air around it."""
    site = {"width_m": 8.0, "height_m": 6.0, "air_height_m": 3.0}
    return hut(site=site, gauges=[], **changes)
