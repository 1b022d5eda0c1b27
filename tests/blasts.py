"""Blasts for tests, by a campaign."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import pytest

from blast_env.evaluation import BlastEvaluator, LoadCase, LoadCaseSet
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.questions.verdict import Consequences, check_facades, consequences_of
from blast_env.gas import settings
from blast_env.geometry import Element
from blast_env.site import AnyCharge


def blasts_behind(
    evaluator: BlastEvaluator, layout: Sequence[Element], charges: Iterable[AnyCharge]
) -> Blasts:
    """Return the blasts of charges behind a layout alone."""
    threats = tuple(LoadCase(charge, number) for number, charge in enumerate(charges))
    case = LoadCaseSet(evaluator.scenario, threats)
    return Campaign(case, {"": tuple(layout)}, evaluator).run()


def consequences(
    evaluator: BlastEvaluator,
    layout: Sequence[Element],
    charges: Iterable[AnyCharge],
    *,
    without_fallen: bool = False,
) -> Consequences:
    """Return the consequences of charges for the buildings behind a layout."""
    check_facades(evaluator.scenario, evaluator.engine)
    threats = tuple(LoadCase(charge, number) for number, charge in enumerate(charges))
    case = LoadCaseSet(evaluator.scenario, threats)
    campaign = Campaign(case, {"": tuple(layout)}, evaluator, without_fallen=without_fallen)
    return consequences_of(campaign.run())


@contextmanager
def soon_growing_cells() -> Iterator[None]:
    """Let coarse and fine cells grow after a third of the path, to twice their largest side.

    A blast takes a tenth of the time, for loads within some 15 % of those of the cells that
    users get: for tests of what is done with loads.
    """
    fewer = {
        name: replace(growth, run=growth.run / 3.0, largest_m=2.0 * growth.largest_m)
        for name, growth in settings._GROWING.items()
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(settings, "_GROWING", fewer)
        yield


@pytest.fixture(scope="package", autouse=True)
def soon_growing_package() -> Iterator[None]:
    """Spare the package whose conftest imports this long blasts on coarse and fine cells."""
    with soon_growing_cells():
        yield
