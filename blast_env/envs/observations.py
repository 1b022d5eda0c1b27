"""What an agent sees: the observations and what they are made of."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, Final, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.envs.item_observations import (
    CHANGING_SITE,
    STRUCTURE_HEIGHT,
    ItemChannels,
    PlacedItems,
    height_share,
    item_costs,
    item_heights,
    items_left,
)
from blast_env.envs.site_grid import Lattice, Plane, SiteGrid
from blast_env.envs.vehicle_observations import (
    EMPTY_REACH,
    REACH,
    VehicleView,
    vehicle_channels,
)
from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import draw_threats
from blast_env.evaluation.evaluator import Evaluators
from blast_env.geometry import Rectangle
from blast_env.scenario import AnySource, Placement, Scenario
from blast_env.scenario.models import AnyStructure
from blast_env.scenario.zone import source_bounds_m

Array = NDArray[Any]
"""An observation; its data type is that of the space."""


FULL_CHARGE_KG: Final = 1000.0
"""TNT-equivalent mass that is shown as 1; larger ones as well."""


FULL_STOCK: Final = 100
"""Number of modules in stock that is shown as 1; larger ones as well."""


class ModuleLoads(Protocol):
    """Gives the loads on the structures without a barrier, at the cost of blasts."""

    def __call__(
        self, scenario: Scenario, sources: tuple[AnySource, ...], blasts: int
    ) -> NDArray[np.float64]:
        """Return the load on each module of the structures without a barrier.

        Args:
            scenario: The scenario.
            sources: Where the charge is, or may be.
            blasts: How many blasts the loads are the mean of.

        Returns:
            Simulation units (modules,), in the order of the scenario's structures, row by row.
        """


@dataclass(frozen=True)
class SimulatedModuleLoads:
    """Loads of blasts of charges from the sources, with seeds from 0 on.

    Those are not the blasts that the layout is assessed with.

    Attributes:
        evaluators: Run the blasts; nothing is asked of them before the loads are.
    """

    evaluators: Evaluators

    def __call__(
        self, scenario: Scenario, sources: tuple[AnySource, ...], blasts: int
    ) -> NDArray[np.float64]:
        """Return the mean load on each module, simulation units (modules,)."""
        threats = draw_threats(scenario.model_copy(update={"charge": sources}), range(blasts))
        loads = self.evaluators.of(scenario).loads_of_many([((), threat) for threat in threats])
        mean: NDArray[np.float64] = np.mean([each.module_impulse_sim for each in loads], axis=0)
        return mean


@dataclass(frozen=True, eq=False)
class Observable:
    """What may be observed of an episode before the charge goes off.

    Observations are made from this and from what has been placed so far, so that nothing else can
    slip into them: with a hidden threat, `sources` are those of the scenario.

    Attributes:
        scenario: The scenario.
        sources: Where the charge is, or may be.
        module_loads: For observations that show loads; they alone need an engine and a
            calibration, and only they call it.
        among_vehicles: Whether other scenarios of the environment have vehicles, so that this one
            shows that it has none.
    """

    scenario: Scenario
    sources: tuple[AnySource, ...]
    module_loads: ModuleLoads | None = None
    among_vehicles: bool = False

    @property
    def shows_vehicles(self) -> bool:
        """Whether observations have values for vehicles."""
        return self.among_vehicles or bool(self.scenario.vehicles)

    def unprotected_loads(self, blasts: int) -> NDArray[np.float64]:
        """Return the load on each module of the structures without a barrier.

        Args:
            blasts: How many blasts the loads are the mean of.

        Raises:
            BlastEnvError: If there is nothing that gives them.
        """
        if self.module_loads is None:
            raise BlastEnvError("module_loads is None, must be given for what shows the loads")
        return self.module_loads(self.scenario, self.sources, blasts)


class EpisodeObservation(Protocol):
    """Observes one episode."""

    def observe(self, placement: Placement) -> Array:
        """Return a fresh array in the space, for the modules placed so far."""


class Observation(Protocol):
    """A kind of observation."""

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space, a `Box` that depends on site, build zone and catalogue alone.

        On their sizes, and on names and sizes of the items.
        """

    def episode(self, observable: Observable) -> EpisodeObservation:
        """Prepare the observations of an episode; what does not change is worked out here."""


def charge_share(tnt_kg: float) -> float:
    """Return a charge's mass as it is shown: (mass / 1000 kg)^(1/3), at most 1.

    The cube root, because distances scale with it (Hopkinson and Cranz): a charge of eight times
    the mass acts as one of the same mass at half the distance.
    """
    return float(min((tnt_kg / FULL_CHARGE_KG) ** (1.0 / 3.0), 1.0))


def stock_shares(placement: Placement) -> tuple[float, float, float]:
    """Return what there is left to build with, each from 0 to 1.

    Returns:
        The share of the stock, the number of modules or pieces as a share of 100 (at most 1), and
        the share of the budget (1 without a budget).
    """
    zone = placement.scenario.zone
    left, budget_left = placement.stock_left, placement.budget_left
    of_budget = 1.0 if zone.budget is None or budget_left is None else budget_left / zone.budget
    return left / zone.stock, min(left / FULL_STOCK, 1.0), of_budget


def occupied_cells(placement: Placement) -> NDArray[np.bool_]:
    """Return which cells of the build zone hold a module, shape (rows, columns)."""
    occupied = np.zeros(placement.usable.shape, dtype=bool)
    if placement.cells:
        occupied[tuple(np.array(placement.cells).T)] = True
    return occupied


def cost_shares(scenario: Scenario) -> NDArray[np.float64]:
    """Return the cost of building on each cell as a share of the highest, (rows, columns)."""
    costs = Placement.empty(scenario).module_costs
    shares: NDArray[np.float64] = costs / costs.max()
    return shares


@dataclass(frozen=True)
class GridObservation:
    """Planes of (rows, columns) squares of 0.5 m over the site, float32 from 0 to 1.

    Row 0 is the lower edge of the site and column 0 the left one, as in the build zone. Whatever
    lies on the 0.5 m grid fills whole squares; what does not is shown by the share of a square
    that it covers.

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

    `charge`: the square root of (how likely the charge is in a square / the largest such value),
    times (mass / 1000 kg)^(1/3), at most 1. A visible charge fills the squares around its centre,
    up to four, and the largest value tells its mass. A hidden one fills all squares where it may
    be, and where it may have different masses, their mean counts; the root lets wide areas be
    seen beside single points.

    Where the build zone has a catalogue, planes follow the ones above (`channels_of`); heights
    are shares of 12 m, and what has the same value everywhere is marked =:

    | plane | value, from 0 to 1 |
    |---|---|
    | `structure_height` | height of the structure here, 1 where it is as high as the air |
    | `<item>:height`, for each item | its height = |
    | `<item>:cost`, for each item | its cost / the budget (or the dearest item's), at most 1 = |
    | `barrier_height` | height of the module that stands here |
    | `stops_vehicles` | 1 where a module stands that stops vehicles |
    | `<item>:left`, for each item | pieces that may still be placed / pieces at first = |
    | `<item>:legal`, `<item>:turned:legal` | 1 where a piece may have its lower left cell now |

    Where the scenario has a vehicle, or is drawn among others that have, two planes come last
    (empty without a vehicle). The plane `charge` shows where it
    enters, whether the threat is visible or hidden: where it goes off is up to the layout.

    | plane | value |
    |---|---|
    | `reach_without_barrier` | 1 where the vehicle gets to on the empty site |
    | `reach` | 1 where it gets to with what stands so far |

    Values are in steps of 1/255, as in `ImageObservation`. They are no whole numbers, because
    stable-baselines3 takes those for an image whose order of axes it guesses from their sizes, and
    may then learn on planes that it has turned. So convolutions of your own see the same planes in
    every library; image policies take `"image"`.
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
            shows_vehicles: Whether those of vehicles are there; if it has some, unless given.
        """
        items = ItemChannels.of(scenario.zone.catalogue).all
        shown = bool(scenario.vehicles) if shows_vehicles is None else shows_vehicles
        return (*self.channels, *items, *vehicle_channels(shown))

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space: (channels, rows, columns)."""
        grid = SiteGrid.of(scenario.site)
        shape = (len(self.channels_of(scenario)), grid.rows, grid.columns)
        return spaces.Box(0.0, 1.0, shape, np.float32)

    def episode(self, observable: Observable) -> "GridEpisode":
        """Draw the planes that do not change."""
        grid = SiteGrid.of(observable.scenario.site)
        scenario, zone = observable.scenario, observable.scenario.zone
        lattice = grid.lattice(zone.corner_m, zone.rows, zone.columns)
        protected, others = _structure_planes(grid, scenario)
        planes = {
            "protected": protected,
            "other_structures": others,
            "cost": lattice.plane(cost_shares(scenario)),
            "charge": _charge_plane(grid, observable.sources),
        }
        items = ItemChannels.of(zone.catalogue)
        if zone.items:
            whole = np.ones((grid.rows, grid.columns), dtype=np.float32)
            planes[STRUCTURE_HEIGHT] = _height_plane(grid, scenario)
            names = (*items.heights, *items.costs)
            values = np.concatenate([item_heights(zone), item_costs(zone)]).astype(np.float32)
            planes |= {name: value * whole for name, value in zip(names, values, strict=True)}
        vehicles = VehicleView.of(scenario, observable.sources)
        if scenario.vehicles:
            planes[EMPTY_REACH] = vehicles.reached(()).astype(np.float32)
        channels = self.channels_of(scenario, observable.shows_vehicles)
        static = np.zeros((len(channels), grid.rows, grid.columns), dtype=np.float32)
        for name, plane in planes.items():
            static[channels.index(name)] = _in_steps(plane)
        return GridEpisode(static, lattice, channels, items, vehicles)


@dataclass(frozen=True)
class GridWithLoadObservation(GridObservation):
    """`GridObservation` with one more plane: the loads on the structures without a barrier.

    Channel 9, `unprotected_load`, has the impulse on each module divided by the largest one: the
    mean of blasts with seeds of their own, of the charge that is visible or of charges drawn from
    where a hidden one may be. The blasts are run at `reset`, once a charge, or once a scenario
    where the charge is hidden.

    Attributes:
        blasts: How many blasts the loads are the mean of.
    """

    blasts: int = 4
    channels: ClassVar[tuple[str, ...]] = (*GridObservation.channels, "unprotected_load")

    def episode(self, observable: Observable) -> "GridEpisode":
        """Draw the planes that do not change, with the loads."""
        episode = super().episode(observable)
        grid = SiteGrid.of(observable.scenario.site)
        impulses = observable.unprotected_loads(self.blasts)
        shares = impulses / max(impulses.max(), np.finfo(float).tiny)
        plane = np.zeros((grid.rows, grid.columns), dtype=np.float32)
        first = 0
        for structure in observable.scenario.structures:
            modules = structure.rows * structure.columns
            values = shares[first : first + modules].reshape(structure.rows, structure.columns)
            plane += grid.lattice(structure.corner_m, structure.rows, structure.columns).plane(
                values
            )
            first += modules
        episode.static[self.channels.index("unprotected_load")] = _in_steps(plane)
        return episode


_LEVELS: Final = np.float32(255.0)


LEAST_IMAGE_SIDE: Final = 36
"""Pixels of an image's shorter side, at least: fewer are too few for the convolutions of the
network that most image policies have (Mnih et al. 2015), with kernels of 8, 4 and 3."""


@dataclass(frozen=True)
class ImageObservation:
    """The planes of `GridObservation` as an image: uint8 (height, width, channels), 255 for 1.

    What image policies take as it is: stable-baselines3's `CnnPolicy`, with no network of your
    own. A pixel is a square of 0.5 m. Row 0 and column 0 of the image are those of the planes.
    Rows and columns of zeros follow after the site, until both sides are at least 36 pixels and
    longer than there are channels: by that libraries that guess the order of axes find it.

    Attributes:
        planes: The planes.
    """

    planes: GridObservation = field(default_factory=GridObservation)

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space: (height, width, channels)."""
        shape = self.planes.space(scenario).shape
        assert shape is not None
        channels, rows, columns = shape
        least = max(LEAST_IMAGE_SIDE, channels + 1)
        return spaces.Box(0, 255, (max(rows, least), max(columns, least), channels), np.uint8)

    def episode(self, observable: Observable) -> "ImageEpisode":
        """Draw the planes that do not change."""
        shape = self.space(observable.scenario).shape
        assert shape is not None
        return ImageEpisode(self.planes.episode(observable), shape[:2])


@dataclass(frozen=True, eq=False)
class ImageEpisode:
    """The images of one episode.

    Attributes:
        planes: Gives the planes.
        size: Height and width of the image, pixels.
    """

    planes: "GridEpisode"
    size: tuple[int, ...]

    def observe(self, placement: Placement) -> NDArray[np.uint8]:
        """Return the image for the modules placed so far, (height, width, channels)."""
        planes = np.moveaxis(self.planes.observe(placement), 0, -1)
        rows, columns, channels = planes.shape
        image = np.zeros((*self.size, channels), dtype=np.uint8)
        image[:rows, :columns] = np.rint(_LEVELS * planes)
        return image


@dataclass(frozen=True, eq=False)
class GridEpisode:
    """The planes of one episode.

    Attributes:
        static: What does not change (channels, rows, columns); the rest is 0.
        zone: Where the build zone lies on the grid.
        channels: Names of the planes.
        items: Names of those of the catalogue.
        vehicles: The vehicles that may be seen.
    """

    static: Plane
    zone: Lattice
    channels: tuple[str, ...]
    items: ItemChannels
    vehicles: VehicleView

    def observe(self, placement: Placement) -> Plane:
        """Return all planes for the modules placed so far, (channels, rows, columns)."""
        planes = self.static.copy()
        cells = np.stack((occupied_cells(placement), placement.free))
        planes[self._of("barrier", "free")] = _in_steps(self.zone.plane(cells))
        shares = np.array(stock_shares(placement), dtype=np.float32)
        same = _in_steps(shares)[:, np.newaxis, np.newaxis]
        planes[self._of("stock_share", "stock", "budget_share")] = same
        if self.items.all:
            self._show_items(planes, placement)
        if REACH in self.channels:
            reached = self.vehicles.reached(placement.layout)
            planes[self.channels.index(REACH)] = _in_steps(reached.astype(np.float32))
        return planes

    def _show_items(self, planes: Plane, placement: Placement) -> None:
        """Fill in what changes of the planes of the catalogue."""
        placed = PlacedItems.of(placement)
        cells = np.concatenate(([placed.heights, placed.stops_vehicles], placement.legal))
        planes[self._of(*CHANGING_SITE, *self.items.legal)] = _in_steps(self.zone.plane(cells))
        left = _in_steps(items_left(placement).astype(np.float32))
        planes[self._of(*self.items.left)] = left[:, np.newaxis, np.newaxis]

    def _of(self, *names: str) -> list[int]:
        return [self.channels.index(name) for name in names]


def _in_steps(values: Plane) -> Plane:
    """Return values from 0 to 1 in steps of 1/255; what is larger counts as 1."""
    steps = np.rint(_LEVELS * np.minimum(values, np.float32(1.0))) / _LEVELS
    return steps.astype(np.float32, copy=False)


def _structure_planes(grid: SiteGrid, scenario: Scenario) -> tuple[Plane, Plane]:
    """Return the planes of the protected structures, by weight, and of the others."""
    protected, others = np.zeros((2, grid.rows, grid.columns), dtype=np.float32)
    weights = [structure.weight for structure in scenario.structures if structure.protected]
    for structure in scenario.structures:
        covered = grid.rectangle(structure.rectangle_m)
        if structure.protected:
            protected += np.float32(structure.weight / max(weights)) * covered
        else:
            others += covered
    return protected, others


def _height_plane(grid: SiteGrid, scenario: Scenario) -> Plane:
    """Return the heights of the structures as shares of 12 m."""
    heights: Plane = np.zeros((grid.rows, grid.columns), dtype=np.float32)
    for structure in scenario.structures:
        share = np.float32(height_share(structure.height_m))
        heights += share * grid.rectangle(structure.rectangle_m)
    return heights


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


MOST_STRUCTURES: Final = 8
"""Structures that the vector has room for."""


_PER_STRUCTURE: Final = 6


_FIXED: Final = 3 + 6 + 2 + MOST_STRUCTURES * _PER_STRUCTURE


@dataclass(frozen=True)
class FeaturesObservation:
    """A vector of float32 from 0 to 1; x is divided by the site's width, y by its height.

    | from | length | what |
    |---|---|---|
    | 0 | 3 | modules left / modules at first; modules left / 100, at most 1; budget left / budget |
    | 3 | 4 | left, bottom, right, top of the smallest box around where the charge is or may be |
    | 7 | 2 | least and largest mass that the charge may have, (mass / 1000 kg)^(1/3), at most 1 |
    | 9 | 2 | x and y of the lower left corner of the build zone |
    | 11 | 8 x 6 | of each structure: left, bottom, right, top; 1; its weight / the largest weight |
    | 59 | cells | 1 where a module stands, row by row |
    | 59 + cells | cells | 1 where a module may be placed now, row by row |
    | 59 + 2 cells | cells | cost of a module / the highest, row by row |

    Protected structures come first, in the order of the scenario. The weight of another structure
    is 0, and all six values are 0 where there is no structure.

    Where the build zone has a catalogue, more values follow; heights are shares of 12 m, and the
    values of cells are row by row:

    | length | what |
    |---|---|
    | 8 | height of each structure, in the order above; 1 where it is as high as the air |
    | items | height of each item |
    | items | cost of each item / the budget (or the dearest item's cost), at most 1 |
    | items | pieces of each item that may still be placed / pieces at first |
    | cells | height of the module that stands on a cell |
    | cells | 1 where a module stands that stops vehicles |
    | variants x cells | 1 where a piece may have its lower left cell now, variant by variant |

    Where the scenario has a vehicle, the box from 3 on is around where it enters. There, and in
    scenarios that are drawn among others with a vehicle, one more value comes last: how near it
    comes to a protected structure with what stands so far, as a share of the site's diagonal; 1
    without a vehicle.
    """

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space: (features,)."""
        zone, catalogue = scenario.zone, scenario.zone.catalogue
        cells = zone.rows * zone.columns
        length = _FIXED + 3 * cells
        if catalogue.has_items:
            length += MOST_STRUCTURES + 3 * len(zone.items) + (2 + len(catalogue.variants)) * cells
        length += bool(scenario.vehicles)
        return spaces.Box(0.0, 1.0, (length,), np.float32)

    def episode(self, observable: Observable) -> "FeaturesEpisode":
        """Work out the values that do not change.

        Raises:
            BlastEnvError: If the scenario has more structures than there is room for.
        """
        scenario, zone = observable.scenario, observable.scenario.zone
        size = np.array([scenario.site.width_m, scenario.site.height_m])
        boxes = np.array([source_bounds_m(source) for source in observable.sources])
        charges = [charge_share(source.tnt_kg) for source in observable.sources]
        fixed = [
            np.zeros(3),
            boxes[:, :2].min(axis=0) / size,
            boxes[:, 2:].max(axis=0) / size,
            [min(charges), max(charges)],
            np.array(zone.corner_m) / size,
            _structures(scenario).ravel(),
            np.zeros(2 * zone.rows * zone.columns),
            cost_shares(scenario).ravel(),
        ]
        if zone.items:
            changing = (
                len(zone.items) + (2 + len(zone.catalogue.variants)) * zone.rows * zone.columns
            )
            fixed += [_structure_heights(scenario), item_heights(zone), item_costs(zone)]
            fixed.append(np.zeros(changing))
        if observable.shows_vehicles:
            fixed.append(np.zeros(1))
        values = np.concatenate(fixed).astype(np.float32)
        vehicles = VehicleView.of(scenario, observable.sources)
        return FeaturesEpisode(np.clip(values, 0.0, 1.0), vehicles, observable.shows_vehicles)


@dataclass(frozen=True, eq=False)
class FeaturesEpisode:
    """The vector of one episode.

    Attributes:
        static: What does not change (features,); the rest is 0.
        vehicles: The vehicles that may be seen.
        shows_vehicles: Whether the stand-off is the last value; 1 without a vehicle.
    """

    static: Array
    vehicles: VehicleView
    shows_vehicles: bool

    def observe(self, placement: Placement) -> Array:
        """Return all values for the modules placed so far, (features,)."""
        values = self.static.copy()
        values[:3] = stock_shares(placement)
        cells = placement.free.size
        values[_FIXED : _FIXED + cells] = occupied_cells(placement).ravel()
        values[_FIXED + cells : _FIXED + 2 * cells] = placement.free.ravel()
        ending = []
        if placement.catalogue.has_items:
            placed = PlacedItems.of(placement)
            ending += [items_left(placement), placed.heights, placed.stops_vehicles]
            ending.append(placement.legal)
        if self.shows_vehicles:
            ending.append(np.array([self.vehicles.stand_off_share(placement.layout)]))
        if ending:
            last = np.concatenate([each.ravel() for each in ending])
            values[-len(last) :] = last
        return values


def _structures(scenario: Scenario) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return the features of the structures, (MOST_STRUCTURES, 6)."""
    structures = _protected_first(scenario)
    if len(structures) > MOST_STRUCTURES:
        raise BlastEnvError(
            f"scenario {scenario.name!r} has {len(structures)} structures, the observation"
            f" 'features' has room for {MOST_STRUCTURES}: use 'grid'"
        )
    largest = max((each.weight for each in structures if each.protected), default=1.0)
    site = Rectangle(0.0, 0.0, scenario.site.width_m, scenario.site.height_m)
    rows = np.zeros((MOST_STRUCTURES, _PER_STRUCTURE))
    for row, structure in zip(rows, structures, strict=False):
        row[:] = _structure(structure, site, largest)
    return rows


def _structure_heights(scenario: Scenario) -> NDArray[np.float64]:
    """Return the heights of the structures, (MOST_STRUCTURES,)."""
    heights = np.zeros(MOST_STRUCTURES)
    structures = _protected_first(scenario)
    heights[: len(structures)] = [height_share(each.height_m) for each in structures]
    return heights


def _protected_first(scenario: Scenario) -> list[AnyStructure]:
    return sorted(scenario.structures, key=lambda structure: not structure.protected)


def _structure(structure: AnyStructure, site: Rectangle, largest_weight: float) -> list[float]:
    left, bottom, right, top = structure.rectangle_m
    weight = structure.weight / largest_weight if structure.protected else 0.0
    sides = [left / site.right, bottom / site.top, right / site.right, top / site.top]
    return [*sides, 1.0, weight]


OBSERVATIONS: Final[Mapping[str, Observation]] = MappingProxyType(
    {
        "grid": GridObservation(),
        "grid_with_load": GridWithLoadObservation(),
        "image": ImageObservation(),
        "features": FeaturesObservation(),
    }
)
"""The observations that have names."""
