"""`blast-env league`: searches, rules and trained agents on the same held-out cases."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from blast_agents.league import (
    Agent,
    Contest,
    Entry,
    ResultStore,
    Search,
    Standings,
    Track,
    Training,
    find_tracks,
    standard_entries,
)
from blast_agents.surrogate.network import Surrogate, load_surrogate
from blast_agents.surrogate.search import SurrogateAgent, SurrogateSearch

from blast_env.cli.cluster import ClusterAddress, running_on
from blast_env.cli.options import CellSide, Processes
from blast_env.cli.output import (
    make_table,
    print_line,
    progress_bar,
    result_console,
    user_errors,
)
from blast_env.cli.targets import checked_targets
from blast_env.engines import Engine, find_engine
from blast_env.errors import BlastEnvError, import_extra
from blast_env.provenance import command

if TYPE_CHECKING:
    from blast_agents.league.trained import TrainedRun


def league(
    out: Annotated[
        Path, typer.Option(help="Folder for tables, figures and results; goes on with what it has.")
    ],
    track: Annotated[
        str, typer.Option(help="known, hidden, vehicle, sites, item_sites or all.")
    ] = "known",
    cases: Annotated[
        int, typer.Option(help="Cases of a track; a hidden threat on a known site is one.")
    ] = 16,
    seeds: Annotated[
        int, typer.Option(help="Held-out threats of a case; 4 times as many where there is one.")
    ] = 16,
    budgets: Annotated[str, typer.Option(help="Blasts a search may spend on a case.")] = (
        "50,200,1000"
    ),
    methods: Annotated[str, typer.Option(help="Search methods.")] = (
        "random,greedy,annealing,genetic"
    ),
    run: Annotated[
        list[Path] | None,
        typer.Option(
            help="Run folder of a trained agent; may be given again. It enters the "
            "tracks that it was trained for."
        ),
    ] = None,
    scenario: Annotated[
        list[str] | None,
        typer.Option(
            help="Scenario of the tracks known and hidden, in the place of the bundled "
            "ones; may be given again."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Decides cases, threats and searches.")] = 0,
    engine: Annotated[
        str, typer.Option(help="Engine that judges, and that searches spend blasts of.")
    ] = "event",
    first_engine: Annotated[
        str | None,
        typer.Option(
            help="Cheaper engine: every search enters once more with blasts of this one; the judge "
            "then decides among its best layouts."
        ),
    ] = None,
    agent_search: Annotated[
        str, typer.Option(help="Blasts that a search from an agent may spend on a case.")
    ] = "",
    surrogate: Annotated[
        Path | None,
        typer.Option(
            help="Surrogate of gas dynamics (studies.surrogate fit): enters by itself, and as a "
            "search with the blasts of --agent-search; what agents draw enters ranked by it, and "
            "their searches guided by it, too."
        ),
    ] = None,
    cell: CellSide = None,
    processes: Processes = 1,
    cluster: ClusterAddress = None,
) -> None:
    """Compare searches, rules and trained agents on the same held-out cases and seeds.

    An interrupted league goes on when it is called again with the same folder.
    """
    with (
        user_errors(lambda: "the same command goes on with what is through"),
        checked_targets(folders={"--out": out}),
        running_on(cluster),
    ):
        # Here, because its figures need the extra `render`.
        from blast_agents.league.report import write_league

        chosen = find_engine(engine, cell)
        noisy = chosen.has_noise
        tracks = find_tracks(track, cases, seeds, seed, scenario or (), noisy=noisy)
        runs = _load_runs(run or (), tracks)
        store = ResultStore(out / "results")
        searches = _Searches(
            tuple(_names(methods)),
            tuple(_numbers(budgets)),
            first_engine,
            tuple(_numbers(agent_search, "--agent-search")),
        )
        found = None if surrogate is None else load_surrogate(surrogate)
        contests = [_contest(each, runs, searches, found, store, chosen) for each in tracks]
        scenarios = [case.scenario for each in tracks for case in each.cases]
        print_line(chosen.describe(scenarios))
        _print_outlook(contests)
        all_standings = [_play(contest, processes) for contest in contests]
        written = write_league(all_standings, out, shlex.join(command()))
    for path in written:
        print_line(f"wrote {path}")


@dataclass(frozen=True)
class _Searches:
    """What searches enter: each method with each budget, and those from agents."""

    methods: tuple[str, ...]
    budgets: tuple[int, ...]
    first_engine: str | None
    agent_budgets: tuple[int, ...]


def _load_runs(runs: Sequence[Path], tracks: Sequence[Track]) -> "list[TrainedRun]":
    if not runs:
        return []
    # Here, because torch takes seconds to start, and is an extra.
    with import_extra("agents", "trained agents"):
        from blast_agents.league.trained import TrainedRun, check_runs

    loaded = [TrainedRun.load(run) for run in runs]
    check_runs(loaded, tracks)
    return loaded


def _by_guesses(found: Surrogate, budgets: Sequence[int]) -> tuple[Entry, ...]:
    """Return a surrogate's entries: its own proposals, and its searches."""
    search = SurrogateSearch(found, found.digest)
    training = Training(found.fit.blasts, found.fit.seconds)
    agent = Agent(SurrogateAgent(found), "surrogate", training)
    return (agent, *(Search(search, budget, has_learnt=True) for budget in budgets))


def _contest(
    track: Track,
    runs: "Sequence[TrainedRun]",
    searches: _Searches,
    surrogate: Surrogate | None,
    store: ResultStore,
    engine: Engine,
) -> Contest:
    vehicles = all(case.scenario.vehicles for case in track.cases)
    items = all(case.scenario.zone.items for case in track.cases)
    entries = standard_entries(searches.methods, searches.budgets, vehicles, items)
    if searches.first_engine is not None:
        asked = [each for each in entries if isinstance(each, Search)]
        entries += tuple(replace(each, first_engine=searches.first_engine) for each in asked)
    for run in runs:
        if run.is_for(track):
            entries += (run.entry, *map(run.search, searches.agent_budgets))
            if surrogate is not None:
                guided = (run.guided(surrogate, each) for each in searches.agent_budgets)
                entries += (run.ranked(surrogate), *guided)
    if surrogate is not None:
        entries += _by_guesses(surrogate, searches.agent_budgets)
    return Contest(track, entries, store, engine)


def _print_outlook(contests: Sequence[Contest]) -> None:
    """Say what is to come before it begins."""
    total = 0
    for contest in contests:
        outlook = contest.outlook()
        total += outlook.blasts
        print_line(
            f"{contest.track.name}: up to {outlook.search_blasts:,} blasts of searches and "
            f"{outlook.held_out_blasts:,} on held-out threats; {outlook.kept_searches} of "
            f"{outlook.searches} searches are through already"
        )
    print_line(f"up to {total:,} blasts in all")


def _play(contest: Contest, processes: int) -> Standings:
    # Here, because its figures need the extra `render`.
    from blast_agents.league.report import HEADERS, sample_text, table_rows, verdict_lines

    with progress_bar(contest.track.name) as progress:
        standings = contest.play(processes, progress)
    two_lines = [
        "\n".join(header.rsplit(" ", 1)) for header in HEADERS
    ]  # so that a page holds them
    table = make_table(contest.track.title, two_lines)
    for row in table_rows(standings):
        table.add_row(*row)
    result_console().print(table)
    for line in (f"{sample_text(standings)}.", *verdict_lines(standings)):
        print_line(line)
    return standings


def _names(text: str) -> list[str]:
    """Return the names of a list with commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def _numbers(text: str, option: str = "--budgets") -> list[int]:
    """Return the numbers of a list with commas.

    Raises:
        BlastEnvError: If one is no whole number.
    """
    try:
        return [int(number) for number in _names(text)]
    except ValueError:
        raise BlastEnvError(
            f"{option} is {text!r}, must be whole numbers with commas between, e.g. 50,200"
        ) from None
