"""Sites for training and sites held out."""

import pickle

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.site import Scenario
from blast_env.sites import HELD_OUT_SITES, SiteRanges, SiteSource, generate_site


def seeds(source: SiteSource) -> range:
    return range(source.first_seed, source.first_seed + source.count)


def test_training_and_held_out_seeds_are_disjoint() -> None:
    training, held_out = seeds(SiteSource.training()), seeds(SiteSource.held_out())
    assert training.start == held_out.stop == HELD_OUT_SITES
    assert held_out.start == 0


def test_held_out_sites_are_counted_from_0(sites: tuple[Scenario, ...]) -> None:
    source = SiteSource.held_out(3)
    assert list(source) == [source.site(index) for index in range(3)] == list(sites[:3])
    assert SiteSource.held_out().site(9_999).name == "site_9999"


def test_few_sites_to_train_on_come_again() -> None:
    rng = np.random.default_rng(1)
    names = {SiteSource.training(2).sample(rng).name for _ in range(12)}
    assert names == {"site_10000", "site_10001"}


def test_the_representative_is_always_the_first_site() -> None:
    source = SiteSource.training()
    assert source.representative is source.representative
    assert source.representative == generate_site(HELD_OUT_SITES)


def test_it_survives_a_pickle() -> None:
    source = SiteSource.held_out(5, SiteRanges(stock=(9, 9)))
    assert source.representative.build_zone is not None  # so that there is something kept
    again = pickle.loads(pickle.dumps(source))
    assert again == source
    assert again.site(4) == source.site(4)


def test_ranges_reach_the_sites() -> None:
    sites = [*SiteSource.held_out(3, SiteRanges(stock=(9, 9)))]
    sites += [SiteSource.training(3, SiteRanges(stock=(9, 9))).site(2)]
    assert {site.build_zone.stock for site in sites if site.build_zone is not None} == {9}


@pytest.mark.parametrize("index", [-1, 3])
def test_a_site_that_does_not_exist_is_an_error(index: int) -> None:
    with pytest.raises(BlastEnvError, match=rf"site {index} does not exist, must be 0 to 2"):
        SiteSource.held_out(3).site(index)


def test_counts_and_seeds_out_of_bounds_are_errors() -> None:
    with pytest.raises(BlastEnvError, match="count is 0, must be at least 1"):
        SiteSource.training(0)
    with pytest.raises(BlastEnvError, match="count is 10001, must be at most 10000"):
        SiteSource.held_out(10_001)
    with pytest.raises(BlastEnvError, match="seeds are -1 to 3, must be within 0 to"):
        SiteSource(-1, 5)
