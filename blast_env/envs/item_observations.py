"""What observations show of a catalogue: heights, items, and which piece may stand where.

Only zones with a catalogue have these values; what others show does not change with them.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.scenario import BuildZone, Catalogue, Placement

FULL_HEIGHT_M: Final = 12.0
"""Height that is shown as 1; what is higher, or as high as the air, as well."""


def height_share(height_m: float | None) -> float:
    """Return a height as it is shown: as a share of 12 m, at most 1."""
    return 1.0 if height_m is None else min(height_m / FULL_HEIGHT_M, 1.0)


@dataclass(frozen=True, eq=False)
class PlacedItems:
    """What stands on each cell of the build zone.

    Attributes:
        heights: Heights of the modules as shares of 12 m, 0 where none stands (rows, columns).
        stops_vehicles: Where a module stands that no vehicle gets past (rows, columns).
    """

    heights: FloatArray
    stops_vehicles: BoolArray

    @classmethod
    def of(cls, placement: Placement) -> "PlacedItems":
        """Return what stands."""
        shape = placement.usable.shape
        heights, stops = np.zeros(shape), np.zeros(shape, dtype=bool)
        for module in placement.modules:
            heights[module.cell] = height_share(module.height_m)
            stops[module.cell] = module.stops_vehicles
        return cls(heights, stops)


def item_heights(zone: BuildZone) -> FloatArray:
    """Return the heights of the items as shares of 12 m (items,)."""
    return np.array([height_share(item.height_m) for item in zone.items])


def item_costs(zone: BuildZone) -> FloatArray:
    """Return what a piece of each item costs, at most 1 (items,).

    As a share of the budget, or of the dearest item's cost where there is no budget.
    """
    costs = np.array([item.cost for item in zone.items])
    return np.asarray(np.minimum(costs / (zone.budget or costs.max(initial=1.0)), 1.0))


def items_left(placement: Placement) -> FloatArray:
    """Return which share of the pieces of each item may still be placed (items,)."""
    catalogue = placement.catalogue
    if not catalogue.has_items:
        return np.zeros(0)
    left = np.array(placement.stocks_left, dtype=np.float64)
    return np.asarray(left / np.maximum(np.array(catalogue.stocks), 1))


STRUCTURE_HEIGHT: Final = "structure_height"


CHANGING_SITE: Final = ("barrier_height", "stops_vehicles")


@dataclass(frozen=True)
class ItemChannels:
    """Names of the planes that a zone with a catalogue has more than others.

    Those of an item begin with its name and a colon, which no name has.

    Attributes:
        heights: Of the items' heights, one an item.
        costs: Of their costs, one an item.
        left: Of what is left of them, one an item.
        legal: Of where each variant may be placed, one a variant.
    """

    heights: tuple[str, ...]
    costs: tuple[str, ...]
    left: tuple[str, ...]
    legal: tuple[str, ...]

    @classmethod
    def of(cls, catalogue: Catalogue) -> "ItemChannels":
        """Return the names for a catalogue; none without items."""
        names = catalogue.names
        variants = catalogue.variants if catalogue.has_items else ()
        return cls(
            heights=tuple(f"{name}:height" for name in names),
            costs=tuple(f"{name}:cost" for name in names),
            left=tuple(f"{name}:left" for name in names),
            legal=tuple(
                f"{each.name}:turned:legal" if each.turned else f"{each.name}:legal"
                for each in variants
            ),
        )

    @property
    def all(self) -> tuple[str, ...]:
        """All names in the order of the planes; none without items."""
        if not self.left:
            return ()
        changing = (*CHANGING_SITE, *self.left, *self.legal)
        return (STRUCTURE_HEIGHT, *self.heights, *self.costs, *changing)
