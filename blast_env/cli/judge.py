"""`blast-env judge`: submissions to the benchmark, judged by gas dynamics."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Final

from blast_env.benchmark import (
    BUDGETS,
    DEFINITIONS,
    JUDGE_CELL_M,
    SMALL,
    Asked,
    BenchmarkProblem,
    Definition,
    JudgedSubmission,
    Method,
    Run,
    ScoreReference,
    Submission,
    judge,
    make,
    play,
    secret_sites,
    shipped_standings,
    site_problems,
    standings_page,
    standings_tables,
    stored_references,
)
from blast_env.benchmark.references import cell_key
from blast_env.benchmark.submissions import read_runs
from blast_env.cli.command import FOLDER, argument, option
from blast_env.cli.options import CacheOptions, ProcessOptions
from blast_env.cli.output import print_line, print_table, progress_bar
from blast_env.design.search import ProposerKind, proposers
from blast_env.envs.arguments import check_names
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation import BlastEvaluator, BlastStore
from blast_env.evaluation.engines import JUDGE, find_engine
from blast_env.files import make_folder, write_atomically

_OWN_SITES: Final = 8
_KEPT: Final = 4096
RULES: Final = "rules"
"""In the place of the names of all rules that suit the sites."""


@dataclass(frozen=True, kw_only=True)
class JudgeCommand(ProcessOptions, CacheOptions):
    """Run submissions to the benchmark again by gas dynamics, and show the standings.

    A submission is a file of layouts. Without one, the command shows the standings that come with
    the package. With --method or --run, it first runs methods and writes their submissions, with
    --scenario on your own sites.
    """

    submissions: tuple[Path, ...] = argument("Files of submissions, judged ones too.", default=())
    method: tuple[str, ...] = option(
        (),
        "Run this method first; may be given again: the name of a search or rule, `rules` for all "
        "that suit, or your own as module:object.",
    )
    run: tuple[Path, ...] = option(
        (), "Run folder of a trained agent, as a further method; may be given again."
    )
    problem: tuple[str, ...] = option(
        (), "Problem for the methods; may be given again; else the small set, `all` for all."
    )
    scenario: tuple[str, ...] = option(
        (), "Your own site in the place of problems: a file or bundled name; may be given again."
    )
    threat: str = option(
        "visible",
        "Of --scenario. visible: a problem for each charge. hidden: one for all charges.",
    )
    cases: int = option(16, "Most visible charges of a --scenario.", min=1)
    budget: tuple[int, ...] = option(
        (), "Blasts of a method; may be given again; else 50, and 0 for those that need none."
    )
    seeds: int = option(1, "Runs of a method for each problem and budget above 0.", min=1)
    secret: str | None = option(
        None, "Judge the methods on generated sites that only this text can draw."
    )
    sites: int = option(_OWN_SITES, "How many sites --secret draws.", min=1)
    search_cell_m: float = option(0.5, "Side of the cells for the methods, m.")
    cell_m: float = option(JUDGE_CELL_M, "Side of the judge's cells, m.")
    out: Path | None = option(
        None, "Folder for the submissions of methods and for the judged ones.", writes=FOLDER
    )

    page: Path | None = option(None, "Write the standings as a page: .md.", writes=(".md",))

    def how_to_resume(self) -> str:
        """Return the way to resume after Ctrl-C: from the written runs, if there are any."""
        kept = super().how_to_resume()
        through = "the same command resumes after the completed runs"
        return f"{through}; {kept}" if self.out is not None and self._plays else kept

    @property
    def _plays(self) -> bool:
        return bool(self.method or self.run)

    def __call__(self) -> None:
        """Judge, and print the table."""
        find_engine(JUDGE, self.cell_m)  # refuses unusable cells before methods run
        if not self._plays and (self.secret is not None or self.scenario):
            raise BlastEnvError("--secret and --scenario need a --method or a --run to judge")
        if self.out is not None:
            make_folder(self.out)
        submitted = [_submission(path) for path in self.submissions]
        judged = [self._judged(each, DEFINITIONS, stored_references()) for each in submitted]
        if self._plays:
            definitions = self._definitions()
            played = [
                self._played(name, method, budgets, definitions)
                for name, method, budgets in self._methods(definitions)
            ]
            references = self._references(definitions, played)
            judged += [self._judged(each, definitions, references) for each in played]
        together = (*shipped_standings(), *judged)
        _print_standings(together)
        if self.page is not None:
            with write_atomically(self.page) as temporary:
                temporary.write_text(standings_page(together), "utf-8")
            print_line(f"wrote {self.page}")

    def _definitions(self) -> Mapping[str, Definition]:
        asked = {"--problem": self.problem, "--secret": self.secret, "--scenario": self.scenario}
        given = [name for name, each in asked.items() if each]
        if len(given) > 1:
            raise BlastEnvError(f"{' and '.join(given)} exclude each other")
        if self.secret is not None:
            return {each.name: each for each in secret_sites(self.secret, self.sites)}
        if self.scenario:
            check_names("threat", [self.threat], ["visible", "hidden"])
            is_hidden = self.threat == "hidden"
            own = [site_problems(each, self.cases, is_hidden=is_hidden) for each in self.scenario]
            return {each.name: each for of_site in own for each in of_site}
        names = DEFINITIONS if self.problem == ("all",) else self.problem or SMALL
        return {name: make(name).definition for name in names}

    def _methods(
        self, definitions: Mapping[str, Definition]
    ) -> Iterator[tuple[str, Method, tuple[int, ...]]]:
        """Yield names, methods and their budgets."""
        with import_extra("agents", "--method"):
            from blast_env.benchmark.methods import budgets_of, find_method, method_of
        here = str(Path.cwd())
        if self.method and here not in sys.path:
            sys.path.insert(0, here)  # for module:object
        sites = [each.scenario for each in definitions.values()]
        for name in self.method:
            for each in proposers(ProposerKind.RULE, suiting=sites) if name == RULES else (name,):
                budgets = budgets_of(each, self.budget)
                if not budgets:
                    raise BlastEnvError(f"--budget is 0: {each} needs blasts")
                yield each, find_method(each), budgets
        if self.run:
            with import_extra("agents", "trained agents"):
                from blast_agents.training import load_agent

                from blast_env.design.surrogate import LearntSearch
        for run in self.run:
            agent = LearntSearch(agent=load_agent(run))
            yield f"agent {run.resolve().name}", method_of(agent), self.budget or BUDGETS[:2]

    def _played(
        self,
        name: str,
        method: Method,
        budgets: Sequence[int],
        definitions: Mapping[str, Definition],
    ) -> Submission:
        """Run a method; its submission is written before it is judged."""
        made = [
            partial(_made, definition=each, cell_m=self.search_cell_m, cache=self.cache)
            for each in definitions.values()
        ]
        asked = tuple(Asked(made, budgets, range(self.seeds)))
        store = None if self.out is None else self.out / self._store(name)
        with progress_bar(f"{len(asked)} runs of {name}") as progress:
            done: list[Run] = []

            def show(run: Run) -> None:
                done.append(run)
                progress(len(done) / len(asked))

            runs = play(method, asked, store, show)
        submission = Submission(name[-60:], runs, f"blast-env judge: {name}")
        if self.out is not None:
            print_line(f"wrote {submission.save(self.out / f'{_file_name(name)}.json')}")
        return submission

    def _store(self, method: str) -> str:
        """Return the file name of the runs that a call may resume: same method, same cells."""
        return f"runs_{_file_name(method)}_{self.search_cell_m:g}.sqlite"

    def _references(
        self, definitions: Mapping[str, Definition], played: Sequence[Submission]
    ) -> Mapping[str, ScoreReference]:
        """Return the stored references; for other sites, those of the rules and all layouts."""
        if self.secret is None and not self.scenario:
            return stored_references()
        from blast_env.benchmark.methods import find_method, reference_of

        found = {}
        engine = find_engine(JUDGE, self.cell_m)
        for name, definition in definitions.items():
            more = {
                f"{each.method}, {run.budget} blasts, seed {run.seed}": run.layout
                for each in played
                for run in each.runs
                if run.problem == name
            }
            if self.secret is not None:
                problem = _made(BUDGETS[1], definition, self.search_cell_m, self.cache)
                more["surrogate, 50 blasts"] = find_method("surrogate")(problem, 0)
            evaluator = BlastEvaluator(definition.scenario, engine, cache=self._shared)
            found[name] = reference_of(definition, evaluator, more, cell_key(self.cell_m))
        return found

    @cached_property
    def _shared(self) -> BlastStore:
        """The store of the judge's blasts: references and submissions need the same ones."""
        return BlastStore(self.cache, _KEPT)

    def _judged(
        self,
        submission: Submission,
        definitions: Mapping[str, Definition],
        references: Mapping[str, ScoreReference],
    ) -> JudgedSubmission:
        with progress_bar(f"judging {submission.method}") as progress:
            judged = judge(
                submission,
                self.cell_m,
                self.processes,
                self._shared,
                definitions=definitions,
                references=references,
                progress=progress,
            )
        if self.out is not None:
            print_line(
                f"wrote {judged.save(self.out / f'judged_{_file_name(judged.method)}.json')}"
            )
        return judged


def _made(
    budget: int, definition: Definition, cell_m: float, cache: Path | None
) -> BenchmarkProblem:
    return make(definition, budget, cell_m, cache=cache)


def _file_name(method: str) -> str:
    return "".join(letter if letter.isalnum() else "_" for letter in method)


def _submission(path: Path) -> Submission:
    """Read a submission, also one judged before."""
    kinds: tuple[type[Any], ...] = (Submission, JudgedSubmission)
    found: Any = read_runs(path, *kinds)
    submission: Submission = found.submission if isinstance(found, JudgedSubmission) else found
    try:
        submission.check()
    except BlastEnvError as error:
        raise BlastEnvError(f"{path}: {error}") from error
    return submission


def _print_standings(judged: Sequence[JudgedSubmission]) -> None:
    """Print one row per submission, the best first, in one table per set of problems."""
    for each in standings_tables(judged):
        print_table(each.title, each.headers, each.rows)
    if not judged:
        print_line("no submissions come with the package")
