"""What can propose a layout on the page: the proposers of the package, by name."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from blast_agents.search import Need, ProposerKind, RuleProposer, find_proposer, proposers
from blast_agents.search.registry import proposer_row

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.geometry import Layout
from blast_env.scenario import AnyCharge, Scenario
from blast_env.scenario.vehicles import source_of

PACKAGED: Final = "package"
"""What `blast-env propose` gives: weights or a surrogate, the best rule where neither can."""


def offered(scenario: Scenario, runs: Iterable[str] = ()) -> Mapping[str, str]:
    """Return what proposes a layout for a site, the best first, by "kind name", with a label.

    Of the kind "rule" is what needs no settings, of "run" the agent of a run folder, and of
    "search" what needs a budget. There is nothing without a build zone.

    Args:
        scenario: The scenario.
        runs: Names of run folders.
    """
    if scenario.build_zone is None:
        return {}
    suiting = proposers(suiting=[scenario])
    offers = {f"rule {PACKAGED}": suiting[PACKAGED].title}
    offers |= {f"run {name}": f"agent of {name}" for name in runs}
    offers |= {f"search {name}": f"search: {name.replace('_', ' ')}" for name in searches(scenario)}
    return offers | {f"rule {name}": f"rule: {suiting[name].title}" for name in rules(scenario)}


def searches(scenario: Scenario) -> tuple[str, ...]:
    """Return the names of the searches for a site."""
    rows = proposers(ProposerKind.SEARCH, ProposerKind.LEARNT, suiting=[scenario])
    return tuple(name for name in rows if name != PACKAGED)


def rules(scenario: Scenario) -> tuple[str, ...]:
    """Return the names of the rules for a site."""
    return tuple(proposers(ProposerKind.RULE, suiting=[scenario]))


def title_of(name: str) -> str:
    """Return what people call a proposer: of a run folder its name.

    Args:
        name: Of the proposer, or a path.
    """
    known = proposers()
    return known[name].title if name in known else name.rpartition("/")[2]


def proposed(name: str, scenario: Scenario, charges: Sequence[AnyCharge]) -> Layout:
    """Return the layout of a rule.

    Args:
        name: The rule.
        scenario: The scenario; it has a build zone.
        charges: One is known; of more of them, each may be the one.

    Raises:
        UnknownNameError: If there is no such rule for the scenario; the message names the nearest.
        BlastEnvError: If the rule finds nothing to build, or there are no charges.
    """
    known = rules(scenario)
    if name not in known:
        raise UnknownNameError("rule", name, known)
    if not charges:
        raise BlastEnvError("threats: there are none, must be at least one")
    rule = find_proposer(name)
    assert isinstance(rule, RuleProposer)
    told = charges[0] if len(charges) == 1 else None
    sources = tuple(source_of(each) for each in charges)
    if Need.VEHICLE in proposer_row(name).needs:  # it is against all vehicles of the site
        return rule.rule(scenario, told)
    return rule.rule(scenario.model_copy(update={"charge": sources}), told)
