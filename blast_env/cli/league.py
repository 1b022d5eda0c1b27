"""`blast-env league`: searches, rules and trained agents on the same held-out cases."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from blast_env.cli.command import FOLDER, option
from blast_env.cli.options import (
    BY_SITE,
    CELL_HELP,
    CELLS_HELP,
    ENGINE_HELP,
    ClusterOptions,
    ProcessOptions,
    running_on,
)
from blast_env.cli.output import (
    print_line,
    print_table,
    print_written,
    progress_bar,
)
from blast_env.design.search import proposers
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation.engines import Engine, default_engine, find_engine
from blast_env.provenance import command
from blast_env.sites import FAMILIES

if TYPE_CHECKING:
    from blast_agents.league import Contest, ResultStore, Standings, Track
    from blast_agents.league.trained import TrainedRun

    from blast_env.design.surrogate import Surrogate


@dataclass(frozen=True, kw_only=True)
class LeagueCommand(ProcessOptions, ClusterOptions):
    """Compare searches, rules and trained agents on the same held-out cases and seeds.

    An interrupted league resumes when it is called again with the same folder.
    """

    out: Path = option(
        ...,
        "Folder for tables, figures and results; results already in it are kept.",
        writes=FOLDER,
    )
    track: str = option("known", f"known, hidden, vehicle, {', '.join(FAMILIES)} or all.")
    cases: int = option(16, "Cases of a track; a hidden threat on a known site is one.")
    seeds: int = option(16, "Held-out threats of a case; 4 times as many where there is one.")
    budgets: str = option("50,200,1000", "Blasts a search may spend on a case.")
    methods: str = option(
        "best_rule,random,population_annealing,genetic",
        f"Search methods: {', '.join(proposers())}.",
    )
    method: tuple[str, ...] = option(
        (),
        "Your own optimiser, for the same budgets; may be given again. Its blasts are "
        "counted, and refused beyond the budget.",
        metavar="MODULE:OBJECT",
    )
    run: tuple[Path, ...] = option(
        (),
        "Run folder of a trained agent; may be given again. It enters the tracks that it was "
        "trained for.",
    )
    scenario: tuple[str, ...] = option(
        (),
        "Scenario of the tracks known and hidden, in the place of the bundled ones; may be given "
        "again.",
    )
    seed: int = option(0, "Decides cases, threats and searches.")
    engine: str | None = option(
        None,
        f"{ENGINE_HELP} It judges, and searches spend blasts of it.",
        show_default=BY_SITE,
    )
    first_engine: str | None = option(
        None,
        "Cheaper engine: every search enters once more with blasts of this one; the judge then "
        "decides among its best layouts.",
    )
    agent_search: str = option("", "Blasts that a search from an agent may spend on a case.")
    surrogate: Path | None = option(
        None,
        "Surrogate of gas dynamics (studies.surrogate fit): an entry by itself, and a search with "
        "the blasts of --agent-search. It also ranks the layouts of agents and guides their "
        "searches, as further entries.",
    )
    cell_m: float | None = option(None, CELL_HELP)
    cells: str | None = option(None, CELLS_HELP, show_default="uniform")

    def how_to_resume(self) -> str:
        """Return the way to resume after Ctrl-C."""
        return "the same command resumes after the completed part"

    def __call__(self) -> None:
        """Play the tracks, and write the results."""
        # Here, because its figures need the extra `render`, and because it imports pandas.
        from blast_agents.league import ResultStore, find_tracks
        from blast_agents.league.report import write_league

        from blast_env.design.surrogate import load_surrogate

        with running_on(self.cluster):
            engine = find_engine(self.engine or self._by_site(), self.cell_m, cells=self.cells)
            tracks = find_tracks(
                self.track, self.cases, self.seeds, self.seed, self.scenario, noisy=engine.has_noise
            )
            for each in tracks:
                if each.name.startswith("known_") and len(each.cases) < self.cases:
                    print_line(
                        f"note: cases of {each.name}: {len(each.cases)}, not {self.cases}: the "
                        "scenario has no more charges, and without noise none counts twice"
                    )
            runs = _load_runs(self.run, tracks)
            store = ResultStore(self.out / "results")
            found = None if self.surrogate is None else load_surrogate(self.surrogate)
            contests = [self._contest(each, runs, found, store, engine) for each in tracks]
            scenarios = [case.scenario for each in tracks for case in each.cases]
            print_line(engine.describe(scenarios))
            _print_outlook(contests)
            all_standings = [_play(contest, self.processes) for contest in contests]
            written = write_league(all_standings, self.out, shlex.join(command()))
        print_written(written)

    def _by_site(self) -> str:
        """Return the default engine of the named sites, or of the track's family."""
        # Here, because it takes half a second to import.
        from blast_env.envs.strategies import scenario_source

        names = self.scenario or ((self.track,) if self.track in FAMILIES else ())
        sites = (scenario_source(each).representative for each in names)
        return default_engine(*sites, particles="event")

    def _contest(
        self,
        track: "Track",
        runs: "Sequence[TrainedRun]",
        surrogate: "Surrogate | None",
        store: "ResultStore",
        engine: Engine,
    ) -> "Contest":
        from blast_agents.league import Contest, standard_entries

        budgets = _budgets("--budgets", self.budgets)
        agent_budgets = _budgets("--agent-search", self.agent_search)
        methods = [*_names(self.methods), *self._own_methods()]
        entries = standard_entries((case.scenario for case in track.cases), methods, budgets)
        if self.first_engine is not None:
            asked = [each for each in entries if each.budget]
            entries += tuple(replace(each, first_engine=self.first_engine) for each in asked)
        for run in runs:
            if run.is_for(track):
                entries += run.entries(agent_budgets, surrogate)
        if surrogate is not None:
            # Here, because it imports torch.
            from blast_agents.league.trained import surrogate_entries

            entries += surrogate_entries(surrogate, agent_budgets)
        return Contest(track, entries, store, engine)

    def _own_methods(self) -> tuple[str, ...]:
        """Return the user's optimisers, which may lie in the current folder."""
        for place in self.method:
            if ":" not in place:
                raise BlastEnvError(f"--method is {place!r}, must be MODULE:OBJECT")
        here = str(Path.cwd())
        if self.method and here not in sys.path:
            sys.path.insert(0, here)
        return self.method


def _load_runs(runs: Sequence[Path], tracks: "Sequence[Track]") -> "list[TrainedRun]":
    if not runs:
        return []
    # Here, because torch takes seconds to start, and is an extra.
    with import_extra("agents", "trained agents"):
        from blast_agents.league.trained import TrainedRun, check_runs

    loaded = [TrainedRun.load(run) for run in runs]
    check_runs(loaded, tracks)
    return loaded


def _print_outlook(contests: "Sequence[Contest]") -> None:
    """Print the number of blasts to come, before they start."""
    total = 0
    for contest in contests:
        outlook = contest.outlook()
        total += outlook.blasts
        print_line(
            f"{contest.track.name}: up to {outlook.search_blasts:,} blasts of searches and "
            f"{outlook.held_out_blasts:,} on held-out threats; {outlook.kept_searches} of "
            f"{outlook.searches} searches are complete already"
        )
    print_line(f"up to {total:,} blasts in all")


def _play(contest: "Contest", processes: int) -> "Standings":
    # Here, because its figures need the extra `render`.
    from blast_agents.league.report import HEADERS, sample_text, table_rows, verdict_lines

    with progress_bar(contest.track.name) as progress:
        standings = contest.play(processes, progress)
    two_lines = [
        "\n".join(header.rsplit(" ", 1)) for header in HEADERS
    ]  # so that a page holds them
    print_table(contest.track.title, two_lines, table_rows(standings))
    for line in (f"{sample_text(standings)}.", *verdict_lines(standings)):
        print_line(line)
    return standings


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _budgets(flag: str, text: str) -> list[int]:
    """Return the budgets of a list with commas.

    Raises:
        BlastEnvError: If one is no whole number from 1 on, or occurs twice.
    """
    names = _names(text)
    if any(not name.isdecimal() or int(name) < 1 for name in names) or len(set(names)) < len(names):
        raise BlastEnvError(
            f"{flag} is {text!r}, must be different whole numbers from 1 on with commas between, "
            "e.g. 50,200"
        )
    return [int(name) for name in names]
