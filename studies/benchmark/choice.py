"""Which generated sites become problems: those where several methods find room above the rules.

No guess has a say in which sites are looked at, and none can choose one: two methods that know of a
layout only what its blast says must find the room, and a third method of any sort.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Final

from blast_env.benchmark import JUDGE_CELL_M, Definition, make, play
from blast_env.benchmark.definitions import SEEDS
from blast_env.benchmark.methods import find_method, reference_of
from blast_env.benchmark.problem import shares_of
from blast_env.benchmark.references import cell_key
from blast_env.envs.arguments import check_names
from blast_env.evaluation import BlastEvaluator, BlastStore
from blast_env.evaluation.engines import JUDGE, find_engine
from blast_env.geometry import Layout
from blast_env.sites import SITE_KINDS
from studies.benchmark.references import HEADROOM, WITHOUT_GUESSES, with_fine_shares

FIRST_SEED: Final = 6_300
"""First of the held-out seeds that are for the choice; nothing else uses them."""

METHODS: Final = ("population_annealing", "genetic", "optuna_tpe", "surrogate")
"""The methods that look for room, in this order; three of them use no guesses."""

_WORTH_A_LOOK: Final = 0.02
"""Share of the load; where the first method leads the rules by less, no other one is played."""

LEAST_LEAD: Final = 0.03
"""Share of the load by which a method is ahead of the best rule that finds room with 50 blasts; the
best of them must be ahead by `HEADROOM`."""

LEAST_FINDERS: Final = 3
LEAST_WITHOUT_GUESSES: Final = 2

_SEED: Final = SEEDS
"""Seed of their runs: beyond those of the standings, which have no run that chose a site."""

_SEARCH_CELL_M: Final = 0.5
_OF_STUDIES: Final = ("optuna_tpe",)


@dataclass(frozen=True)
class Candidate:
    """What methods find on a site.

    Attributes:
        name: Name of the problem.
        rule: The best rule, by the finest cells that ran.
        leads: Share of the load that the layout of each method takes off beyond the best rule, with
            the cells of a search. A method that could change nothing was not played.
        fine_leads: The same layouts with the judge's cells; none without room on the coarser ones.
    """

    name: str
    rule: str
    leads: Mapping[str, float] = field(default_factory=dict)
    fine_leads: Mapping[str, float] = field(default_factory=dict)

    @property
    def has_room(self) -> bool:
        """Whether the site passes with both sizes of the cells."""
        return all(
            are_enough(found(leads)) and max(leads.values()) >= HEADROOM
            for leads in (self.leads, self.fine_leads)
        )


def found(leads: Mapping[str, float]) -> tuple[str, ...]:
    """Return the methods that are ahead of the best rule by `LEAST_LEAD`."""
    return tuple(method for method, lead in leads.items() if lead >= LEAST_LEAD)


def are_enough(finders: Collection[str]) -> bool:
    """Return whether enough methods found room, and enough of them without guesses."""
    without = set(finders) & set(WITHOUT_GUESSES)
    return len(finders) >= LEAST_FINDERS and len(without) >= LEAST_WITHOUT_GUESSES


def candidates(kinds: Sequence[str], first: int, count: int) -> Iterator[Definition]:
    """Yield problems on generated sites in a fixed order: of each kind the first seed, and so on.

    Raises:
        UnknownNameError: If there is no such kind.
    """
    check_names("kind", kinds, SITE_KINDS)
    for seed in range(first, first + count):
        for kind in kinds:
            yield Definition(f"{kind}_{seed}", "known")


def looked_at(definition: Definition, budget: int, folder: Path, store: BlastStore) -> Candidate:
    """Play the methods on a site; see `Candidate`.

    Args:
        definition: The problem.
        budget: Blasts of each method.
        folder: Folder of the completed runs, which are not repeated.
        store: Store of the blasts.
    """
    # 1. The rules.
    coarse = cell_key(_SEARCH_CELL_M)
    evaluator = _evaluator(definition, _SEARCH_CELL_M, store)
    known = reference_of(definition, evaluator, {}, coarse)
    # 2. The methods, as long as the site can still pass and the first one finds anything.
    layouts: dict[str, Layout] = {}
    leads: dict[str, float] = {}
    for index, method in enumerate(METHODS):
        can_pass = are_enough({*found(leads), *METHODS[index:]})
        if not can_pass or (leads and leads[METHODS[0]] < _WORTH_A_LOOK):
            break
        layouts[method] = _played(method, definition, budget, folder, store)
        (share,) = shares_of(definition.case, [layouts[method]], evaluator)
        leads[method] = known.rule.shares[coarse] - share
    if not are_enough(found(leads)):
        return Candidate(definition.name, known.rule.method, leads)
    # 3. The same layouts, and the rules near the best one, by the judge's cells.
    fine = _evaluator(definition, JUDGE_CELL_M, store)
    rule = with_fine_shares(definition, known, fine).rule
    judged = shares_of(definition.case, list(layouts.values()), fine)
    fine_leads = {
        method: rule.shares[cell_key(JUDGE_CELL_M)] - share
        for method, share in zip(layouts, judged, strict=True)
    }
    return Candidate(definition.name, rule.method, leads, fine_leads)


def _evaluator(definition: Definition, cell_m: float, store: BlastStore) -> BlastEvaluator:
    return BlastEvaluator(definition.scenario, find_engine(JUDGE, cell_m), cache=store)


def _played(
    method: str, definition: Definition, budget: int, folder: Path, store: BlastStore
) -> Layout:
    made = partial(make, definition, cell_m=_SEARCH_CELL_M, cache=store)
    module = "studies.benchmark.methods:" if method in _OF_STUDIES else ""
    asked = [(made, budget, _SEED)]
    (run,) = play(find_method(module + method), asked, folder / f"runs_{method}.sqlite")
    return run.layout
