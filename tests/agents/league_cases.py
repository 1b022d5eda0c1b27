"""A small site, an agent that needs no training, and standings made of plain numbers."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from blast_agents.league.entries import NO_TRAINING, LeagueEntry, NoBarrier, Training
from blast_agents.league.standings import Result, Standings
from blast_agents.league.tracks import Track, known_track

from blast_env.design.rules import line_of_sight_wall
from blast_env.design.search import LayoutProblem, Proposal, ProposerKind, Report, SearchResult
from blast_env.site import AnyCharge, Scenario, SegmentSource
from tests.design.search_cases import small_scenario

ROAD = SegmentSource(kind="segment", start_m=(5.0, 15.0), end_m=(5.0, 25.0), tnt_kg=100.0)
TRAINING = Training(blasts=5000, seconds=60.0)


def road_scenario(stock: int = 3) -> Scenario:
    """Return the small site of the searches with a charge anywhere on a road."""
    return small_scenario(stock=stock).model_copy(update={"charge": (ROAD,), "name": "road"})


@dataclass(frozen=True)
class WallAgent:
    """Proposes a wall in the middle of the zone, and remembers what it was told."""

    name: str = "agent"
    told: list[AnyCharge | None] = field(default_factory=list, repr=False, compare=False)

    def propose(
        self, problem: LayoutProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        self.told.append(problem.told)
        return SearchResult(line_of_sight_wall(problem.scenario, problem.told, 0.5))


def result(
    name: str,
    impulse_pa_s: Sequence[Sequence[float]],
    blasts: int = 0,
    seconds: Sequence[float] | None = None,
    training: Training = NO_TRAINING,
    is_rule: bool = False,
    has_learnt: bool = False,
) -> Result:
    """Return a result with a module in each layout, unless it is that of no barrier."""
    layout = () if name == "no barrier" else ((0, 0),)
    times = seconds or [0.01] * len(impulse_pa_s)
    kind = ProposerKind.RULE if is_rule else ProposerKind.SEARCH
    if has_learnt or training != NO_TRAINING:
        kind = ProposerKind.LEARNT
    method, _, spent = name.rpartition(", ")
    return Result(
        LeagueEntry(
            NoBarrier(method if "blasts" in spent else name), blasts, kind=kind, training=training
        ),
        tuple(Proposal(layout, each, blasts) for each in times),
        np.array(impulse_pa_s, dtype=np.float64),
    )


def standings(
    unprotected: Sequence[Sequence[float]], *results: Result, track: Track | None = None
) -> Standings:
    """Return standings of results on so many cases and held-out threats."""
    bare = np.array(unprotected, dtype=np.float64)
    track = track or known_track(road_scenario(), *bare.shape)
    return Standings(track, (result("no barrier", bare.tolist()), *results), bare, "event")
