"""One small report for all tests of reports: a hut and a wall, a second or two a blast."""

from collections.abc import Iterator
from functools import cache, partial

import pytest

from blast_env.answers.report import Limit, Report, Study, StudyOptions, run_report, summary
from blast_env.evaluation.questions.probability import level_probability
from tests.figures import undrawn_package as undrawn_package
from tests.report.sites import LAYOUT, glazed_hut


@pytest.fixture(scope="package", autouse=True)
def _probabilities_are_drawn_once() -> Iterator[None]:
    """And a tenth of the draws: many pages show one study."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(summary, "level_probability", cache(partial(level_probability, draws=100)))
        yield


@pytest.fixture(scope="package")
def report() -> Report:
    limits = (Limit("hut", impulse_pa_s=300.0),)
    return run_report(glazed_hut(), LAYOUT, StudyOptions(limits=limits, places=1))


@pytest.fixture(scope="package")
def study(report: Report) -> Study:
    return report.study
