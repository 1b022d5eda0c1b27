"""The methods of the package on the problems of the benchmark."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from blast_env.benchmark import (
    BUDGETS,
    BenchmarkProblem,
    Definition,
    KnownLayout,
    Method,
    ScoreReference,
)
from blast_env.benchmark.problem import shares_of
from blast_env.benchmark.references import engine_key
from blast_env.design.search import (
    Proposer,
    ProposerKind,
    find_proposer,
    layouts_by_rule,
)
from blast_env.design.search.registry import proposer_row
from blast_env.errors import BlastEnvError, value_text
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.engines.contract import load_plugin
from blast_env.geometry import Layout


def _proposed(proposer: Proposer, problem: BenchmarkProblem, seed: int) -> Layout:
    """Return the layout of a proposer, within the budget of a problem."""
    result = proposer.propose(problem, problem.most_blasts, seed)
    if result.interrupted:
        raise KeyboardInterrupt
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
    """Return a method by the name of a proposer, or by `module:object`.

    Raises:
        UnknownNameError: If the proposer is unknown.
        BlastEnvError: If the module or object does not exist or is not callable.
    """
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
    return known if kind is ProposerKind.LEARNT else tuple(each for each in known if each)


def reference_of(
    definition: Definition, evaluator: BlastEvaluator, more: Mapping[str, Layout], cell: str
) -> ScoreReference:
    """Return the reference layouts of a problem's score: the best rule and the best known layout.

    Args:
        definition: The problem.
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
        *(KnownLayout(each, known[each], {cell: shares[each]}) for each in (rule, best)),
    )
