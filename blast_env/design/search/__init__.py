"""Proposers: classical searches and rules, with their problem (`registry` lists all of them)."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.design.search.advice import (
        MeasureKind,
        advise,
        advise_until,
        against_several,
        kinds_for,
        only,
    )
    from blast_env.design.search.batch_moves import BatchMoves
    from blast_env.design.search.by_rule import (
        ProposerKind,
        ProposerRow,
        RuleProposer,
    )
    from blast_env.design.search.evolution import GeneticSearch, Nsga2Search
    from blast_env.design.search.learnt import Guesses, SurrogateSearch, improved, search_by
    from blast_env.design.search.methods import (
        BestRuleSearch,
        PopulationAnnealingSearch,
        RandomSearch,
    )
    from blast_env.design.search.moves import Moves, random_part, random_walls
    from blast_env.design.search.operators import cut, individual, layout_of, mixed, repaired
    from blast_env.design.search.problem import (
        Candidate,
        LayoutAgent,
        Progress,
        Proposer,
        Report,
        SamplingAgent,
        SearchResult,
    )
    from blast_env.design.search.registry import find_proposer, proposers, widened
    from blast_env.design.search.session import Plan, Search, SearchEndedError, SearchSession
    from blast_env.evaluation import DesignProblem
    from blast_env.geometry import Layout
    from blast_env.rules import Need, layouts_by_rule
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "BatchMoves",
    "BestRuleSearch",
    "Candidate",
    "DesignProblem",
    "GeneticSearch",
    "Guesses",
    "Layout",
    "LayoutAgent",
    "MeasureKind",
    "Moves",
    "Need",
    "Nsga2Search",
    "Plan",
    "PopulationAnnealingSearch",
    "Progress",
    "Proposer",
    "ProposerKind",
    "ProposerRow",
    "RandomSearch",
    "Report",
    "RuleProposer",
    "SamplingAgent",
    "Search",
    "SearchEndedError",
    "SearchResult",
    "SearchSession",
    "SurrogateSearch",
    "advise",
    "advise_until",
    "against_several",
    "cut",
    "find_proposer",
    "improved",
    "individual",
    "kinds_for",
    "layout_of",
    "layouts_by_rule",
    "mixed",
    "only",
    "proposers",
    "random_part",
    "random_walls",
    "repaired",
    "search_by",
    "widened",
]
