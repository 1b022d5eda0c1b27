"""The study behind a report: its campaigns, and the results of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, BlastStore, LoadCase, LoadCaseSet, ThreatOutcome
from blast_env.evaluation.blasts import NO_BARRIER, Blasts, Severity
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines.contract import Engine
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.questions.grid_error import GridError, impulse_of
from blast_env.evaluation.questions.probability import Uncertainty
from blast_env.evaluation.questions.verdict import Consequences, consequences_of
from blast_env.evaluation.record import BlastRecord, BuildingLoad
from blast_env.gas.settings import Cells
from blast_env.geometry import Element, Layout, Rectangle, layout_text, standing
from blast_env.io.export.bill import LayoutPlan, bill_of_quantities
from blast_env.layout import LayoutState, check_layout
from blast_env.report.details import ReportDetails
from blast_env.report.figures import Picture, ThreatPictures
from blast_env.report.limits import Limit, check_limits
from blast_env.report.threats import chief_threats, other_places, requested_threats
from blast_env.response.buildings import LevelOfProtection
from blast_env.site import AnyCharge, AnyStructure, ObjectiveSection, Scenario
from blast_env.site.structures import buildings_of
from blast_env.statistics import reductions

MOST_THREATS: Final = 6
_BARE, _WALLED = "without a barrier", "with the layout"
_ITEMS, _PLACES = "without each item", "other places"


def final_cells(scenario: Scenario) -> tuple[Cells, Cells]:
    """Return the coarser and the finer cells of a report on a site, by `GasEngine.final`."""
    fine = GasEngine().final([scenario])
    return ("coarse", "fine") if fine.is_growing else (2.0 * fine.cell_m, fine.cell_m)


@dataclass(frozen=True)
class StudyOptions:
    """The scope and the resolution of a study.

    Attributes:
        charges: The threats; without any, the worst of the places of each source.
        most_threats: Greatest number of such threats, 1 to 6.
        cells: Two sides of cells in m, the coarser one first: their loads show the error of the
            grid. Twice the same is one size, without that error. For large sites "coarse" and
            "fine", which grow.
        limits: Limits of the loads on buildings.
        target: Level of protection that buildings with facades must reach; `None` for that of the
            scenario's objective, or low if it has none.
        places: Number of places of each source in the sensitivity study.
        items: Whether to rank the worth of each module or piece.
        processes: Worker processes of blasts that need no pictures.
        cache: Folder of the loads of those blasts.
        mass_error: Half the width of the 95 % interval of the charges' masses, as a share.
        details: Project, client, author and the like.

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
    details: ReportDetails = field(default_factory=ReportDetails)

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
        coarse, fine = (GasEngine.with_cells(each) for each in self.cells)
        if not coarse.smallest_m >= fine.smallest_m:
            raise BlastEnvError(
                f"cells are {coarse.smallest_m:g} m and {fine.smallest_m:g} m, must be two sizes, "
                "the coarser one first"
            )

    @property
    def sizes(self) -> tuple[Cells, ...]:
        """The cells, each once."""
        return tuple(dict.fromkeys(self.cells))

    @property
    def ratio(self) -> float:
        """Side of the coarser cells over that of the finer ones; 1 for one size."""
        coarse, fine = (GasEngine.with_cells(each).smallest_m for each in self.cells)
        return coarse / fine

    @property
    def coarse(self) -> GasEngine:
        """The engine of the blasts without pictures, with the coarser cells."""
        return GasEngine.with_cells(self.cells[0])

    @property
    def words(self) -> tuple[str, str]:
        """The coarser and the finer cells, in words."""
        coarse, fine = (GasEngine.with_cells(each).cell_words for each in self.cells)
        return coarse, fine


@dataclass(frozen=True)
class ReportedBuilding:
    """A building: one structure, or several that form it.

    Attributes:
        name: Its name.
        structures: The structures.
    """

    name: str
    structures: tuple[AnyStructure, ...]

    @property
    def protected(self) -> bool:
        """Whether its load counts."""
        return any(each.protected for each in self.structures)

    @property
    def height_m(self) -> float | None:
        """Its height; `None` for as high as the air."""
        heights = [each.height_m for each in self.structures]
        known = [height_m for height_m in heights if height_m is not None]
        return max(known) if len(known) == len(heights) else None

    @property
    def bounds_m(self) -> Rectangle:
        """The rectangle around it."""
        return Rectangle.around([each.rectangle_m for each in self.structures])


def targets_of(scenario: Scenario) -> tuple[ReportedBuilding, ...]:
    """Return the buildings of a scenario, protected ones first."""
    together = buildings_of(scenario.structures)
    targets = [ReportedBuilding(name, tuple(parts)) for name, parts in together.items()]
    return tuple(sorted(targets, key=lambda each: not each.protected))


@dataclass(frozen=True)
class LoadPair:
    """Loads on a building under a threat, without and with the layout, on one size of cells.

    Attributes:
        target: The building.
        threat: The threat.
        cells: The cells.
        unprotected: Without the layout.
        protected: With it.
        error: The error of the cells; `None` without coarser ones.
    """

    target: ReportedBuilding
    threat: LoadCase
    cells: Cells
    unprotected: BuildingLoad
    protected: BuildingLoad
    error: GridError | None

    def impulse_of(self, record: BlastRecord) -> float:
        """Return the impulse on the building in a blast, Pa s."""
        return record.complete.buildings[self.target.name].impulse_pa_s

    @property
    def reduction(self) -> float:
        """Share of the impulse that is gone; NaN if there is none."""
        return reductions(self.protected.impulse_pa_s, self.unprotected.impulse_pa_s).item()

    @property
    def reduction_error(self) -> float:
        """Error of the cells of the reduction, an absolute share; NaN with one size."""
        return np.nan if self.error is None else self.error.of_reduction(self.impulse_of)

    @property
    def unprotected_error_pa_s(self) -> float:
        """Error of the cells of the impulse without the layout; NaN with one size."""
        share = np.nan if self.error is None else self.error.of_unprotected(self.impulse_of)
        return share * self.unprotected.impulse_pa_s

    @property
    def protected_error_pa_s(self) -> float:
        """Error of the cells of the impulse with the layout; NaN with one size."""
        share = np.nan if self.error is None else self.error.of_load(self.impulse_of)
        return share * self.protected.impulse_pa_s


class ItemWorth(NamedTuple):
    """The worth of one module or piece of the layout.

    Attributes:
        name: Its row and column, and its item if it is a piece.
        rectangle_m: The ground that it covers.
        worth: Growth of the impulse if it is left out, as a share of the impulse without a barrier,
            mean over the threats; below 0 if the layout is better without it.
    """

    name: str
    rectangle_m: Rectangle
    worth: float


@dataclass(frozen=True, eq=False)
class Study:
    """The content of a report.

    Attributes:
        scenario: The scenario.
        layout: The layout.
        options: The options.
        blasts: The blasts of the threats with the finer cells, without the layout and with it; all
            of them on the coarser cells as well, unless there is one size.
        pictures: Facades and histories with the finer cells, by threat; none if it was stopped
            before those.
        items: The blasts without each module or piece, with the coarser cells; `None` without.
        places: Those of charges at other places, with the coarser cells; `None` without.
        stopped: The part before which it was stopped; empty for a whole report.
    """

    scenario: Scenario
    layout: Layout
    options: StudyOptions
    blasts: Blasts
    pictures: Mapping[str, tuple[Picture, ...]] = field(default_factory=dict)
    items: Blasts | None = None
    places: Blasts | None = None
    stopped: str = ""

    @property
    def target(self) -> LevelOfProtection:
        """Level of protection that buildings with facades must reach."""
        asked = (self.options.target, self.scenario.objective.level, LevelOfProtection.LOW)
        return next(each for each in asked if each is not None)

    @property
    def targets(self) -> tuple[ReportedBuilding, ...]:
        """The buildings."""
        return targets_of(self.scenario)

    @property
    def threats(self) -> tuple[LoadCase, ...]:
        """The threats."""
        return self.blasts.threats

    @property
    def bill(self) -> pd.DataFrame:
        """Bill of quantities of the layout; `blast_env.io.export.bill.BILL_COLUMNS`."""
        return bill_of_quantities(LayoutPlan(self.scenario, self.layout))

    @property
    def cost(self) -> float:
        """The cost of the layout."""
        return LayoutState.of(self.scenario, self.layout).cost

    @cached_property
    def unprotected(self) -> Consequences:
        """Response of the buildings without the layout, with the finer cells."""
        return consequences_of(self.blasts, NO_BARRIER)

    @cached_property
    def protected(self) -> Consequences:
        """Response of the buildings and of the barrier with it."""
        return consequences_of(self.blasts)

    @cached_property
    def walled_coarse(self) -> Consequences:
        """The same with the coarser cells."""
        return consequences_of(self.blasts.coarse or self.blasts)

    @cached_property
    def pairs(self) -> tuple[LoadPair, ...]:
        """Loads by cell size, threat and building, the coarser cells first."""
        coarse, fine = self.options.cells
        found = () if self.blasts.coarse is None else self._pairs(self.blasts.coarse, coarse)
        return (*found, *self._pairs(self.blasts, fine))

    @property
    def fine(self) -> tuple[LoadPair, ...]:
        """Loads by threat and building with the finer cells."""
        return tuple(each for each in self.pairs if each.cells == self.options.cells[1])

    def _pairs(self, blasts: Blasts, cells: Cells) -> tuple[LoadPair, ...]:
        found = []
        for number, threat in enumerate(blasts.threats):
            protected, unprotected = (
                each.complete.buildings for each in blasts.pairs(blasts.judged)[number]
            )
            error = GridError.of(blasts, number=number)
            found += [
                LoadPair(each, threat, cells, unprotected[each.name], protected[each.name], error)
                for each in self.targets
                if each.name in unprotected and each.name in protected
            ]
        return tuple(found)

    @property
    def _labelled(self) -> list[tuple[str, BlastRecord]]:
        """The records of the threats with their labels, the coarser cells first."""
        sizes = [self.blasts] if self.blasts.coarse is None else [self.blasts.coarse, self.blasts]
        return [
            (_label(threat, words, blasts.engine), record)
            for blasts in sizes
            for number, threat in enumerate(blasts.threats)
            for words, record in zip(
                (_WALLED, _BARE), blasts.pairs(blasts.judged)[number], strict=True
            )
        ]

    @property
    def notes(self) -> tuple[str, ...]:
        """Reasons to distrust loads, by threat and cell size."""
        notes = (
            f"{label}: {note}" for label, each in self._labelled for note in each.complete.notes
        )
        return tuple(dict.fromkeys(notes))

    @property
    def digests(self) -> tuple[tuple[str, str], ...]:
        """Digest of every blast of the threats."""
        return tuple((label, each.complete.digest) for label, each in self._labelled)

    @property
    def uncertainty(self) -> Uncertainty:
        """The uncertain quantities, with the largest error of the cells of an impulse."""
        shares = (
            each.protected_error_pa_s / each.protected.impulse_pa_s
            for each in self.fine
            if each.target.protected
        )
        cells = max((share for share in shares if np.isfinite(share)), default=0.0)
        return Uncertainty(mass=self.options.mass_error, cells=cells)

    @property
    def grid_error(self) -> float:
        """Largest error of the cells of a reduction of the impulse; NaN with one size."""
        found = (each.reduction_error for each in self.fine if each.target.protected)
        return max((each for each in found if np.isfinite(each)), default=float("nan"))

    @property
    def worths(self) -> tuple[ItemWorth, ...]:
        """The worth of every module or piece, by the impulse if it alone is left out."""
        if self.items is None:
            return ()
        pieces = standing(self.layout)
        impulses = np.array([self.items.values(name, impulse_of) for name in self.items.layouts])
        unprotected, whole, without = impulses[0], impulses[1], impulses[2:]
        worths = ((without - whole) / unprotected).mean(axis=1)
        items = [
            ItemWorth(
                layout_text([element]),
                self.scenario.zone.element_rectangle_m(element),
                float(worth),
            )
            for element, worth in zip(pieces, worths, strict=True)
        ]
        return tuple(sorted(items, key=lambda each: -each.worth))

    @property
    def outcomes(self) -> tuple[ThreatOutcome, ...]:
        """Charges at other places, by the impulse whatever counts in the site's objective."""
        if self.places is None:
            return ()
        count = range(len(self.places.threats))
        return tuple(ThreatOutcome.of(self.places, k, ObjectiveSection()) for k in count)


Told = Callable[[str, float], None]
"""Called with the label of the current part, and its completed share, 0 to 1."""


def run_study(
    scenario: Scenario,
    layout: Sequence[Element],
    options: StudyOptions | None = None,
    progress: Told = lambda _, __: None,
) -> Study:
    """Run all blasts of a report.

    Without given threats, charges at other places come first: the worst of them are the threats. An
    interruption (`KeyboardInterrupt`) after the threats with the coarser cells gives a report on
    the parts finished by then. Progress is the label of the current part, and its completed share.

    Raises:
        BlastEnvError: If the layout is not legal, a charge is out of place, or a limit names no
            building; all before the first blast.
    """
    options = options or StudyOptions(cells=final_cells(scenario))
    cells = check_layout(scenario, layout)
    if not cells:
        raise BlastEnvError("the layout is empty: there is nothing to report on")
    check_limits(options.limits, [each.name for each in targets_of(scenario)])
    asked = requested_threats(scenario, options.charges)
    for threat in asked:
        check_layout(scenario.with_possible_charges([threat.charge]), cells)
    return Runs(scenario, tuple(cells), options, progress).study(asked)


class PlannedPart(NamedTuple):
    """A part of a report before it is run.

    Attributes:
        label: The label that `run_study` reports.
        cells: Their cells.
        charges: The charge of each blast; of equal blasts, only the first is run.
        is_drawn: Whether each blast has pictures.
    """

    label: str
    cells: Cells
    charges: tuple[AnyCharge, ...]
    is_drawn: bool = False


def blasts_of(
    scenario: Scenario, layout: Layout, options: StudyOptions, threats: Sequence[LoadCase]
) -> tuple[PlannedPart, ...]:
    """Return the parts of a report in their order, with the blasts of each."""
    coarse = options.cells[0]
    own = [threat.charge for threat in threats]
    places = [each.charge for each in other_places(scenario, options.places)]
    both = ((), layout)
    first = [] if options.charges else places  # the candidates for the threats
    known = {(each, charge) for each in both for charge in (*first, *own)}
    parts = [PlannedPart(_PLACES, coarse, tuple(first * len(both)))] if first else []
    last = options.sizes[-1]
    parts += [
        PlannedPart(
            _label(threat, words, GasEngine.with_cells(size)), size, (threat.charge,), size == last
        )
        for size in (options.sizes[-1:] if first else options.sizes)
        for threat in threats
        for words in (_BARE, _WALLED)
    ]

    def asked(label: str, layouts: Sequence[Layout], charges: Sequence[AnyCharge]) -> None:
        pairs = dict.fromkeys((each, charge) for each in layouts for charge in charges)
        new = [pair for pair in pairs if pair not in known]
        known.update(new)
        parts.append(PlannedPart(label, coarse, tuple(charge for _, charge in new)))

    asked(_ITEMS, _fewer(layout) if options.items else (), own)
    if options.charges:
        asked(_PLACES, both, places)
    return tuple(parts)


def _fewer(layout: Layout) -> list[Layout]:
    """Return the layouts that lack one module or piece, one for each."""
    return [tuple(each for each in layout if each != piece) for piece in standing(layout)]


def _label(threat: LoadCase, words: str, engine: Engine) -> str:
    """Return the label of a blast of the threats, for progress and for its digest."""
    return f"{threat.name} {words}, {engine.words.partition(', ')[2]}"


def threats_of(scenario: Scenario, options: StudyOptions) -> tuple[LoadCase, ...]:
    """Return the threats of a report before any blast, for its cost.

    Those given, or stand-ins: one of the places of each source.
    """
    if options.charges:
        return requested_threats(scenario, options.charges)
    places = other_places(scenario, options.places)
    return chief_threats(places, lambda _: Severity(), options.most_threats)


class Runs:
    """The campaigns of a report, one part after the other; they share a store.

    Args:
        scenario: The scenario.
        layout: The layout.
        options: The options.
        progress: Called with the label of the current part, and its completed share.
    """

    def __init__(
        self, scenario: Scenario, layout: Layout, options: StudyOptions, progress: Told
    ) -> None:
        self.scenario, self.layout = scenario, layout
        self.options, self.progress = options, progress
        self._store = BlastStore(options.cache)
        self._both = {NO_BARRIER: (), _WALLED: layout}

    def study(self, asked: tuple[LoadCase, ...]) -> Study:
        """Run the parts, and return what was finished before an interruption.

        Raises:
            KeyboardInterrupt: If not even the coarser cells were finished.
        """
        part, threats, blasts = _PLACES, asked, list[Blasts]()
        pictures: dict[str, tuple[Picture, ...]] = {}
        items = places = None
        try:
            threats = asked or self.choose_threats()
            for size in self.options.sizes:
                part = GasEngine.with_cells(size).cell_words
                drawn = pictures if size == self.options.sizes[-1] else None
                blasts.append(self._on_threats(size, threats, drawn))
            part = _ITEMS
            items = self.without_items(threats) if self.options.items else None
            part = _PLACES
            places = self.other_places()
            part = ""
        except KeyboardInterrupt:
            if not blasts:
                raise
            self.progress(f"stopped before: {part}", 1.0)
        cells = self.options.sizes
        options = replace(self.options, cells=(cells[0], cells[len(blasts) - 1]))
        fine = blasts[-1] if len(blasts) < 2 else replace(blasts[-1], coarse=blasts[0])
        if len(blasts) < len(cells):
            pictures.clear()
        return Study(self.scenario, self.layout, options, fine, pictures, items, places, part)

    def _campaign(
        self, layouts: Mapping[str, Layout], threats: Sequence[LoadCase], cells: Cells
    ) -> Campaign:
        evaluator = BlastEvaluator(self.scenario, GasEngine.with_cells(cells), cache=self._store)
        case = LoadCaseSet(self.scenario, tuple(threats))
        return Campaign(case, layouts, evaluator, processes=self.options.processes)

    def _on_threats(
        self,
        cells: Cells,
        threats: Sequence[LoadCase],
        pictures: dict[str, tuple[Picture, ...]] | None,
    ) -> Blasts:
        """Run every threat with cells of one size, blast by blast; draw those of the finer ones."""
        whole = self._campaign(self._both, threats, cells)
        for threat in threats:
            drawing = None if pictures is None else ThreatPictures()
            for name, words in zip(self._both, (_BARE, _WALLED), strict=True):
                label = _label(threat, words, whole.evaluator.engine)
                one = self._campaign({name: self._both[name]}, [threat], cells)
                one.run(partial(self.progress, label), drawing)
            if pictures is not None and drawing is not None:
                both = self._campaign(self._both, [threat], cells).run()
                pictures[threat.name] = drawing.pictures(both)
        return whole.run()

    def choose_threats(self) -> tuple[LoadCase, ...]:
        """Return the worst places as threats, by loads with the layout, as in the verdict."""
        places = self.other_places()
        objective = self.scenario.objective
        loads = [each.loads for each in places.records[places.judged]]
        found = {
            each: Severity.of_loads(load, objective)
            for each, load in zip(places.threats, loads, strict=True)
        }
        most = self.options.most_threats
        return chief_threats(places.threats, lambda each: found[each], most)

    def other_places(self) -> Blasts:
        """Return the blasts of the charges at other places."""
        places = other_places(self.scenario, self.options.places)
        campaign = self._campaign(self._both, places, self.options.cells[0])
        return campaign.run(partial(self.progress, _PLACES))

    def without_items(self, threats: Sequence[LoadCase]) -> Blasts:
        """Return the blasts without a barrier, with the layout, and without each item of it."""
        fewer = {str(number): each for number, each in enumerate(_fewer(self.layout))}
        campaign = self._campaign(self._both | fewer, threats, self.options.cells[0])
        return campaign.run(partial(self.progress, _ITEMS))
