"""The verdict of a report: pass or fail, by the response of facades and by given limits."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from blast_env.evaluation.questions.verdict import (
    BarrierResponse,
    BuildingSummary,
    Consequences,
    Verdict,
    other_glazing,
)
from blast_env.evaluation.record import BuildingLoad
from blast_env.report.limits import Limit
from blast_env.report.study import LoadPair, Study
from blast_env.response.buildings import LevelOfProtection
from blast_env.values import count_of


@dataclass(frozen=True)
class OtherGlass:
    """All windows with the glass of another component.

    Attributes:
        title: Its title.
        cost: Cost by the measures of the site, without those already in the layout; `None` if they
            do not put it into all windows.
        bare_word: The verdict on the buildings without the layout.
        word: The same behind it.
    """

    title: str
    cost: float | None
    bare_word: str
    word: str


class Side(NamedTuple):
    """The verdict on a site without the layout, or with it.

    Attributes:
        found: The response of its buildings.
        passes: Whether all requirements are kept.
        flagged: Whether a load behind the verdict has a note.
    """

    found: Consequences
    passes: bool
    flagged: bool

    @classmethod
    def of(
        cls,
        found: Consequences,
        target: LevelOfProtection,
        loads: Sequence[tuple[Limit, BuildingLoad]],
    ) -> "Side":
        """Return the verdict by the level of the buildings, and by limits of loads."""
        kept = all(limit.is_kept(load) for limit, load in loads)
        flagged = found.is_flagged or any(load.flagged for _, load in loads)
        return cls(found, kept and found.passes(target), flagged)

    @property
    def word(self) -> str:
        """The verdict in a word."""
        return Verdict.of(self.passes).word(self.flagged)


@dataclass(frozen=True, eq=False)
class StudyVerdict:
    """Whether the layout of a study passes.

    It goes by the required level of protection, if buildings have facades, and by the given limits;
    both must be kept, on the finer cells and under every threat.

    Attributes:
        study: The study.
    """

    study: Study

    @cached_property
    def limits(self) -> tuple[tuple[Limit, LoadPair], ...]:
        """Each limit, with the loads under each threat."""
        given = self.study.options.limits
        return tuple(
            (limit, pair)
            for limit in given
            for pair in self.study.fine
            if pair.target.name == limit.target
        )

    @property
    def buildings(self) -> dict[str, tuple[BuildingSummary, BuildingSummary]]:
        """The buildings with a facade, without the layout and with it."""
        sides = self.study.unprotected, self.study.protected
        return {
            name: (sides[0].summary(name), sides[1].summary(name))
            for name in self.study.protected.buildings
        }

    @cached_property
    def sides(self) -> tuple["Side", "Side"]:
        """The verdicts without the layout and with it."""
        target = self.study.target
        loads = [(limit, pair.unprotected, pair.protected) for limit, pair in self.limits]
        return (
            Side.of(self.study.unprotected, target, [(limit, load) for limit, load, _ in loads]),
            Side.of(self.study.protected, target, [(limit, load) for limit, _, load in loads]),
        )

    @property
    def passes(self) -> bool | None:
        """Whether all requirements are kept with the layout; `None` without any."""
        is_asked = self.limits or self.study.protected.buildings
        return self.sides[1].passes if is_asked else None

    @property
    def word(self) -> str:
        """The verdict in a word."""
        return "NO VERDICT" if self.passes is None else self.sides[1].word

    def kept(self, side: int) -> int:
        """Return the number of limits that are kept without the layout (0) or with it (1)."""
        loads = [(limit, (pair.unprotected, pair.protected)) for limit, pair in self.limits]
        return sum(limit.is_kept(both[side]) for limit, both in loads)

    @property
    def words(self) -> str:
        """The verdict on each requirement, such as `level of protection below Low`."""
        study = self.study
        words = [study.protected.level_words_for(study.target)] * bool(study.protected.buildings)
        exceeded = [
            pair.threat.name for limit, pair in self.limits if not limit.is_kept(pair.protected)
        ]
        if exceeded:
            threats = list(dict.fromkeys(exceeded))
            noun = "threat" if len(threats) == 1 else "threats"
            limits = count_of("load limit", len(exceeded))
            words.append(f"{limits} exceeded ({noun} {', '.join(threats)})")
        elif self.limits:
            words.append(f"{count_of('load limit', len(self.limits))} kept")
        return "; ".join(words)

    @property
    def doubt(self) -> str:
        """Why a fail rests on sharper peaks; empty if it does not."""
        has_buildings = bool(self.study.protected.buildings)
        return self.study.protected.doubt(self.study.target) if has_buildings else ""

    @property
    def barrier(self) -> BarrierResponse | None:
        """The barrier under the threat that tilts a piece most."""
        return self.study.protected.worst_barrier

    @cached_property
    def glazing(self) -> tuple[OtherGlass, ...]:
        """Other glass in all windows, if any building has panes."""
        return tuple(self._glazing())

    def _glazing(self) -> Iterator[OtherGlass]:
        study = self.study
        if not any(each.facade.panes for each in study.protected.responses):
            return
        for name, glazing in other_glazing(study.scenario).items():
            words = (
                Verdict.of(each.found.with_glazing(glazing).passes(study.target))
                .word(each.flagged)
                .lower()
                for each in self.sides
            )
            yield OtherGlass(glazing.title, _price(study, name), *words)


def _price(study: Study, glazing: str) -> float | None:
    """Return the cost by the site's measures of a glass in all windows that lack it.

    Of overlapping measures, the dearest ones that are not needed are left out.
    """
    bays = [bay for bay in study.scenario.named_bays(study.layout) if bay.glazing]
    missing = [bay.bay for bay in bays if bay.glazing != glazing]
    taken = [each for each in study.scenario.zone.hardening if each.glazing == glazing]
    for measure in sorted(taken, key=lambda each: -each.cost):
        fewer = [each for each in taken if each is not measure]
        if all(any(each.covers(bay) for each in fewer) for bay in missing):
            taken = fewer
    if not all(any(each.covers(bay) for each in taken) for bay in missing):
        return None
    return sum(each.cost for each in taken)
