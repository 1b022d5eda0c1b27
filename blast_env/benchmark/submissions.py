"""Submissions: a method's layouts, one per run, in a file for the judge."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal, TypeVar

from pydantic import ConfigDict, Field, TypeAdapter

from blast_env.benchmark.definitions import BUDGETS, DEFINITIONS, Definition
from blast_env.benchmark.problem import BenchmarkProblem
from blast_env.benchmark.references import Share
from blast_env.documents import MAX_BYTES, checked_as, parse_json, read_text
from blast_env.errors import BlastEnvError, value_text
from blast_env.evaluation import BudgetError
from blast_env.files import write_text
from blast_env.geometry import Layout
from blast_env.layout import check_layout
from blast_env.reading import read_apart
from blast_env.store import Store
from blast_env.values import MOST_SEED, path_of

FORMAT: Final = "blast-env submission 1"
MOST_BYTES: Final = 20_000_000
"""Most bytes of a file."""

MOST_RUNS: Final = 10_000
"""Most runs of a file: each problem with each budget and sixty seeds."""

MOST_BLASTS: Final = BUDGETS[-1]
"""Most blasts of a run: the largest budget of the score."""

Method = Callable[[BenchmarkProblem, int], Layout]
"""Finds a layout for a problem within its budget; the number is the random seed."""

Runs = TypeVar("Runs")
"""A dataclass with runs."""

Blasts = Annotated[int, Field(ge=0, le=MOST_BLASTS)]
Curve = Annotated[tuple[tuple[Blasts, Share], ...], Field(max_length=MOST_BLASTS)]
MethodName = Annotated[str, Field(min_length=1, max_length=60)]
Note = Annotated[str, Field(max_length=500)]


@dataclass(frozen=True)
class Run:
    """One run of a method on a problem.

    Attributes:
        problem: Name of the problem.
        budget: Most blasts of the run.
        seed: Seed of the run.
        blasts: Blasts spent.
        layout: The layout found.
        curve: Blasts and share of the load that remains with the best layout by then, as the
            method saw it, each time it changed.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    problem: str
    budget: Blasts
    seed: Annotated[int, Field(ge=0, le=MOST_SEED)]
    blasts: Blasts
    layout: Layout
    curve: Curve = field(default=(), kw_only=True)

    @property
    def key(self) -> tuple[str, int, int]:
        """Problem, budget and seed, which identify the run within a submission."""
        return self.problem, self.budget, self.seed


_RUN: Final = TypeAdapter(Run)


@dataclass(frozen=True)
class Submission:
    """All runs of a method.

    Attributes:
        method: Name in the table.
        runs: One per problem, budget and seed.
        note: Settings, versions, location of the code: one line.
        format: Format of the file.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    method: MethodName
    runs: Annotated[tuple[Run, ...], Field(min_length=1, max_length=MOST_RUNS)]
    note: Note = ""
    format: Literal["blast-env submission 1"] = FORMAT

    @classmethod
    def load(
        cls, path: str | Path, definitions: Mapping[str, Definition] = DEFINITIONS
    ) -> "Submission":
        """Read a file and check it.

        Raises:
            BlastEnvError: If it cannot be read or has another format, or as `check`.
        """
        found = read_runs(path, cls)
        try:
            found.check(definitions)
        except BlastEnvError as error:
            raise BlastEnvError(f"{path}: {error}") from error
        return found

    def save(self, path: str | Path) -> Path:
        """Write the file, one run per line.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        return write_runs(path, self)

    def check(self, definitions: Mapping[str, Definition] = DEFINITIONS) -> None:
        """Refuse invalid runs.

        Raises:
            BlastEnvError: If a problem is unknown, a run is there twice or exceeds its budget, or a
                layout is illegal; the message names run and reason.
        """
        seen, legal = set(), set()
        for index, run in enumerate(self.runs):
            where = f"runs[{index}]"
            if run.problem not in definitions:
                raise BlastEnvError(f"{where}: there is no problem {value_text(run.problem)}")
            if run.key in seen:
                raise BlastEnvError(
                    f"{where}: {run.problem}, {run.budget}, {run.seed}: appears twice"
                )
            if run.blasts > run.budget:
                raise BlastEnvError(
                    f"{where}: {run.blasts} blasts were spent, the budget is {run.budget}"
                )
            seen.add(run.key)
            if (run.problem, run.layout) in legal:
                continue
            try:
                check_layout(definitions[run.problem].scenario, run.layout)
            except BlastEnvError as error:
                raise BlastEnvError(f"{where}: {run.problem}: {error}") from error
            legal.add((run.problem, run.layout))


def read_runs(path: str | Path, kind: type[Runs], *others: type[Runs]) -> Runs:
    """Return the content of a file of runs; a large one is read in a separate process with limits.

    Args:
        kind: Its dataclass.
        others: Further dataclasses, for a file with their `format`.
    """
    path = path_of(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            found: Runs = read_apart(str(path), _runs_in, path, (kind, *others))
            return found
    except OSError:
        pass  # whose reason reading says
    read: Runs = _runs_in(path, (kind, *others))
    return read


def _runs_in(path: Path, kinds: tuple[Any, ...]) -> Any:
    try:
        content = parse_json(read_text(path, MOST_BYTES))
        given = content if isinstance(content, dict) else {}
        runs = given.get("runs")
        if isinstance(runs, list) and len(runs) > MOST_RUNS:
            raise BlastEnvError(f"has {len(runs):,} runs, must have at most {MOST_RUNS:,}")
        asked: Any = given.get("format")
        kind = next((kind for kind in kinds if kind.format == asked), kinds[0])
        return checked_as(kind, content)
    except BlastEnvError as error:
        raise BlastEnvError(f"{path}: {error}") from error


def write_runs(path: str | Path, record: Any) -> Path:
    """Write a dataclass with `runs` as JSON, one run per line."""
    rest = {name: value for name, value in asdict(record).items() if name != "runs"}
    lines = ",\n".join(f"    {json.dumps(asdict(run))}" for run in record.runs)
    head = json.dumps(rest, indent=2, allow_nan=False)[:-2]
    return write_text(path, f'{head},\n  "runs": [\n{lines}\n  ]\n}}\n')


@dataclass(frozen=True)
class RunGrid:
    """The runs of a method: every problem, budget and seed.

    Attributes:
        problems: Functions that make the problems from a budget.
        budgets: Budgets, blasts.
        seeds: Seeds of the runs; with the budget 0 only the first is used.
    """

    problems: Sequence[Callable[[int], BenchmarkProblem]]
    budgets: Sequence[int]
    seeds: Sequence[int] = field(default=(0,))

    def __iter__(self) -> Any:
        """Yield (function that makes the problem, budget, seed), seed by seed."""
        for seed in self.seeds:
            for budget in self.budgets:
                if budget or seed == self.seeds[0]:
                    yield from ((make, budget, seed) for make in self.problems)


def play(
    method: Method,
    asked: Iterable[tuple[Callable[[int], BenchmarkProblem], int, int]],
    store: Path | None = None,
    progress: Callable[[Run], None] | None = None,
    identity: str = "",
) -> tuple[Run, ...]:
    """Run a method on problems.

    A method that asks for more blasts than are left ends with the best layout that it evaluated.

    Args:
        method: The method.
        asked: Triples (function that makes the problem, budget, seed); see `RunGrid`.
        store: File in which each run is kept, a `Store`; runs that it has are not repeated.
        progress: Called with each run.
        identity: What the layouts go by besides the problem, such as a digest of weights or of the
            method's source: runs of another one are not taken from the store.

    Raises:
        BudgetError: If the budget does not pay for one evaluation.
        LayoutError: If its layout is illegal.
    """
    kept = None if store is None else Store(store)
    runs = []
    for make, budget, seed in asked:
        problem = make(budget)
        key = json.dumps((problem.definition.digest, budget, seed, identity))
        run = None if kept is None else kept.read(key, _RUN.validate_json)
        if run is None:
            layout = tuple(sorted(check_layout(problem.scenario, _found(method, problem, seed))))
            spent, curve = problem.blasts, problem.curve
            run = Run(problem.name, budget, seed, spent, layout, curve=curve)
            if kept is not None:
                kept.put(key, _RUN.dump_json(run))
        runs.append(run)
        if progress is not None:
            progress(run)
    return tuple(runs)


def _found(method: Method, problem: BenchmarkProblem, seed: int) -> Layout:
    try:
        return method(problem, seed)
    except BudgetError:
        if problem.best is None:
            raise
        return problem.best.layout
