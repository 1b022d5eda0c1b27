"""The proposers that the page offers, by name."""

from collections.abc import Mapping
from typing import Final

from blast_env.design.search import ProposerKind, proposers
from blast_env.site import Scenario

PACKAGED: Final = "package"
"""The proposer of `blast-env search --method package`."""


def offered(scenario: Scenario) -> Mapping[str, str]:
    """Return the labels of the proposers for a site, the best first; none without a build zone."""
    if scenario.build_zone is None:
        return {}
    suiting = proposers(suiting=[scenario])
    offers = {PACKAGED: suiting[PACKAGED].title}
    offers |= {name: f"search: {name.replace('_', ' ')}" for name in suiting if runs_blasts(name)}
    rules = proposers(ProposerKind.RULE, suiting=[scenario])
    return offers | {name: f"rule: {row.title}" for name, row in rules.items()}


def runs_blasts(name: str) -> bool:
    """Return whether a proposer runs blasts, and so needs a budget."""
    return name in proposers(ProposerKind.SEARCH, ProposerKind.LEARNT) and name != PACKAGED
