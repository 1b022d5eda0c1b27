"""The study of a layout, for a report: its campaigns, their cost, and their blasts.

1. Charges at other places of each source, without the layout and with it, on the coarser cells. The
   worst of them are the threats, unless these are given; then this part comes last.
2. The threats, without the layout and with it, on both sizes of cells.
3. The threats without each module or piece of the layout, on the coarser cells.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.evaluation.blasts import NO_BARRIER, Blasts, Severity
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.cases import LoadCase, LoadCaseSet
from blast_env.evaluation.engines.contract import BlastDrawing
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.evaluator import BlastEvaluator, BlastStore
from blast_env.evaluation.places import chief_threats, other_places, requested_threats
from blast_env.evaluation.questions.grid_error import Effect, GridError, impulse_of
from blast_env.evaluation.questions.limits import Limit, LoadLimit, SiteVerdict, check_limits
from blast_env.evaluation.questions.probability import Uncertainty
from blast_env.evaluation.questions.reduction import ThreatOutcome
from blast_env.evaluation.questions.verdict import Consequences, consequences_by_layout
from blast_env.evaluation.record import BlastRecord
from blast_env.gas.cost import CostGuess
from blast_env.gas.settings import Cells
from blast_env.geometry import Element, Layout, standing
from blast_env.layout import check_layout
from blast_env.response.levels import LevelOfProtection
from blast_env.site import AnyCharge, ObjectiveSection, Scenario
from blast_env.site.structures import buildings_of

MOST_THREATS: Final = 6
LAYOUT: Final = "with the layout"
_ITEMS, _PLACES = "without each item", "other places"


def final_cells(scenario: Scenario) -> tuple[Cells, Cells]:
    """Return the coarser and the finer cells of a study of a site, by `GasEngine.final`."""
    fine = GasEngine().final([scenario])
    return ("coarse", "fine") if fine.is_growing else (2.0 * fine.cell_m, fine.cell_m)


@dataclass(frozen=True)
class StudyOptions:
    """The scope and the resolution of a study.

    Attributes:
        charges: The threats; without any, the worst of the places of each source.
        most_threats: Greatest number of such threats, 1 to 6.
        cells: Two sides of cells in m, the coarser one first: their loads show the grid error.
            Twice the same is one size, without that error. For large sites "coarse" and "fine",
            which grow.
        limits: Limits of the loads on buildings.
        target: Level of protection that buildings with facades must reach; `None` for that of the
            scenario's objective, or low if it has none.
        places: Number of places of each source in the sensitivity study.
        items: Whether to rank the worth of each module or piece.
        processes: Worker processes of blasts that need no pictures.
        cache: Folder of the store of blasts.
        mass_error: Half the width of the 95 % interval of the charges' masses, as a share.

    Raises:
        BlastEnvError: If an option is out of bounds.
    """

    charges: tuple[AnyCharge, ...] = ()
    most_threats: int = 2
    cells: tuple[Cells, Cells] = (0.5, 0.25)
    limits: tuple[Limit, ...] = ()
    target: LevelOfProtection | None = None
    places: int = 5
    items: bool = True
    processes: int = 1
    cache: Path | None = None
    mass_error: float = 0.1

    def __post_init__(self) -> None:
        """Check the options."""
        for name, value, low, high in (
            ("threats", self.most_threats, 1, MOST_THREATS),
            ("charges", len(self.charges), 0, MOST_THREATS),
            ("places", self.places, 1, 50),
            ("mass_error", self.mass_error, 0.0, 0.3),
        ):
            if not low <= value <= high:
                raise BlastEnvError(f"{name} is {value}, must be {low} to {high}")
        coarse, fine = self.engines
        if not coarse.smallest_m >= fine.smallest_m:
            raise BlastEnvError(
                f"cells are {coarse.smallest_m:g} m and {fine.smallest_m:g} m, must be two sizes, "
                "the coarser one first"
            )

    @property
    def engines(self) -> tuple[GasEngine, GasEngine]:
        """The engines with the coarser and with the finer cells; the same for one size."""
        coarse, fine = self.cells
        return GasEngine.with_cells(coarse), GasEngine.with_cells(fine)


class StudyPart(NamedTuple):
    """A part of a study.

    Attributes:
        label: Its label in progress.
        campaign: Its blasts.
        is_drawn: Whether each blast has pictures: then all are run.
    """

    label: str
    campaign: Campaign
    is_drawn: bool = False


Progress: TypeAlias = Callable[[str, float], None]
"""Called with the label of the current part, and its completed share."""

Drawing: TypeAlias = Callable[[LoadCase], BlastDrawing]
"""Returns what draws the blasts of a threat on the finer cells, no barrier first."""


@dataclass(frozen=True, eq=False)
class StudyPlan:
    """The parts of a study before they are run; they share a store.

    Attributes:
        scenario: The scenario.
        layout: The layout.
        options: The options.
    """

    scenario: Scenario
    layout: Layout
    options: StudyOptions

    @cached_property
    def _store(self) -> BlastStore:
        return BlastStore(self.options.cache)

    @property
    def _both(self) -> dict[str, Layout]:
        return {NO_BARRIER: (), LAYOUT: self.layout}

    @cached_property
    def places(self) -> StudyPart:
        """The charges at other places."""
        places = other_places(self.scenario, self.options.places)
        return StudyPart(_PLACES, self._campaign(self._both, places, self.options.engines[0]))

    def items(self, threats: Sequence[LoadCase]) -> StudyPart:
        """Return the layout without each of its modules or pieces, under the threats."""
        fewer: dict[str, Layout] = {
            str(number): tuple(element for element in self.layout if element != piece)
            for number, piece in enumerate(standing(self.layout))
        }
        engine = self.options.engines[0]
        return StudyPart(_ITEMS, self._campaign(self._both | fewer, threats, engine))

    def threats(self, threats: Sequence[LoadCase], engine: GasEngine) -> list[StudyPart]:
        """Return the threats on cells of one size, one part each; the finer ones are drawn."""
        is_drawn = engine == self.options.engines[1]
        return [
            StudyPart(
                f"{threat.name}, {engine.cell_words}",
                self._campaign(self._both, [threat], engine),
                is_drawn,
            )
            for threat in threats
        ]

    def parts(self, threats: Sequence[LoadCase]) -> Iterator[StudyPart]:
        """Yield the parts in their order."""
        if not self.options.charges:
            yield self.places
        for engine in dict.fromkeys(self.options.engines):
            yield from self.threats(threats, engine)
        if self.options.items:
            yield self.items(threats)
        if self.options.charges:
            yield self.places

    def cost(self) -> "StudyCost":
        """Return the estimated cost; nothing is run for it.

        Raises:
            BlastEnvError: If there are too many threats.
        """
        places = self.places.campaign.case.threats
        stand_ins = chief_threats(places, lambda _: Severity(), self.options.most_threats)
        threats = requested_threats(self.scenario, self.options.charges) or stand_ins
        known: set[object] = set()
        parts: dict[str, tuple[CostGuess, ...]] = {}
        drawn = 0
        for part in self.parts(threats):
            engine, found = part.campaign.evaluator.engine, []
            for threat in part.campaign.case.threats:
                for layout in part.campaign.layouts.values():
                    blast = engine, layout, threat.charge
                    if part.is_drawn or blast not in known:
                        found.append(engine.cost(self.scenario, threat.charge))
                    known.add(blast)
            parts[part.label] = tuple(cost for cost in found if cost is not None)
            drawn += len(found) * part.is_drawn
        return StudyCost(parts, drawn)

    def run(self, progress: Progress, drawing: Drawing | None = None) -> "Study":
        """Run the parts, and return what was finished before an interruption.

        Raises:
            KeyboardInterrupt: If not even the coarser cells were finished.
        """
        asked = requested_threats(self.scenario, self.options.charges)
        places = items = None
        sizes: list[Blasts] = []
        name = _PLACES
        try:
            # 1. The worst of many places are the threats, unless these are given.
            if not asked:
                places = self._run(self.places, progress)
            threats = asked if places is None else self._worst_of(places)
            # 2. The coarser cells first: after an interruption they are a result.
            for engine in dict.fromkeys(self.options.engines):
                name = engine.cell_words
                for part, threat in zip(self.threats(threats, engine), threats, strict=True):
                    drawn = drawing(threat) if drawing is not None and part.is_drawn else None
                    self._run(part, progress, drawn)
                sizes.append(self._campaign(self._both, threats, engine).run())
            # 3. The items, and the places if they were not needed before.
            name = _ITEMS
            if self.options.items:
                items = self._run(self.items(threats), progress)
            name = _PLACES
            places = places or self._run(self.places, progress)
            name = ""
        except KeyboardInterrupt:
            if not sizes:
                raise
            progress(f"stopped before: {name}", 1.0)
        blasts = sizes[-1] if len(sizes) < 2 else replace(sizes[1], coarse=sizes[0])
        return Study(self, blasts, items, places, name)

    def _run(
        self, part: StudyPart, progress: Progress, drawing: BlastDrawing | None = None
    ) -> Blasts:
        return part.campaign.run(partial(progress, part.label), drawing)

    def _campaign(
        self, layouts: Mapping[str, Layout], threats: Sequence[LoadCase], engine: GasEngine
    ) -> Campaign:
        evaluator = BlastEvaluator(self.scenario, engine, cache=self._store)
        case = LoadCaseSet(self.scenario, tuple(threats))
        return Campaign(case, layouts, evaluator, processes=self.options.processes)

    def _worst_of(self, places: Blasts) -> tuple[LoadCase, ...]:
        """Return the worst places as threats, by loads with the layout, as in the verdict."""
        objective = self.scenario.objective
        found = {
            threat: Severity.of_loads(record.loads, objective)
            for threat, record in zip(places.threats, places.records[places.judged], strict=True)
        }
        return chief_threats(places.threats, found.__getitem__, self.options.most_threats)


class StudyCost(NamedTuple):
    """The estimated cost of a study.

    Attributes:
        parts: The costs of the blasts of each part, by the label in its progress.
        drawn: Number of blasts with pictures.
    """

    parts: Mapping[str, tuple[CostGuess, ...]]
    drawn: int

    @property
    def blasts(self) -> tuple[CostGuess, ...]:
        """The cost of each blast."""
        return tuple(cost for costs in self.parts.values() for cost in costs)

    def share(self, label: str, share: float) -> float | None:
        """Return the completed share of the whole at a share of a part; `None` of no part."""
        costs_s = {name: sum(cost.seconds for cost in own) for name, own in self.parts.items()}
        if label not in costs_s:
            return None
        # Progress by cost: cells of half the side are eight times as many, in twice the steps.
        names = list(costs_s)
        before_s = sum(costs_s[name] for name in names[: names.index(label)])
        return min((before_s + share * costs_s[label]) / sum(costs_s.values()), 1.0)


@dataclass(frozen=True, eq=False)
class Study:
    """The blasts of a study, and what they say.

    Attributes:
        plan: The site, the layout and the options.
        blasts: The blasts of the threats with the finer cells, without the layout and with it; all
            of them on the coarser cells as well, unless there is one size or it was stopped.
        items: The blasts without each module or piece, with the coarser cells; `None` without.
        places: Those of charges at other places, with the coarser cells; `None` without.
        stopped: The part before which it was stopped; empty for a whole study.
    """

    plan: StudyPlan
    blasts: Blasts
    items: Blasts | None = None
    places: Blasts | None = None
    stopped: str = ""

    @property
    def scenario(self) -> Scenario:
        """The site."""
        return self.plan.scenario

    @property
    def layout(self) -> Layout:
        """The layout."""
        return self.plan.layout

    @property
    def options(self) -> StudyOptions:
        """The options."""
        return self.plan.options

    @property
    def threats(self) -> tuple[LoadCase, ...]:
        """The threats."""
        return self.blasts.threats

    @property
    def has_finer(self) -> bool:
        """Whether it was not stopped before the finer cells."""
        return self.blasts.engine == self.options.engines[1]

    @property
    def sizes(self) -> tuple[Blasts, ...]:
        """The blasts of the threats on each size of cells, the coarser one first."""
        coarse = self.blasts.coarse
        return (self.blasts,) if coarse is None else (coarse, self.blasts)

    @property
    def target(self) -> LevelOfProtection:
        """Level of protection that buildings with facades must reach."""
        asked = (self.options.target, self.scenario.objective.level, LevelOfProtection.LOW)
        return next(level for level in asked if level is not None)

    @cached_property
    def found(self) -> dict[str, Consequences]:
        """Response of the buildings and of the barrier without the layout and with it, by name."""
        return consequences_by_layout(self.blasts)

    @property
    def unprotected(self) -> Consequences:
        """That without the layout."""
        return self.found[NO_BARRIER]

    @property
    def protected(self) -> Consequences:
        """That with it."""
        return self.found[self.blasts.judged]

    def buildings(self, *, protected: bool) -> tuple[str, ...]:
        """Return the buildings with a known load, those that count or the others.

        Those that the layout takes away have none with it.
        """
        sides = (records[0].complete.buildings for records in self.blasts.records.values())
        known = set.intersection(*(set(side) for side in sides))
        return tuple(
            name
            for name, parts in buildings_of(self.scenario.structures).items()
            if name in known and any(part.protected for part in parts) is protected
        )

    def effect(self, blasts: Blasts, number: int, building: str) -> Effect:
        """Return the impulse on a building under a threat, without the layout and with it."""

        def impulse_of(record: BlastRecord) -> float:
            return record.complete.buildings[building].impulse_pa_s

        return Effect.of(blasts, impulse_of, number)

    @cached_property
    def effects(self) -> dict[str, tuple[Effect, ...]]:
        """The impulse on each protected building under each threat (threats,)."""
        numbers = range(len(self.threats))
        return {
            name: tuple(self.effect(self.blasts, k, name) for k in numbers)
            for name in self.buildings(protected=True)
        }

    @property
    def verdicts(self) -> tuple[SiteVerdict, SiteVerdict]:
        """The verdicts without the layout and with it."""
        sides = zip(self.found.values(), self.blasts.records.values(), strict=True)
        without, behind = (
            SiteVerdict(found, self.target, tuple(self._limited(records)))
            for found, records in sides
        )
        return without, behind

    @property
    def unloaded_limits(self) -> tuple[Limit, ...]:
        """The limits of buildings without a load behind the layout: no verdict checks them."""
        checked = {own.limit for own in self.verdicts[1].limited}
        return tuple(limit for limit in self.options.limits if limit not in checked)

    def _limited(self, records: Sequence[BlastRecord]) -> Iterator[LoadLimit]:
        for limit in self.options.limits:
            for threat, record in zip(self.threats, records, strict=True):
                load = record.complete.buildings.get(limit.building)
                if load is not None:
                    yield LoadLimit(limit, threat.name, load)

    def notes_of(self, blasts: Blasts) -> tuple[str, ...]:
        """Return reasons to distrust the loads of the threats on cells of one size."""
        found = _labelled(blasts)
        notes = (f"{label}: {note}" for label, own in found for note in own.complete.notes)
        return tuple(dict.fromkeys(notes))

    @property
    def digests(self) -> Iterator[tuple[str, str]]:
        """The digest of every blast of the threats, with its label."""
        for blasts in self.sizes:
            yield from ((label, own.complete.digest) for label, own in _labelled(blasts))

    @property
    def uncertainty(self) -> Uncertainty:
        """The uncertain quantities, with the grid error under the threat that governs."""
        number = self.protected.worst_number if self.protected.responses else self.blasts.worst()
        return Uncertainty.of(self.options.mass_error, GridError.of(self.blasts, number=number))

    @property
    def grid_error(self) -> float:
        """Largest grid error of a reduction of the impulse; NaN with one size."""
        every = (effect.reduction_error for own in self.effects.values() for effect in own)
        return max((error for error in every if np.isfinite(error)), default=float("nan"))

    @property
    def worths(self) -> tuple[tuple[Element, float], ...]:
        """The worth of every module or piece, the largest first.

        It is the growth of the impulse if it alone is left out, as a share of the impulse without a
        barrier, mean over the threats; below 0 if the layout is better without it.
        """
        if self.items is None:
            return ()
        impulses = np.array([self.items.values(name, impulse_of) for name in self.items.layouts])
        unprotected, whole, without = impulses[0], impulses[1], impulses[2:]
        worths = ((without - whole) / unprotected).mean(axis=1).tolist()
        found = zip(standing(self.layout), worths, strict=True)
        return tuple(sorted(found, key=lambda pair: -pair[1]))

    @property
    def outcomes(self) -> tuple[ThreatOutcome, ...]:
        """Charges at other places, by the impulse whatever counts in the site's objective."""
        if self.places is None:
            return ()
        count = range(len(self.places.threats))
        return tuple(ThreatOutcome.of(self.places, k, ObjectiveSection()) for k in count)


def _labelled(blasts: Blasts) -> Iterator[tuple[str, BlastRecord]]:
    """Yield the records with their labels, threat by threat, with the layout first."""
    for threat, pair in zip(blasts.threats, blasts.pairs(blasts.judged), strict=True):
        for words, record in zip((LAYOUT, "without a barrier"), pair, strict=True):
            yield f"{threat.name} {words}, {gas_of(blasts).cell_words}", record


def gas_of(blasts: Blasts) -> GasEngine:
    """Return the engine of blasts by gas dynamics."""
    assert isinstance(blasts.engine, GasEngine)
    return blasts.engine


def run_study(
    scenario: Scenario,
    layout: Sequence[Element],
    options: StudyOptions | None = None,
    progress: Progress = lambda _, __: None,
    drawing: Drawing | None = None,
) -> Study:
    """Run all blasts of a study.

    Without given threats, charges at other places come first: the worst of them are the threats. An
    interruption (`KeyboardInterrupt`) after the threats with the coarser cells gives a study with
    the parts finished by then.

    Raises:
        BlastEnvError: If the layout is not legal, a charge is out of place, or a limit names no
            building; all before the first blast.
    """
    options = options or StudyOptions(cells=final_cells(scenario))
    cells = check_layout(scenario, layout)
    if not cells:
        raise BlastEnvError("the layout is empty: there is nothing to report on")
    check_limits(options.limits, [*buildings_of(scenario.structures)])
    for threat in requested_threats(scenario, options.charges):
        check_layout(scenario.with_possible_charges([threat.charge]), cells)
    return StudyPlan(scenario, tuple(cells), options).run(progress, drawing)
