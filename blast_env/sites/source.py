"""Sites for an environment: disjoint sets of seeds for training and evaluation."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache, partial
from types import MappingProxyType
from typing import Final

import numpy as np

from blast_env.bundled import (
    COURT_SITES,
    HEADROOM_SITES,
    ITEM_SITES,
    KERB_SITES,
    LANE_SITES,
    LARGE_SITES,
    LOW_SITES,
    SITES,
    SQUARE_SITES,
    STREET_SITES,
)
from blast_env.errors import BlastEnvError
from blast_env.site import Scenario
from blast_env.sites.criterion import SiteCriterion
from blast_env.sites.generate import HELD_OUT_SITES, RANGES, generate_site
from blast_env.sites.headroom_sites import headroom_site
from blast_env.sites.item_sites import ItemSiteRanges, large_ranges
from blast_env.sites.kerb_sites import (
    court_site,
    kerb_site,
    lane_site,
    low_site,
    square_site,
    street_site,
)
from blast_env.sites.ranges import Ranges
from blast_env.values import MOST_SEED

FAMILIES: Final[Mapping[str, Ranges]] = MappingProxyType(
    {SITES: RANGES, ITEM_SITES: ItemSiteRanges(), LARGE_SITES: large_ranges()}
)
"""The named families of generated sites."""

SITE_KINDS: Final[Mapping[str, Callable[[int], Scenario]]] = MappingProxyType(
    {
        **{name: partial(generate_site, ranges=ranges) for name, ranges in FAMILIES.items()},
        KERB_SITES: kerb_site,
        STREET_SITES: street_site,
        COURT_SITES: court_site,
        SQUARE_SITES: square_site,
        LOW_SITES: low_site,
        LANE_SITES: lane_site,
        HEADROOM_SITES: headroom_site,
    }
)
"""What makes a site from its seed, by the name of its kind: the families, and kinds of any size."""

TRAINING_SITES: Final = 2**31
"""Default number of training seeds, practically unlimited."""

_MOST_LOOKED_AT: Final = 50


@dataclass(frozen=True)
class SiteSource:
    """A `ScenarioSource` of generated sites with consecutive seeds.

    Attributes:
        count: Number of sites, at least 1.
        criterion: Acceptance criterion; the family's default unless given.

    Raises:
        BlastEnvError: If a seed or the count is out of bounds.
    """

    first_seed: int
    count: int
    ranges: Ranges = RANGES
    criterion: SiteCriterion | None = None

    def __post_init__(self) -> None:
        """Check the seeds; see the class for the errors."""
        if self.count < 1:
            raise BlastEnvError(f"count is {self.count}, must be at least 1")
        last_seed = self.first_seed + self.count - 1
        if not 0 <= self.first_seed <= last_seed <= MOST_SEED:
            raise BlastEnvError(
                f"seeds are {self.first_seed} to {last_seed}, must be within 0 to {MOST_SEED}"
            )

    @classmethod
    def training(cls, count: int = TRAINING_SITES, ranges: Ranges = RANGES) -> "SiteSource":
        """Return the training sites.

        Args:
            count: Number of sites; small numbers serve to study generalisation.

        Raises:
            BlastEnvError: If the count is out of bounds.
        """
        return cls(HELD_OUT_SITES, count, ranges)

    @classmethod
    def held_out(cls, count: int = HELD_OUT_SITES, ranges: Ranges = RANGES) -> "SiteSource":
        """Return the first held-out sites, which training never uses, in a fixed order.

        Args:
            count: Number of sites, at most 10,000.

        Raises:
            BlastEnvError: If the count is out of bounds.
        """
        if count > HELD_OUT_SITES:
            raise BlastEnvError(f"count is {count}, must be at most {HELD_OUT_SITES}")
        return cls(0, count, ranges)

    @cached_property
    def representative(self) -> Scenario:
        """The first site; in a family with vehicles the first of 50 sites that has one."""
        wanted = isinstance(self.ranges, ItemSiteRanges) and self.ranges.vehicle_probability > 0.0
        if wanted:
            sites = (self.site(index) for index in range(min(self.count, _MOST_LOOKED_AT)))
            with_vehicle = next((site for site in sites if site.vehicles), None)
            if with_vehicle is not None:
                return with_vehicle
        return self.site(0)

    def sample(self, rng: np.random.Generator) -> Scenario:
        """Draw a site uniformly with `rng`.

        Raises:
            BlastEnvError: As `generate_site`.
        """
        return self.site(int(rng.integers(self.count)))

    def site(self, index: int) -> Scenario:
        """Return the site of an index from 0.

        Raises:
            BlastEnvError: If the index is out of bounds, or as `generate_site`.
        """
        if not 0 <= index < self.count:
            raise BlastEnvError(f"site {index} does not exist, must be 0 to {self.count - 1}")
        seed = self.first_seed + index
        if self.criterion is not None:
            return generate_site(seed, self.ranges, self.criterion)
        return _site(seed, self.ranges)

    def __iter__(self) -> Iterator[Scenario]:
        """Yield all sites in order."""
        return (self.site(index) for index in range(self.count))


@lru_cache(maxsize=512)
def _site(seed: int, ranges: Ranges) -> Scenario:
    """Return a site; training draws the same few hundred again, at longer than an episode."""
    return generate_site(seed, ranges)


@cache
def training_sites(family: str) -> SiteSource:
    """Return the cached source of a family's training sites.

    Args:
        family: A name in `FAMILIES`.
    """
    return SiteSource.training(ranges=FAMILIES[family])
