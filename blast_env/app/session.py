"""An open design: edits saved at once, running work, results.

A session is independent of the page. All tabs on one design share its session, and designs are
independent of each other.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from itertools import cycle, islice
from pathlib import Path
from typing import Any, Final

from blast_env.answers.compare import BuildingVerdict, building_verdicts, comparison
from blast_env.answers.document import Table, charge_text
from blast_env.app import placing
from blast_env.app.blasts import BlastTask
from blast_env.app.design import SLOTS, Design, History
from blast_env.app.folder import DesignFolder, WorkFolder
from blast_env.app.jobs import Workers, jobs_of, settle
from blast_env.app.kept import DesignSettings, read_kept
from blast_env.app.offers import runs_blasts
from blast_env.app.tasks import AnswerTask, ReportTask, SearchTask
from blast_env.app.threats import threats_of, usual_threats
from blast_env.app.work import Answer, Question, Status, Task
from blast_env.design.search.advice import kinds_for, most_blasts
from blast_env.design.search.advised import ROUNDS
from blast_env.design.search.registry import proposer_row
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastStore, LoadCase, LoadCaseSet
from blast_env.evaluation.blasts import NO_BARRIER, Blasts
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.questions.capacity import MOST_BLASTS
from blast_env.evaluation.questions.probability import Uncertainty
from blast_env.evaluation.questions.verdict import BuildingResponse, Consequences, response_to
from blast_env.evaluation.study import StudyCost, StudyOptions, StudyPlan
from blast_env.gas.cost import CostGuess
from blast_env.gas.settings import Cells
from blast_env.geometry import Layout, Measure
from blast_env.layout import check_layout
from blast_env.response.levels import LevelOfProtection
from blast_env.site import AnyCharge, Scenario

NO_FACADE = "Give structures windows or wall panels first (on the left)."
"""Message where no structure has a facade, so that there is no level of protection."""

_DPI: Final = 100


@dataclass(frozen=True)
class LayoutView:
    """A layout with a blast to show beside others."""

    name: str
    layout: Layout
    key: str


@dataclass
class Session:
    """An open design.

    Attributes:
        workers: The worker processes.
        history: The design with its steps.
        cells: The cells of new blasts and of the results shown; searches take larger ones.
        threats: Names of the threats of blasts; by default `usual_threats` of the site.
        view: The view opened last; a reloaded page starts with it.
    """

    folder: DesignFolder
    work: WorkFolder
    workers: Workers
    history: History
    cells: Cells = 0.5
    threats: tuple[str, ...] = ()
    view: str = "Plan"
    _listeners: list[Callable[[], None]] = field(default_factory=list, init=False)
    _judged: dict[tuple[str, str], tuple[BuildingVerdict, ...]] = field(
        default_factory=dict, init=False
    )
    _on: tuple[Scenario, Cells, Campaign] | None = field(default=None, init=False)

    @classmethod
    def opened(cls, folder: DesignFolder, work: WorkFolder, workers: Workers) -> "Session":
        """Return the session of a saved design."""
        session = cls(folder, work, workers, folder.load())
        settle(folder.jobs, workers)
        final = GasEngine().final([session.scenario])
        cells = final.cells if final.is_growing else final.cell_m
        kept = folder.settings() or DesignSettings(cells=cells)
        session.cells, session.view = kept.cells, kept.view
        session._choose(kept.threats)
        return session

    def keep(self) -> None:
        """Save cells, threats and view, with which the design is opened again."""
        kept = DesignSettings(cells=self.cells, threats=self.threats, view=self.view)
        self.folder.keep_settings(kept)

    def _choose(self, threats: Iterable[str]) -> None:
        """Take the threats that the site has; the usual ones if it has none of them."""
        known = {own.name for own in threats_of(self.scenario)}
        self.threats = tuple(threat for threat in threats if threat in known)
        self.threats = self.threats or usual_threats(self.scenario)

    @property
    def design(self) -> Design:
        """The current design."""
        return self.history.design

    @property
    def scenario(self) -> Scenario:
        """Its site."""
        return self.design.scenario

    # Edits.

    def listen(self, listener: Callable[[], None]) -> Callable[[], None]:
        """Call a function after every edit; return a function that ends that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    @property
    def is_watched(self) -> bool:
        """Whether a tab shows the design."""
        return bool(self._listeners)

    def put(self, label: str, design: Design) -> None:
        """Make a step, and save it.

        Raises:
            BlastEnvError: If it cannot be saved; the step is made all the same.
        """
        self._set(self.history.then(label, design))

    def put_site(self, label: str, scenario: Scenario) -> tuple[str, ...]:
        """Make a step to a changed site; return notes on the elements removed from layouts."""
        design, notes = self.design.with_scenario(scenario)
        self.put(label, design)
        return notes

    def harden(self, measure: str, *, taken: bool) -> None:
        """Add a measure to the active layout, or remove it."""
        own = Measure.named(measure)
        layout = tuple(element for element in self.design.layout if element != own)
        label = f"{'take' if taken else 'leave'} {measure}"
        self.put(label, self.design.with_layout((*layout, own) if taken else layout))

    def show(self, slot: int) -> None:
        """Make another layout the active one."""
        self._set(self.history.showing(slot))

    def undo(self) -> None:
        """Undo the last step."""
        self._set(self.history.undone())

    def redo(self) -> None:
        """Redo the last undone step."""
        self._set(self.history.redone())

    def _set(self, history: History) -> None:
        self.history = history
        self._choose(self.threats)
        try:
            self.folder.save(history)
        finally:
            for listener in [*self._listeners]:
                listener()

    # Work.

    def chosen_threats(self) -> tuple[LoadCase, ...]:
        """Return the threats of blasts."""
        return tuple(own for own in threats_of(self.scenario) if own.name in self.threats)

    def blast(self, slots: Iterable[int]) -> Path:
        """Run the blasts of layouts under the chosen threats; return the folder of the work.

        Raises:
            BlastEnvError: If there are no layouts, or the work cannot be started.
        """
        chosen = [*slots]
        names = ", ".join(SLOTS[own] for own in chosen)
        folder = None
        for slot in chosen:
            task = BlastTask(
                **self._on_site(self.scenario.without_budget),
                layout=self.design.layouts[slot],
                blasts=self.folder.blasts,
            )
            folder = self._begin(task, f"blast of {SLOTS[slot]}, {self.engine.words}")
        if folder is None:
            raise BlastEnvError(f"layouts: there are none to blast ({names})")
        return folder

    def search(self, method: str, budget: int = 0) -> Path:
        """Search for a layout against the chosen threats, or propose one without a blast.

        Args:
            budget: Most blasts, for a proposer that runs any.

        Raises:
            UnknownNameError: If there is no such proposer.
            BlastEnvError: If there is no build zone, or the budget of a search is below 1.
        """
        _ = self.scenario.zone
        if not runs_blasts(method):
            budget = 0
        elif budget < 1:
            raise BlastEnvError(f"budget is {budget} blasts, must be at least 1")
        title = proposer_row(method).title
        task = SearchTask(**self._on_site(), method=method, budget=budget)
        if budget == 0:
            return self._begin(task, f"proposal: {title}")
        return self._begin(task, f"{method} search, {budget} blasts, {self._search_engine.words}")

    def report(self, page: Path, pdf: Path | None = None, **contents: Any) -> Path:
        """Report on the active layout, by gas dynamics, under the chosen threats.

        Args:
            page: The page to write, .html.
            pdf: The same as PDF.
            contents: Options of `StudyOptions`.

        Raises:
            BlastEnvError: If the layout is empty, or the report cannot be started.
        """
        options = self._study_options(contents)
        task = ReportTask(self.scenario, self.design.layout, options, page, pdf)
        return self._begin(task, f"report {page.name if pdf is None else pdf.name}")

    def _study_options(self, contents: Mapping[str, Any]) -> StudyOptions:
        if not self.design.layout:
            raise BlastEnvError(
                f"layout {SLOTS[self.design.active]} is empty: there is nothing to report on"
            )
        check_layout(self.scenario, self.design.layout)  # refuses one that costs too much
        charges = tuple(chosen_threat.charge for chosen_threat in self.chosen_threats())
        return StudyOptions(charges=charges, cache=self.work.cache, **contents)

    def ask(
        self, question: Question, target: LevelOfProtection, mass_error: float, budget: int
    ) -> Path:
        """Ask a question on the active layout under the chosen threats, by gas dynamics.

        Args:
            target: Required level of protection.
            mass_error: Uncertainty of the masses; see `Uncertainty`.
            budget: Most blasts of a search of advice.

        Raises:
            BlastEnvError: If it cannot be answered: without a facade, or, with advice, without a
                budget of the build zone.
        """
        task = self._question(question, target, mass_error, budget)
        return self._begin(task, f"{question} {task.name}, {self.engine.words}")

    def cost_of_question(
        self, question: Question, target: LevelOfProtection, mass_error: float, budget: int
    ) -> tuple[CostGuess, ...]:
        """Return the largest costs of the blasts of a question; see `ask`."""
        task = self._question(question, target, mass_error, budget)
        layouts = 2 if task.layout else 1
        fine = tuple(self._cost(threat.charge) for threat in task.threats)
        coarse = tuple(
            self._search_engine.cost(self.scenario, threat.charge) for threat in task.threats
        )
        if question is Question.CAPACITY:
            return fine * (layouts * MOST_BLASTS)
        if question is Question.ASSESS:
            return (fine + coarse[: self.engine.coarser is not None]) * layouts
        kinds = kinds_for(self.scenario)
        blasts, barriers = most_blasts(self.scenario, kinds, ROUNDS, budget, len(fine))
        return tuple(islice(cycle(coarse), blasts)) + fine * barriers

    def _question(
        self, question: Question, target: LevelOfProtection, mass_error: float, budget: int
    ) -> AnswerTask:
        Uncertainty(mass=mass_error)  # refuses one that is out of bounds
        if not self.scenario.bays:
            raise BlastEnvError(NO_FACADE)
        if question is Question.ADVISE:
            if self.scenario.zone.budget is None:
                raise BlastEnvError("the build zone has no budget: advice is for one")
            if budget < len(self.chosen_threats()):
                raise BlastEnvError(
                    f"budget is {budget} blasts, must be at least {len(self.chosen_threats())}: "
                    "one per threat"
                )
        is_advice = question is Question.ADVISE
        return AnswerTask(
            **self._on_site(None if is_advice else self.scenario.without_budget),
            subject=self.subject,
            layout=self.design.layout,
            question=question,
            name=SLOTS[self.design.active],
            target=target,
            mass_error=mass_error,
            budget=budget,
        )

    def answers(self) -> list[tuple[Answer, bool]]:
        """Return an answer to each question asked, and whether it is on the present design.

        One on the present design comes before others; of several, the latest counts.
        """
        subject, found = self.subject, dict[Question, Answer]()
        read = [read_kept(Answer, path) for path in self.folder.answers_there()]
        every = [own for own in read if own is not None]
        for answer in sorted(every, key=lambda part: part.subject != subject):
            found.setdefault(answer.question, answer)
        return [
            (found[question], found[question].subject == subject)
            for question in Question
            if question in found
        ]

    @property
    def subject(self) -> str:
        """The digest of the site, the active layout and the chosen threats."""
        on = self.scenario.model_dump_json(), self.design.layout, self.chosen_threats()
        return sha256(repr(on).encode()).hexdigest()

    def take(self, status: Status, slot: int) -> None:
        """Put the layout of a proposal or a search into a slot of the design.

        Raises:
            BlastEnvError: If there is none, or it is not legal on the changed site.
        """
        if status.layout is None:
            raise BlastEnvError(f"{status.title}: there is no layout to use")
        layout = placing.layout_from(self.scenario, status.layout)
        design = self.design.with_layout(layout, slot)
        self.put(f"{status.title} into {SLOTS[slot]}", design)

    def jobs(self, most: int | None = None) -> list[tuple[Path, Status]]:
        """Return the requested work, the latest first, at most `most` of it."""
        return jobs_of(self.folder.jobs, most)

    @property
    def is_at_work(self) -> bool:
        """Whether the latest work is unfinished."""
        return any(not status.is_over for _, status in self.jobs(1))

    def _begin(self, task: Task, title: str) -> Path:
        return self.workers.begin(task, self.folder.jobs, title)

    def _on_site(self, site: Scenario | None = None) -> dict[str, Any]:
        """Return the parameters common to all work on the site, or on a variant of it."""
        return {
            "site": site or self.scenario,
            "threats": self.chosen_threats(),
            "cache": self.work.cache,
            "cells": self.cells,
        }

    def cost(self, slots: Iterable[int]) -> tuple[CostGuess, ...]:
        """Return the costs of the missing blasts of layouts."""
        keys: dict[str, AnyCharge] = {}
        evaluator = self._campaign({}).evaluator
        for threat in self.chosen_threats():
            for layout in ((), *(self.design.layouts[slot] for slot in slots)):
                key = evaluator.key(layout, threat).digest
                if evaluator.known(layout, threat) is None or not self.folder.pictures_of(key):
                    keys[key] = threat.charge
        return tuple(self._cost(charge) for charge in keys.values())

    def cost_of_error(self, slots: Iterable[int]) -> tuple[CostGuess, ...]:
        """Return the costs of the missing blasts with coarser cells: the worst charge of each."""
        coarser, threats = self._campaign({}).coarser, self.chosen_threats()
        if coarser is None:
            return ()
        layouts = dict.fromkeys([(), *(self.design.layouts[slot] for slot in slots)])
        missing = [
            layout
            for layout in layouts
            if all(coarser.known(layout, threat) is None for threat in threats)
        ]
        cost = coarser.engine.cost(self.scenario, threats[0].charge)
        return () if cost is None else (cost,) * len(missing)

    @property
    def engine(self) -> GasEngine:
        """Gas dynamics with the cells."""
        return GasEngine.with_cells(self.cells)

    @property
    def _search_engine(self) -> GasEngine:
        """The engine of searches: with coarser cells than those of final statements."""
        return self.engine.coarser or self.engine

    def cost_of_report(self, **contents: Any) -> StudyCost:
        """Return the cost of a report on the active layout; see `report`.

        Raises:
            BlastEnvError: If the layout is empty, or there are too many threats.
        """
        options = self._study_options(contents)
        return StudyPlan(self.scenario, self.design.layout, options).cost()

    def cost_of_search(self, budget: int) -> tuple[CostGuess, ...]:
        """Return the costs of the blasts of a search."""
        engine, charges = (
            self._search_engine,
            [chosen_threat.charge for chosen_threat in self.chosen_threats()],
        )
        costs = [engine.cost(self.scenario, charge) for charge in charges]
        return tuple(costs[k % len(costs)] for k in range(max(budget, 0)))

    def _cost(self, charge: AnyCharge) -> CostGuess:
        return self.engine.cost(self.scenario, charge)

    # Results.

    def shown(self, threat: LoadCase) -> tuple[LayoutView, ...]:
        """Return the layouts with the keys of their blasts under a threat, no barrier first.

        Empty layouts are left out: they equal no barrier.
        """
        return tuple(
            LayoutView(name, layout, self.key(layout, threat))
            for name, layout in self._layouts.items()
        )

    @property
    def _layouts(self) -> dict[str, Layout]:
        """The layouts to show, by name."""
        named = zip(SLOTS, self.design.layouts, strict=True)
        return {NO_BARRIER: (), **{name: layout for name, layout in named if layout}}

    def key(self, layout: Layout, threat: LoadCase) -> str:
        """Return the key of a blast, by which its pictures are kept."""
        return self._campaign({}).evaluator.key(layout, threat).digest

    def _campaign(self, layouts: Mapping[str, Layout]) -> Campaign:
        """Return a campaign under the chosen threats, whose blasts are stored or not."""
        if self._on is None or self._on[:2] != (self.scenario, self.cells):
            one = Campaign.on(
                self.scenario.without_budget,
                {},
                self.chosen_threats(),
                self.engine,
                self.engine.coarser,
                self._store,
            )
            self._on = self.scenario, self.cells, one
        case = LoadCaseSet(self._on[2].scenario, self.chosen_threats())
        return replace(self._on[2], case=case, layouts=layouts)

    @cached_property
    def _store(self) -> BlastStore:
        return BlastStore(self.work.cache)

    def results(self) -> dict[str, Blasts]:
        """Return the stored blasts of the shown layouts beside those of no barrier, by name."""
        found = {
            name: self._campaign({NO_BARRIER: (), name: layout}).stored()
            for name, layout in self._layouts.items()
        }
        return {name: blasts for name, blasts in found.items() if blasts is not None}

    def comparison(self) -> Table:
        """Return the table of all blasts of the current design."""
        layouts = {
            name: (blasts, placing.cost_of(self.scenario, self._layouts[name]))
            for name, blasts in self.results().items()
        }
        return comparison(
            layouts, [chosen_threat.name for chosen_threat in self.chosen_threats()], self.scenario
        )

    def verdicts(self) -> list[tuple[str, str, tuple[BuildingVerdict, ...]]]:
        """Return the verdicts on the buildings in all blasts of the current design.

        Each has the name of the layout, that of the threat, and the verdicts.
        """
        return [
            (part.name, threat.name, own)
            for threat in self.chosen_threats()
            for part in self.shown(threat)
            if (own := self.judged(part, threat))
        ]

    def judged(self, shown: LayoutView, threat: LoadCase) -> tuple[BuildingVerdict, ...]:
        """Return the response of the buildings with their current facades to a blast."""
        if not any(structure.facade for structure in self.scenario.structures):
            return ()
        known = shown.key, repr(self.scenario.bays_with(shown.layout))
        if known not in self._judged:
            found = self._consequences(shown, threat)
            if found is None:
                return ()
            self._judged[known] = building_verdicts(found)
        return self._judged[known]

    def damage_png(self, shown: LayoutView, threat: LoadCase, building: str) -> bytes | None:
        """Return the picture of a building's damage; `None` without the histories on its bays."""
        found = self._consequences(shown, threat)
        own = () if found is None else (x for x in found.responses if x.building == building)
        return next(map(damage_png, own), None)

    def _consequences(self, shown: LayoutView, threat: LoadCase) -> Consequences | None:
        record = self._campaign({}).evaluator.known(shown.layout, threat)
        if record is None:
            return None
        charge = threat.charge_against(self.scenario, shown.layout)
        return response_to(self.scenario, shown.layout, charge, record)


def damage_png(building: BuildingResponse) -> bytes:
    """Return the facade of one building in the colours of its damage, as PNG."""
    # Here, because pictures take half a second to import, and tables need none.
    from blast_env.plots.facade import facade_picture
    from blast_env.plots.figures import png_of

    rows = [(charge_text(building.charge), building)]
    return png_of(facade_picture(rows, building.building), _DPI)


@dataclass
class Sessions:
    """The open designs, one session per design for all its tabs.

    Attributes:
        workers: The worker processes for all designs.
    """

    work: WorkFolder
    workers: Workers
    _open: dict[str, Session] = field(default_factory=dict, init=False)

    def of(self, design_id: str) -> Session:
        """Return the session of a design.

        Raises:
            BlastEnvError: If no design has that name, or it cannot be read.
        """
        if design_id not in self._open:
            folder = self.work.open(design_id)
            self._open[design_id] = Session.opened(folder, self.work, self.workers)
        return self._open[design_id]

    def leave(self, design_id: str) -> None:
        """Drop the session of a design, unless a tab still shows it."""
        session = self._open.get(design_id)
        if session is not None and not session.is_watched:
            del self._open[design_id]

    def new(self, scenario: Scenario, label: str) -> Session:
        """Return the session of a new design."""
        return self.of(self.work.create(scenario, label).design_id)
