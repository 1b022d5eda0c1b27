"""Processor time of a guess in a batch of layouts against one charge.

A search changes a layout piece by piece, so most pieces of a layout are in the one before. Times
are on one core.
"""

from collections.abc import Sequence
from statistics import fmean, median
from time import process_time
from typing import Annotated, Final, NamedTuple

import numpy as np
import typer

from blast_env.answers.terminal import print_line
from blast_env.cli.output import user_errors
from blast_env.design.search.moves import Moves
from blast_env.evaluation import draw_threats
from blast_env.geometry import Layout
from blast_env.rules import random_layout
from blast_env.site import Scenario, load_scenario
from blast_env.surrogate import packaged_surrogate, site_of
from blast_env.tables import markdown_table
from blast_env.units import MS_PER_S

LAYOUTS: Final = 256
"""Layouts of a batch."""

_SITES: Final = (
    "control_room",
    "courtyard",
    "hotel_forecourt",
    "school_and_clinic",
    "shopping_street",
    "visitor_entrance",
)
_REPEATS: Final = 15
_OFTEN: Final = 6
"""Times that a batch is met before it counts as known: pieces are kept from the fifth on."""


class GuessTimes(NamedTuple):
    """Processor time of a guess.

    Attributes:
        points: Points of walls at which the networks guess.
        pieces: Mean number of pieces of a layout.
        known_ms: Time of a guess if all pieces have been met before.
        new_ms: The same if most of them have not.
    """

    points: int
    pieces: float
    known_ms: float
    new_ms: float


def guess_times(scenario: Scenario, repeats: int = _REPEATS) -> GuessTimes:
    """Time guesses of the packaged surrogate on a scenario, medians over some batches."""
    surrogate, site = packaged_surrogate(), site_of(scenario)
    (threat,) = draw_threats(scenario, [0])
    charges = [threat.charge_against(scenario, ())] * LAYOUTS
    rng = np.random.default_rng(0)
    batches = [changed(scenario, rng) for _ in range(1 + repeats)]

    def taken_ms(layouts: Sequence[Layout]) -> float:
        began_s = process_time()
        surrogate.guess(site, layouts, charges)
        return MS_PER_S * (process_time() - began_s) / len(layouts)

    known = batches[0]
    for _ in range(_OFTEN):
        taken_ms(known)
    return GuessTimes(
        points=len(site.arrays.points.area_m2),
        pieces=fmean(map(len, known)),
        known_ms=median(taken_ms(known) for _ in range(repeats)),
        new_ms=median(map(taken_ms, batches[1:])),
    )


def changed(scenario: Scenario, rng: np.random.Generator) -> list[Layout]:
    """Return a random layout, and others that are each a change of the one before."""
    moves, found = Moves(scenario), [random_layout(scenario, rng)]
    while len(found) < LAYOUTS:
        found.append(moves.neighbour(found[-1], rng))
    return found


def main(
    scenarios: Annotated[list[str] | None, typer.Argument(help="Bundled names or paths.")] = None,
) -> None:
    """Print the processor time of a guess on each scenario."""
    with user_errors():
        rows = []
        for name in scenarios or _SITES:
            found = guess_times(load_scenario(name))
            times = (f"{found.known_ms:.3f}", f"{found.new_ms:.3f}")
            rows.append((name, str(found.points), f"{found.pieces:.0f}", *times))
    headers = ("on", "points", "pieces of a layout", "ms a guess, pieces met before")
    print_line(markdown_table((*headers, "most pieces new"), rows))


if __name__ == "__main__":
    typer.run(main)
