"""Reference layouts for the score of each problem: the rules', and the best one known."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast, get_args

import numpy as np

from blast_env.arrays import FloatArray, IntArray
from blast_env.benchmark import (
    DEFINITIONS,
    JUDGE_CELL_M,
    Definition,
    ReferenceLayout,
    Run,
    ScoreReference,
    SubmissionJudgement,
    make,
    stored_references,
)
from blast_env.benchmark.data import remember_published
from blast_env.benchmark.definitions import Family
from blast_env.benchmark.methods import find_method
from blast_env.benchmark.problem import shares_of
from blast_env.benchmark.references import cell_key
from blast_env.design.search import layouts_by_rule
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import BlastEvaluator, BlastStore
from blast_env.evaluation.engines import JUDGE, find_engine
from blast_env.geometry import Layout
from blast_env.layout import load_layout
from blast_env.site import Charge, VehicleCharge

DATA = Path("docs/data")
_MOST = 50_000  # blasts in memory
_CLOSE = 0.03
"""Share of the load within which a rule may become the best one with finer cells."""
HEADROOM = 0.05
"""Share of the load that a find takes off beyond the best rule."""
WITHOUT_GUESSES = ("botorch_turbo", "genetic", "optuna_tpe", "population_annealing", "random")
"""Methods that know of a layout only what its blast says."""


def named_definition(name: str) -> Definition:
    """Return the definition of a name without its version, such as `control_room-known_2`."""
    site, _, family = name.removesuffix(f"-v{Definition.version}").rpartition("-")
    family, _, place = family.partition("_")
    if family not in get_args(Family):
        raise UnknownNameError("family", family, get_args(Family))
    return Definition(site, cast("Family", family), int(place or 1))


def published_layouts(definition: Definition, published: BlastStore) -> Iterator[Layout]:
    """Yield the published layouts with a blast for every charge of a problem.

    Problems with vehicle charges, which are not fixed, have none.
    """
    charges = [threat.charge for threat in definition.case.threats]
    if any(isinstance(charge, VehicleCharge) for charge in charges):
        return
    blasted: dict[Layout, set[Charge]] = defaultdict(set)
    for key, _ in published.items():  # noqa: PERF102  # is no dictionary
        if key.scenario_hash == definition.scenario.without_budget.content_hash:
            blasted[key.layout].add(key.charge)
    for layout, own in blasted.items():
        if layout and own.issuperset(charges):
            yield layout


def known_layouts(definition: Definition, published: BlastStore) -> dict[str, Layout]:
    """Return candidates for the best known layout of a problem, by their origin."""
    scenario = definition.scenario
    found: dict[str, Layout] = {}
    for number, layout in enumerate(published_layouts(definition, published)):
        found[f"published blasts {number}"] = layout
    path = DATA / "best_found" / f"{definition.site}.json"
    if definition.family != "known" and path.exists():
        found["study of the scenarios"] = load_layout(path, scenario)
    if scenario.zone.items:
        for name in ("package", "surrogate"):
            found[name] = find_method(name)(make(definition, 0), 0)
    return {name: tuple(sorted(layout)) for name, layout in found.items()}


def with_judged(
    known: Mapping[str, ScoreReference],
    judged: Iterable[SubmissionJudgement],
    cache: BlastStore,
) -> dict[str, ScoreReference]:
    """Return references whose best known layout is the best by the judge's cells.

    It must be better than the best rule on cells of 0.5 m, too, so that both sizes have a scale.

    Args:
        known: The references.
        judged: Judged submissions, whose layouts are candidates.
        cache: Store of the blasts with cells of 0.5 m.
    """
    coarse, fine = cell_key(0.5), cell_key(JUDGE_CELL_M)
    better: dict[str, list[ReferenceLayout]] = defaultdict(list)
    for submission in judged:
        for run in submission.runs:
            best = known[run.problem].best
            if cell_key(submission.cell_m) == fine and run.share < best.shares[fine]:
                method = f"{submission.method}, {run.budget:,} blasts, seed {run.seed}"
                better[run.problem].append(ReferenceLayout(method, run.layout, {fine: run.share}))
    found, engine = dict(known), find_engine(JUDGE, 0.5)
    for name, candidates in better.items():
        evaluator = BlastEvaluator(DEFINITIONS[name].scenario, engine, cache=cache)
        for candidate in sorted(candidates, key=lambda candidate: candidate.shares[fine]):
            (share,) = shares_of(DEFINITIONS[name].case, [candidate.layout], evaluator)
            if share < known[name].rule.shares[coarse]:
                best = replace(candidate, shares={coarse: share, **candidate.shares})
                found[name] = replace(known[name], best=best)
                break
    return found


def rescaled(
    judged: SubmissionJudgement, known: Mapping[str, ScoreReference]
) -> SubmissionJudgement:
    """Return a judged submission with the shares of new references: best rule, best known."""
    key = cell_key(judged.cell_m)
    runs = (
        replace(run, rule=reference.rule.shares[key], best=reference.best.shares[key])
        for run in judged.runs
        for reference in [known[run.problem]]
    )
    return replace(judged, runs=tuple(runs))


def entered(kept: SubmissionJudgement | None, new: SubmissionJudgement) -> SubmissionJudgement:
    """Return a judged submission of the standings with the runs of another one beside its own.

    A run of the same problem, budget and seed is replaced. Runs of problems that are no longer in
    the benchmark go.

    Args:
        kept: The one of the standings, if there is one.
        new: The other one, of the same method, engine and cells.

    Raises:
        BlastEnvError: If another engine or other cells judged it.
    """
    old = new if kept is None else kept
    judges = [(own.engine, own.cell_m) for own in (old, new)]
    if judges[0] != judges[1]:
        raise BlastEnvError(f"{new.method}: was judged by {judges[1]}, the standings {judges[0]}")
    runs = {run.key: run for own in (old, new) for run in own.runs if run.problem in DEFINITIONS}
    order = [*DEFINITIONS]
    placed = sorted(runs.values(), key=lambda run: (order.index(run.problem), run.budget, run.seed))
    return replace(new, runs=tuple(placed))


def published_blasts(definitions: Mapping[str, Definition]) -> BlastStore:
    """Return the published blasts of these problems."""
    store = BlastStore(size=_MOST)
    sites = {
        definition.scenario.content_hash: definition.scenario for definition in definitions.values()
    }
    remember_published(store, sites.values())
    return store


def with_published(folder: Path, published: BlastStore) -> BlastStore:
    """Return the store of a folder, with the published blasts in its memory alone."""
    store = BlastStore(folder, _MOST)
    for key, loads in published.items():
        store.remember(key, loads)
    return store


def with_fine_shares(
    definition: Definition, known: ScoreReference, evaluator: BlastEvaluator
) -> ScoreReference:
    """Return the references with their shares by the judge's cells, and the best rule by these.

    Args:
        definition: The problem.
        known: Its references with cells of 0.5 m.
        evaluator: Runs the blasts with the cells of the judge.
    """
    coarse, fine = cell_key(0.5), cell_key(JUDGE_CELL_M)
    layouts = layouts_by_rule(definition.scenario, definition.case.charge)
    least = min(known.rules.values())
    close = [name for name, share in known.rules.items() if share < least + _CLOSE]
    rules = [
        ReferenceLayout(name, tuple(sorted(layouts[name])), {coarse: known.rules[name]})
        for name in close
    ]
    found = [*rules, known.best]
    shares = shares_of(definition.case, [rule.layout for rule in found], evaluator)
    *rules, best = (
        replace(rule, shares={**rule.shares, fine: share})
        for rule, share in zip(found, shares, strict=True)
    )
    return replace(known, rule=min(rules, key=lambda rule: rule.shares[fine]), best=best)


def seen_rule(name: str, cache: Path | None) -> float:
    """Return the share that the best rule leaves as a search sees it.

    A problem whose judge has other charges takes the blasts of the layout.
    """
    problem, rule = make(name, 0, cache=cache), stored_references()[name].rule
    judged = problem.definition.case
    if {threat.charge for threat in judged.threats} == {
        threat.charge for threat in problem.threats
    }:
        return rule.shares[cell_key(0.5)]
    (share,) = shares_of(problem.case, [rule.layout], problem.evaluator)
    return share


def mean_curve(runs: Sequence[Run], rules: Mapping[str, float], blasts: IntArray) -> FloatArray:
    """Return the mean points beside the best rule after numbers of blasts, 0 before a layout.

    Each problem counts once, whatever the number of its runs.

    Args:
        runs: The runs.
        rules: Share of the load that the best rule leaves, by problem.
        blasts: The numbers (blasts,).
    """
    points: dict[str, list[FloatArray]] = defaultdict(list)
    for run in runs:
        spent, shares = np.array([(0, rules[run.problem]), *run.curve]).T
        by_then = shares[np.searchsorted(spent, blasts, side="right") - 1]
        points[run.problem].append(100.0 * (rules[run.problem] - by_then))
    mean: FloatArray = np.mean([np.mean(own, axis=0) for own in points.values()], axis=0)
    return mean


def finders(problem: str, submissions: Iterable[SubmissionJudgement]) -> tuple[str, ...]:
    """Return the methods with a run that takes off 5 points more than the best rule.

    Runs with blasts count, by the judge's cells. Sites that the guesses of one method chose favour
    it; headroom that several methods find by blasts does not rest on them.
    """
    return tuple(
        submission.method
        for submission in submissions
        if any(
            run.problem == problem and run.budget > 0 and run.rule - run.share >= HEADROOM
            for run in submission.runs
        )
    )
