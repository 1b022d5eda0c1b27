"""The proposers that the page offers, by name."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from blast_env.design.search import Need, ProposerKind, RuleProposer, find_proposer, proposers
from blast_env.design.search.registry import proposer_row, why_nothing
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.geometry import Layout
from blast_env.site import AnyCharge, Scenario
from blast_env.site.vehicles import source_of

PACKAGED: Final = "package"
"""The proposer of `blast-env search --method package`."""


def offered(scenario: Scenario, runs: Iterable[str] = ()) -> Mapping[str, str]:
    """Return the labels of the proposers for a site by "kind name", the best first.

    The kinds are "rule" (needs no settings), "run" (the agent of a run folder) and "search" (needs
    a budget). The result is empty without a build zone.

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
    """Return the title of a proposer; that of a run folder is its name.

    Args:
        name: Name of the proposer, or a path.
    """
    known = proposers()
    return known[name].title if name in known else name.rpartition("/")[2]


def proposed(name: str, scenario: Scenario, charges: Sequence[AnyCharge]) -> tuple[Layout, str]:
    """Return the layout of a rule; if it is empty, also the reason.

    Args:
        name: The rule.
        scenario: The scenario; it has a build zone.
        charges: A single one is known; of several, any may be the one.

    Raises:
        UnknownNameError: If there is no such rule for the scenario; the message names the nearest.
        BlastEnvError: If there are no charges.
    """
    known = rules(scenario)
    if name not in known:
        raise UnknownNameError("rule", name, known)
    if not charges:
        raise BlastEnvError("threats: there are none, must be at least one")
    rule = find_proposer(name)
    assert isinstance(rule, RuleProposer)
    known_charge = charges[0] if len(charges) == 1 else None
    sources = tuple(source_of(each) for each in charges)
    if Need.VEHICLE not in proposer_row(name).needs:  # else it plans for all vehicles of the site
        scenario = scenario.model_copy(update={"charge": sources})
    layout = rule.rule(scenario, known_charge)
    return layout, "" if layout else why_nothing(scenario, known_charge)
