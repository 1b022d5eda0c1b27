"""Put the best weights of a run into the package, with what they did in a league.

python -m scripts.pack_agent RUN NAME --league out/league --track known_NAME
"""

import re
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer
from blast_agents.league.report import PAGE
from blast_agents.training.packaged import LeagueResult, pack

from blast_env.cli.output import print_line, user_errors
from blast_env.errors import BlastEnvError


def main(
    run: Annotated[Path, typer.Argument(help="Run folder; it took part in the league.")],
    name: Annotated[str, typer.Argument(help="Of the files.")],
    league: Annotated[Path | None, typer.Option(help="Folder of the league.")] = None,
    track: Annotated[str, typer.Option(help="Name of its track, as of its files.")] = "",
) -> None:
    """Write NAME.pt and NAME.json into the package."""
    with user_errors():
        result = None if league is None else league_result(league, track, run.resolve().name)
        for path in pack(run, name, result):
            print_line(f"wrote {path}")


def league_result(folder: Path, track: str, run: str) -> LeagueResult:
    """Return what the agent of a run did in a league.

    Args:
        folder: Of the league.
        track: Name of the track.
        run: Name of the run folder.

    Raises:
        BlastEnvError: If the league has no such track, or the agent did not enter it.
    """
    try:
        table = pd.read_csv(folder / f"{track}_summary.csv").set_index("entry")
        page = (folder / PAGE).read_text(encoding="utf-8")
    except OSError as error:
        raise BlastEnvError(f"{folder}: has no league with a track {track!r}: {error}") from error
    entries = [entry for entry in table.index if entry.endswith(f"({run})")]
    said = re.search(r"^Engine (\S+), blast-env \S+: `(.+)`$", page, re.MULTILINE)
    if len(entries) != 1 or said is None:
        raise BlastEnvError(f"{folder}: {run!r} did not enter {track!r} once, or {PAGE} is damaged")
    agent, rules = table.loc[entries[0]], table[table["is_rule"]]
    of_rules = {str(name): float(value) for name, value in rules["reduction"].items()}
    best = max(of_rules, key=lambda name: of_rules[name])
    return LeagueResult(
        command=said[2],
        engine=said[1],
        track=track,
        cases=int(agent["cases"]),
        reduction=float(agent["reduction"]),
        low=float(agent["reduction_low"]),
        high=float(agent["reduction_high"]),
        best_rule=best,
        best_rule_reduction=of_rules[best],
    )


if __name__ == "__main__":
    typer.run(main)
