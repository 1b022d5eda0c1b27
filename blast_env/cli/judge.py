"""`blast-env judge`: submissions to the benchmark, judged by gas dynamics."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import count
from pathlib import Path
from typing import Annotated, Final

import typer

from blast_env.answers import Line
from blast_env.answers.terminal import print_line
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
from blast_env.geometry import Layout

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
        "square_sites, low_sites, lane_sites or headroom_sites; may be given again.",
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
    judging = _Judge(cell_m, search_cell_m, range(seeds), processes, cache, out)
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
        submitted, entries = [read_submission(path) for path in submissions], list[_Entry]()
        if plays:
            definitions = _definitions(problem, secret, sites, scenario or (), threat, cases)
            entries = _entries(method, run, tuple(dict.fromkeys(budget)), definitions)
        judging.check_names([entry.method for entry in entries], submitted)
        judged = [judging.judged(item, DEFINITIONS, stored_references()) for item in submitted]
        if plays:
            played = [judging.played(entry, definitions) for entry in entries]
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
        own: dict[str, Definition] = {}
        for site in scenarios:
            for found in site_problems(site, cases, is_hidden=threat == "hidden"):
                other = own.setdefault(found.name, found)
                if other != found:
                    raise BlastEnvError(
                        f"--scenario {site}: its problems have the names of those of"
                        f" {other.site}: one of the files needs another name"
                    )
        return own
    return {name: make(name).definition for name in problems or DEFINITIONS}


@dataclass(frozen=True)
class _Entry:
    """A method that runs.

    Attributes:
        name: Its name on the command line.
        run: The method.
        budgets: The budgets with which it enters.
        identity: What its layouts go by besides the problem; see `play`.
    """

    name: str
    run: Method
    budgets: Sequence[int]
    identity: str = ""

    @property
    def method(self) -> str:
        """Its name in a submission."""
        return self.name.rpartition(":")[2][-60:]


def _entries(
    names: Sequence[str],
    runs: Sequence[Path],
    asked: Sequence[int],
    definitions: Mapping[str, Definition],
) -> list[_Entry]:
    """Return the methods by name and the trained agents, each once."""
    with import_extra("agents", "--method"):
        from blast_env.benchmark import methods
    here = str(Path.cwd())
    if names and here not in sys.path:
        sys.path.insert(0, here)  # for module:object
    sites = [definition.scenario for definition in definitions.values()]
    found = list[_Entry]()
    for name in names:
        if name in (AGENT, SURROGATE):
            found.append(_with_guesses(name, asked))
            continue
        given = [*methods.entries([name], asked, sites)]
        found += [_Entry(*entry, methods.source_digest(name)) for entry in given]
    found += [_trained(run, asked or BUDGETS[:2], definitions) for run in runs]
    return [*{(entry.name, entry.identity): entry for entry in found}.values()]


def _with_guesses(name: str, asked: Sequence[int]) -> _Entry:
    """Return the packaged agent, or the search that it begins."""
    from blast_env.benchmark.methods import budgets_of, method_of
    from blast_env.surrogate import packaged_surrogate

    if name == AGENT:
        agent, digests = agent_without_blasts()
        return _Entry(name, method_of(agent), (0,), " ".join(digests.values()))
    search, digests = surrogate_search(packaged_surrogate())
    own = FROM_AGENT if AGENT in digests else name  # two methods, never under one name
    return _Entry(own, method_of(search), budgets_of(name, asked), " ".join(digests.values()))


def _trained(run: Path, budgets: Sequence[int], definitions: Mapping[str, Definition]) -> _Entry:
    """Return the agent of a run folder; say if it has learnt against other threats."""
    from blast_env.benchmark.methods import method_of

    with import_extra("agents", "trained agents"):
        from blast_agents.training import load_agent
        from blast_agents.training.run_folder import RunFolder

        from blast_env.design.search.learnt import SurrogateSearch
    agent = load_agent(run)
    learnt = RunFolder(run).configuration().settings.threat
    known = [definition.case.charge is not None for definition in definitions.values()]
    if (learnt == "hidden" and any(known)) or (learnt == "visible" and not all(known)):
        shown = "where the charge is hidden" if learnt == "hidden" else "known charges"
        print_line(f"{run}: it has learnt {shown}, and is judged on problems of the other kind")
    search = SurrogateSearch(agent=agent)
    return _Entry(f"agent {run.resolve().name}", method_of(search), budgets, agent.digest)


@dataclass(frozen=True)
class _Judge:
    """Runs methods and judges their submissions, with the options of the command."""

    cell_m: float
    search_cell_m: float
    seeds: range
    processes: int
    cache: Path | None
    out: Path | None

    def __post_init__(self) -> None:
        find_engine(JUDGE, self.cell_m)  # refuses unusable cells before methods run

    def check_names(self, played: Sequence[str], submitted: Sequence[Submission]) -> None:
        """Refuse methods whose files would have one name."""
        names: dict[str, str] = {}
        methods = *(item.method for item in submitted), *played
        for method in methods if self.out is not None else ():
            if _file_name(method) in names:
                raise BlastEnvError(
                    f"{names[_file_name(method)]!r} and {method!r} would be one file in {self.out}:"
                    " give each a name of its own, or a call without the other"
                )
            names[_file_name(method)] = method

    def played(self, entry: _Entry, definitions: Mapping[str, Definition]) -> Submission:
        """Run a method; its submission is written before it is judged."""
        made = [partial(self.made, definition) for definition in definitions.values()]
        asked, name = tuple(RunGrid(made, entry.budgets, self.seeds)), entry.name
        store = None
        if self.out is not None:  # the runs that a call may resume: same method, same cells
            store = self.out / f"runs_{_file_name(name)}_{self.search_cell_m:g}.sqlite"
        ran: list[int] = []

        def counted(problem: BenchmarkProblem, seed: int) -> Layout:
            ran.append(seed)
            return entry.run(problem, seed)

        with progress_bar(f"{len(asked)} runs of {name}") as progress:
            done = count(1)
            advance = lambda _: progress(next(done) / len(asked))  # noqa: E731
            runs = play(counted, asked, store, advance, entry.identity)
        if len(ran) < len(asked):
            kept = len(asked) - len(ran)
            print_line(f"{kept} of {len(asked)} runs of {name} are those of an earlier call")
        submission = Submission(entry.method, runs, f"blast-env judge: {name}")
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
