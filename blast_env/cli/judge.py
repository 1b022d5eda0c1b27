"""`blast-env judge`: submissions to the benchmark, judged by gas dynamics."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from blast_env.benchmark import (
    BUDGETS,
    DEFINITIONS,
    JUDGE_CELL_M,
    SMALL,
    Asked,
    BenchmarkProblem,
    Definition,
    JudgedSubmission,
    Run,
    ScoreReference,
    Submission,
    judge,
    make,
    play,
    secret_sites,
    shipped_standings,
    standings_page,
    standings_tables,
    stored_references,
)
from blast_env.benchmark.judging import FORMAT as JUDGED
from blast_env.benchmark.references import cell_key
from blast_env.benchmark.submissions import read_runs
from blast_env.cli.command import FOLDER, argument, option
from blast_env.cli.options import CacheOptions, ProcessOptions
from blast_env.cli.output import print_line, print_table, progress_bar
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.engines import JUDGE, find_engine
from blast_env.files import make_folder, write_atomically

_OWN_SITES: Final = 8


@dataclass(frozen=True, kw_only=True)
class JudgeCommand(ProcessOptions, CacheOptions):
    """Run submissions to the benchmark again by gas dynamics, and show the standings.

    A submission is a file of layouts. Without one, the command shows the standings that come with
    the package. With --method, it first runs your method and writes its submission.
    """

    submissions: tuple[Path, ...] = argument("Files of submissions, judged ones too.", default=())
    method: str | None = option(
        None, "Run this method first: a search's name, or your own as module:object."
    )
    problem: tuple[str, ...] = option(
        (), "Problem for --method; may be given several times; else the small set, `all` for all."
    )
    budget: tuple[int, ...] = option(
        (), "Blasts that --method may spend; may be given several times; else 0 and 50."
    )
    seeds: int = option(1, "Runs of --method for each problem and budget above 0.", min=1)
    secret: str | None = option(
        None, "Judge --method on generated sites that only this text can draw."
    )
    sites: int = option(_OWN_SITES, "How many sites --secret draws.", min=1)
    search_cell_m: float = option(0.5, "Side of the cells for --method, m.")
    cell_m: float = option(JUDGE_CELL_M, "Side of the judge's cells, m.")
    out: Path | None = option(
        None, "Folder for the submission of --method and for the judged submissions.", writes=FOLDER
    )

    page: Path | None = option(None, "Write the standings as a page: .md.", writes=(".md",))

    def how_to_resume(self) -> str:
        """Return the way to resume after Ctrl-C: from the written runs, if there are any."""
        kept = super().how_to_resume()
        through = "the same command resumes after the completed runs"
        return kept if self.out is None or self.method is None else f"{through}; {kept}"

    def __call__(self) -> None:
        """Judge, and print the table."""
        find_engine(JUDGE, self.cell_m)  # refuses unusable cells before methods run
        if self.out is not None:
            make_folder(self.out)
        submitted = [_submission(path) for path in self.submissions]
        judged = [self._judged(each, DEFINITIONS, stored_references()) for each in submitted]
        if self.method is not None:
            definitions = self._definitions()
            submission = self._played(self.method, definitions)
            references = self._references(definitions)
            judged.append(self._judged(submission, definitions, references))
        elif self.secret is not None:
            raise BlastEnvError("--secret is given without --method: layouts cannot be known yet")
        together = (*shipped_standings(), *judged)
        _print_standings(together)
        if self.page is not None:
            with write_atomically(self.page) as temporary:
                temporary.write_text(standings_page(together), "utf-8")
            print_line(f"wrote {self.page}")

    def _definitions(self) -> Mapping[str, Definition]:
        if self.secret is not None:
            if self.problem:
                raise BlastEnvError("--problem and --secret exclude each other")
            return {each.name: each for each in secret_sites(self.secret, self.sites)}
        names = DEFINITIONS if self.problem == ("all",) else self.problem or SMALL
        return {name: make(name).definition for name in names}

    def _played(self, method: str, definitions: Mapping[str, Definition]) -> Submission:
        """Run the method; its submission is written before it is judged."""
        with import_extra("agents", "--method"):
            from blast_env.benchmark.methods import find_method
        found = find_method(method)
        made = [
            partial(_made, definition=each, cell_m=self.search_cell_m, cache=self.cache)
            for each in definitions.values()
        ]
        asked = tuple(Asked(made, self.budget or BUDGETS[:2], range(self.seeds)))
        journal = None if self.out is None else self.out / self._journal(method)
        with progress_bar(f"{len(asked)} runs of {method}") as progress:
            done: list[Run] = []

            def show(run: Run) -> None:
                done.append(run)
                progress(len(done) / len(asked))

            runs = play(found, asked, journal, show)
        submission = Submission(method[-60:], runs, f"blast-env judge --method {method}")
        if self.out is not None:
            print_line(f"wrote {submission.save(self.out / 'submission.json')}")
        return submission

    def _journal(self, method: str) -> str:
        """Return the file name of the runs that a call may resume: same method, same cells."""
        return f"runs_{_file_name(method)}_{self.search_cell_m:g}.jsonl"

    def _references(self, definitions: Mapping[str, Definition]) -> Mapping[str, ScoreReference]:
        """Return the stored references; for secret sites, those of rules and package search."""
        if self.secret is None:
            return stored_references()
        from blast_env.benchmark.methods import find_method, reference_of

        found = {}
        engine = find_engine(JUDGE, self.cell_m)
        for name, definition in definitions.items():
            problem = _made(BUDGETS[1], definition, self.search_cell_m, self.cache)
            best = find_method("surrogate")(problem, 0)
            evaluator = BlastEvaluator(definition.scenario, engine, cache=self.cache)
            more = {"surrogate, 50 blasts": best}
            found[name] = reference_of(definition, evaluator, more, cell_key(self.cell_m))
        return found

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
                self.cache,
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
    try:
        content = read_runs(path)
    except BlastEnvError as error:
        raise BlastEnvError(f"{path}: {error}") from error
    if isinstance(content, dict) and content.get("format") == JUDGED:
        return JudgedSubmission.load(path).submission
    return Submission.load(path)


def _print_standings(judged: Sequence[JudgedSubmission]) -> None:
    """Print one row per submission, the best first, in one table per set of problems."""
    for each in standings_tables(judged):
        print_table(each.title, each.headers, each.rows)
    if not judged:
        print_line("no submissions come with the package")
