"""The methods of the package on the problems of the benchmark."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from hashlib import sha256
from typing import Any, Final

from blast_env.benchmark import (
    BUDGETS,
    BenchmarkProblem,
    Definition,
    Method,
    ReferenceLayout,
    ScoreReference,
    Submission,
)
from blast_env.benchmark.problem import shares_of
from blast_env.benchmark.references import cell_key, engine_key
from blast_env.design.search import (
    Proposer,
    ProposerKind,
    find_proposer,
    layouts_by_rule,
    proposers,
)
from blast_env.design.search.registry import proposer_row
from blast_env.errors import BlastEnvError, value_text
from blast_env.evaluation import BlastEvaluator, BlastStore
from blast_env.evaluation.engines import JUDGE, find_engine
from blast_env.evaluation.engines.contract import load_plugin
from blast_env.files import read_regular
from blast_env.geometry import Layout
from blast_env.site import Scenario

RULES: Final = "rules"
"""In the place of the names of all rules that suit the sites."""

_MOST_SOURCE_BYTES: Final = 100_000_000


def _proposed(proposer: Proposer, problem: BenchmarkProblem, seed: int) -> Layout:
    """Return the layout of a proposer, within the budget of a problem."""
    result = proposer.propose(problem, problem.most_blasts, seed)
    if result.interrupted:
        raise KeyboardInterrupt
    for step in result.history:
        problem.enter(step)
    return result.layout


def method_of(proposer: Proposer) -> Method:
    """Return a proposer as a method for benchmark problems."""
    return partial(_proposed, proposer)


def _by_rule(proposer: Proposer, problem: BenchmarkProblem, seed: int) -> Layout:
    """Return the layout of a rule; nothing where the site has none, as without a sight line."""
    try:
        return _proposed(proposer, problem, seed)
    except BlastEnvError:
        return ()


def find_method(name: str) -> Method:
    """Return a method by the name of a proposer, or by `module:object`."""
    if ":" not in name:
        is_rule = proposer_row(name).kind is ProposerKind.RULE
        return partial(_by_rule if is_rule else _proposed, find_proposer(name))
    try:
        found = load_plugin(name)
        if isinstance(found, type):
            found = found()
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise BlastEnvError(f"method is {value_text(name)}: {error}") from error
    if hasattr(found, "propose"):
        return method_of(found)
    if not callable(found):
        raise BlastEnvError(f"method is {value_text(name)}, must be something to call")
    return partial(_called, found, name)


def source_digest(name: str) -> str:
    """Return a digest of the file of a method `module:object`; empty for methods of the package."""
    if ":" not in name:
        return ""
    file = getattr(sys.modules.get(name.partition(":")[0]), "__file__", None)
    return "" if file is None else sha256(read_regular(file, _MOST_SOURCE_BYTES)).hexdigest()[:16]


def _called(method: Callable[[Any, int], Any], name: str, problem: Any, seed: int) -> Layout:
    """Call a method; refuse one that does not take a problem and a seed, or returns no layout."""
    try:
        layout: Any = method(problem, seed)
    except TypeError as error:
        within = error.__traceback__ and error.__traceback__.tb_next
        if within is not None:  # a fault of the method itself
            raise
        message = f"method is {value_text(name)}, must take a problem and a seed: {error}"
        raise BlastEnvError(message) from error
    if not isinstance(layout, Sequence):
        what = type(layout).__name__
        raise BlastEnvError(f"method is {value_text(name)}, must return a layout, not: {what}")
    return tuple(layout)


def budgets_of(name: str, asked: Sequence[int]) -> tuple[int, ...]:
    """Return the budgets with which a method enters.

    Args:
        name: As for `find_method`.
        asked: The budgets that were asked for; a rule has 0 alone, a search those above 0. If
            there are none: 50, and 0 for methods of the package that need no blast.
    """
    kind = ProposerKind.SEARCH if ":" in name else proposer_row(name).kind
    if kind is ProposerKind.RULE:
        return (0,)
    if ":" in name and asked:
        return tuple(asked)
    known = tuple(asked or BUDGETS[:2])
    return known if kind is ProposerKind.LEARNT else tuple(number for number in known if number)


def entries(
    names: Iterable[str], asked: Sequence[int], sites: Sequence[Scenario]
) -> Iterator[tuple[str, Method, tuple[int, ...]]]:
    """Yield names, methods and their budgets.

    Args:
        names: Names as for `find_method`, or `RULES`.
        asked: The budgets that were asked for; see `budgets_of`.
        sites: The sites of the problems.
    """
    for name in names:
        for proposer in proposers(ProposerKind.RULE, suiting=sites) if name == RULES else (name,):
            budgets = budgets_of(proposer, asked)
            if not budgets:
                raise BlastEnvError(f"--budget is 0: {proposer} needs blasts")
            yield proposer, find_method(proposer), budgets


def references_of(
    definitions: Mapping[str, Definition],
    played: Sequence[Submission],
    cell_m: float,
    cache: BlastStore,
    guided: Callable[[Definition, int], BenchmarkProblem] | None = None,
) -> Mapping[str, ScoreReference]:
    """Return the references of problems without stored ones, from the rules and submissions.

    Args:
        cell_m: Side of the cells, m.
        guided: Makes a problem of a budget for the search by the surrogate, a further source.
    """
    found, engine = {}, find_engine(JUDGE, cell_m)
    for name, definition in definitions.items():
        more = {
            f"{submission.method}, {run.budget} blasts, seed {run.seed}": run.layout
            for submission in played
            for run in submission.runs
            if run.problem == name
        }
        if guided is not None:
            more["surrogate, 50 blasts"] = find_method("surrogate")(
                guided(definition, BUDGETS[1]), 0
            )
        evaluator = BlastEvaluator(definition.scenario, engine, cache=cache)
        found[name] = reference_of(definition, evaluator, more, cell_key(cell_m))
    return found


def reference_of(
    definition: Definition, evaluator: BlastEvaluator, more: Mapping[str, Layout], cell: str
) -> ScoreReference:
    """Return the reference layouts of a problem's score: the best rule and the best known layout.

    Args:
        evaluator: Runs the blasts of the comparison.
        more: Further known layouts, by the name of their source.
        cell: Side of the evaluator's cells; see `cell_key`.
    """
    rules = layouts_by_rule(definition.scenario, definition.case.charge)
    rules = {name: tuple(sorted(layout)) for name, layout in rules.items()}
    names = [*rules, *more]
    layouts = [*rules.values(), *more.values()]
    shares = dict(zip(names, shares_of(definition.case, layouts, evaluator), strict=True))
    rule, best = min(rules, key=shares.__getitem__), min(shares, key=shares.__getitem__)
    known = dict(zip(names, layouts, strict=True))
    return ScoreReference(
        definition.digest,
        engine_key(evaluator.engine),
        {name: shares[name] for name in rules},
        *(
            ReferenceLayout(layout, known[layout], {cell: shares[layout]})
            for layout in (rule, best)
        ),
    )
