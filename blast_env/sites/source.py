"""Sites for an environment: one set of seeds to train on, another to be judged on."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from types import MappingProxyType
from typing import Final

import numpy as np

from blast_env.bundled import ITEM_SITES, LARGE_SITES, SITES
from blast_env.errors import BlastEnvError
from blast_env.scenario import Scenario
from blast_env.sites.criterion import SiteCriterion
from blast_env.sites.generate import MOST_SEED, RANGES, AnyRanges, generate_site
from blast_env.sites.item_sites import ItemSiteRanges, large_ranges

FAMILIES: Final[Mapping[str, AnyRanges]] = MappingProxyType(
    {SITES: RANGES, ITEM_SITES: ItemSiteRanges(), LARGE_SITES: large_ranges()}
)
"""The families of generated sites that have names."""

HELD_OUT_SITES: Final = 10_000
"""Seeds 0 to 9,999 are held out; training has the seeds from 10,000 on."""

TRAINING_SITES: Final = 2**31
"""Number of seeds for training, as good as endless."""

_MOST_LOOKED_AT: Final = 50


@dataclass(frozen=True)
class SiteSource:
    """Gives every episode a generated site; a `ScenarioSource`.

    Attributes:
        first_seed: The first seed of the sites.
        count: How many sites there are; their seeds follow each other.
        ranges: What the sites may be.
        criterion: Which sites are used; the family's own unless given.

    Raises:
        BlastEnvError: If seeds are out of bounds, or there are none.
    """

    first_seed: int
    count: int
    ranges: AnyRanges = RANGES
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
    def training(cls, count: int = TRAINING_SITES, ranges: AnyRanges = RANGES) -> "SiteSource":
        """Return the sites to train on.

        Args:
            count: How many; fewer show how far what is learnt carries over.
            ranges: What the sites may be.

        Raises:
            BlastEnvError: If there are none.
        """
        return cls(HELD_OUT_SITES, count, ranges)

    @classmethod
    def held_out(cls, count: int = HELD_OUT_SITES, ranges: AnyRanges = RANGES) -> "SiteSource":
        """Return sites that training never sees, always the same ones in the same order.

        Args:
            count: How many; at most 10,000.
            ranges: What the sites may be.

        Raises:
            BlastEnvError: If the count is out of bounds.
        """
        if count > HELD_OUT_SITES:
            raise BlastEnvError(f"count is {count}, must be at most {HELD_OUT_SITES}")
        return cls(0, count, ranges)

    @cached_property
    def representative(self) -> Scenario:
        """The first site; in a family with vehicles the first one that has a vehicle."""
        wanted = isinstance(self.ranges, ItemSiteRanges) and self.ranges.vehicle_probability > 0.0
        if wanted:
            sites = (self.site(index) for index in range(min(self.count, _MOST_LOOKED_AT)))
            with_vehicle = next((site for site in sites if site.vehicles), None)
            if with_vehicle is not None:
                return with_vehicle
        return self.site(0)

    def sample(self, rng: np.random.Generator) -> Scenario:
        """Draw a site, all as likely, with nothing but `rng`.

        Raises:
            BlastEnvError: As `generate_site`.
        """
        return self.site(int(rng.integers(self.count)))

    def site(self, index: int) -> Scenario:
        """Return the site of an index, from 0 on.

        Raises:
            BlastEnvError: If there is none, or as `generate_site`.
        """
        if not 0 <= index < self.count:
            raise BlastEnvError(f"site {index} does not exist, must be 0 to {self.count - 1}")
        return generate_site(self.first_seed + index, self.ranges, self.criterion)

    def __iter__(self) -> Iterator[Scenario]:
        """Yield all sites in their order."""
        return (self.site(index) for index in range(self.count))


@cache
def training_sites(family: str) -> SiteSource:
    """Return the sites of a family to train on: one source, which finds its first site once.

    Args:
        family: Name of one of `FAMILIES`.
    """
    return SiteSource.training(ranges=FAMILIES[family])
