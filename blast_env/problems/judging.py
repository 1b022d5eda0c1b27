"""Playing a submission again by gas dynamics, and its score between best rule and best known."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
from pydantic import ConfigDict, Field

from blast_env.documents import checked_as, parse_json
from blast_env.engines import JUDGE, Engine, find_engine
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastCache, BlastEvaluator
from blast_env.problems.definitions import BUDGETS, DEFINITIONS, Definition
from blast_env.problems.problem import shares_of
from blast_env.problems.references import ScoreReference, Share, cell_key, stored_references
from blast_env.problems.submissions import MOST_RUNS, Run, Submission, read_runs, write_runs
from blast_env.statistics import Estimate, stratified_estimate

JUDGE_CELL_M: Final = 0.25
"""Side of the cells that the judge uses."""

FORMAT: Final = "blast-env judged 1"

_SAME: Final = 1e-9
"""Shares that differ by less are equal."""


@dataclass(frozen=True)
class JudgedRun(Run):
    """A run that was played again; further attributes as of `Run`.

    Attributes:
        share: Share of the load without a barrier that is left.
        rule: The same of the best rule: score 0.
        best: The same of the best layout known: score 1.
    """

    share: Share
    rule: Share
    best: Share

    @property
    def score(self) -> float:
        """Score: 0 for the best rule or worse, 1 for the best known, more for a better one."""
        gain = self.rule - self.share
        if self.rule - self.best < _SAME:
            return 1.0 if gain > -_SAME else 0.0
        return max(gain / (self.rule - self.best), 0.0)


@dataclass(frozen=True)
class JudgedSubmission:
    """A submission that was played again; the table of standings is made of such files.

    Attributes:
        method: Name in the table.
        cell_m: Side of the judge's cells, m.
        engine: The judge, with its version.
        runs: As submitted, with what is left of the loads.
        note: As submitted.
        format: Of the file.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    method: str
    cell_m: Annotated[float, Field(gt=0.0)]
    engine: str
    runs: Annotated[tuple[JudgedRun, ...], Field(min_length=1, max_length=MOST_RUNS)]
    note: str = ""
    format: Literal["blast-env judged 1"] = FORMAT

    @classmethod
    def load(cls, path: str | Path) -> "JudgedSubmission":
        """Read a file.

        Raises:
            BlastEnvError: If it cannot be read or is anything else.
        """
        try:
            return checked_as(cls, read_runs(path))
        except BlastEnvError as error:
            raise BlastEnvError(f"{path}: {error}") from error

    def save(self, path: str | Path) -> Path:
        """Write the file, a run a line.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        return write_runs(path, self)

    @property
    def submission(self) -> Submission:
        """The same as it was submitted, to be judged again."""
        runs = (
            Run(each.problem, each.budget, each.seed, each.blasts, each.layout)
            for each in self.runs
        )
        return Submission(self.method, tuple(runs), self.note)

    @property
    def problems(self) -> tuple[str, ...]:
        """The problems that were entered."""
        return tuple(dict.fromkeys(run.problem for run in self.runs))

    def score(self, budget: int) -> Estimate:
        """Return the mean score with a budget, over the problems that were entered.

        What was found with fewer blasts counts for more blasts, too; without any it is 0. The 95 %
        interval says how the mean would change with other seeds of the same runs.
        """
        return self._mean({budget: 1.0})

    def area(self) -> Estimate:
        """Return the score over all budgets: the area under it over the logarithm of the blasts."""
        return self._mean(BUDGET_WEIGHTS)

    def _mean(self, of_budgets: Mapping[int, float]) -> Estimate:
        """Return the mean score with budgets, each by its weight."""
        groups = []
        for name in self.problems:
            weights: dict[int, float] = defaultdict(float)
            for budget, weight in of_budgets.items():
                weights[self._spent(name, budget)] += weight
            for budget, weight in weights.items():
                groups.append((weight / len(self.problems), self._scores(name, budget) or [0.0]))
        return stratified_estimate(groups)

    def _spent(self, problem: str, budget: int) -> int:
        """Return the largest budget up to this one that was entered; -1 if there is none."""
        entered = {run.budget for run in self.runs if run.problem == problem}
        return max((each for each in entered if each <= budget), default=-1)

    def _scores(self, problem: str, budget: int) -> list[float]:
        spent = self._spent(problem, budget)
        return [run.score for run in self.runs if run.problem == problem and run.budget == spent]


def _budget_weights() -> dict[int, float]:
    """Return the weight of each budget: the trapezoids over the logarithm of 1 + blasts."""
    places = np.log1p(np.array(BUDGETS, dtype=np.float64))
    widths = np.diff(places)
    weights = 0.5 * (np.append(widths, 0.0) + np.append(0.0, widths)) / places[-1]
    return {budget: float(weight) for budget, weight in zip(BUDGETS, weights, strict=True)}


BUDGET_WEIGHTS: Final[Mapping[int, float]] = _budget_weights()
"""Weights of the budgets in the area; together 1."""


def judge(
    submission: Submission,
    cell_m: float | None = JUDGE_CELL_M,
    processes: int = 1,
    cache: str | Path | BlastCache | None = None,
    engine: str | Engine = JUDGE,
    definitions: Mapping[str, Definition] = DEFINITIONS,
    references: Mapping[str, ScoreReference] | None = None,
    progress: Callable[[float], None] | None = None,
) -> JudgedSubmission:
    """Play a submission again by gas dynamics.

    Equal layouts are played once. Best rule and best known are played with the same cells, unless
    their loads with such cells are stored.

    Args:
        submission: The layouts.
        cell_m: Side of the cells, m.
        processes: Worker processes; they change nothing but the time.
        cache: Folder in which blasts are kept for the next call.
        engine: Another engine than gas dynamics, for tests.
        definitions: The problems by name.
        references: What they are scored between; the stored ones unless given.
        progress: Called with the share that is done.

    Raises:
        BlastEnvError: As `Submission.check`, or if a problem has no reference.
    """
    submission.check(definitions)
    known = stored_references() if references is None else references
    found = find_engine(engine, cell_m)
    by_problem: dict[str, list[Run]] = defaultdict(list)
    for run in submission.runs:
        by_problem[run.problem].append(run)
    judged: list[JudgedRun] = []
    for index, (name, runs) in enumerate(by_problem.items()):
        if name not in known:
            raise BlastEnvError(
                f"{name}: has no best rule and no best known layout to compare with"
            )
        evaluator = BlastEvaluator(definitions[name].scenario, found, cache=cache)
        judged += _judged(definitions[name], runs, known[name], evaluator, cell_m, processes)
        if progress is not None:
            progress((index + 1) / len(by_problem))
    return JudgedSubmission(
        submission.method,
        0.5 if cell_m is None else cell_m,
        found.version,
        tuple(judged),
        submission.note,
    )


def _judged(
    definition: Definition,
    runs: Sequence[Run],
    reference: ScoreReference,
    evaluator: BlastEvaluator,
    cell_m: float | None,
    processes: int,
) -> Iterator[JudgedRun]:
    cell = "" if cell_m is None else cell_key(cell_m)
    stored = {
        each.layout: each.shares[cell]
        for each in (reference.rule, reference.best)
        if cell in each.shares and evaluator.engine.name == JUDGE
    }
    wanted = (reference.rule.layout, reference.best.layout, *(run.layout for run in runs))
    layouts = [each for each in dict.fromkeys(wanted) if each not in stored]
    found = shares_of(definition.case, layouts, evaluator, processes)
    shares = dict(zip(layouts, found, strict=True)) | stored
    rule, best = (shares[each.layout] for each in (reference.rule, reference.best))
    for run in runs:
        yield JudgedRun(**vars(run), share=shares[run.layout], rule=rule, best=best)


def shipped_standings() -> tuple[JudgedSubmission, ...]:
    """Return the submissions that come with the package."""
    folder = files("blast_env.problems").joinpath("data/standings")
    if not folder.is_dir():
        return ()
    found = (each for each in folder.iterdir() if each.name.endswith(".json"))
    return tuple(
        checked_as(JudgedSubmission, parse_json(each.read_text("utf-8")))
        for each in sorted(found, key=lambda each: each.name)
    )
