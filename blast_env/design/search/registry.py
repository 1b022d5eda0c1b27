"""The proposers of the package, by name: a new one is a file and a line here.

`blast-env search` and `judge`, the page and the studies list these proposers.
"""

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from blast_env.design.search.by_rule import ProposerKind, ProposerRow, rule_rows
from blast_env.design.search.evolution import GeneticSearch, Nsga2Search
from blast_env.design.search.methods import BestRuleSearch, PopulationAnnealingSearch, RandomSearch
from blast_env.design.search.package import PackageProposer
from blast_env.design.search.problem import Proposer
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.geometry import Layout
from blast_env.site import Scenario

if TYPE_CHECKING:
    from blast_env.design.search.learnt import SurrogateSearch


def _by_surrogate() -> "SurrogateSearch":
    from blast_env.design.search.learnt import packaged_search  # half a second to import

    return packaged_search()


_TABLE: Final[Mapping[str, ProposerRow]] = MappingProxyType(
    {
        "package": ProposerRow(PackageProposer, "the package's proposal", ProposerKind.LEARNT),
        "genetic": ProposerRow(GeneticSearch, "genetic search"),
        "nsga2": ProposerRow(Nsga2Search, "genetic search for load and cost"),
        "population_annealing": ProposerRow(PopulationAnnealingSearch, "population annealing"),
        "random": ProposerRow(RandomSearch, "random search"),
        "best_rule": ProposerRow(BestRuleSearch, "the best rule"),
        "surrogate": ProposerRow(_by_surrogate, "search by the surrogate", ProposerKind.LEARNT),
        **rule_rows(),
    }
)


def proposers(*kinds: ProposerKind, suiting: Iterable[Scenario] = ()) -> Mapping[str, ProposerRow]:
    """Return the proposers by name.

    Args:
        kinds: Restricts the list to these kinds; all kinds by default.
        suiting: Restricts the list to proposers that suit all of these scenarios.
    """
    scenarios = tuple(suiting)
    return {
        name: row
        for name, row in _TABLE.items()
        if (not kinds or row.kind in kinds) and all(map(row.suits, scenarios))
    }


def proposer_row(name: str) -> ProposerRow:
    """Return the description of a proposer."""
    if name not in _TABLE:
        raise UnknownNameError("search method", name, _TABLE)
    return _TABLE[name]


def check_suits(name: str, scenario: Scenario) -> None:
    """Check that a site has the properties that a proposer requires."""
    for need in proposer_row(name).needs:
        if not need.is_met(scenario):
            raise BlastEnvError(f"{scenario.name} has no {need.value}: {name} is of no use there")


def find_proposer(name: str, initial: tuple[Layout, ...] = ()) -> Proposer:
    """Return the proposer of a name, with its default settings.

    Args:
        name: One of `proposers()`.
        initial: Initial layouts of a search, in addition to random ones.

    Raises:
        UnknownNameError: If no proposer has that name; the message suggests the nearest one.
        BlastEnvError: If `initial` is not empty and the proposer takes no initial layouts.
    """
    found: Proposer = proposer_row(name).make()
    if not initial:
        return found
    if not _begins_with_layouts(found):
        known = proposers(ProposerKind.SEARCH)
        names = ", ".join(
            proposer for proposer in known if _begins_with_layouts(find_proposer(proposer))
        )
        raise BlastEnvError(f"{name} begins with no layouts; methods that can: {names}")
    begun: Proposer = replace(found, initial=initial)  # type: ignore[type-var]
    return begun


def widened(proposer: Proposer, width: int) -> Proposer:
    """Return a proposer that keeps more workers busy, if it is a search with a width.

    Args:
        width: Number of blasts that can run at the same time; the result depends on it.
    """
    if not _has_field(proposer, "width"):
        return proposer
    wide: Proposer = replace(proposer, width=width)  # type: ignore[type-var]
    return wide


def _begins_with_layouts(proposer: Any) -> bool:
    return _has_field(proposer, "initial")


def _has_field(proposer: Any, name: str) -> bool:
    return is_dataclass(proposer) and name in {field.name for field in fields(proposer)}
