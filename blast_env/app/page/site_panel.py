"""The panel on the left: the things on the site, and their values."""

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from nicegui import ui

from blast_env.app import edits
from blast_env.app.editor import Editor
from blast_env.app.edits import SiteThing, ThingKind
from blast_env.app.page.fields import FormField, change_of, fields_of, value_of
from blast_env.app.page.numbers import NumberField
from blast_env.geometry import WALLS, WallName
from blast_env.response.components import catalogue
from blast_env.site import Scenario

_SIDES: Final = {"left_right": "left and right", "bottom_top": "bottom and top"}
_PARTS: Final = {"": "the whole building"} | {wall: f"its {wall} side" for wall in WALLS}
_SITE: Final = SiteThing(ThingKind.SITE)
_ADDED: Final = {
    ThingKind.ITEM: "add an item to the catalogue of barriers",
    ThingKind.MEASURE: "add better glazing or walls that a layout can include at a cost",
}


class SitePanel:
    """Shows and changes the selected thing.

    Args:
        editor: The editor of the design.
        after: Called after the panel has changed something.
    """

    def __init__(self, editor: Editor, after: Callable[[], None]) -> None:
        self._editor = editor
        self._after = after
        self._fields: tuple[FormField, ...] = ()
        self._inputs: list[Any] = []
        self._side: WallName | None = None
        self._filling = False
        self._build()

    def _build(self) -> None:
        with ui.column().classes("be-side be-left").props('role="region" aria-label="site"'):
            with ui.row().classes("w-full items-center no-wrap"):
                self._name = ui.input("site").props("dense outlined").classes("grow")
                self._name.on("blur", self._rename).on("keydown.enter", self._rename)
            self._chooser = ui.select({}, label="selected", on_change=self._choose)
            self._chooser.props("dense outlined options-dense").classes("w-full")
            self._form = ui.column().classes("w-full gap-1")
            with ui.row().classes("gap-1"):
                self._delete = ui.button("delete", icon="delete", on_click=self._remove)
                self._delete.props("dense outline no-caps size=sm")
                for kind, words in _ADDED.items():
                    add = ui.button(kind.value, icon="add", on_click=partial(self._add, kind))
                    add.props("dense outline no-caps size=sm").tooltip(words)
            ui.label("arrow keys move the selection by 0.5 m").classes("be-quiet")
            self._facts = ui.label().classes("be-quiet")

    def refresh(self) -> None:
        """Show the current design."""
        scenario, editor = self._editor.session.scenario, self._editor
        if editor.selected is not None and not edits.has(scenario, editor.selected):
            editor.selected = None
        thing = editor.selected or _SITE
        self._filling = True
        self._name.value = scenario.name
        options = {_id(own): words for own, words in edits.things(scenario)}
        self._chooser.set_options(options, value=_id(thing))
        fields = fields_of(scenario, thing, self._side)
        if fields != self._fields:
            self._fields = fields
            self._form.clear()
            with self._form:
                self._inputs = [self._input(part) for part in fields]
        section = edits.section_of(scenario, thing)
        for field, element in zip(self._fields, self._inputs, strict=True):
            value: Any = value_of(section, field) if field.form != "of" else self._side or ""
            if isinstance(element, NumberField):
                element.show(value)
            else:
                element.value = value
        self._delete.set_enabled(thing != _SITE)
        self._facts.text = " ".join(
            (
                f"Air {scenario.air_height_m:g} m high.",
                "Walls without a height reach up to it."
                if any(structure.height_m is None for structure in scenario.structures)
                else "",
            )
        )
        self._filling = False

    def _input(self, field: FormField) -> Any:
        element: Any
        if field.form == "switch":
            element = ui.switch(field.label, on_change=lambda e: self._put(field, e.value))
            return element.tooltip(field.hint) if field.hint else element
        if field.form == "walls":
            element = ui.select([*WALLS], label=field.label, multiple=True)
        elif field.form == "side":
            element = ui.select(_SIDES, label=field.label, clearable=True)
        elif field.form == "of":
            element = ui.select(_PARTS, label=field.label)
        elif field.form in ("glazing", "wall"):
            element = ui.select(self._components(field.form), label=field.label, clearable=True)
        elif field.form == "text":
            element = ui.input(field.label)
        else:
            element = NumberField(
                field.label,
                taken=lambda number: self._put(field, number),
                optional=field.optional,
                whole=field.form == "integer",
            )
        if field.form == "text":
            element.on("blur", lambda: self._put(field, element.value))
            element.on("keydown.enter", lambda: self._put(field, element.value))
        elif not isinstance(element, NumberField):
            element.on_value_change(lambda e: self._put(field, e.value))
        if field.optional:
            empty = "none" if field.form in ("glazing", "wall") else "by rule"
            element.props(f'placeholder="{empty}" clearable stack-label')
        element.props("dense outlined").classes("w-full")
        return element.tooltip(field.hint) if field.hint else element

    def _components(self, kind: str) -> dict[str, str]:
        known = {**catalogue(), **self._editor.session.scenario.components}
        return {name: own.title or name for name, own in known.items() if own.kind == kind}

    def _put(self, field: FormField, typed: Any) -> None:
        if self._filling:
            return
        if field.form == "of":
            self._side = typed or None
            self.refresh()
            return
        scenario = self._editor.session.scenario
        thing = self._editor.selected or _SITE
        section = edits.section_of(scenario, thing)
        if value_of(section, field) == typed:
            return
        values = change_of(section, field, typed)
        label = f"{thing.kind}: {field.label}"
        self._editor.attempt(label, lambda site: edits.with_values(site, thing, values))
        self._after()

    def _rename(self) -> None:
        typed = self._name.value
        if self._filling or typed == self._editor.session.scenario.name:
            return
        self._editor.attempt("rename", lambda site: edits.with_values(site, None, {"name": typed}))
        self._after()

    def _choose(self, event: Any) -> None:
        if self._filling or not event.value:
            return
        kind, _, number = str(event.value).rpartition(" ")
        self._editor.selected, self._side = SiteThing(ThingKind(kind), int(number)), None
        self._after()

    def _add(self, kind: ThingKind) -> None:
        editor = self._editor

        def add(site: Scenario) -> Scenario:
            after, editor.selected = edits.added(site, kind, (0.0, 0.0), (0.0, 0.0))
            return after

        editor.attempt(f"add {kind}", add)
        self._after()

    def _remove(self) -> None:
        self._editor.delete()
        self._after()


def _id(thing: SiteThing) -> str:
    return f"{thing.kind} {thing.number}"
