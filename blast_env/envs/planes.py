"""Observations as planes over the site: `grid` for own networks, `image` for image policies."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import ceil
from typing import Any, ClassVar, Final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.envs.observable import (
    Array,
    BatchObservation,
    Observable,
    Plane,
    cells_shown,
    charge_share,
    cost_shares,
    height_share,
    item_values,
    items_left,
    items_placed,
    stock_shares,
)
from blast_env.geometry import Rectangle
from blast_env.layout.batch import Placements
from blast_env.sections import PointM
from blast_env.site import AnySource, Catalogue, RectangleSource, Scenario
from blast_env.site.structures import is_open_below
from blast_env.units import MODULE_SIDE_M

_POINTS_PER_MODULE: Final = 8  # along a line of possible places of a charge


@dataclass(frozen=True)
class SiteGrid:
    """Planes of (rows, columns) squares of 0.5 m, as of `Site.squares`; row 0 is the lower edge.

    Attributes:
        rows: Number of squares upwards.
        columns: Number of squares to the right.
    """

    rows: int
    columns: int

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
        # As many points per module along a line that its plane is even.
        start, end = np.array(start_m), np.array(end_m)
        length_m = float(np.hypot(*(end - start)))
        count = 1 + _POINTS_PER_MODULE * ceil(length_m / MODULE_SIDE_M)
        share = (np.arange(count) + 0.5) / count
        points_m = start + share[:, np.newaxis] * (end - start)
        plane = np.zeros((self.rows, self.columns), dtype=np.float32)
        # Cloud in cell: the shares of a point in the four squares around it are linear in its
        # offset from their centres, so that their mean is the point (Hockney & Eastwood, Computer
        # Simulation Using Particles, 1988).
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
    variants = [
        f"{variant.name}:turned" if variant.turned else variant.name
        for variant in catalogue.variants
    ]
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
        shape = (len(self.channels_of(scenario)), *scenario.site.squares)
        return spaces.Box(0.0, 1.0, shape, np.float32)

    def episode(self, observable: Observable) -> "GridEpisode":
        """Draw the planes that do not change."""
        scenario, zone = observable.scenario, observable.scenario.zone
        grid = SiteGrid(*scenario.site.squares)
        channels = self.channels_of(scenario, observable.shows_vehicles)
        static = np.zeros((len(channels), grid.rows, grid.columns), dtype=np.uint8)
        lattice = grid.lattice(zone.corner_m, zone.rows, zone.columns)
        episode = GridEpisode(static, lattice, channels, observable)
        protected, others, heights = _structure_planes(grid, scenario)
        costs = lattice.plane(cost_shares(zone))
        charge = _charge_plane(grid, observable.sources)
        names = ("protected", "other_structures", "cost", "charge")
        episode.show(static, names, np.stack((protected, others, costs, charge)))
        if zone.items:
            episode.show(static, (STRUCTURE_HEIGHT,), heights[np.newaxis])
            for ending, values in zip((":height", ":cost"), item_values(zone), strict=True):
                episode.show(static, episode.ending(ending), values)
        if scenario.vehicles:
            episode.show(static, (EMPTY_REACH,), observable.reached(())[np.newaxis])
        return episode


@dataclass(frozen=True, eq=False)
class GridEpisode(BatchObservation):
    """The planes of one episode.

    Attributes:
        static: The constant planes (channels, rows, columns), 255 for 1; the others are 0.
        zone: Position of the build zone on the grid.
        channels: Names of the planes.
        observable: The observable part of the episode.
    """

    static: NDArray[np.uint8]
    zone: Lattice
    channels: tuple[str, ...]
    observable: Observable

    @staticmethod
    def observe_many(episodes: Sequence["GridEpisode"], placements: Placements) -> Plane:
        """Return the planes of several episodes (episodes, channels, rows, columns)."""
        planes = np.array([episode.static for episode in episodes])
        GridEpisode.draw(episodes, placements, planes)
        return planes.astype(np.float32) / _LEVELS

    @staticmethod
    def draw(
        episodes: Sequence["GridEpisode"],
        placements: Placements,
        planes: NDArray[np.uint8],
    ) -> None:
        """Draw the planes that change over the constant ones, 255 for 1.

        Args:
            episodes: The episodes.
            placements: The modules placed so far in each.
            planes: All planes (episodes, channels, rows, columns), changed in place.
        """
        # 1. Values that are the same everywhere, and values of cells.
        channels = episodes[0].channels
        uniform, on_cells = stock_shares(placements), cells_shown(placements)
        names, cell_names = ["stock_share", "stock", "budget_share"], ["barrier", "free"]
        if BARRIER_HEIGHT in channels:
            uniform = np.hstack((uniform, items_left(placements)))
            names += episodes[0].ending(":left")
            on_cells = np.concatenate((on_cells, items_placed(placements)), axis=1)
            cell_names += [BARRIER_HEIGHT, "stops_vehicles", *episodes[0].ending(":legal")]
        planes[:, [channels.index(name) for name in names]] = _levels(uniform)[..., None, None]
        # 2. Cells go to the squares of the site: straight where they fill one each, else by area.
        numbers = [channels.index(cell_name) for cell_name in cell_names]
        levels = _levels(on_cells)
        for position, (own, of_cells, whole, episode) in enumerate(
            zip(planes, levels, on_cells, episodes, strict=True)
        ):
            if episode.zone.squares is None:
                own[numbers] = _levels(episode.zone.plane(whole))
            else:
                own[numbers, *episode.zone.squares] = of_cells
            if REACH in channels:
                reached = episode.observable.reached(placements.layout(position))
                own[channels.index(REACH)] = _levels(reached)

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
    # Probability and mass of the charge: their product would hide which of both is small, so that a
    # square has the mean mass, weighed by the root of its probability.
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
        shape = _image_shape(len(self.planes.channels_of(scenario)), *scenario.site.squares)
        return spaces.Box(0, 255, shape, np.uint8)

    def episode(self, observable: Observable) -> "ImageEpisode":
        """Draw the planes that do not change."""
        planes = self.planes.episode(observable)
        static = np.zeros(_image_shape(*planes.static.shape), dtype=np.uint8)
        _, rows, columns = planes.static.shape
        static[:rows, :columns] = np.moveaxis(planes.static, 0, -1)
        return ImageEpisode(planes, static)


def _image_shape(channels: int, rows: int, columns: int) -> tuple[int, int, int]:
    """Return the shape of the image of some planes, with both sides long enough."""
    least = max(LEAST_IMAGE_SIDE, channels + 1)
    return max(rows, least), max(columns, least), channels


@dataclass(frozen=True, eq=False)
class ImageEpisode(BatchObservation):
    """The images of one episode.

    Attributes:
        planes: The planes of the episode.
        static: The image of the constant planes (height, width, channels).
    """

    planes: GridEpisode
    static: NDArray[np.uint8]

    @staticmethod
    def observe_many(
        episodes: Sequence["ImageEpisode"], placements: Placements
    ) -> NDArray[np.uint8]:
        """Return the images of several episodes (episodes, height, width, channels)."""
        images = np.array([episode.static for episode in episodes])
        _, rows, columns = episodes[0].planes.static.shape
        planes = np.moveaxis(images[:, :rows, :columns], -1, 1)
        GridEpisode.draw([episode.planes for episode in episodes], placements, planes)
        return images
