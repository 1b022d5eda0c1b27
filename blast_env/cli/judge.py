"""`blast-env judge`: submissions to the benchmark, judged by gas dynamics."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import count
from pathlib import Path
from typing import Annotated, Final

import typer

from blast_env.answers import Line
from blast_env.benchmark import (
    BUDGETS,
    DEFINITIONS,
    JUDGE_CELL_M,
    BenchmarkProblem,
    Definition,
    Method,
    RunGrid,
    ScoreReference,
    Submission,
    SubmissionJudgement,
    make,
    play,
    secret_sites,
    shipped_standings,
    site_problems,
    standings_page,
    standings_tables,
    stored_references,
)
from blast_env.benchmark import judge as judge_submission
from blast_env.benchmark.judging import read_submission
from blast_env.cli.agents import (
    AGENT,
    FROM_AGENT,
    SURROGATE,
    agent_without_blasts,
    surrogate_search,
)
from blast_env.cli.command import writes
from blast_env.cli.options import CacheOption, ProcessesOption, refuse_given, resume_words
from blast_env.cli.output import print_outcome, print_written, progress_bar, resumable
from blast_env.envs.arguments import check_names
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation import BlastStore
from blast_env.evaluation.engines import JUDGE, find_engine
from blast_env.files import make_folder, write_text

_KEPT: Final = 4096
_OF_METHODS: Final = ("problem", "budget", "seeds", "search_cell_m")
_OF_SCENARIOS: Final = ("threat", "cases")
_OF_SECRETS: Final = ("sites",)
_NO_STANDINGS: Final = (Line.of("no submissions come with the package"),)

_ScenarioOption = Annotated[
    list[str] | None,
    typer.Option(
        help="Your own site in the place of problems: a file, a bundled name, or for generated "
        "ones sites, item_sites, large_sites, kerb_sites, street_sites, court_sites, "
        "square_sites or headroom_sites; may be given again.",
    ),
]
_ThreatOption = Annotated[
    str,
    typer.Option(
        help="Of --scenario. visible: a problem for each charge. hidden: one for all charges."
    ),
]
_CasesOption = Annotated[
    int,
    typer.Option(help="Most visible charges of a --scenario, or how many generated sites.", min=1),
]
_SeedsOption = Annotated[
    int, typer.Option(help="Runs of a method for each problem and budget above 0.", min=1)
]
_SecretOption = Annotated[
    str | None,
    typer.Option(help="Judge the methods on generated sites that only this text can draw."),
]
_SearchCellOption = Annotated[
    float, typer.Option("--search-cell", help="Side of the cells for the methods, m.")
]


def judge(
    context: typer.Context,
    submissions: list[Path] = typer.Argument(
        default=[], help="Files of submissions, judged ones too."
    ),
    method: list[str] = typer.Option(
        [],
        help="Run this method first; may be given again: the name of a search or rule, `agent` for "
        "the packaged agent, `rules` for all that suit, or your own as module:object.",
    ),
    run: list[Path] = typer.Option(
        [], help="Run folder of a trained agent, as a further method; may be given again."
    ),
    problem: list[str] = typer.Option(
        [], help="Problem for the methods; may be given again; else all."
    ),
    scenario: _ScenarioOption = None,
    threat: _ThreatOption = "visible",
    cases: _CasesOption = 16,
    budget: list[int] = typer.Option(
        [],
        help="Blasts of a method; may be given again; else 50, and 0 for those that need none.",
    ),
    seeds: _SeedsOption = 1,
    secret: _SecretOption = None,
    sites: int = typer.Option(8, help="How many sites --secret draws.", min=1),
    search_cell_m: _SearchCellOption = 0.5,
    cell_m: float = typer.Option(JUDGE_CELL_M, "--cell", help="Side of the judge's cells, m."),
    out: Path | None = writes("Folder for the submissions of methods and for the judged ones"),
    page: Path | None = writes("Write the standings as a page", ".md"),
    processes: ProcessesOption = 1,
    cache: CacheOption = None,
) -> None:
    """Run submissions to the benchmark again by gas dynamics, and show the standings.

    A submission is a file of layouts. Without one, the command shows the standings that come with
    the package. With --method or --run, it first runs methods and writes their submissions, with
    --scenario on your own sites.
    """
    judging = _Judging(cell_m, search_cell_m, range(seeds), processes, cache, out)
    plays = bool(method or run)
    is_secret = secret is not None
    if not plays and (is_secret or scenario):
        raise BlastEnvError("--secret and --scenario need a --method or a --run to judge")
    _refuse_without_effect(context, plays=plays, is_own=bool(scenario), is_secret=is_secret)
    resume = resume_words(cache)
    if plays and out is not None:
        resume = f"the same command resumes after the completed runs; {resume}"
    with resumable(resume):
        if out is not None:
            make_folder(out)
        submitted = [read_submission(path) for path in submissions]
        judged = [judging.judged(item, DEFINITIONS, stored_references()) for item in submitted]
        if plays:
            definitions = _definitions(problem, secret, sites, scenario or (), threat, cases)
            played = [
                judging.played(*item, definitions)
                for item in _methods(method, run, tuple(dict.fromkeys(budget)), definitions)
            ]
            references = stored_references()
            if is_secret or scenario:
                references = judging.references(played, definitions, is_secret=is_secret)
            judged += [judging.judged(item, definitions, references) for item in played]
    together = (*shipped_standings(), *judged)
    written = [] if page is None else [write_text(page, standings_page(together))]
    print_outcome(standings_tables(together) if together else _NO_STANDINGS, written)


def _refuse_without_effect(
    context: typer.Context, *, plays: bool, is_own: bool, is_secret: bool
) -> None:
    """Refuse options without the one that they belong to: all problems take hours."""
    if not plays:
        refuse_given(context, _OF_METHODS, "is for --method and --run")
    if not is_own:
        refuse_given(context, _OF_SCENARIOS, "is for --scenario")
    if not is_secret:
        refuse_given(context, _OF_SECRETS, "is for --secret")


def _definitions(
    problems: Sequence[str],
    secret: str | None,
    count: int,
    scenarios: Sequence[str],
    threat: str,
    cases: int,
) -> Mapping[str, Definition]:
    """Return the problems of the methods by name: those named, secret, or of your own sites."""
    asked = {"--problem": problems, "--secret": secret, "--scenario": scenarios}
    given = [name for name, item in asked.items() if item]
    if len(given) > 1:
        raise BlastEnvError(f"{' and '.join(given)} exclude each other")
    if secret is not None:
        return {secret_site.name: secret_site for secret_site in secret_sites(secret, count)}
    if scenarios:
        check_names("threat", [threat], ["visible", "hidden"])
        own = [
            site_problems(scenario, cases, is_hidden=threat == "hidden") for scenario in scenarios
        ]
        return {problem.name: problem for of_site in own for problem in of_site}
    return {name: make(name).definition for name in problems or DEFINITIONS}


def _methods(
    names: Sequence[str],
    runs: Sequence[Path],
    asked: Sequence[int],
    definitions: Mapping[str, Definition],
) -> Iterator[tuple[str, Method, Sequence[int]]]:
    """Yield names, methods and their budgets."""
    with import_extra("agents", "--method"):
        from blast_env.benchmark.methods import budgets_of, entries, method_of
        from blast_env.surrogate import packaged_surrogate
    here = str(Path.cwd())
    if names and here not in sys.path:
        sys.path.insert(0, here)  # for module:object
    sites = [definition.scenario for definition in definitions.values()]
    for name in names:
        if name == AGENT:
            yield name, method_of(agent_without_blasts()[0]), (0,)
        elif name == SURROGATE:
            search, digests = surrogate_search(packaged_surrogate())
            own = FROM_AGENT if AGENT in digests else name  # two methods, never under one name
            yield own, method_of(search), budgets_of(name, asked)
        else:
            yield from entries([name], asked, sites)
    if runs:
        with import_extra("agents", "trained agents"):
            from blast_agents.training import load_agent

            from blast_env.design.search.learnt import SurrogateSearch
    for run in runs:
        agent = SurrogateSearch(agent=load_agent(run))
        yield f"agent {run.resolve().name}", method_of(agent), asked or BUDGETS[:2]


@dataclass(frozen=True)
class _Judging:
    """Runs methods and judges their submissions, with the options of the command."""

    cell_m: float
    search_cell_m: float
    seeds: range
    processes: int
    cache: Path | None
    out: Path | None

    def __post_init__(self) -> None:
        find_engine(JUDGE, self.cell_m)  # refuses unusable cells before methods run

    def played(
        self,
        name: str,
        method: Method,
        budgets: Sequence[int],
        definitions: Mapping[str, Definition],
    ) -> Submission:
        """Run a method; its submission is written before it is judged."""
        made = [partial(self.made, definition) for definition in definitions.values()]
        asked = tuple(RunGrid(made, budgets, self.seeds))
        store = None
        if self.out is not None:  # the runs that a call may resume: same method, same cells
            store = self.out / f"runs_{_file_name(name)}_{self.search_cell_m:g}.sqlite"
        with progress_bar(f"{len(asked)} runs of {name}") as progress:
            done = count(1)
            runs = play(method, asked, store, lambda _: progress(next(done) / len(asked)))
        submission = Submission(name.rpartition(":")[2][-60:], runs, f"blast-env judge: {name}")
        if self.out is not None:
            print_written([submission.save(self.out / f"{_file_name(name)}.json")])
        return submission

    def references(
        self,
        played: Sequence[Submission],
        definitions: Mapping[str, Definition],
        *,
        is_secret: bool,
    ) -> Mapping[str, ScoreReference]:
        """Return the references of problems of your own, or of secret ones."""
        from blast_env.benchmark.methods import references_of

        guided = self.made if is_secret else None
        return references_of(definitions, played, self.cell_m, self.shared, guided)

    def judged(
        self,
        submission: Submission,
        definitions: Mapping[str, Definition],
        references: Mapping[str, ScoreReference],
    ) -> SubmissionJudgement:
        """Judge a submission."""
        with progress_bar(f"judging {submission.method}") as progress:
            judged = judge_submission(
                submission,
                self.cell_m,
                self.processes,
                self.shared,
                definitions=definitions,
                references=references,
                progress=progress,
            )
        if self.out is not None:
            name = f"judged_{_file_name(judged.method)}.json"
            print_written([judged.save(self.out / name)])
        return judged

    def made(self, definition: Definition, budget: int) -> BenchmarkProblem:
        """Return a problem for a method."""
        return make(definition, budget, self.search_cell_m, cache=self.cache)

    @cached_property
    def shared(self) -> BlastStore:
        """The store of the judge's blasts: references and submissions need the same ones."""
        return BlastStore(self.cache, _KEPT)


def _file_name(method: str) -> str:
    return "".join(letter if letter.isalnum() else "_" for letter in method)
