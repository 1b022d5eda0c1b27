"""What observations show of vehicles: the ground that they reach, and how near they come.

Only scenarios with vehicles have these values, and those that an environment draws beside some:
there nothing is reached, and nothing comes near.
"""

from dataclasses import dataclass
from math import hypot, inf
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray
from blast_env.geometry import Layout
from blast_env.scenario import AnySource, Scenario, VehicleSource
from blast_env.scenario.build_scene import vehicle_reach, worst_places
from blast_env.scenario.vehicles import squares_of

EMPTY_REACH: Final = "reach_without_barrier"
REACH: Final = "reach"


def vehicle_channels(shown: bool) -> tuple[str, ...]:
    """Return the names of the planes that show vehicles; none where they are not shown."""
    return (EMPTY_REACH, REACH) if shown else ()


@dataclass(frozen=True)
class VehicleView:
    """The vehicles that may be seen.

    Attributes:
        scenario: The scenario.
        vehicles: Those of them that may bring the charge.
    """

    scenario: Scenario
    vehicles: tuple[VehicleSource, ...]

    @classmethod
    def of(cls, scenario: Scenario, sources: tuple[AnySource, ...]) -> "VehicleView":
        """Return the vehicles among the sources of a charge."""
        return cls(scenario, tuple(each for each in sources if isinstance(each, VehicleSource)))

    def reached(self, layout: Layout) -> BoolArray:
        """Return which squares of the site a vehicle gets to with a layout, (rows, columns)."""
        rows, columns = squares_of(self.scenario.site)
        ground = np.zeros((rows, columns), dtype=bool)
        for source in self.vehicles:
            ground |= vehicle_reach(self.scenario, source, layout).ground(rows, columns)
        return ground

    def stand_off_share(self, layout: Layout) -> float:
        """Return how near a vehicle comes, as a share of the site's diagonal; 1 without any."""
        diagonal_m = hypot(self.scenario.site.width_m, self.scenario.site.height_m)
        return min(self.stand_off_m(layout) / diagonal_m, 1.0)

    def stand_off_m(self, layout: Layout) -> float:
        """Return how near a vehicle comes to a protected structure; infinite without any."""
        stand_offs_m = [
            worst_places(self.scenario, source, layout).stand_off_m for source in self.vehicles
        ]
        return min(stand_offs_m, default=inf)
