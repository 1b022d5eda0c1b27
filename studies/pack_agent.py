"""Put the best weights of a run into the package, with their result in a league.

python -m studies.pack_agent RUN NAME --league out/league --track known_NAME
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import typer
from blast_agents.league.report import PAGE
from blast_agents.training.packaged import LeagueResult, pack
from pydantic import ConfigDict, Field

from blast_env.cli.output import print_line, user_errors
from blast_env.documents import DocumentError, parse_csv, read_text
from blast_env.errors import BlastEnvError


@dataclass(frozen=True)
class SummaryRow:
    """The columns used of a row of a league's summary."""

    __pydantic_config__: ClassVar = ConfigDict(allow_inf_nan=False)

    entry: str
    is_rule: bool
    cases: Annotated[int, Field(ge=1)]
    reduction: float
    reduction_low: float
    reduction_high: float


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
    """Return the result of a run's agent in a league.

    Args:
        folder: Folder of the league.
        track: Name of the track.
        run: Name of the run folder.

    Raises:
        BlastEnvError: If the league has no such track, the agent did not enter it exactly once,
            no rule entered it, or the league's page is damaged.
    """
    try:
        rows = list(parse_csv(read_text(folder / f"{track}_summary.csv"), SummaryRow))
        page = read_text(folder / PAGE)
    except DocumentError as error:
        raise BlastEnvError(f"{folder}: has no league with a track {track!r}: {error}") from error
    entries = [row for row in rows if row.entry.endswith(f"({run})")]
    rules = {row.entry: row.reduction for row in rows if row.is_rule}
    said = re.search(r"^Engine (.+?), blast-env \S+: `(.+)`$", page, re.MULTILINE)
    if len(entries) != 1 or said is None:
        raise BlastEnvError(f"{folder}: {run!r} did not enter {track!r} once, or {PAGE} is damaged")
    if not rules:
        raise BlastEnvError(f"{folder}: no rule entered {track!r}")
    (agent,), best = entries, max(rules, key=lambda name: rules[name])
    return LeagueResult(
        command=said[2],
        engine=said[1],
        track=track,
        cases=agent.cases,
        reduction=agent.reduction,
        low=agent.reduction_low,
        high=agent.reduction_high,
        best_rule=best,
        best_rule_reduction=rules[best],
    )


if __name__ == "__main__":
    typer.run(main)
