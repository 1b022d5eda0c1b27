"""What a search found, and when."""

from dataclasses import dataclass

import pandas as pd

from agents.search.problem import Layout


@dataclass(frozen=True)
class Candidate:
    """A layout and what the search knew of it.

    Attributes:
        blasts: Blasts that the search had spent by then.
        layout: Its cells, sorted.
        impulse_pa_s: Impulse over the threats that it had met, Pa*s.
        threats: How many threats that were, counted from the first.
    """

    blasts: int
    layout: Layout
    impulse_pa_s: float
    threats: int


@dataclass(frozen=True)
class Progress:
    """How far a search has come.

    Attributes:
        blasts: Blasts spent.
        budget: Most that it may spend.
        best: The best layout so far; `None` before the first.
    """

    blasts: int
    budget: int
    best: Candidate | None


@dataclass(frozen=True)
class SearchResult:
    """What a search found.

    Attributes:
        method: Name of the method.
        layout: The best layout, its cells sorted; empty if the search ended before it had one.
        impulse_pa_s: Its impulse over the threats that it has met, Pa*s; `None` without a blast.
            The search chose it by these blasts, so that on others it will be somewhat more.
        threats: How many threats it has met.
        blasts: Blasts spent: distinct pairs of layout and threat that the search asked for,
            whatever a cache knew of them.
        budget: Most that it might have spent.
        seed: What decided everything that was drawn.
        history: The best layout each time that it changed.
        interrupted: Whether it was ended from outside (Ctrl-C) before it was through.
        front: The layouts of which none has both less impulse and fewer modules, by number of
            modules; only of methods that search for it.
    """

    method: str
    layout: Layout
    impulse_pa_s: float | None
    threats: int
    blasts: int
    budget: int
    seed: int
    history: tuple[Candidate, ...]
    interrupted: bool
    front: tuple[Candidate, ...] = ()

    def best_at(self, blasts: int) -> Candidate | None:
        """Return the best layout after so many blasts, or `None` if there was none yet.

        A search plans for its whole budget. What it has after part of it is less than what a
        search with that budget finds.
        """
        by_then = [each for each in self.history if each.blasts <= blasts]
        return by_then[-1] if by_then else None

    def history_table(self) -> pd.DataFrame:
        """Return one row each time that the best layout changed."""
        return _table(self.history)

    def front_table(self) -> pd.DataFrame:
        """Return one row a layout of the front."""
        return _table(self.front)


def _table(candidates: tuple[Candidate, ...]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            (each.blasts, each.impulse_pa_s, each.threats, len(each.layout), _cells_text(each))
            for each in candidates
        ],
        columns=["blasts", "impulse_pa_s", "threats", "modules", "layout"],
    )


def _cells_text(candidate: Candidate) -> str:
    """Return the cells of a layout for one field of a table: `3,4 3,5`."""
    return " ".join(f"{row},{column}" for row, column in candidate.layout)
