"""The observation `"grid"`: planes over the site, for convolutional networks."""

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.envs.observation import (
    Array,
    Sight,
    charge_share,
    cost_shares,
    occupied_cells,
    stock_shares,
)
from blast_env.envs.scenario_source import zone_of
from blast_env.envs.site_grid import Lattice, Plane, SiteGrid
from blast_env.scenario import AnySource, Placement, Scenario

_PROTECTED, _OTHER, _COST, _CHARGE = 0, 1, 2, 3
_FIRST_CHANGING: Final = 4  # barrier, free, stock share, stock, budget


@dataclass(frozen=True)
class GridObservation:
    """Planes of (rows, columns) squares of 0.5 m over the site, uint8: 255 stands for 1.

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
    | 5 | `free` | 1 where a module may be placed now |
    | 6 | `stock_share` | modules left / modules at first, the same everywhere |
    | 7 | `stock` | modules left / 100, at most 1, the same everywhere |
    | 8 | `budget_share` | budget left / budget, 1 without a budget, the same everywhere |

    `charge`: the square root of (how likely the charge is in a square / the largest such value),
    times (mass / 1000 kg)^(1/3), at most 1. A visible charge fills the squares around its centre,
    up to four, and the largest value tells its mass. A hidden one fills all squares where it may
    be, and where it may have different masses, their mean counts; the root lets wide areas be
    seen beside single points.

    Whole numbers up to 255 are how stable-baselines3 knows an image: its `CnnPolicy` takes the
    planes as they are and divides by 255 itself. Its network wants sites of 18 m x 18 m or more.
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

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space: (channels, rows, columns)."""
        grid = SiteGrid.of(scenario.site)
        return spaces.Box(0, 255, (len(self.channels), grid.rows, grid.columns), np.uint8)

    def episode(self, sight: Sight) -> "GridEpisode":
        """Draw the planes that do not change."""
        grid = SiteGrid.of(sight.scenario.site)
        planes = np.zeros((len(self.channels), grid.rows, grid.columns), dtype=np.float32)
        _draw_structures(planes, grid, sight.scenario)
        zone = zone_of(sight.scenario)
        lattice = grid.lattice(zone.corner_m, zone.rows, zone.columns)
        planes[_COST] = lattice.plane(cost_shares(sight.scenario))
        planes[_CHARGE] = _charge_plane(grid, sight.sources)
        return GridEpisode(_levels(planes), lattice)


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

    def episode(self, sight: Sight) -> "GridEpisode":
        """Draw the planes that do not change, with the loads."""
        episode = super().episode(sight)
        grid = SiteGrid.of(sight.scenario.site)
        impulses = sight.unprotected_module_impulse_sim(self.blasts)
        shares = impulses / max(impulses.max(), np.finfo(float).tiny)
        plane = np.zeros((grid.rows, grid.columns), dtype=np.float32)
        first = 0
        for structure in sight.scenario.structures:
            modules = structure.rows * structure.columns
            values = shares[first : first + modules].reshape(structure.rows, structure.columns)
            plane += grid.lattice(structure.corner_m, structure.rows, structure.columns).plane(
                values
            )
            first += modules
        episode.static[-1] = _levels(plane)
        return episode


@dataclass(frozen=True, eq=False)
class GridEpisode:
    """The planes of one episode.

    Attributes:
        static: What does not change (channels, rows, columns); the rest is 0.
        zone: Where the build zone lies on the grid.
    """

    static: NDArray[np.uint8]
    zone: Lattice

    def observe(self, placement: Placement) -> NDArray[np.uint8]:
        """Return all planes for the modules placed so far, (channels, rows, columns)."""
        planes = self.static.copy()
        first = _FIRST_CHANGING
        cells = np.stack((occupied_cells(placement), placement.free))
        planes[first : first + 2] = _levels(self.zone.plane(cells))
        shares = np.array(stock_shares(placement), dtype=np.float32)
        planes[first + 2 : first + 5] = _levels(shares)[:, np.newaxis, np.newaxis]
        return planes


def _levels(values: Plane) -> NDArray[np.uint8]:
    """Return values from 0 to 1 as whole numbers from 0 to 255."""
    return np.rint(255.0 * np.minimum(values, 1.0)).astype(np.uint8)


def _draw_structures(planes: Plane, grid: SiteGrid, scenario: Scenario) -> None:
    weights = [structure.weight for structure in scenario.structures if structure.protected]
    for structure in scenario.structures:
        covered = grid.rectangle(structure.rectangle_m)
        if structure.protected:
            planes[_PROTECTED] += np.float32(structure.weight / max(weights)) * covered
        else:
            planes[_OTHER] += covered


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
