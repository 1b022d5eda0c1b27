"""The script that measures sites with blasts."""

import numpy as np
import pytest

from blast_env.site import Scenario
from blast_env.sites import SiteMeasures, SiteRanges
from studies.check_sites import SiteMeasurement, drawn_sites, measured
from tests.sites.cases import yard


def result(reduction: list[float]) -> SiteMeasurement:
    shares = SiteMeasures(1.0, 0.8, 0.7, 0.4)
    return SiteMeasurement(True, shares, 1000.0, np.array(reduction), np.array(reduction))


@pytest.mark.parametrize(
    ("reduction", "fault"),
    [
        ([0.8, 0.4, 0.5], ""),
        ([0.14, 0.0, 0.03], "too little to gain"),
        ([0.8, 0.4, 0.99], "everything can be gained"),
        ([0.6, 0.52, 0.52], "the place does not matter"),
    ],
)
def test_a_site_is_worth_solving_or_has_a_fault(reduction: list[float], fault: str) -> None:
    assert result(reduction).fault == fault


def test_the_last_site_drawn_for_a_seed_is_the_one_generated(sites: tuple[Scenario, ...]) -> None:
    drawn = [list(drawn_sites(seed, SiteRanges())) for seed in range(3)]
    assert [draw[-1] for draw in drawn] == list(sites[:3])
    assert max(map(len, drawn)) > 1


def test_measuring_puts_the_visibility_layout_first() -> None:
    found = measured(yard(stock=5), random_layouts=2, threats=1, engine="pymunk")
    assert found.cut.shape == found.reduction.shape == (3,)
    assert found.cut[0] == pytest.approx(found.shares.layout_share)
    assert found.reduction[0] > found.reduction[1:].max()
    assert found.unprotected_pa_s > 0.0
