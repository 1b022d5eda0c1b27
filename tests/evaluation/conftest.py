"""One evaluator for all tests here: what it remembers keeps them fast."""

import pytest

from blast_env.evaluation import BlastEvaluator, LayoutEvaluation, evaluate_against
from tests.evaluation.cases import COURTYARD, THREATS, WALL


@pytest.fixture(scope="session")
def evaluator() -> BlastEvaluator:
    return BlastEvaluator(COURTYARD)


@pytest.fixture(scope="session")
def evaluation(evaluator: BlastEvaluator) -> LayoutEvaluation:
    return evaluate_against(evaluator, WALL, THREATS)


@pytest.fixture(scope="package", autouse=True)
def _undrawn(undrawn: None) -> None:
    """Leave figures empty, unless a test asks for `drawn`."""
