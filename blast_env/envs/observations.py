"""Observations of an agent, and their parts."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import ceil, hypot, inf
from types import MappingProxyType
from typing import Any, ClassVar, Final, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout, Rectangle
from blast_env.layout import LayoutState
from blast_env.layout.build_site import vehicle_reach, worst_places
from blast_env.site import (
    AnySource,
    BuildZone,
    Catalogue,
    RectangleSource,
    Scenario,
    Site,
    VehicleSource,
)
from blast_env.site.reach import squares_of
from blast_env.site.sections import PointM
from blast_env.site.terraces import is_open_below
from blast_env.site.zone import source_bounds_m
from blast_env.units import MODULE_SIDE_M

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

# ---- The observable part of an episode.


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
    """

    scenario: Scenario
    sources: tuple[AnySource, ...]
    among_vehicles: bool = False

    @property
    def shows_vehicles(self) -> bool:
        """Whether observations have values for vehicles."""
        return self.among_vehicles or bool(self.scenario.vehicles)


@dataclass(frozen=True)
class VehicleView:
    """The observable vehicles.

    Attributes:
        scenario: The scenario.
        vehicles: The vehicles that may bring the charge.
    """

    scenario: Scenario
    vehicles: tuple[VehicleSource, ...]

    @classmethod
    def of(cls, scenario: Scenario, sources: tuple[AnySource, ...]) -> "VehicleView":
        """Return the vehicles among the sources of a charge."""
        return cls(scenario, tuple(each for each in sources if isinstance(each, VehicleSource)))

    def reached(self, layout: Layout) -> BoolArray:
        """Return the mask of squares of the site within reach of a vehicle, (rows, columns)."""
        rows, columns = squares_of(self.scenario.site)
        ground = np.zeros((rows, columns), dtype=bool)
        for source in self.vehicles:
            ground |= vehicle_reach(self.scenario, source, layout).ground(rows, columns)
        return ground

    def stand_off_m(self, layout: Layout) -> float:
        """Return the least stand-off of a vehicle, m; infinite without vehicles."""
        places = (worst_places(self.scenario, source, layout) for source in self.vehicles)
        return min((each.stand_off_m for each in places), default=inf)


class EpisodeObservation(Protocol):
    """Observes one episode."""

    def observe(self, placement: LayoutState) -> Any:
        """Return a new element of the space, for the modules placed so far."""


class BatchedObservation(ABC):
    """Observes one episode, or several of them in one array; keeps no state between placements."""

    @staticmethod
    @abstractmethod
    def observe_many(episodes: Sequence[Any], placements: Sequence[LayoutState]) -> Any:
        """Return the observations of episodes of this class, with a leading axis (episodes, ...).

        Args:
            episodes: The episodes, whose spaces are equal.
            placements: The modules placed so far in each of them.
        """

    def observe(self, placement: LayoutState) -> Any:
        """Return a new element of the space, for the modules placed so far."""
        return one_of(self.observe_many([self], [placement]), 0)


def one_of(observed: Any, index: int) -> Any:
    """Return one of several observations."""
    if isinstance(observed, dict):
        return {key: each[index] for key, each in observed.items()}
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


def stock_shares(placements: Sequence[LayoutState]) -> FloatArray:
    """Return the remaining stock and budget as values from 0 to 1 (placements, 3).

    They are the share of the stock, the number of modules or pieces as a share of 100 (at most 1),
    and the share of the budget (1 without a budget).
    """
    rows = []
    for each in placements:
        zone, left, budget_left = each.scenario.zone, each.stock_left, each.budget_left
        of_budget = 1.0 if zone.budget is None or budget_left is None else budget_left / zone.budget
        rows.append((left / zone.stock, min(left / FULL_STOCK, 1.0), of_budget))
    return np.array(rows)


def cost_shares(scenario: Scenario) -> FloatArray:
    """Return the cost of building on each cell as a share of the highest, (rows, columns)."""
    costs = LayoutState.empty(scenario).module_costs
    return np.asarray(costs / costs.max())


def cells_shown(placements: Sequence[LayoutState], legal: BoolArray) -> BoolArray:
    """Return where modules stand and where some may be placed (placements, 2, rows, columns).

    Args:
        placements: The placements.
        legal: `LayoutState.legal` of each (placements, variants, rows, columns).
    """
    occupied = np.array([each.standing for each in placements]) > 0
    return np.stack((occupied, legal.any(axis=1)), axis=1)


def item_values(zone: BuildZone) -> tuple[FloatArray, FloatArray]:
    """Return the constant values of the items of a catalogue, including measures.

    Returns:
        Their heights (items,), and their costs per piece (items,): as a share of the budget, or of
        the dearest item's cost if there is no budget, at most 1.
    """
    everything = {each.item: each for each in zone.catalogue.variants}.values()
    costs = np.array([each.cost for each in everything])
    shares = np.minimum(costs / (zone.budget or costs.max(initial=1.0)), 1.0)
    return np.array([height_share(each.height_m) for each in everything]), np.asarray(shares)


def items_placed(placements: Sequence[LayoutState], legal: BoolArray) -> tuple[FloatArray, Plane]:
    """Return the values of a catalogue that change with the layouts.

    Args:
        placements: The placements.
        legal: As for `cells_shown`.

    Returns:
        The remaining share of the pieces of each item (placements, items); and for each cell the
        height of its module, whether that stops vehicles, and whether a piece of each variant may
        have its lower left cell there (placements, 2 + variants, rows, columns).
    """
    on_cells = np.empty((len(legal), 2 + legal.shape[1], *legal.shape[2:]), dtype=np.float32)
    on_cells[:, 2:] = legal
    tables: dict[int, Plane] = {}
    for own, each in zip(on_cells, placements, strict=True):
        if id(each.catalogue) not in tables:
            rows = [(height_share(v.height_m), v.stops_vehicles) for v in each.catalogue.variants]
            tables[id(each.catalogue)] = np.array([(0.0, 0.0), *rows], dtype=np.float32).T
        np.take(tables[id(each.catalogue)], each.standing, axis=1, out=own[:2], mode="clip")
    return items_left(placements), on_cells


def items_left(placements: Sequence[LayoutState]) -> FloatArray:
    """Return the remaining share of the pieces of each item (placements, items)."""
    stocks = np.array([each.catalogue.stocks for each in placements])
    left: FloatArray = np.array([each.stocks_left for each in placements]) / np.maximum(stocks, 1)
    return left


# ---- The grid of squares of 0.5 m over a site.

_POINTS_PER_MODULE: Final = 8  # along a line of possible places of a charge


@dataclass(frozen=True)
class SiteGrid:
    """Planes of (rows, columns) squares of 0.5 m; row 0 is the lower edge of the site.

    Attributes:
        rows: Number of squares upwards.
        columns: Number of squares to the right.
    """

    rows: int
    columns: int

    @classmethod
    def of(cls, site: Site) -> "SiteGrid":
        """Return the grid of a site; its last squares may extend beyond the site."""
        return cls(*squares_of(site))

    def lattice(self, corner_m: tuple[float, float], rows: int, columns: int) -> "Lattice":
        """Return the position of a lattice of modules on the grid.

        Args:
            corner_m: Its lower left corner.
            rows: Number of modules upwards.
            columns: Number of modules to the right.
        """
        return Lattice(
            _shares(self.rows, corner_m[1], rows), _shares(self.columns, corner_m[0], columns)
        )

    def rectangle(self, rectangle_m: Rectangle) -> Plane:
        """Return the share of each square that a rectangle covers, (rows, columns)."""
        left, bottom, right, top = rectangle_m
        along_y = _covered(self.rows, np.array([bottom]), np.array([top]))
        along_x = _covered(self.columns, np.array([left]), np.array([right]))
        return (along_y @ along_x.T).astype(np.float32)

    def source(self, source: AnySource) -> Plane:
        """Return the probability of the charge of a source in each square, (rows, columns).

        The plane adds up to 1. A point is distributed over the four squares around it such that
        their mean position is the point. A vehicle is shown at its entries.
        """
        if isinstance(source, RectangleSource):
            plane = self.rectangle(source.rectangle_m)
        else:
            plane = np.sum([self._line(*ends_m) for ends_m in source.lines_m], axis=0)
        # Divided by the sum, since a narrow rectangle covers only a tiny part of its squares.
        return plane / np.float32(plane.sum(dtype=np.float64))

    def _line(self, start_m: PointM, end_m: PointM) -> Plane:
        """Return a plane of closely spaced points along a line."""
        start, end = np.array(start_m), np.array(end_m)
        length_m = float(np.hypot(*(end - start)))
        count = 1 + _POINTS_PER_MODULE * ceil(length_m / MODULE_SIDE_M)
        share = (np.arange(count) + 0.5) / count
        return self._points(start + share[:, np.newaxis] * (end - start))

    def _points(self, points_m: NDArray[np.float64]) -> Plane:
        """Return a plane of points (n, 2), each distributed over the four squares around it."""
        plane = np.zeros((self.rows, self.columns), dtype=np.float32)
        places = points_m[:, ::-1] / MODULE_SIDE_M - 0.5
        low = np.floor(places).astype(int)
        beyond = places - low
        for up in (0, 1):
            for right in (0, 1):
                row = np.clip(low[:, 0] + up, 0, self.rows - 1)
                column = np.clip(low[:, 1] + right, 0, self.columns - 1)
                along_y = beyond[:, 0] if up else 1.0 - beyond[:, 0]
                along_x = beyond[:, 1] if right else 1.0 - beyond[:, 1]
                np.add.at(plane, (row, column), along_y * along_x)
        return plane


@dataclass(frozen=True, eq=False)
class Lattice:
    """Position of a lattice of modules on the grid; modules on the 0.5 m grid fill one square each.

    Attributes:
        along_y: Share of each row of squares covered by each row of modules (grid rows, rows).
        along_x: The same for columns (grid columns, columns).
    """

    along_y: Plane
    along_x: Plane

    def plane(self, values: NDArray[np.generic]) -> Plane:
        """Return values of the modules (..., rows, columns) on the grid, weighted by area."""
        plane: Plane = self.along_y @ values.astype(np.float32) @ self.along_x.T
        return plane

    @cached_property
    def squares(self) -> tuple[slice, slice] | None:
        """Rows and columns of the grid that the modules fill, one square each; `None` if not so."""
        found = []
        for share in (self.along_y, self.along_x):
            first, count = int(share[:, 0].argmax()), share.shape[1]
            found.append(slice(first, first + count))
            if not np.array_equal(share, np.eye(len(share), count, -first)):
                return None
        return found[0], found[1]


def _shares(squares: int, start_m: float, modules: int) -> Plane:
    low_m = np.asarray(start_m + MODULE_SIDE_M * np.arange(modules), dtype=np.float64)
    return _covered(squares, low_m, low_m + MODULE_SIDE_M).astype(np.float32)


def _covered(
    squares: int, low_m: NDArray[np.float64], high_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the share of each square covered by each interval (squares, intervals)."""
    first = np.arange(squares)[:, np.newaxis]
    low, high = low_m / MODULE_SIDE_M, high_m / MODULE_SIDE_M
    common = np.minimum(first + 1, high) - np.maximum(first, low)
    # Rounded, so that edges on the grid, up to the last bit, fill whole squares.
    covered: NDArray[np.float64] = np.round(np.clip(common, 0.0, 1.0), 9)
    return covered


# ---- Planes.

STRUCTURE_HEIGHT: Final = "structure_height"
BARRIER_HEIGHT: Final = "barrier_height"
EMPTY_REACH: Final = "reach_without_barrier"
REACH: Final = "reach"


def item_channels(catalogue: Catalogue) -> tuple[str, ...]:
    """Return the names of the additional planes for a zone with a catalogue.

    Those of an item begin with its name and a colon, which no name contains.
    """
    if not catalogue.has_items:
        return ()
    heights, costs, left = (
        tuple(f"{name}:{what}" for name in catalogue.names) for what in ("height", "cost", "left")
    )
    variants = [f"{each.name}:turned" if each.turned else each.name for each in catalogue.variants]
    legal = tuple(f"{name}:legal" for name in variants)
    return STRUCTURE_HEIGHT, *heights, *costs, BARRIER_HEIGHT, "stops_vehicles", *left, *legal


def vehicle_channels(shown: bool) -> tuple[str, ...]:
    """Return the names of the planes for vehicles; none if they are not shown."""
    return (EMPTY_REACH, REACH) if shown else ()


@dataclass(frozen=True)
class GridObservation:
    """Planes of (rows, columns) squares of 0.5 m over the site, float32 from 0 to 1.

    Row 0 is the lower edge of the site and column 0 the left one, as in the build zone. Objects
    on the 0.5 m grid fill whole squares; others are shown by the covered share of each square.

    | channel | plane | value, from 0 to 1 |
    |---|---|---|
    | 0 | `protected` | weight of the protected structure here / the largest weight |
    | 1 | `other_structures` | 1 where another structure stands |
    | 2 | `cost` | cost of a module on this cell of the build zone / the highest; 0 outside |
    | 3 | `charge` | see below |
    | 4 | `barrier` | 1 where a module stands |
    | 5 | `free` | 1 where a module, or the lower left cell of some piece, may be placed now |
    | 6 | `stock_share` | modules left / modules at first, the same everywhere |
    | 7 | `stock` | modules left / 100, at most 1, the same everywhere |
    | 8 | `budget_share` | budget left / budget, 1 without a budget, the same everywhere |

    `charge`: the square root of (probability of the charge in a square / the largest such value),
    times (mass / 1000 kg)^(1/3), at most 1. A visible charge fills the squares around its centre,
    up to four, and the largest value gives its mass. A hidden one fills all its possible squares;
    of several possible masses in a square, the mean value counts. The root keeps wide areas
    visible beside single points.

    If the build zone has a catalogue, further planes follow (`channels_of`); heights are shares
    of 12 m, and planes with the same value everywhere are marked =:

    | plane | value, from 0 to 1 |
    |---|---|
    | `structure_height` | height of the structure here, 1 where it is as high as the air |
    | `<item>:height`, for each item | its height = |
    | `<item>:cost`, for each item | its cost / the budget (or the dearest item's), at most 1 = |
    | `barrier_height` | height of the module here |
    | `stops_vehicles` | 1 where a module stops vehicles |
    | `<item>:left`, for each item | pieces that may still be placed / pieces at first = |
    | `<item>:legal`, `<item>:turned:legal` | 1 where a piece may have its lower left cell now |

    If the scenario has a vehicle, or is drawn among others that have one, two planes come last
    (empty without a vehicle). The plane `charge` then shows its entries, for visible and hidden
    threats alike: the place of the detonation depends on the layout.

    | plane | value |
    |---|---|
    | `reach_without_barrier` | 1 within reach of the vehicle on the empty site |
    | `reach` | 1 within its reach with the modules placed so far |

    Values are in steps of 1/255, as in `ImageObservation`, but not integers: stable-baselines3
    takes integers for an image, guesses the order of its axes from their sizes, and may transpose
    the planes. Custom convolutions thus see the same planes in every library; image policies take
    `"image"`.
    """

    channels: ClassVar[tuple[str, ...]] = (
        "protected",
        "other_structures",
        "cost",
        "charge",
        "barrier",
        "free",
        "stock_share",
        "stock",
        "budget_share",
    )

    def channels_of(
        self, scenario: Scenario, shows_vehicles: bool | None = None
    ) -> tuple[str, ...]:
        """Return the names of the planes; those of catalogue and vehicles, if any, come last.

        Args:
            scenario: The scenario.
            shows_vehicles: Whether to include those of vehicles; by default if it has vehicles.
        """
        shown = bool(scenario.vehicles) if shows_vehicles is None else shows_vehicles
        items = item_channels(scenario.zone.catalogue)
        return (*self.channels, *items, *vehicle_channels(shown))

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space: (channels, rows, columns)."""
        shape = (len(self.channels_of(scenario)), *squares_of(scenario.site))
        return spaces.Box(0.0, 1.0, shape, np.float32)

    def episode(self, observable: Observable) -> "GridEpisode":
        """Draw the planes that do not change."""
        scenario, zone = observable.scenario, observable.scenario.zone
        grid = SiteGrid.of(scenario.site)
        channels = self.channels_of(scenario, observable.shows_vehicles)
        static = np.zeros((len(channels), grid.rows, grid.columns), dtype=np.uint8)
        lattice = grid.lattice(zone.corner_m, zone.rows, zone.columns)
        vehicles = VehicleView.of(scenario, observable.sources)
        episode = GridEpisode(static, lattice, channels, vehicles)
        protected, others, heights = _structure_planes(grid, scenario)
        costs = lattice.plane(cost_shares(scenario))
        charge = _charge_plane(grid, observable.sources)
        names = ("protected", "other_structures", "cost", "charge")
        episode.show(static, names, np.stack((protected, others, costs, charge)))
        if zone.items:
            episode.show(static, (STRUCTURE_HEIGHT,), heights[np.newaxis])
            for ending, values in zip((":height", ":cost"), item_values(zone), strict=True):
                episode.show(static, episode.ending(ending), values)
        if scenario.vehicles:
            episode.show(static, (EMPTY_REACH,), vehicles.reached(())[np.newaxis])
        return episode


@dataclass(frozen=True, eq=False)
class GridEpisode(BatchedObservation):
    """The planes of one episode.

    Attributes:
        static: The constant planes (channels, rows, columns), 255 for 1; the others are 0.
        zone: Position of the build zone on the grid.
        channels: Names of the planes.
        vehicles: The observable vehicles.
    """

    static: NDArray[np.uint8]
    zone: Lattice
    channels: tuple[str, ...]
    vehicles: VehicleView

    @staticmethod
    def observe_many(episodes: Sequence["GridEpisode"], placements: Sequence[LayoutState]) -> Plane:
        """Return the planes of several episodes (episodes, channels, rows, columns)."""
        planes = np.array([each.static for each in episodes])
        GridEpisode.draw(episodes, placements, planes)
        return planes.astype(np.float32) / _LEVELS

    @staticmethod
    def draw(
        episodes: Sequence["GridEpisode"],
        placements: Sequence[LayoutState],
        planes: NDArray[np.uint8],
    ) -> None:
        """Draw the planes that change over the constant ones, 255 for 1.

        Args:
            episodes: The episodes.
            placements: The modules placed so far in each.
            planes: All planes (episodes, channels, rows, columns), changed in place.
        """
        channels = episodes[0].channels
        legal = np.array([each.legal for each in placements])
        uniform, on_cells = stock_shares(placements), cells_shown(placements, legal)
        names, cell_names = ["stock_share", "stock", "budget_share"], ["barrier", "free"]
        if BARRIER_HEIGHT in channels:
            left, of_items = items_placed(placements, legal)
            uniform = np.hstack((uniform, left))
            names += episodes[0].ending(":left")
            on_cells = np.concatenate((on_cells, of_items), axis=1)
            cell_names += [BARRIER_HEIGHT, "stops_vehicles", *episodes[0].ending(":legal")]
        planes[:, [channels.index(each) for each in names]] = _levels(uniform)[..., None, None]
        numbers = [channels.index(each) for each in cell_names]
        levels = _levels(on_cells)
        for own, of_cells, whole, each, placement in zip(
            planes, levels, on_cells, episodes, placements, strict=True
        ):
            if each.zone.squares is None:
                own[numbers] = _levels(each.zone.plane(whole))
            else:
                own[numbers, *each.zone.squares] = of_cells
            if REACH in channels:
                own[channels.index(REACH)] = _levels(each.vehicles.reached(placement.layout))

    def ending(self, ending: str) -> tuple[str, ...]:
        """Return the names of the planes with an ending, in their order."""
        return tuple(name for name in self.channels if name.endswith(ending))

    def show(self, planes: NDArray[np.uint8], names: Sequence[str], values: NDArray[Any]) -> None:
        """Set some of the planes to values from 0 to 1, in steps of 1/255; larger ones become 1.

        Args:
            planes: All planes (channels, rows, columns), changed in place.
            names: Names of the planes to set.
            values: (names, rows, columns), or (names,) for planes with one value everywhere.
        """
        shape = values.shape if values.ndim == 3 else (*values.shape, 1, 1)
        levels = _levels(values).reshape(shape)
        planes[[self.channels.index(name) for name in names]] = levels


_LEVELS: Final = np.float32(255.0)


def _levels(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Return values from 0 to 1 in steps of 1/255; larger ones become 1."""
    shares = np.minimum(values.astype(np.float32), np.float32(1.0))
    return np.rint(_LEVELS * shares).astype(np.uint8)


def _structure_planes(grid: SiteGrid, scenario: Scenario) -> tuple[Plane, Plane, Plane]:
    """Return planes of the protected structures by weight, the others, and the heights of all."""
    protected, others, heights = np.zeros((3, grid.rows, grid.columns), dtype=np.float32)
    weights = [structure.weight for structure in scenario.structures if structure.protected]
    for structure in scenario.structures:
        covered = np.sum([grid.rectangle(box) for box in structure.boxes_m], axis=0)
        below = 0.0 if is_open_below(structure, scenario.structures) else structure.base_m
        rise = height_share(structure.height_m) - height_share(below)  # on top of a terrace
        heights += np.float32(rise) * covered
        if structure.protected:
            protected += np.float32(structure.weight / max(weights)) * covered
        else:
            others += covered
    return protected, others, heights


def _charge_plane(grid: SiteGrid, sources: tuple[AnySource, ...]) -> Plane:
    total_weight = sum(source.weight for source in sources)
    likely = np.zeros((grid.rows, grid.columns), dtype=np.float32)
    heavy = np.zeros_like(likely)
    for source in sources:
        share = np.float32(source.weight / total_weight) * grid.source(source)
        likely += share
        heavy += np.float32(charge_share(source.tnt_kg)) * share
    mean_share = np.divide(heavy, likely, out=np.zeros_like(heavy), where=likely > 0.0)
    plane: Plane = np.sqrt(likely / likely.max()) * mean_share
    return plane


LEAST_IMAGE_SIDE: Final = 36
"""Least length of an image's shorter side, pixels: the convolutions of the usual network of image
policies (Mnih et al. 2015), with kernels of 8, 4 and 3, need as many."""


@dataclass(frozen=True)
class ImageObservation:
    """The planes of `GridObservation` as an image: uint8 (height, width, channels), 255 for 1.

    Image policies such as `CnnPolicy` of stable-baselines3 take it without a custom network.
    A pixel is a square of 0.5 m. Row 0 and column 0 of the image are those of the planes. Rows and
    columns of zeros follow after the site, until both sides have at least 36 pixels and more than
    there are channels, so that libraries guess the order of axes correctly.

    Attributes:
        planes: The observation that gives the planes.
    """

    planes: GridObservation = field(default_factory=GridObservation)

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space: (height, width, channels)."""
        rows, columns = squares_of(scenario.site)
        channels = len(self.planes.channels_of(scenario))
        least = max(LEAST_IMAGE_SIDE, channels + 1)
        return spaces.Box(0, 255, (max(rows, least), max(columns, least), channels), np.uint8)

    def episode(self, observable: Observable) -> "ImageEpisode":
        """Draw the planes that do not change."""
        shape = self.space(observable.scenario).shape
        assert shape is not None
        planes = self.planes.episode(observable)
        static = np.zeros((*shape[:2], len(planes.static)), dtype=np.uint8)
        _, rows, columns = planes.static.shape
        static[:rows, :columns] = np.moveaxis(planes.static, 0, -1)
        return ImageEpisode(planes, static)


@dataclass(frozen=True, eq=False)
class ImageEpisode(BatchedObservation):
    """The images of one episode.

    Attributes:
        planes: The planes of the episode.
        static: The image of the constant planes (height, width, channels).
    """

    planes: GridEpisode
    static: NDArray[np.uint8]

    @staticmethod
    def observe_many(
        episodes: Sequence["ImageEpisode"], placements: Sequence[LayoutState]
    ) -> NDArray[np.uint8]:
        """Return the images of several episodes (episodes, height, width, channels)."""
        images = np.array([each.static for each in episodes])
        _, rows, columns = episodes[0].planes.static.shape
        planes = np.moveaxis(images[:, :rows, :columns], -1, 1)
        GridEpisode.draw([each.planes for each in episodes], placements, planes)
        return images


# ---- A vector.

MOST_STRUCTURES: Final = 8
"""Most structures that fit the vector."""

_BESIDES_PLACES: Final = 3 + 6 + 2
_FIXED: Final = _BESIDES_PLACES + MOST_STRUCTURES * 6


@dataclass(frozen=True)
class FeaturesObservation:
    """A vector of float32 from 0 to 1; x is divided by the site's width, y by its height.

    | from | length | values |
    |---|---|---|
    | 0 | 3 | modules left / modules at first; modules left / 100, at most 1; budget left / budget |
    | 3 | 4 | left, bottom, right, top of the smallest box around places of the charge |
    | 7 | 2 | least and largest possible mass of the charge, (mass / 1000 kg)^(1/3), at most 1 |
    | 9 | 2 | x and y of the lower left corner of the build zone |
    | 11 | 8 x 6 | of each structure: left, bottom, right, top; 1; its weight / the largest weight |
    | 59 | cells | 1 where a module stands, row by row |
    | 59 + cells | cells | 1 where a module may be placed now, row by row |
    | 59 + 2 cells | cells | cost of a module / the highest, row by row |

    Protected structures come first, in the order of the scenario. The weight of other structures
    is 0, and unused places for structures have six zeros.

    If the build zone has a catalogue, more values follow; heights are shares of 12 m, and the
    values of cells are row by row:

    | length | values |
    |---|---|
    | 8 | height of each structure, in the order above; 1 where it is as high as the air |
    | items | height of each item |
    | items | cost of each item / the budget (or the dearest item's cost), at most 1 |
    | items | pieces of each item that may still be placed / pieces at first |
    | cells | height of the module on a cell |
    | cells | 1 where a module stops vehicles |
    | variants x cells | 1 where a piece may have its lower left cell now, variant by variant |

    If the scenario has a vehicle, the box from 3 on encloses its entries. For such scenarios, and
    for those drawn among others with a vehicle, one more value comes last: the stand-off of the
    vehicle with the modules placed so far, as a share of the site's diagonal; 1 without a vehicle.
    """

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space: (features,)."""
        zone, catalogue = scenario.zone, scenario.zone.catalogue
        cells = zone.rows * zone.columns
        length = _FIXED + 3 * cells + bool(scenario.vehicles)
        if catalogue.has_items:
            length += (
                MOST_STRUCTURES + 3 * len(catalogue.names) + (2 + len(catalogue.variants)) * cells
            )
        return spaces.Box(0.0, 1.0, (length,), np.float32)

    def episode(self, observable: Observable) -> "FeaturesEpisode":
        """Compute the constant values.

        Raises:
            BlastEnvError: If the scenario has more than `MOST_STRUCTURES` structures.
        """
        scenario, zone = observable.scenario, observable.scenario.zone
        structures = _structures(scenario)
        charge = _charge_and_corner(scenario, observable.sources)
        site = (charge, structures[:, :-1].ravel())
        items = (structures[:, -1], *item_values(zone)) if zone.items else ()
        return FeaturesEpisode(
            np.concatenate(site),
            cost_shares(scenario),
            np.concatenate((*items, [])),
            VehicleView.of(scenario, observable.sources),
            observable.shows_vehicles,
        )


@dataclass(frozen=True, eq=False)
class FeaturesEpisode(BatchedObservation):
    """The vector of one episode.

    Attributes:
        site: Values of charge, corner of the build zone and structures (56,).
        costs: Costs of the cells (rows, columns).
        items: Heights of structures and items and costs of items; empty without a catalogue.
        vehicles: The observable vehicles.
        shows_vehicles: Whether the stand-off is the last value; 1 without a vehicle.
    """

    site: FloatArray
    costs: FloatArray
    items: FloatArray
    vehicles: VehicleView
    shows_vehicles: bool

    @staticmethod
    def observe_many(
        episodes: Sequence["FeaturesEpisode"], placements: Sequence[LayoutState]
    ) -> Array:
        """Return the vectors of several episodes (episodes, features)."""
        legal = np.array([each.legal for each in placements])
        parts: list[NDArray[Any]] = [
            stock_shares(placements),
            np.array([each.site for each in episodes]),
        ]
        parts += [cells_shown(placements, legal), np.array([each.costs for each in episodes])]
        parts.append(np.array([each.items for each in episodes]))
        if placements[0].catalogue.has_items:
            parts += items_placed(placements, legal)
        if episodes[0].shows_vehicles:
            pairs = zip(episodes, placements, strict=True)
            parts.append(np.stack([_stand_off(each.vehicles, own.layout) for each, own in pairs]))
        return _joined(parts)


def _joined(parts: Sequence[NDArray[Any]]) -> Plane:
    """Return values of several episodes (episodes, ...) as vectors (episodes, n), from 0 to 1."""
    rows = [each.reshape(len(each), -1) for each in parts]
    joined: Plane = np.concatenate(rows, axis=1, dtype=np.float32, casting="unsafe")
    return np.clip(joined, 0.0, 1.0, out=joined)


def _structures(scenario: Scenario) -> FloatArray:
    """Return left, bottom, right, top, 1, weight and height of each structure, as shares.

    The shape is (MOST_STRUCTURES, 7), with the protected ones first.
    """
    structures = sorted(scenario.structures, key=lambda structure: not structure.protected)
    if len(structures) > MOST_STRUCTURES:
        raise BlastEnvError(
            f"scenario {scenario.name!r} has {len(structures)} structures, the observation"
            f" 'features' has room for {MOST_STRUCTURES}: use 'grid'"
        )
    largest = max((each.weight for each in structures if each.protected), default=1.0)
    width_m, height_m = scenario.site.width_m, scenario.site.height_m
    rows = np.zeros((MOST_STRUCTURES, 7))
    for row, each in zip(rows, structures, strict=False):
        left, bottom, right, top = each.rectangle_m
        row[:4] = left / width_m, bottom / height_m, right / width_m, top / height_m
        row[4:] = 1.0, each.weight / largest if each.protected else 0.0, height_share(each.height_m)
    return rows


# ---- A dictionary.


@dataclass(frozen=True)
class DictObservation:
    """Planes, a vector and the mask of legal actions, for policies with several inputs.

    | key | space |
    |---|---|
    | `planes` | those of `ImageObservation` |
    | `vector` | float32 from 0 to 1, see below |
    | `action_mask` | `MultiBinary(actions)`, added by the environment: `info["action_mask"]` |

    The vector has the values that belong to no place: x is divided by the site's width, y by its
    height.

    | from | length | values |
    |---|---|---|
    | 0 | 3 | modules left / modules at first; modules left / 100, at most 1; budget left / budget |
    | 3 | 4 | left, bottom, right, top of the smallest box around places of the charge |
    | 7 | 2 | least and largest possible mass of the charge, (mass / 1000 kg)^(1/3), at most 1 |
    | 9 | 2 | x and y of the lower left corner of the build zone |
    | 11 | items | with a catalogue: height of each item |
    | | items | cost of each item / the budget (or the dearest item's cost), at most 1 |
    | | items | pieces of each item that may still be placed / pieces at first |
    | last | 1 | with vehicles: stand-off / the site's diagonal, as in `FeaturesObservation` |

    Attributes:
        planes: The observation that gives the planes.
    """

    planes: ImageObservation = field(default_factory=ImageObservation)

    def space(self, scenario: Scenario) -> spaces.Space[Any]:
        """Return the space, without the mask."""
        items = scenario.zone.catalogue
        length = _BESIDES_PLACES + 3 * len(items.names) * items.has_items + bool(scenario.vehicles)
        vector = spaces.Box(0.0, 1.0, (length,), np.float32)
        return spaces.Dict({"planes": self.planes.space(scenario), "vector": vector})

    def episode(self, observable: Observable) -> "DictEpisode":
        """Compute the constant values."""
        scenario, sources = observable.scenario, observable.sources
        items = item_values(scenario.zone) if scenario.zone.items else ()
        return DictEpisode(
            self.planes.episode(observable),
            np.concatenate((_charge_and_corner(scenario, sources), *items)),
            VehicleView.of(scenario, sources),
            observable.shows_vehicles,
        )


@dataclass(frozen=True, eq=False)
class DictEpisode(BatchedObservation):
    """The dictionaries of one episode.

    Attributes:
        planes: The images of the episode.
        site: Values of charge, corner of the build zone and items.
        vehicles: The observable vehicles.
        shows_vehicles: Whether the stand-off is the last value.
    """

    planes: ImageEpisode
    site: FloatArray
    vehicles: VehicleView
    shows_vehicles: bool

    @staticmethod
    def observe_many(
        episodes: Sequence["DictEpisode"], placements: Sequence[LayoutState]
    ) -> dict[str, Array]:
        """Return planes and vectors of several episodes, with a leading axis (episodes, ...)."""
        parts = [stock_shares(placements), np.array([each.site for each in episodes])]
        if placements[0].catalogue.has_items:
            parts.append(items_left(placements))
        if episodes[0].shows_vehicles:
            pairs = zip(episodes, placements, strict=True)
            parts.append(np.stack([_stand_off(each.vehicles, own.layout) for each, own in pairs]))
        planes = ImageEpisode.observe_many([each.planes for each in episodes], placements)
        return {"planes": planes, "vector": _joined(parts)}


def _charge_and_corner(scenario: Scenario, sources: tuple[AnySource, ...]) -> FloatArray:
    """Return the box around the charge, its masses and the corner of the build zone (8,)."""
    size = np.array([scenario.site.width_m, scenario.site.height_m])
    boxes = np.array([source_bounds_m(source) for source in sources])
    charges = [charge_share(source.tnt_kg) for source in sources]
    return np.concatenate(
        (
            *(boxes[:, :2].min(axis=0) / size, boxes[:, 2:].max(axis=0) / size),
            *([min(charges), max(charges)], np.array(scenario.zone.corner_m) / size),
        )
    )


def _stand_off(vehicles: VehicleView, layout: Layout) -> FloatArray:
    """Return the stand-off as a share of the site's diagonal (1,)."""
    site = vehicles.scenario.site
    return np.array([vehicles.stand_off_m(layout) / hypot(site.width_m, site.height_m)])


OBSERVATIONS: Final[Mapping[str, Observation]] = MappingProxyType(
    {
        "dict": DictObservation(),
        "grid": GridObservation(),
        "image": ImageObservation(),
        "features": FeaturesObservation(),
    }
)
"""The observations, by their names."""

SINGLE_ARRAYS: Final = tuple(name for name in OBSERVATIONS if name != "dict")
"""Names of the observations that are a single array."""
