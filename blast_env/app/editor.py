"""The editor of the plan: tools, selection, dragging, and the reasons against a place.

Works in metres, independently of the page. Each stroke is one step of the design.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from blast_env.app import edits, placing
from blast_env.app.edits import SiteThing, ThingKind
from blast_env.app.session import Session
from blast_env.bays import STOREY_M
from blast_env.errors import BlastEnvError
from blast_env.geometry import Cell, Element, Layout, Rectangle
from blast_env.sections import PointM
from blast_env.site import Scenario, ScenarioError
from blast_env.units import MODULE_SIDE_M


class Tool(StrEnum):
    """The tools of the mouse."""

    SELECT = "select and move"
    PLACE = "place"
    ERASE = "erase"
    STRUCTURE = "structure"
    ZONE = "build zone"
    KEEP_OUT = "no-build area"
    CHARGE = "charge"
    CHARGE_AREA = "charge area"
    GAUGE = "gauge"


_DRAWN: Final = {
    Tool.STRUCTURE: ThingKind.STRUCTURE,
    Tool.ZONE: ThingKind.ZONE,
    Tool.KEEP_OUT: ThingKind.KEEP_OUT,
    Tool.CHARGE: ThingKind.CHARGE,
    Tool.CHARGE_AREA: ThingKind.CHARGE,
    Tool.GAUGE: ThingKind.GAUGE,
}

_ON_ROAD: Final = "the zone lies over a road: draw a no-build area to keep it free"
_HANDLE_M: Final = 0.6  # reach of the handle for the size, at the upper right corner


@dataclass(frozen=True)
class Ghost:
    """The preview of an element or thing at the mouse.

    Attributes:
        reason: The reason why it cannot stand there; empty if it can.
        line_m: The ends of a line, a diagonal of the rectangle; `None` for an area.
    """

    rectangle_m: Rectangle
    reason: str = ""
    line_m: tuple[PointM, PointM] | None = None


@dataclass
class _Stroke:
    """The state of a stroke while the button is down."""

    start_m: PointM
    layout: Layout
    moves: bool = False
    sizes: bool = False
    lifted: Element | None = None
    made: Scenario | None = None
    thing: SiteThing | None = None


@dataclass
class Editor:
    """The editor of one page for a design.

    Attributes:
        tool: The current tool.
        item: Name of the item to place.
        turned: Whether it is placed turned.
        new_height_m: Height of a structure to draw; `None` for the height of the air.
        cursor: The cell of the keyboard; `None` before its first use.
        ghost: The preview at the mouse.
        pending: The layout under an unfinished stroke; `None` without one.
        message: A message not yet shown.
    """

    session: Session
    tool: Tool = Tool.SELECT
    item: str = ""
    turned: bool = False
    new_height_m: float | None = STOREY_M
    selected: SiteThing | None = None
    cursor: Cell | None = None
    ghost: Ghost | None = None
    pending: Layout | None = None
    message: str = ""
    _stroke: _Stroke | None = field(default=None, init=False)
    _last: Cell | PointM | None = field(default=None, init=False)

    @property
    def scenario(self) -> Scenario:
        """The site, with a dragged thing at its new place if it can be there."""
        stroke = self._stroke
        return self.session.scenario if stroke is None or stroke.made is None else stroke.made

    @property
    def layout(self) -> Layout:
        """The layout, with the changes of the stroke so far."""
        return self.session.design.layout if self.pending is None else self.pending

    @property
    def holds_something(self) -> bool:
        """Whether the current stroke moves or draws anything."""
        stroke = self._stroke
        return stroke is not None and (stroke.thing is not None or stroke.lifted is not None)

    def choose(self, tool: Tool) -> None:
        """Take another tool."""
        self.message = ""
        self.tool, self.ghost, self._stroke, self.pending = tool, None, None, None

    def named_at(self, x_m: float, y_m: float) -> str:
        """Return the label of the thing at a place; empty without one."""
        thing = edits.thing_at(self.scenario, x_m, y_m, _HANDLE_M)
        return next((words for own, words in edits.things(self.scenario) if own == thing), "")

    # The mouse.

    def press(self, x_m: float, y_m: float, erase: bool = False) -> None:
        """Begin a stroke at a place."""
        self.message = ""
        self._stroke = stroke = _Stroke((x_m, y_m), self.session.design.layout)
        self._last = None
        if self.tool in (Tool.PLACE, Tool.ERASE) or erase:
            self._paint(x_m, y_m, erase or self.tool is Tool.ERASE)
        elif self.tool is Tool.SELECT:
            self._take_hold(x_m, y_m, stroke)
        else:
            self._draw(x_m, y_m)

    def move(self, x_m: float, y_m: float, erase: bool = False) -> bool:
        """Follow the mouse; return whether the plan must be drawn again."""
        if self.tool is Tool.SELECT or self.tool in _DRAWN:
            place: Cell | PointM | None = (edits.snapped(x_m), edits.snapped(y_m))
        else:
            place = placing.cell_at(self.session.scenario, x_m, y_m)
        if place == self._last:
            return False
        self._last = place
        if self._stroke is None:
            return self._hover(x_m, y_m)
        if self.tool in (Tool.PLACE, Tool.ERASE) or erase:
            self._paint(x_m, y_m, erase or self.tool is Tool.ERASE)
        elif self.tool is Tool.SELECT:
            self._drag(x_m, y_m)
        else:
            self._draw(x_m, y_m)
        return True

    def release(self) -> None:
        """End the stroke: make one step, or set the message to the reason against it."""
        stroke, self._stroke = self._stroke, None
        pending, self.pending = self.pending, None
        ghost, self.ghost, self._last = self.ghost, None, None
        if stroke is None:
            return
        if ghost is not None and ghost.reason:
            self.message = ghost.reason
        if stroke.made is not None:
            verb = "size" if stroke.sizes else "move" if stroke.moves else "draw"
            kind = stroke.thing.kind if stroke.thing is not None else "site"
            self._keep(f"{verb} {kind}", stroke.made)
            if kind is ThingKind.ZONE and edits.has_road_in_zone(stroke.made):
                self.message = self.message or _ON_ROAD
            self.selected = stroke.thing
        elif pending is not None and pending != self.session.design.layout:
            count = abs(len(pending) - len(self.session.design.layout))
            verb = (
                "move" if not count else "place" if len(pending) > len(stroke.layout) else "erase"
            )
            self._keep_layout(f"{verb} {max(count, 1)}", pending)

    def leave(self) -> None:
        """Abandon the stroke when the mouse leaves the plan."""
        self.ghost, self._stroke, self.pending, self._last = None, None, None, None

    # The keyboard.

    def step_cursor(self, rows: int, columns: int) -> None:
        """Move the cell of the keyboard within the zone."""
        zone = self.session.scenario.build_zone
        if zone is None:
            self.message = "there is no build zone: draw one first"
            return
        row, column = self.cursor or (zone.rows // 2, zone.columns // 2)
        if self.cursor is not None:
            row, column = row + rows, column + columns
        self.message = ""
        self.cursor = min(max(row, 0), zone.rows - 1), min(max(column, 0), zone.columns - 1)
        self._show_at(self.cursor)

    def toggle_at_cursor(self) -> None:
        """Place the item at the cell of the keyboard, or remove the element there."""
        if self.cursor is None:
            self.step_cursor(0, 0)
            return
        design = self.session.design
        there = placing.element_at(design.scenario, design.layout, self.cursor)
        if there is not None:
            self._keep_layout(
                "erase 1", tuple(element for element in design.layout if element != there)
            )
        else:
            self._show_at(self.cursor)
            if self.ghost is not None and self.ghost.reason:
                self.message = self.ghost.reason
                return
            new = placing.element(design.scenario, self.item, self.cursor, self.turned)
            self._keep_layout("place 1", (*design.layout, new))
        self.ghost = None

    def nudge(self, x_m: float, y_m: float) -> None:
        """Move the selected thing by a distance, if it can be there."""
        if self.selected is None:
            return
        selected = self.selected
        label = f"move {selected.kind}"
        self.attempt(label, lambda scenario: edits.moved(scenario, selected, (x_m, y_m)))

    def delete(self) -> None:
        """Remove the selected thing, if the site can do without it."""
        if self.selected is None:
            self.message = "nothing is selected"
            return
        selected = self.selected
        if self.attempt(f"delete {selected.kind}", lambda s: edits.removed(s, selected)):
            self.selected = None

    def attempt(self, label: str, edit: Callable[[Scenario], Scenario]) -> bool:
        """Make an edit of the site a step, or set the message; return whether it was made."""
        try:
            scenario = edit(self.session.scenario)
        except BlastEnvError as error:
            self.message = reason_of(error)
            return False
        self.message = ""
        self._keep(label, scenario)
        return True

    # The strokes.

    def _take_hold(self, x_m: float, y_m: float, stroke: _Stroke) -> None:
        scenario, layout = self.session.scenario, self.session.design.layout
        cell = placing.cell_at(scenario, x_m, y_m)
        there = None if cell is None else placing.element_at(scenario, layout, cell)
        if there is not None:
            stroke.lifted, stroke.moves = there, True
            self.selected = None
            return
        own = self.selected
        if own is not None and edits.has(scenario, own) and edits.has_size(scenario, own):
            box = edits.rectangle_of(scenario, own)
            if max(abs(x_m - box.right), abs(y_m - box.top)) <= _HANDLE_M:
                stroke.sizes, stroke.thing = True, own
                return
        self.selected = edits.thing_at(scenario, x_m, y_m, _HANDLE_M)
        stroke.thing, stroke.moves = self.selected, self.selected is not None

    def _drag(self, x_m: float, y_m: float) -> None:
        stroke = self._stroke
        if stroke is None:
            return
        if stroke.lifted is not None:
            self._drag_element(x_m, y_m, stroke, stroke.lifted)
            return
        if stroke.thing is None:
            return
        scenario, thing = self.session.scenario, stroke.thing
        by_m = (x_m - stroke.start_m[0], y_m - stroke.start_m[1])
        box = edits.held_m(scenario, thing, stroke.start_m)
        if stroke.sizes:
            end = edits.snapped(x_m), edits.snapped(y_m)
            right = max(end[0], box.left + MODULE_SIDE_M)
            target = Rectangle(box.left, box.bottom, right, max(end[1], box.bottom + MODULE_SIDE_M))
        else:
            shift = edits.snapped(by_m[0]), edits.snapped(by_m[1])
            target = Rectangle(
                box.left + shift[0], box.bottom + shift[1], box.right + shift[0], box.top + shift[1]
            )
        # It follows the mouse also where the site refuses it, and then says why.
        self.ghost = Ghost(target)
        try:
            if stroke.sizes:
                stroke.made = edits.resized(scenario, thing, (x_m, y_m))
            else:
                stroke.made = edits.moved(scenario, thing, by_m, stroke.start_m)
        except BlastEnvError as error:
            stroke.made = None
            self.ghost = Ghost(target, reason_of(error))

    def _drag_element(self, x_m: float, y_m: float, stroke: _Stroke, lifted: Element) -> None:
        scenario = self.session.scenario
        cell = placing.cell_at(scenario, x_m, y_m)
        if cell is None:
            return
        others = tuple(element for element in stroke.layout if element != lifted)
        moved = placing.moved_to(lifted, cell)
        reason = placing.reason_against(scenario, others, moved)
        self.ghost = Ghost(placing.rectangle_of(scenario, moved), reason or "")
        self.pending = stroke.layout if reason else (*others, moved)

    def _paint(self, x_m: float, y_m: float, erase: bool) -> None:
        scenario, layout = self.session.scenario, self.layout
        cell = placing.cell_at(scenario, x_m, y_m)
        if cell is None:
            self.message = "there is no build zone: draw one first"
            return
        there = placing.element_at(scenario, layout, cell)
        if erase:
            if there is not None:
                self.pending = tuple(element for element in layout if element != there)
            return
        self._show_at(cell)
        if self.ghost is None or not self.ghost.reason:
            new = placing.element(scenario, self.item, cell, self.turned)
            self.pending = (*layout, new)
        elif there is not None:
            self.ghost = None  # a stroke over an existing element is no mistake

    def _draw(self, x_m: float, y_m: float) -> None:
        stroke = self._stroke
        if stroke is None:
            return
        (x0, y0), (x1, y1) = stroke.start_m, (x_m, y_m)
        xs = sorted((edits.snapped(x0), edits.snapped(x1)))
        ys = sorted((edits.snapped(y0), edits.snapped(y1)))
        box = Rectangle(xs[0], ys[0], xs[1], ys[1])
        line = None
        if self.tool is Tool.CHARGE:
            line = (
                (edits.snapped(x0), edits.snapped(y0)),
                (edits.snapped(x1), edits.snapped(y1)),
            )
        self.ghost = Ghost(box, "", line)
        if line is None and self.tool is not Tool.GAUGE and 0.0 in (xs[1] - xs[0], ys[1] - ys[0]):
            stroke.made = None
            return  # no area yet
        scenario = self.session.scenario
        try:
            stroke.made, stroke.thing = edits.added(
                scenario,
                _DRAWN[self.tool],
                (x0, y0),
                (x1, y1),
                self.new_height_m,
                self.tool is Tool.CHARGE_AREA,
            )
        except BlastEnvError as error:
            stroke.made = None
            self.ghost = Ghost(box, reason_of(error), line)

    def _hover(self, x_m: float, y_m: float) -> bool:
        before = self.ghost
        self.ghost = None
        if self.tool is Tool.PLACE:
            cell = placing.cell_at(self.session.scenario, x_m, y_m)
            if cell is not None:
                self._show_at(cell)
        return self.ghost != before

    def _show_at(self, cell: Cell) -> None:
        """Preview the item on a cell."""
        scenario = self.session.scenario
        new = placing.element(scenario, self.item, cell, self.turned)
        reason = placing.reason_against(scenario, self.layout, new)
        self.ghost = Ghost(placing.rectangle_of(scenario, new), reason or "")

    def _keep(self, label: str, scenario: Scenario) -> None:
        settled = edits.settled_names(self.session.scenario, scenario)
        try:
            notes = (*settled, *self.session.put_site(label, scenario))
        except BlastEnvError as error:
            notes = (str(error),)
        if notes:
            self.message = "; ".join(notes)

    def _keep_layout(self, label: str, layout: Layout) -> None:
        try:
            self.session.put(label, self.session.design.with_layout(layout))
        except BlastEnvError as error:
            self.message = str(error)


def reason_of(error: BlastEnvError) -> str:
    """Return an error in one sentence: the first problem, and the number of others."""
    if not isinstance(error, ScenarioError):
        return str(error)
    first, more = error.problems[0], len(error.problems) - 1
    text = str(first).replace("\n", " ")
    return text if not more else f"{text} (and {more} more)"
