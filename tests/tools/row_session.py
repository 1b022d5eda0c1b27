"""Sessions on an engine that blows nothing, with a best layout that is known."""

from dataclasses import dataclass, field
from threading import Event
from typing import Any

from blast_env.benchmark import ReferenceLayout, ScoreReference
from blast_env.evaluation.engines import BlastLoads
from blast_env.geometry import Piece
from blast_env.tools import Session, call_tool
from blast_env.tools.records import Answer
from tests.benchmark.row import RowEngine

NAME = "control_room-known-v2"
BEST = tuple(Piece(12, column, "low_wall", True) for column in range(3))
"""Three walls in row 12; a fourth would take off more."""

REFERENCE = ScoreReference(
    "",
    "row 1",
    {},
    ReferenceLayout("wall", BEST[:1]),
    ReferenceLayout("three walls", BEST),
)


@dataclass(frozen=True)
class HeldEngine(RowEngine):
    """A row engine whose blasts with barriers wait, and fail while told to.

    Attributes:
        go: Lets blasts go on.
        fails: Whether blasts fail.
    """

    go: Event = field(default_factory=Event, compare=False, repr=False)
    fails: Event = field(default_factory=Event, compare=False, repr=False)

    def loads(self, *blast: Any) -> BlastLoads:
        """Return the loads."""
        if blast[1]:
            assert self.go.wait(30.0)
        if self.fails.is_set():
            raise RuntimeError("the air ran out")
        return super().loads(*blast)


def session(seed: int = 0, budget: int = 3, **changes: Any) -> Session:
    given = {"engine": RowEngine(), "judge_cell_m": None, "reference": REFERENCE, "wait_s": None}
    return Session(NAME, seed, budget, **(given | changes))


def walls(*pieces: Piece) -> list[dict[str, Any]]:
    """Pieces as a client sends them."""
    return [piece._asdict() for piece in pieces]


def said(answer: Answer) -> dict[str, Any]:
    """A result without the time."""
    return answer.model_dump(exclude={"seconds"})


def submitted(own: Session, *pieces: Piece) -> float:
    outcome = call_tool(own, "submit", {"layout": walls(*pieces)})
    score: float = outcome.model_dump()["score"]["score"]
    return score
