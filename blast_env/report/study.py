"""The study behind a report: its blasts and their results."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, BlastLoads, LoadCase, ThreatOutcome
from blast_env.evaluation.consequences import Consequences, Severity, consequences_of
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.evaluation.probability import Uncertainty
from blast_env.evaluation.shared import keep_consequences
from blast_env.gas.settings import Cells
from blast_env.geometry import Element, Layout, layout_text, standing
from blast_env.io.export.bill import LayoutPlan, bill_of_quantities
from blast_env.layout import LayoutState, check_layout
from blast_env.report.details import ReportDetails
from blast_env.report.figures import (
    Picture,
    blast_pictures,
    damage_pictures,
    risk_picture,
)
from blast_env.report.loads import (
    MeasuredBlast,
    ReportedBuilding,
    TargetLoad,
    measure,
    targets_of,
)
from blast_env.report.outcomes import ItemWorth, Limit, LoadPair, check_limits
from blast_env.report.threats import chief_threats, other_places, requested_threats
from blast_env.response.buildings import LevelOfProtection
from blast_env.runner import as_completed
from blast_env.site import AnyCharge, ObjectiveSection, Scenario

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


@dataclass(frozen=True, eq=False)
class Study:
    """The content of a report.

    Attributes:
        scenario: The scenario.
        layout: The layout.
        options: The options.
        targets: The buildings.
        threats: The threats.
        bill: Bill of quantities of the layout; `blast_env.io.export.bill.BILL_COLUMNS`.
        cost: Its cost.
        pairs: Loads by threat, building and cell size.
        unprotected: Response of the buildings without the layout, with the finer cells.
        protected: Response of the buildings and of the barrier with it.
        walled_coarse: The same with the coarser cells.
        pictures: Facades and histories with the finer cells, by threat; none if it was stopped
            before those.
        items: The worth of each module or piece, the most valuable one first.
        places: Charges at other places.
        notes: Reasons to distrust loads, by threat and cell size.
        digests: Digest of every blast with pictures.
        stopped: The part before which it was stopped; empty for a whole report.
    """

    scenario: Scenario
    layout: Layout
    options: StudyOptions
    targets: tuple[ReportedBuilding, ...]
    threats: tuple[LoadCase, ...]
    bill: pd.DataFrame
    cost: float
    pairs: tuple[LoadPair, ...]
    unprotected: Consequences
    protected: Consequences
    walled_coarse: Consequences
    pictures: dict[str, tuple[Picture, ...]]
    items: tuple[ItemWorth, ...]
    places: tuple[ThreatOutcome, ...]
    notes: tuple[str, ...]
    digests: tuple[tuple[str, str], ...]
    stopped: str = ""

    @property
    def target(self) -> LevelOfProtection:
        """Level of protection that buildings with facades must reach."""
        asked = (self.options.target, self.scenario.objective.level, LevelOfProtection.LOW)
        return next(each for each in asked if each is not None)

    @property
    def fine(self) -> tuple[LoadPair, ...]:
        """Loads by threat and building with the finer cells."""
        return tuple(each for each in self.pairs if each.cells == self.options.cells[1])

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
    targets = targets_of(scenario)
    check_limits(options.limits, targets)
    asked = requested_threats(scenario, options.charges)
    for threat in asked:
        check_layout(scenario.with_possible_charges([threat.charge]), cells)
    bill = bill_of_quantities(LayoutPlan(scenario, cells))
    runs = Runs(scenario, cells, options, targets, asked, progress)
    items: tuple[ItemWorth, ...] = ()
    places: tuple[ThreatOutcome, ...] = ()
    part = options.words[1]
    try:
        if not asked:
            runs.choose_threats()
        runs.run_threats()
        part = _ITEMS
        items = runs.item_worths() if options.items else ()
        part = _PLACES
        places = runs.other_places()
        part = ""
    except KeyboardInterrupt:
        options = runs.completed_options()
        progress(f"stopped before: {part}", 1.0)
    coarse, fine = options.cells
    return Study(
        scenario=scenario,
        layout=cells,
        options=options,
        targets=targets,
        threats=runs.threats,
        bill=bill,
        cost=LayoutState.of(scenario, cells).cost,
        pairs=tuple(each for each in runs.pairs if each.cells in options.cells),
        unprotected=runs.consequences(fine, protected=False),
        protected=runs.consequences(fine, protected=True),
        walled_coarse=runs.consequences(coarse, protected=True),
        pictures=runs.pictures,
        items=items,
        places=places,
        notes=tuple(dict.fromkeys(runs.notes)),
        digests=tuple(runs.digests),
        stopped=part,
    )


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
        PlannedPart(_label(threat, words, size), size, (threat.charge,), size == last)
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


def _label(threat: LoadCase, words: str, cells: Cells) -> str:
    """Return the label of a blast of the threats, for progress and for its digest."""
    return f"{threat.name} {words}, {GasEngine.with_cells(cells).cell_words}"


def threats_of(scenario: Scenario, options: StudyOptions) -> tuple[LoadCase, ...]:
    """Return the threats of a report before any blast, for its cost.

    Those given, or stand-ins: one of the places of each source.
    """
    if options.charges:
        return requested_threats(scenario, options.charges)
    places = other_places(scenario, options.places)
    return chief_threats(places, lambda _: Severity(), options.most_threats)


class _Blast(NamedTuple):
    """The numbers of a report from a blast, without its pressures and pictures.

    Attributes:
        on_targets: Load on each building with a wall in the air, by name.
        found: Response of buildings and barrier.
        loads: Loads on the structures.
        notes: Reasons to distrust the loads.
        digest: Digest of the blast.
    """

    on_targets: dict[str, TargetLoad]
    found: Consequences
    loads: BlastLoads
    notes: tuple[str, ...]
    digest: str

    @classmethod
    def of(cls, measured: MeasuredBlast) -> "_Blast":
        result = measured.result
        found = consequences_of(result.blast.scenario, result, result.run.site.charge)
        return cls(measured.loads, found, result.loads(), measured.notes, result.digest)


def _measured(work: tuple[GasBlast, tuple[ReportedBuilding, ...]]) -> _Blast:
    """Run a blast, in this process or a worker."""
    return _Blast.of(measure(*work))


class Runs:
    """The blasts of a report, one part after the other; each is run once."""

    def __init__(
        self,
        scenario: Scenario,
        layout: Layout,
        options: StudyOptions,
        targets: tuple[ReportedBuilding, ...],
        threats: tuple[LoadCase, ...],
        progress: Told,
    ) -> None:
        self.scenario, self.layout, self.options = scenario, layout, options
        self.targets, self.threats, self.progress = targets, threats, progress
        self.pairs: list[LoadPair] = []
        self.pictures: dict[str, tuple[Picture, ...]] = {}
        self.notes: list[str] = []
        self.digests: list[tuple[str, str]] = []
        self._ahead: dict[tuple[Layout, LoadCase], _Blast] = {}
        self._found: dict[tuple[Cells, bool], list[Consequences]] = {}
        self._evaluators = {
            size: BlastEvaluator(scenario, GasEngine.with_cells(size), cache=options.cache)
            for size in options.sizes
        }
        self._evaluator = self._evaluators[options.cells[0]]

    def run_threats(self) -> None:
        """Run every threat with both sizes of cells, without and with the layout.

        The coarser ones come first: they suffice for a report if the rest is stopped.
        """
        *coarser, fine = self.options.sizes
        for size in coarser:
            for threat in self.threats:
                self._keep(threat, size, *(self._coarse(threat, each) for each in self._layouts))
        for threat in self.threats:
            both = [self._measured(threat, fine, layout) for layout in self._layouts]
            self._keep(threat, fine, *map(_Blast.of, both))
            # Drawn now, because only these two results are in memory at once.
            unprotected, protected = (
                self._found[fine, is_walled][-1] for is_walled in (False, True)
            )
            self.pictures[threat.name] = (
                *damage_pictures(unprotected, protected),
                risk_picture(*both),
                *blast_pictures(both[0], both[1]),
            )

    @property
    def _layouts(self) -> tuple[Layout, Layout]:
        return (), self.layout

    def completed_options(self) -> StudyOptions:
        """Return the options of a report on the finished cells, perhaps the coarser ones alone.

        Raises:
            KeyboardInterrupt: If not even these are finished.
        """
        count = len(self.threats)
        done = [
            size
            for size in self.options.cells
            if count and len(self._found.get((size, True), ())) == count
        ]
        if not done:
            raise KeyboardInterrupt
        if len(self.pictures) < count:
            self.pictures.clear()
        return replace(self.options, cells=(done[0], done[-1]))

    def consequences(self, cells: Cells, *, protected: bool) -> Consequences:
        """Return the consequences of all threats on the given cells, without or with the layout."""
        return Consequences.together(self._found[cells, protected])

    def _blast(self, threat: LoadCase, cells: Cells, layout: Layout) -> GasBlast:
        return GasBlast(self.scenario, layout, 0, GasEngine.with_cells(cells), threat.charge)

    def _coarse(self, threat: LoadCase, layout: Layout) -> _Blast:
        """Return a blast with the coarser cells, which may be among those run ahead."""
        if (layout, threat) in self._ahead:
            return self._ahead[layout, threat]
        return _Blast.of(self._measured(threat, self.options.cells[0], layout))

    def _measured(self, threat: LoadCase, cells: Cells, layout: Layout) -> MeasuredBlast:
        label = _label(threat, _WALLED if layout else _BARE, cells)
        progress = partial(self.progress, label)
        return measure(self._blast(threat, cells, layout), self.targets, progress)

    def _keep(self, threat: LoadCase, cells: Cells, unprotected: _Blast, protected: _Blast) -> None:
        """Keep the numbers of both blasts of a threat."""
        for layout, words, each in (((), _BARE, unprotected), (self.layout, _WALLED, protected)):
            label = _label(threat, words, cells)
            self.notes += [f"{label}: {note}" for note in each.notes]
            self.digests.append((label, each.digest))
            self._found.setdefault((cells, bool(layout)), []).append(each.found)
            self._evaluators[cells].keep(layout, threat, each.loads)
            keep_consequences(self._evaluators[cells], layout, threat.charge, each.found)
        coarser = {
            each.target.name: each
            for each in self.pairs
            if each.threat is threat and self.options.ratio > 1.0
        }
        for target in self.targets:
            if target.name in unprotected.on_targets and target.name in protected.on_targets:
                loads = unprotected.on_targets[target.name], protected.on_targets[target.name]
                coarse = coarser.get(target.name)
                ratio = self.options.ratio
                self.pairs.append(LoadPair(target, threat, cells, *loads, coarse, ratio))

    def other_places(self) -> tuple[ThreatOutcome, ...]:
        """Return the outcomes of the charges at other places."""
        places = other_places(self.scenario, self.options.places)
        return self._outcomes(_PLACES, places)

    def choose_threats(self) -> None:
        """Choose the worst places as threats, by loads with the layout, as in the verdict.

        Their blasts with the coarser cells are kept for `run_threats`.
        """
        places = other_places(self.scenario, self.options.places)
        if len(self.options.sizes) > 1:
            self._run_ahead(places)
        loads = self._blasts(_PLACES, self._layouts, places)[len(places) :]
        objective = self.scenario.objective
        severities = (Severity.of_loads(each, objective) for each in loads)
        found = dict(zip(places, severities, strict=True))
        self.threats = chief_threats(places, lambda each: found[each], self.options.most_threats)
        self._ahead = {key: each for key, each in self._ahead.items() if key[1] in self.threats}

    def _run_ahead(self, places: Sequence[LoadCase]) -> None:
        """Run and measure the blasts at places that the store lacks."""
        asked = [
            (layout, place)
            for layout in self._layouts
            for place in places
            if not self._evaluator.knows(layout, place)
        ]
        size = self.options.cells[0]
        work = [(self._blast(place, size, layout), self.targets) for layout, place in asked]
        for done, (index, blast) in enumerate(
            as_completed(_measured, work, self.options.processes), start=1
        ):
            self._ahead[asked[index]] = blast
            self._evaluator.keep(*asked[index], blast.loads)
            self.progress(_PLACES, done / len(work))

    def _outcomes(self, label: str, charges: Sequence[LoadCase]) -> tuple[ThreatOutcome, ...]:
        loads = self._blasts(label, self._layouts, charges)
        unprotected, protected = loads[: len(charges)], loads[len(charges) :]
        # The page has impulses there, whatever counts in the objective of the scenario.
        site = self.scenario.model_copy(update={"objective": ObjectiveSection()})
        return tuple(
            map(
                partial(ThreatOutcome.of, site, self.layout),
                charges,
                protected,
                unprotected,
            )
        )

    def item_worths(self) -> tuple[ItemWorth, ...]:
        """Return the worth of every module or piece, by the impulse if it alone is left out."""
        pieces = standing(self.layout)
        layouts = ((), self.layout, *_fewer(self.layout))
        impulses = self._loads(_ITEMS, layouts, self.threats)
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

    def _loads(
        self, label: str, layouts: Sequence[Layout], threats: Sequence[LoadCase]
    ) -> FloatArray:
        """Return the impulses on the protected structures, Pa s (layouts, threats)."""
        blasts = self._blasts(label, layouts, threats)
        counted = [each.protected_impulse_pa_s for each in blasts]
        return np.asarray(np.reshape(counted, (len(layouts), len(threats))))

    def _blasts(
        self, label: str, layouts: Sequence[Layout], threats: Sequence[LoadCase]
    ) -> list[BlastLoads]:
        """Return the loads of every layout under every threat, from the store if possible."""
        pairs = [(layout, threat) for layout in layouts for threat in threats]
        progress = partial(self.progress, label)
        return self._evaluator.loads_of_many(pairs, self.options.processes, progress)
