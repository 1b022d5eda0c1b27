"""Generated sites on which layouts are ahead of all rules: a list of their kinds and seeds.

On four of ten generated sites the rules leave an agent little to win. `studies.headroom_sites`
looks for the others, by guesses that a few blasts confirm.
"""

from collections.abc import Sequence
from itertools import product, zip_longest
from typing import Final

from blast_env.bundled import HEADROOM_SITES, ITEM_SITES, KERB_SITES
from blast_env.errors import BlastEnvError
from blast_env.site import Scenario
from blast_env.sites.generate import HELD_OUT_SITES, generate_site
from blast_env.sites.item_sites import ItemSiteRanges
from blast_env.sites.kerb_sites import kerb_site
from blast_env.values import checked_seed


def _in_turn(item_sites: Sequence[int], kerb_sites: Sequence[int]) -> tuple[tuple[str, int], ...]:
    """Return kind and seed of sites of both kinds in turn, then of those that are left of one."""
    pairs = zip_longest(product([ITEM_SITES], item_sites), product([KERB_SITES], kerb_sites))
    return tuple(site for pair in pairs for site in pair if site is not None)


# fmt: off
_ITEM_SITES: Final = (
    0, 2, 4, 5, 6, 7, 8, 13, 14, 16, 17, 18, 19, 22, 23, 24, 25, 27, 29, 31, 32, 33, 34, 35, 36,
    38, 39, 40, 41, 44, 46, 50, 51, 52, 54, 58, 59, 60, 63, 64, 66, 69, 71, 72, 73, 75, 77,
)
_KERB_SITES: Final = (
    0, 1, 2, 3, 4, 5, 7, 8, 9, 12, 13, 14, 15, 17, 19, 22, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34,
    35, 36, 40, 41, 42, 43, 44, 45, 46, 47, 48, 49, 53, 54, 55, 57, 58, 59, 60, 61, 62, 64, 65,
    66, 68, 69, 71, 73, 74, 76, 77,
)
# fmt: on
HEADROOM_HELD_OUT: Final = _in_turn(_ITEM_SITES, _KERB_SITES)
"""Kind and seed of those held out from training, by a search on the first 80 of each kind."""

# fmt: off
_TRAINING_ITEM_SITES: Final = (
    0, 3, 4, 6, 8, 9, 10, 11, 14, 18, 19, 21, 22, 25, 27, 33, 34, 38, 39,
)
_TRAINING_KERB_SITES: Final = (
    0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 14, 16, 17, 18, 19, 21, 24, 26, 27, 29, 30, 31, 32, 37, 38, 39,
)
# fmt: on
HEADROOM_TRAINING: Final = _in_turn(
    [HELD_OUT_SITES + number for number in _TRAINING_ITEM_SITES],
    [HELD_OUT_SITES + number for number in _TRAINING_KERB_SITES],
)
"""Kind and seed of those of training, by a search on 40 of each kind from 10,000 on."""


def headroom_site(seed: int) -> Scenario:
    """Return a site with room above the rules, as its kind has it.

    Args:
        seed: Its place in `HEADROOM_HELD_OUT`, or 10,000 more than that in `HEADROOM_TRAINING`.

    Raises:
        BlastEnvError: If the seed is out of bounds.
    """
    checked_seed(seed)
    for first, sites in ((0, HEADROOM_HELD_OUT), (HELD_OUT_SITES, HEADROOM_TRAINING)):
        if first <= seed < first + len(sites):
            kind, own = sites[seed - first]
            return kerb_site(own) if kind == KERB_SITES else generate_site(own, ItemSiteRanges())
    raise BlastEnvError(
        f"{HEADROOM_SITES}: seed is {seed}, must be 0 to {len(HEADROOM_HELD_OUT) - 1}, or "
        f"{HELD_OUT_SITES} to {HELD_OUT_SITES + len(HEADROOM_TRAINING) - 1}"
    )
