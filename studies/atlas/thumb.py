"""Rules of thumb by the atlas and by gas dynamics: which make a site worse, and have the word."""

from collections.abc import Iterator
from typing import Final

from blast_env.design.by_atlas import expected_share
from blast_env.design.proposal import problem_of
from blast_env.design.search import ProposerKind, proposers
from blast_env.site import load_scenario

SITES: Final = ("hotel_forecourt", "shopping_street", "school_and_clinic")
"""Bundled sites whose load is an impulse, on which rules differ much."""


def rows(site: str) -> Iterator[tuple[str, ...]]:
    """Yield one row per rule: what it leaves of the impulse by the atlas and of the load by gas."""
    scenario = load_scenario(site)
    problem = problem_of(scenario, None)
    for name, row in proposers(ProposerKind.RULE, suiting=[scenario]).items():
        found = row.make().propose(problem)
        share = expected_share(problem, found.layout) if found.layout else None
        if share is not None:
            by_gas = problem.load(found.layout) / problem.load(())
            yield site, name, f"{share:.2f}", f"{by_gas:.2f}", "yes" if found.by else ""
