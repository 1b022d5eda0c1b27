"""Sites that several tests look at."""

import pytest

from blast_env.site import Scenario
from blast_env.sites import generate_site


@pytest.fixture(scope="session")
def sites() -> tuple[Scenario, ...]:
    """The first sites."""
    return tuple(generate_site(seed) for seed in range(40))
