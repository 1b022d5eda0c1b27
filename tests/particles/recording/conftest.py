"""Small real blasts, simulated once."""

from typing import Any

import pytest

from blast_env.evaluation.engines import BlastResult, simulate
from blast_env.site import (
    Scenario,
)
from tests.builders import block, point, site, square, zone

SEED = 2**60 + 1
"""Greater than what Excel can hold as a number."""


def make_scenario(**overrides: dict[str, Any]) -> Scenario:
    return site(
        "small_yard",
        (20.0, 20.0),
        point(4.0, 10.0),
        square("building", 11.0, 8.5, 6, protected=True, module_capacity=2500.0),
        block("facade", 16.0, 1.0, 36, 1, protected=True),
        block("shed", 2.0, 15.0, 2, 4),
        build_zone=zone(8.0, 8.0, 8, 2, stock=16),
        simulation={"overrides": {"explosive": {"ball_count": 480}} | overrides},
    )


@pytest.fixture(scope="session")
def blast() -> BlastResult:
    """Two protected structures, a shed and a barrier, all of them hit."""
    return simulate(make_scenario(), layout=[(3, 0), (4, 0), (5, 1)], seed=SEED)


@pytest.fixture(scope="session")
def quiet_blast() -> BlastResult:
    """A run that ends before anything is hit."""
    return simulate(make_scenario(stepping={"time_limit_s": 1e-4}))
