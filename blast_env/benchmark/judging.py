"""Replay of submissions by gas dynamics, and scores from the best rule to the best known layout."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import ConfigDict, Field

from blast_env.arrays import FloatArray
from blast_env.benchmark.definitions import DEFINITIONS, Definition
from blast_env.benchmark.problem import shares_of
from blast_env.benchmark.references import (
    ScoreReference,
    Share,
    cell_key,
    engine_key,
    stored_references,
)
from blast_env.benchmark.submissions import (
    MOST_RUNS,
    MethodName,
    Note,
    Run,
    Submission,
    read_runs,
    write_runs,
)
from blast_env.documents import checked_as, parse_json
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, BlastStore
from blast_env.evaluation.engines import JUDGE, Engine, find_engine
from blast_env.statistics import Estimate, mean_estimate, p_value_of_mean, stratified_estimate

JUDGE_CELL_M: Final = 0.25
"""Side of the judge's cells, m."""

FORMAT: Final = "blast-env judged 1"

_SAME: Final = 1e-9
"""Tolerance within which shares are equal."""


@dataclass(frozen=True)
class RunJudgement(Run):
    """A replayed run; further attributes as in `Run`.

    Attributes:
        share: Share of the load without a barrier that remains.
        rule: The same for the best rule: score 0.
        best: The same for the best known layout: score 1.
    """

    share: Share
    rule: Share
    best: Share

    @property
    def score(self) -> float:
        """Score: 0 for the best rule or worse, 1 for the best known layout, above 1 if better.

        It forgets how much worse: `SubmissionJudgement.lead` ranks, which does not.
        """
        # Where the best known layout is no better than the rule, equal to it is full marks.
        gain = self.rule - self.share
        if self.rule - self.best < _SAME:
            return 1.0 if gain > -_SAME else 0.0
        return max(gain / (self.rule - self.best), 0.0)


@dataclass(frozen=True)
class SubmissionJudgement:
    """A replayed submission; the table of standings is made from files of these.

    Attributes:
        method: Name in the table.
        cell_m: Side of the judge's cells, m.
        engine: Version of the judge's engine.
        runs: The submitted runs with the shares of the load that remain.
        note: As submitted.
        format: Format of the file.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    method: MethodName
    cell_m: Annotated[float, Field(ge=0.01, le=100.0)]
    engine: Annotated[str, Field(max_length=500)]
    runs: Annotated[tuple[RunJudgement, ...], Field(min_length=1, max_length=MOST_RUNS)]
    note: Note = ""
    format: Literal["blast-env judged 1"] = FORMAT

    @classmethod
    def load(cls, path: str | Path) -> "SubmissionJudgement":
        """Read a file.

        Raises:
            BlastEnvError: If it cannot be read or has another format.
        """
        return read_runs(path, cls)

    def save(self, path: str | Path) -> Path:
        """Write the file, one run per line.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        return write_runs(path, self)

    @property
    def submission(self) -> Submission:
        """The submission without its shares, for another judgement."""
        runs = (Run(*run.key, run.blasts, run.layout, curve=run.curve) for run in self.runs)
        return Submission(self.method, tuple(runs), self.note)

    @property
    def problems(self) -> tuple[str, ...]:
        """The problems of the submission."""
        return tuple(dict.fromkeys(run.problem for run in self.runs))

    def score(self, budget: int) -> Estimate:
        """Return the mean score with a budget over the problems of the submission.

        A problem without a run scores 0. The 95 % interval covers the variation of the mean over
        the seeds of the runs.
        """
        scores = self._by_problem(budget, lambda run: run.score, 0.0)
        return stratified_estimate([(1.0 / len(scores), score) for score in scores])

    def reduction(self, budget: int) -> Estimate:
        """Return the mean share of the load taken off, with its interval over the problems.

        A problem without a run counts 0.
        """
        return self._mean(budget, lambda run: 1.0 - run.share, 0.0)

    def lead(self, budget: int) -> Estimate:
        """Return `reduction` less that of the best rule of each problem, paired by problem."""
        return self._mean(budget, lambda run: run.rule - run.share, -1.0)

    def lead_p_value(self, budget: int) -> float:
        """Return the p value of Student's t test over the problems that the lead is 0."""
        return p_value_of_mean(self._means(budget, lambda run: run.rule - run.share, -1.0))

    def _by_problem(
        self, budget: int, value: Callable[[RunJudgement], float], missing: float
    ) -> list[list[float]]:
        """Return a value of the runs with a budget, by problem."""
        # Every problem counts once, whatever the number of its runs, and also without any.
        found: dict[str, list[float]] = {name: [] for name in self.problems}
        for run in self.runs:
            if run.budget == budget:
                found[run.problem].append(value(run))
        return [item or [missing] for item in found.values()]

    def _mean(
        self, budget: int, value: Callable[[RunJudgement], float], missing: float
    ) -> Estimate:
        return mean_estimate(self._means(budget, value, missing))

    def _means(
        self, budget: int, value: Callable[[RunJudgement], float], missing: float
    ) -> FloatArray:
        """Return the mean value of the runs with a budget for each problem (problems,)."""
        return np.array([np.mean(runs) for runs in self._by_problem(budget, value, missing)])


def judge(
    submission: Submission,
    cell_m: float | None = JUDGE_CELL_M,
    processes: int = 1,
    cache: str | Path | BlastStore | None = None,
    engine: str | Engine = JUDGE,
    definitions: Mapping[str, Definition] = DEFINITIONS,
    references: Mapping[str, ScoreReference] | None = None,
    progress: Callable[[float], None] | None = None,
) -> SubmissionJudgement:
    """Replay a submission by gas dynamics.

    Equal layouts run once. The best rule and the best known layout run with the same cells, unless
    their shares with these cells and this version of the engine are stored.

    Args:
        submission: The layouts.
        cell_m: Side of the cells, m; `None` for the engine's default.
        processes: Number of worker processes; it has no effect on the result.
        cache: Folder or store in which blasts are kept for the next call.
        engine: Another engine than gas dynamics, for tests.
        definitions: The problems by name.
        references: References of the scores by problem; the stored ones unless given.
        progress: Called with the completed share, 0 to 1.

    Raises:
        BlastEnvError: As `Submission.check`, or if a problem has no reference.
    """
    submission.check(definitions)
    known = stored_references() if references is None else references
    found = find_engine(engine, cell_m)
    by_problem: dict[str, list[Run]] = defaultdict(list)
    for run in submission.runs:
        by_problem[run.problem].append(run)
    judged: list[RunJudgement] = []
    for index, (name, runs) in enumerate(by_problem.items()):
        if name not in known:
            raise BlastEnvError(
                f"{name}: has no best rule and no best known layout to compare with"
            )
        evaluator = BlastEvaluator(definitions[name].scenario, found, cache=cache)
        judged += _judged(definitions[name], runs, known[name], evaluator, cell_m, processes)
        if progress is not None:
            progress((index + 1) / len(by_problem))
    return SubmissionJudgement(
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
) -> Iterator[RunJudgement]:
    # 1. Shares of the references are stored for some cells, and hold for one version.
    cell = "" if cell_m is None else cell_key(cell_m)
    stored = {
        run.layout: run.shares[cell]
        for run in (reference.rule, reference.best)
        if cell in run.shares and engine_key(evaluator.engine) == reference.engine
    }
    # 2. All others run, each layout once.
    wanted = (reference.rule.layout, reference.best.layout, *(run.layout for run in runs))
    layouts = [layout for layout in dict.fromkeys(wanted) if layout not in stored]
    found = shares_of(definition.case, layouts, evaluator, processes)
    shares = dict(zip(layouts, found, strict=True)) | stored
    rule, best = (shares[run.layout] for run in (reference.rule, reference.best))
    for run in runs:
        yield RunJudgement(**vars(run), share=shares[run.layout], rule=rule, best=best)


def read_submission(path: Path) -> Submission:
    """Read a submission, also one judged before."""
    kinds: tuple[type[Any], ...] = (Submission, SubmissionJudgement)
    found: Any = read_runs(path, *kinds)
    submission: Submission = found.submission if isinstance(found, SubmissionJudgement) else found
    try:
        submission.check()
    except BlastEnvError as error:
        raise BlastEnvError(f"{path}: {error}") from error
    return submission


def shipped_standings() -> tuple[SubmissionJudgement, ...]:
    """Return the bundled judged submissions."""
    folder = files("blast_env.benchmark").joinpath("data/standings")
    if not folder.is_dir():
        return ()
    found = (path for path in folder.iterdir() if path.name.endswith(".json"))
    return tuple(
        checked_as(SubmissionJudgement, parse_json(path.read_text("utf-8")))
        for path in sorted(found, key=lambda path: path.name)
    )
