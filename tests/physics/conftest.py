"""What the tests of the physics share."""

import pytest

from blast_env.physics.engine import Engine
from blast_env.physics.engines import PARTICLE_ENGINES, find_particle_engine


@pytest.fixture(params=PARTICLE_ENGINES)
def engine(request: pytest.FixtureRequest) -> Engine:
    """Every engine that comes with the package, one after the other."""
    return find_particle_engine(str(request.param))
