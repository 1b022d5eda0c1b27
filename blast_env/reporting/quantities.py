"""What a layout is made of: a bill of quantities."""

from collections import Counter
from dataclasses import dataclass

from blast_env.geometry import Cell
from blast_env.scenario import Placement, Scenario
from blast_env.scenario.zone import Surroundings, empty_zone
from blast_env.units import MODULE_SIDE_M


@dataclass(frozen=True)
class Position:
    """A line of a bill of quantities.

    Attributes:
        what: What it is.
        count: How many.
        unit_cost: Cost of one, in whatever unit the scenario's costs are.
    """

    what: str
    count: int
    unit_cost: float

    @property
    def cost(self) -> float:
        """Cost of all."""
        return self.count * self.unit_cost


@dataclass(frozen=True)
class Bill:
    """A bill of quantities.

    Attributes:
        positions: Its lines.
        cost: Cost of all.
        budget: What it may be; `None` without a bound.
        stock: How many modules there are.
        volume_m3: Volume of all modules; `None` where they are as high as the air.
        ground_m2: Ground that they cover.
    """

    positions: tuple[Position, ...]
    cost: float
    budget: float | None
    stock: int
    volume_m3: float | None
    ground_m2: float


def bill_of(scenario: Scenario, layout: tuple[Cell, ...]) -> Bill:
    """Return the bill of quantities of a layout.

    Raises:
        LayoutError: If it does not fit the scenario.
    """
    zone = scenario.zone
    costs = empty_zone(
        Surroundings(zone, scenario.structures, scenario.charge, scenario.charge_radius_m)
    ).module_costs
    side = f"{MODULE_SIDE_M:g}"
    height = "as high as the air" if zone.height_m is None else f"{zone.height_m:g} m high"
    counts = Counter(float(costs[cell]) for cell in layout)
    ground_m2 = len(layout) * MODULE_SIDE_M**2
    return Bill(
        positions=tuple(
            Position(f"module {side} m x {side} m, {height}", count, cost)
            for cost, count in sorted(counts.items())
        ),
        cost=Placement.of(scenario, layout).cost,
        budget=zone.budget,
        stock=zone.stock,
        volume_m3=None if zone.height_m is None else ground_m2 * zone.height_m,
        ground_m2=ground_m2,
    )
