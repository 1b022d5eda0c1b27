"""What the tests of the physics share."""

import pytest

from blast_env.evaluation.engines import CALIBRATED_ENGINES, Engine
from blast_env.evaluation.engines.particles import find_particle_engine


@pytest.fixture(params=CALIBRATED_ENGINES)
def engine(request: pytest.FixtureRequest) -> Engine:
    """Every engine that comes with the package, one after the other."""
    return find_particle_engine(str(request.param))
