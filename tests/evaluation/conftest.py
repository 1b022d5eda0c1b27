"""One evaluator for all tests here: what it remembers keeps them fast."""

import pytest

from blast_env.evaluation import BlastEvaluator, Evaluation
from tests.evaluation.cases import COURTYARD, THREATS, WALL, evaluate_against
from tests.figures import undrawn_package as undrawn_package


@pytest.fixture(scope="session")
def evaluator() -> BlastEvaluator:
    return BlastEvaluator(COURTYARD, "event")


@pytest.fixture(scope="session")
def evaluation(evaluator: BlastEvaluator) -> Evaluation:
    return evaluate_against(evaluator, WALL, THREATS)
