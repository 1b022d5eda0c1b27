"""The observable part of an episode, and the parts common to all observations."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import hypot, inf, nan
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.layout.batch import Placements
from blast_env.layout.build_site import vehicle_reach, worst_places
from blast_env.site import AnySource, BuildZone, Scenario, VehicleSource
from blast_env.site.zone import module_costs_of

if TYPE_CHECKING:  # most sites have no vehicle
    from blast_env.vehicles.worst_places import PlainGround

Array = NDArray[Any]
"""An observation; its data type is that of the space."""

MASK: Final = "action_mask"
"""Key of the mask of legal actions, which environments add to a `Dict`."""

Plane = NDArray[np.float32]
"""Values of the squares of a site (rows, columns), or several planes of them."""

FULL_CHARGE_KG: Final = 1000.0
"""TNT-equivalent mass shown as 1; larger ones too."""

FULL_STOCK: Final = 100
"""Number of modules in stock shown as 1; larger ones too."""

FULL_HEIGHT_M: Final = 12.0
"""Height shown as 1; larger ones, and the full height of the air, too."""


@dataclass(frozen=True, eq=False)
class Observable:
    """The observable part of an episode before the charge goes off.

    Observations use only this and the present layout, so no other information can leak into them:
    with a hidden threat, `sources` are those of the scenario.

    Attributes:
        scenario: The scenario.
        sources: The place of the charge, or its possible places.
        among_vehicles: Whether other scenarios of the environment have vehicles, so that values
            for vehicles are present.
        of_site: What an observation keeps for all episodes on the site, by its own names.
    """

    scenario: Scenario
    sources: tuple[AnySource, ...]
    among_vehicles: bool = False
    of_site: dict[str, Any] = field(default_factory=dict, repr=False)

    @property
    def shows_vehicles(self) -> bool:
        """Whether observations have values for vehicles."""
        return self.among_vehicles or bool(self.scenario.vehicles)

    @cached_property
    def vehicles(self) -> tuple[VehicleSource, ...]:
        """The vehicles that may bring the charge."""
        return tuple(source for source in self.sources if isinstance(source, VehicleSource))

    @cached_property
    def diagonal_m(self) -> float:
        """Diagonal of the site, m."""
        return hypot(self.scenario.site.width_m, self.scenario.site.height_m)

    def reached(self, layout: Layout) -> BoolArray:
        """Return the mask of squares of the site within reach of a vehicle, (rows, columns)."""
        rows, columns = self.scenario.site.squares
        ground = np.zeros((rows, columns), dtype=bool)
        for source in self.vehicles:
            ground |= vehicle_reach(self.scenario, source, layout).ground(rows, columns)
        return ground

    @cached_property
    def plain(self) -> "tuple[PlainGround, ...]":
        """The surroundings of the vehicles, if plain and the same with any layout; else nothing."""
        scenario = self.scenario
        if scenario.zone.removable:
            return ()
        grounds = [scenario.vehicle_ground(source).plain for source in self.vehicles]
        plain = [ground for ground in grounds if ground is not None]
        return tuple(plain) if len(plain) == len(grounds) else ()

    def stand_off_m(self, layout: Layout) -> float:
        """Return the least stand-off of a vehicle, m; infinite without vehicles."""
        places = (worst_places(self.scenario, source, layout) for source in self.vehicles)
        return min((place.stand_off_m for place in places), default=inf)


def stand_offs_m(episodes: Sequence[Observable], placements: Placements) -> FloatArray:
    """Return the stand-off in several episodes, m; infinite without vehicles (episodes,)."""
    found = np.full(len(episodes), inf)
    # 1. Plain surroundings on the same site at once.
    groups: dict[tuple[int, tuple[PlainGround, ...]], list[int]] = {}
    for position, episode in enumerate(episodes):
        if episode.plain:
            groups.setdefault((id(placements.rules[position]), episode.plain), []).append(position)
        elif episode.vehicles:
            found[position] = nan
    for (_, grounds), own in groups.items():
        table, counts = placements.rules[own[0]].obstacles, placements.placed[own]
        arrays = table.boxes_m, table.kinds, placements.numbers[own], counts
        nearest_m = grounds[0].stand_offs_m(*arrays)
        for ground in grounds[1:]:
            nearest_m = np.minimum(nearest_m, ground.stand_offs_m(*arrays))
        found[own] = nearest_m
    # 2. The others one by one.
    for position in np.flatnonzero(np.isnan(found)).tolist():
        found[position] = episodes[position].stand_off_m(placements.layout(position))
    return found


class EpisodeObservation(Protocol):
    """Observes one episode."""

    def observe(self, placement: LayoutState) -> Any:
        """Return a new element of the space, for the modules placed so far."""


class BatchObservation(ABC):
    """Observes one episode, or several of them in one array; keeps no state between placements."""

    @staticmethod
    @abstractmethod
    def observe_many(episodes: Sequence[Any], placements: Placements) -> Any:
        """Return the observations of episodes of this class, with a leading axis (episodes, ...).

        Args:
            episodes: The episodes, whose spaces are equal.
            placements: The modules placed so far in each of them.
        """

    def observe(self, placement: LayoutState) -> Any:
        """Return a new element of the space, for the modules placed so far."""
        return one_of(self.observe_many([self], Placements.of(placement)), 0)


def one_of(observed: Any, index: int) -> Any:
    """Return one of several observations."""
    if isinstance(observed, dict):
        return {key: value[index] for key, value in observed.items()}
    return observed[index]


class Observation(Protocol):
    """A kind of observation."""

    def space(self, scenario: Scenario) -> spaces.Space[Any]:
        """Return the space, a `Box`, or a `Dict` without the key `action_mask`.

        The environment adds this mask to a `Dict`. The space depends only on the sizes of site and
        build zone, the names and sizes of the items, and whether there are vehicles.
        """

    def episode(self, observable: Observable) -> EpisodeObservation:
        """Prepare the observations of an episode, with all values that do not change."""


# ---- Values from 0 to 1, common to planes and vectors.


def charge_share(tnt_kg: float) -> float:
    """Return a charge's mass as an observed value: (mass / 1000 kg)^(1/3), at most 1.

    The cube root, because distances scale with it (Hopkinson and Cranz): a charge of eight times
    the mass has the same peak at twice the distance.
    """
    return float(min((tnt_kg / FULL_CHARGE_KG) ** (1.0 / 3.0), 1.0))


def height_share(height_m: float | None) -> float:
    """Return a height as an observed value: a share of 12 m, at most 1; 1 for None."""
    return 1.0 if height_m is None else min(height_m / FULL_HEIGHT_M, 1.0)


def stock_shares(placements: Placements) -> FloatArray:
    """Return the remaining stock and budget as values from 0 to 1 (placements, 3).

    They are the share of the stock, the number of modules or pieces as a share of 100 (at most 1),
    and the share of the budget (1 without a budget).
    """
    left, shares = placements.left[:, 0], np.empty((len(placements.left), 3))
    shares[:, 0] = left / placements.stock[:, 0]
    shares[:, 1] = np.minimum(left / FULL_STOCK, 1.0)
    # NaN marks a zone without a budget, which never runs out.
    has_none = np.isnan(placements.budget)
    shares[:, 2] = np.where(has_none, 1.0, placements.budget_left / placements.budget)
    return shares


def cost_shares(zone: BuildZone) -> FloatArray:
    """Return the cost of building on each cell as a share of the highest, (rows, columns)."""
    costs = module_costs_of(zone)
    return np.asarray(costs / costs.max())


def cells_shown(placements: Placements) -> BoolArray:
    """Return where modules stand and where some may be placed (placements, 2, rows, columns)."""
    return np.stack((placements.occupancy > 0, placements.legal.any(axis=1)), axis=1)


def item_values(zone: BuildZone) -> tuple[FloatArray, FloatArray]:
    """Return the constant values of the items of a catalogue, including measures.

    Returns:
        Their heights (items,), and their costs per piece (items,): as a share of the budget, or of
        the dearest item's cost if there is no budget, at most 1.
    """
    everything = {variant.item: variant for variant in zone.catalogue.variants}.values()
    costs = np.array([item.cost for item in everything])
    shares = np.minimum(costs / (zone.budget or costs.max(initial=1.0)), 1.0)
    return np.array([height_share(item.height_m) for item in everything]), np.asarray(shares)


def variant_values(zone: BuildZone) -> Plane:
    """Return height and whether vehicles are stopped by the variant on a cell (2, variants + 1).

    Variants count from 1, and nothing is 0.
    """
    variants = zone.catalogue.variants
    rows = [(height_share(variant.height_m), variant.stops_vehicles) for variant in variants]
    return np.array([(0.0, 0.0), *rows], dtype=np.float32).T.copy()


def items_placed(placements: Placements) -> Plane:
    """Return the values of the cells that change with the layouts of pieces.

    Returns:
        For each cell the height of its module, whether that stops vehicles, and whether a piece of
        each variant may have its lower left cell there (placements, 2 + variants, rows, columns).
    """
    legal = placements.legal
    on_cells = np.empty((len(legal), 2 + legal.shape[1], *legal.shape[2:]), dtype=np.float32)
    on_cells[:, 2:] = legal
    of_catalogues: dict[int, list[int]] = {}
    for index, rule in enumerate(placements.rules):
        of_catalogues.setdefault(id(rule.catalogue), []).append(index)
    for own in of_catalogues.values():
        tables = variant_values(placements.rules[own[0]].zone)
        which: slice | list[int] = slice(None) if len(own) == len(legal) else own
        for plane, table in enumerate(tables):
            on_cells[which, plane] = table.take(placements.occupancy[which], mode="clip")
    return on_cells


def items_left(placements: Placements) -> FloatArray:
    """Return the remaining share of the pieces of each item (placements, items)."""
    left = np.minimum(placements.left[:, 1:], placements.left[:, :1])
    shares: FloatArray = left / np.maximum(placements.stock[:, 1:], 1)
    return shares
