"""Blasts for tests, by a campaign."""

from collections.abc import Iterable, Sequence

from blast_env.evaluation import BlastEvaluator, LoadCase, LoadCaseSet
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.questions.verdict import Consequences, check_facades, consequences_of
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
