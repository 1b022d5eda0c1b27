"""What agents that use tools score without a model: scripts and searches at an equal budget.

python -m studies.tools_table
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory
from time import perf_counter

import typer

from blast_env.answers.terminal import print_line
from blast_env.benchmark import JUDGE_CELL_M, make
from blast_env.benchmark.methods import find_method
from blast_env.benchmark.submissions import play
from blast_env.cli.output import user_errors
from blast_env.tables import markdown_table
from blast_env.tools import SCRIPTS, Session, played_in
from blast_env.tools.records import pieces_of
from blast_env.tools.scripts import Script, submitted

Agent = Callable[[str, int, int], Script]
"""Returns the script of a problem, a seed and a budget."""


def _scripted(name: str) -> Agent:
    return lambda _, __, ___: SCRIPTS[name]()


def _searched(name: str) -> Agent:
    """Return an agent that submits what a search finds with the same budget, and no tool."""

    def search(problem: str, seed: int, budget: int) -> Script:
        asked = [(lambda blasts: make(problem, blasts), budget, seed)]
        (run,) = play(find_method(name), asked)
        return submitted([piece.model_dump() for piece in pieces_of(run.layout)])

    return search


HEADERS = ("agent", "mean score", "range", "seconds an episode")

AGENTS: dict[str, Agent] = {
    **{name: _scripted(name) for name in SCRIPTS},
    "the package's proposal": _searched("package"),
    "genetic search": _searched("genetic"),
    "search by the surrogate": _searched("surrogate"),
}


@dataclass(frozen=True)
class Episodes:
    """The episodes of each agent.

    Attributes:
        problems: Names of problems.
        budget: Most blasts of an episode.
        seeds: Episodes of each problem.
        cell_m: Side of the judge's cells, m.
        known: Folder of blasts that every episode begins with.
    """

    problems: Sequence[str]
    budget: int
    seeds: int
    cell_m: float
    known: Path

    def row(self, name: str) -> tuple[str, str, str, str]:
        """Return an agent's mean score, its range, and its seconds an episode."""
        scores, seconds = [], 0.0
        for problem, seed in product(self.problems, range(self.seeds)):
            with TemporaryDirectory() as folder:
                cache = copytree(self.known, Path(folder) / "blasts")
                session = Session(problem, seed, self.budget, judge_cell_m=self.cell_m, cache=cache)
                began_s = perf_counter()
                scores.append(played_in(AGENTS[name](problem, seed, self.budget), session))
                seconds += perf_counter() - began_s
                session.close()
        span = f"{min(scores):.2f} to {max(scores):.2f}"
        mean_s = seconds / len(scores)
        return name, f"{sum(scores) / len(scores):.2f}", span, f"{mean_s:.1f}"


def main(
    problem: list[str] = typer.Option(["control_room-known-v2"], help="Problems."),
    budget: int = typer.Option(4, help="Most blasts of an episode."),
    seeds: int = typer.Option(1, help="Episodes of each problem."),
    cell_m: float = typer.Option(JUDGE_CELL_M, "--cell", help="Side of the judge's cells, m."),
) -> None:
    """Print a table of the agents."""
    with user_errors(), TemporaryDirectory() as folder:
        for name in problem:  # what all episodes share: what is compiled, the judge's references
            known = Session(name, 0, 0, judge_cell_m=cell_m, cache=folder)
            played_in(SCRIPTS["nothing"](), known)
            known.close()
        episodes = Episodes(problem, budget, seeds, cell_m, Path(folder))
        rows = [episodes.row(name) for name in AGENTS]
        print_line(markdown_table(HEADERS, rows))


if __name__ == "__main__":
    typer.run(main)
