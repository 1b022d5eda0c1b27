"""One evaluator for all tests here: what it remembers keeps them fast."""

from collections.abc import Iterator

import pytest

from blast_env.evaluation import BlastEvaluator, Evaluation, evaluate_against
from tests.evaluation.cases import COURTYARD, THREATS, WALL
from tests.figures import undrawn_figures


@pytest.fixture(scope="session")
def evaluator() -> BlastEvaluator:
    return BlastEvaluator(COURTYARD)


@pytest.fixture(scope="session")
def evaluation(evaluator: BlastEvaluator) -> Evaluation:
    return evaluate_against(evaluator, WALL, THREATS)


@pytest.fixture(scope="package", autouse=True)
def _undrawn() -> Iterator[None]:
    """Leave figures empty, unless a test asks for `drawn`."""
    with undrawn_figures():
        yield
