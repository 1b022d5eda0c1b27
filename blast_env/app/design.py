"""A design: a site, and up to four layouts for it side by side; with undo and redo."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from blast_env.app import placing
from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.site import Scenario

SLOTS: Final = ("A", "B", "C", "D")
"""Names of the layouts of a design."""

MOST_STEPS: Final = 100
"""Steps that can be undone."""


@dataclass(frozen=True)
class Design:
    """A site and its layouts, all of them legal but for the budget.

    Attributes:
        layouts: One for each of `SLOTS`.
        active: Number of the active layout, which edits change.
    """

    scenario: Scenario
    layouts: tuple[Layout, ...] = ((),) * len(SLOTS)
    active: int = 0

    def __post_init__(self) -> None:
        """Check the layouts."""
        if len(self.layouts) != len(SLOTS):
            raise BlastEnvError(f"layouts: there are {len(self.layouts)}, must be {len(SLOTS)}")
        if not 0 <= self.active < len(SLOTS):
            raise BlastEnvError(f"active is {self.active}, must be 0 to {len(SLOTS) - 1}")
        for layout in self.layouts:
            LayoutState.of(self.scenario.without_budget, layout)

    @property
    def layout(self) -> Layout:
        """The active layout."""
        return self.layouts[self.active]

    def with_layout(self, layout: Layout, slot: int | None = None) -> "Design":
        """Return the design with another layout in a slot, by default the active one."""
        number = self.active if slot is None else slot
        layouts = [*self.layouts]
        layouts[number] = LayoutState.of(self.scenario.without_budget, layout).layout
        return replace(self, layouts=tuple(layouts))

    def with_scenario(self, scenario: Scenario) -> tuple["Design", tuple[str, ...]]:
        """Return the design on a changed site, and notes on the elements removed from layouts."""
        layouts, notes = [], []
        for name, layout in zip(SLOTS, self.layouts, strict=True):
            kept, reasons = placing.legal_elements(scenario, layout)
            layouts.append(kept)
            if reasons:
                notes.append(f"layout {name}: {len(reasons)} removed: {reasons[0]}")
        return replace(self, scenario=scenario, layouts=tuple(layouts)), tuple(notes)

    def record(self) -> dict[str, Any]:
        """Return the design as plain data."""
        return {
            "scenario": self.scenario.model_dump(mode="json", exclude_none=True),
            "layouts": [[list(element) for element in layout] for layout in self.layouts],
            "active": self.active,
        }

    @classmethod
    def from_record(cls, record: Mapping[str, Any], source: str) -> "Design":
        """Return the design of a record.

        Args:
            record: Plain data, as `record` gives it.
            source: Source of the record, for the error.
        """
        try:
            scenario = Scenario.from_document(record["scenario"], source)
            layouts = tuple(placing.layout_from(scenario, layout) for layout in record["layouts"])
            return cls(scenario, layouts, int(record["active"]))
        except BlastEnvError:
            raise
        except (KeyError, TypeError, ValueError) as error:
            raise BlastEnvError(f"{source}: is not a design: {error!r}") from error


@dataclass(frozen=True)
class DesignStep:
    """A design and the label of the step that made it."""

    label: str
    design: Design


@dataclass(frozen=True)
class History:
    """A design with its earlier and its undone steps; immutable.

    Attributes:
        past: Earlier steps, the oldest first.
        present: The current step.
        future: Undone steps, the next first.
    """

    present: DesignStep
    past: tuple[DesignStep, ...] = ()
    future: tuple[DesignStep, ...] = ()

    @property
    def design(self) -> Design:
        """The current design."""
        return self.present.design

    def then(self, label: str, design: Design) -> "History":
        """Return the history with one more step; the same history if nothing changes."""
        if design == self.design:
            return self
        past = (*self.past, self.present)[-MOST_STEPS:]
        return History(DesignStep(label, design), past)

    def showing(self, active: int) -> "History":
        """Return the history with another active layout: no step, nothing to undo."""
        shown = replace(self.present, design=replace(self.design, active=active))
        return replace(self, present=shown)

    def undone(self) -> "History":
        """Return the history one step back; unchanged at its beginning."""
        if not self.past:
            return self
        return History(self.past[-1], self.past[:-1], (self.present, *self.future))

    def redone(self) -> "History":
        """Return the history with the last undone step; unchanged if there is none."""
        if not self.future:
            return self
        return History(self.future[0], (*self.past, self.present), self.future[1:])

    def record(self) -> dict[str, Any]:
        """Return the history as plain data, each site in it once."""
        sites: list[dict[str, Any]] = []

        def of_step(step: DesignStep) -> dict[str, Any]:
            record = step.design.record()
            site = record["scenario"]
            if site not in sites:
                sites.append(site)
            return {**record, "label": step.label, "scenario": sites.index(site)}

        return {
            "present": of_step(self.present),
            "past": [of_step(step) for step in self.past],
            "future": [of_step(step) for step in self.future],
            "sites": sites,
        }

    @classmethod
    def from_record(cls, record: Mapping[str, Any], source: str) -> "History":
        """Return the history of a record."""

        def step_of(part: Mapping[str, Any]) -> DesignStep:
            whole = {**part, "scenario": record["sites"][part["scenario"]]}
            return DesignStep(str(part["label"]), Design.from_record(whole, source))

        try:
            return cls(
                step_of(record["present"]),
                tuple(step_of(step) for step in record["past"]),
                tuple(step_of(step) for step in record["future"]),
            )
        except (KeyError, TypeError, IndexError) as error:
            raise BlastEnvError(f"{source}: is not a design: {error!r}") from error
