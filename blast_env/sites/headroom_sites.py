"""Generated sites on which layouts are ahead of all rules: a list of their kinds and seeds.

On most generated sites the rules leave an agent little to win. `python -m studies.headroom_sites`
looks for those where they do not, by guesses that a few blasts confirm.
"""

from typing import Final

from blast_env.bundled import HEADROOM_SITES, ITEM_SITES, KERB_SITES
from blast_env.errors import BlastEnvError
from blast_env.site import Scenario
from blast_env.sites.generate import HELD_OUT_SITES, generate_site
from blast_env.sites.item_sites import ItemSiteRanges
from blast_env.sites.kerb_sites import kerb_site
from blast_env.values import checked_seed

HEADROOM_HELD_OUT: Final = (
    *((ITEM_SITES, seed) for seed in (17, 29, 32)),
    *((KERB_SITES, seed) for seed in (8, 9, 12, 13, 15, 17, 22, 25, 27, 29, 36)),
)
"""Kind and seed of those held out from training, by a search on the first 50 and 40 seeds."""

HEADROOM_TRAINING: Final = tuple(
    (KERB_SITES, HELD_OUT_SITES + number)
    for number in (0, 4, 7, 14, 18, 21, 26, 27, 30, 31, 32, 37)
)
"""Kind and seed of those of training, by a search on 40 seeds from 10,000 on."""


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
