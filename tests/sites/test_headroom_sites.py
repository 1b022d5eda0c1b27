"""The listed sites with room above the rules."""

import pytest

from blast_env.errors import BlastEnvError
from blast_env.sites import (
    HEADROOM_HELD_OUT,
    HEADROOM_TRAINING,
    HELD_OUT_SITES,
    SITE_KINDS,
    headroom_site,
)


def test_each_is_the_site_of_its_kind_and_seed() -> None:
    kind, seed = HEADROOM_HELD_OUT[1]
    assert headroom_site(1) == SITE_KINDS[kind](seed)
    kind, seed = HEADROOM_TRAINING[0]
    assert headroom_site(HELD_OUT_SITES) == SITE_KINDS["headroom_sites"](HELD_OUT_SITES)
    assert headroom_site(HELD_OUT_SITES) == SITE_KINDS[kind](seed)


def test_seeds_held_out_from_training_stay_so() -> None:
    assert all(seed < HELD_OUT_SITES for _, seed in HEADROOM_HELD_OUT)
    assert all(seed >= HELD_OUT_SITES for _, seed in HEADROOM_TRAINING)
    both = (*HEADROOM_HELD_OUT, *HEADROOM_TRAINING)
    assert len(set(both)) == len(both)


def test_the_first_sites_are_of_both_kinds() -> None:
    """Whoever takes the first few does not judge on one kind alone."""
    for sites in (HEADROOM_HELD_OUT, HEADROOM_TRAINING):
        kinds = [kind for kind, _ in sites[:30]]
        assert all(kinds.count(kind) == 15 for kind in set(kinds))


@pytest.mark.parametrize("seed", [len(HEADROOM_HELD_OUT), 9_999, 10_000 + 10_000])
def test_there_are_no_others(seed: int) -> None:
    with pytest.raises(BlastEnvError, match=rf"headroom_sites: seed is {seed}, must be 0 to"):
        headroom_site(seed)
