"""What the tests of the physics share."""

import pytest

from blast_env.physics.engine import Engine
from blast_env.physics.engines import ENGINE_NAMES, find_particle_engine


@pytest.fixture(params=ENGINE_NAMES)
def engine(request: pytest.FixtureRequest) -> Engine:
    """Every engine that comes with the package, one after the other."""
    return find_particle_engine(str(request.param))
