"""The verdict of a report: pass or fail, by the response of facades and by given limits."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from blast_env.evaluation.consequences import (
    BarrierResponse,
    Consequences,
    Verdict,
    other_glazing,
)
from blast_env.report.outcomes import Limit, LoadPair
from blast_env.report.study import Study
from blast_env.response.walls import DamageLevel


@dataclass(frozen=True)
class KeptLimit:
    """Whether a building keeps its limit under a threat.

    Attributes:
        limit: The limit.
        pair: The loads, with the finer cells.
        kept: Whether it is kept with the layout.
        kept_bare: Whether it is kept without.
    """

    limit: Limit
    pair: LoadPair
    kept: bool
    kept_bare: bool


@dataclass(frozen=True)
class BuildingLine:
    """A building with a facade, without the layout and with it: the worst of all threats.

    Attributes:
        name: The building.
        levels: Level of protection in words, with that on the cells if it differs.
        broken: Expected number of broken panes.
        panes: Number of its panes.
        conditions: Performance condition of the worst pane, GSA, and its rating, ISO 16933.
        failed: Number of wall panels with hazardous damage or worse.
        panels: Number of its wall panels.
        damages: Damage of the worst panel.
    """

    name: str
    levels: tuple[str, ...]
    broken: tuple[float, ...]
    panes: int
    conditions: tuple[str, ...]
    failed: tuple[int, ...]
    panels: int
    damages: tuple[str, ...]


@dataclass(frozen=True)
class OtherGlass:
    """All windows with the glass of another component.

    Attributes:
        title: Its title.
        cost: Cost by the measures of the site, without those already in the layout; `None` if they
            do not put it into all windows.
        passes: Whether the buildings pass with it behind the layout.
        passes_bare: The same without the layout.
    """

    title: str
    cost: float | None
    passes: bool
    passes_bare: bool


@dataclass(frozen=True)
class ReportVerdict:
    """Whether the layout passes.

    Attributes:
        passes: Whether all requirements are kept; `None` without any.
        passes_bare: The same without the layout.
        flagged: Whether a load behind the verdict has a note.
        flagged_bare: The same without the layout.
        words: The verdict on each requirement, such as `level of protection below Low`.
        doubt: Why a fail rests on sharper peaks; empty if it does not.
        buildings: The buildings with a facade.
        limits: The given limits.
        barrier: The barrier under the threat that tilts a piece most.
        glazing: Other glass in all windows.
    """

    passes: bool | None
    passes_bare: bool | None
    flagged: bool
    flagged_bare: bool
    words: str
    doubt: str
    buildings: tuple[BuildingLine, ...]
    limits: tuple[KeptLimit, ...]
    barrier: BarrierResponse | None
    glazing: tuple[OtherGlass, ...]

    @property
    def word(self) -> str:
        """The verdict in a word."""
        return "NO VERDICT" if self.passes is None else Verdict.of(self.passes).word(self.flagged)


def verdict_of(study: Study) -> ReportVerdict:
    """Return the verdict of a report.

    It goes by the required level of protection, if buildings have facades, and by the given limits;
    both must be kept, on the finer cells and under every threat.
    """
    limits = tuple(_limits(study))
    target = study.target
    kept, kept_bare = ([each.kept for each in limits], [each.kept_bare for each in limits])
    asked = [_limit_words(limits)] if limits else []
    doubt = ""
    glazing: tuple[OtherGlass, ...] = ()
    if study.protected.buildings:
        asked.insert(0, study.protected.level_words_for(target))
        kept.append(study.protected.passes(target))
        kept_bare.append(study.unprotected.passes(target))
        doubt = study.protected.doubt(target)
        glazing = tuple(_glazing(study))
    return ReportVerdict(
        passes=all(kept) if asked else None,
        passes_bare=all(kept_bare) if asked else None,
        flagged=study.protected.is_flagged or any(each.pair.protected.flagged for each in limits),
        flagged_bare=study.unprotected.is_flagged
        or any(each.pair.unprotected.flagged for each in limits),
        words="; ".join(asked),
        doubt=doubt,
        buildings=tuple(_line(study, name) for name in study.protected.buildings),
        limits=limits,
        barrier=study.protected.worst_barrier,
        glazing=glazing,
    )


def _limits(study: Study) -> Iterator[KeptLimit]:
    fine = study.options.cells[1]
    for limit in study.options.limits:
        for pair in study.pairs:
            if pair.target.name == limit.target and pair.cells == fine:
                yield KeptLimit(
                    limit, pair, limit.is_kept(pair.protected), limit.is_kept(pair.unprotected)
                )


def _limit_words(limits: Sequence[KeptLimit]) -> str:
    """Return how many limits are exceeded, and under which threats."""
    exceeded = [each.pair.threat.name for each in limits if not each.kept]
    if not exceeded:
        return f"{counted(len(limits), 'load limit')} kept"
    threats = list(dict.fromkeys(exceeded))
    noun = "threat" if len(threats) == 1 else "threats"
    return f"{counted(len(exceeded), 'load limit')} exceeded ({noun} {', '.join(threats)})"


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: `1 load limit`, `2 load limits`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _line(study: Study, name: str) -> BuildingLine:
    both: Sequence[Consequences] = (study.unprotected, study.protected)
    facades = [[response.facade for response in each.of(name)] for each in both]
    first = facades[0][0]
    return BuildingLine(
        name=name,
        levels=tuple(each.level_words(name) for each in both),
        broken=tuple(max(each.broken_panes for each in own) for own in facades),
        panes=first.panes,
        conditions=tuple(max(each.worst_condition for each in own).words for own in facades),
        failed=tuple(
            max(sum(level >= DamageLevel.HAZARDOUS for level in each.walls.levels) for each in own)
            for own in facades
        ),
        panels=len(first.walled),
        damages=tuple(max(each.worst_damage for each in own).name.lower() for own in facades),
    )


def _glazing(study: Study) -> Iterator[OtherGlass]:
    """Yield the verdicts with other glass, if any building has panes."""
    if not any(each.facade.panes for each in study.protected.responses):
        return
    for name, glazing in other_glazing(study.scenario).items():
        protected, unprotected = (
            each.with_glazing(glazing).passes(study.target)
            for each in (study.protected, study.unprotected)
        )
        yield OtherGlass(glazing.title, _price(study, name), protected, unprotected)


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
