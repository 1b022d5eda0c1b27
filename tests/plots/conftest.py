import pytest

from blast_env.evaluation.engines import Blast, BlastResult
from tests.plots.scenes import small_blast


@pytest.fixture(scope="session")
def blast() -> Blast:
    return small_blast()


@pytest.fixture(scope="session")
def barrier_blast() -> Blast:
    return small_blast(with_barrier=True)


@pytest.fixture(scope="session")
def result(blast: Blast) -> BlastResult:
    return blast.run()


@pytest.fixture(scope="session")
def barrier_result(barrier_blast: Blast) -> BlastResult:
    return barrier_blast.run()
