"""The editable values of a thing on a site, as fields of a form."""

from collections.abc import Mapping
from typing import Any, Final, Literal, NamedTuple

from blast_env.app.edits import Document, SiteThing, ThingKind, section_of
from blast_env.geometry import WALLS, WallName
from blast_env.site import Scenario
from blast_env.site.structures import FacadeSection

Form = Literal["number", "integer", "text", "switch", "walls", "side", "of", "glazing", "wall"]


class FormField(NamedTuple):
    """A field.

    Attributes:
        label: Its label, with its unit.
        key: Its key in the scenario file.
        form: Kind of its value.
        part: Number of the coordinate, if the key holds several.
        optional: Whether it may be empty: then the default of the file format holds.
        inside: Key of the subtable that holds the key, if there is one.
        hint: Its effect, if the label does not explain it.
        side: Side of the building to which a component belongs; `None` for the whole building.
    """

    label: str
    key: str
    form: Form = "number"
    part: int | None = None
    optional: bool = False
    inside: str = ""
    hint: str = ""
    side: WallName | None = None


_CORNER: Final = (
    FormField("left (m)", "corner_m", part=0),
    FormField("bottom (m)", "corner_m", part=1),
)
_SIZE: Final = (FormField("width (m)", "size_m", part=0), FormField("depth (m)", "size_m", part=1))

_FIELDS: Final[Mapping[ThingKind, tuple[FormField, ...]]] = {
    ThingKind.SITE: (
        FormField("width (m)", "width_m"),
        FormField("depth (m)", "height_m"),
        FormField("height of the air (m)", "air_height_m", optional=True),
    ),
    ThingKind.ZONE: (
        *_CORNER,
        FormField("rows", "rows", "integer"),
        FormField("columns", "columns", "integer"),
        FormField("stock", "stock", "integer"),
        FormField("height of modules (m)", "height_m", optional=True),
        FormField("cost of a module", "module_cost"),
        FormField("budget", "budget", optional=True),
        FormField("clearance (m)", "clearance_m"),
        FormField("access way (m)", "width_m", optional=True, inside="access_way"),
        FormField("access way between", "between", "side", optional=True, inside="access_way"),
    ),
    ThingKind.KEEP_OUT: (FormField("reason", "reason", "text"), *_CORNER, *_SIZE),
    ThingKind.COST_AREA: (
        FormField("reason", "reason", "text"),
        FormField("cost of a module", "module_cost", optional=True),
        FormField("cost factor of items", "cost_factor", optional=True),
        *_CORNER,
        *_SIZE,
    ),
    ThingKind.MEASURE: (
        FormField("name", "name", "text"),
        FormField("glass", "glazing", "glazing", optional=True),
        FormField("wall panels", "wall", "wall", optional=True),
        FormField("on the walls", "walls", "walls"),
        FormField("cost", "cost"),
    ),
    ThingKind.ITEM: (
        FormField("name", "name", "text"),
        FormField("length (modules)", "length_modules", "integer"),
        FormField("thickness (modules)", "thickness_modules", "integer"),
        FormField("height (m)", "height_m"),
        FormField("cost", "cost"),
        FormField("stock", "stock", "integer"),
        FormField("may be rotated", "rotatable", "switch"),
        FormField("stops vehicles", "stops_vehicles", "switch"),
    ),
    ThingKind.GAUGE: (
        FormField("name", "name", "text"),
        FormField("x (m)", "position_m", part=0),
        FormField("y (m)", "position_m", part=1),
        FormField("height (m)", "position_m", part=2),
    ),
}

_OF_CHARGES: Final = (
    FormField(
        "name", "threat", "text", optional=True, hint="backpack, car, van and lorry set the mass"
    ),
    FormField("mass (kg TNT)", "tnt_kg"),
    FormField("height (m)", "height_m"),
    FormField("weight", "weight"),
)
_OF_CHARGE: Final[Mapping[str, tuple[FormField, ...]]] = {
    "point": (FormField("x (m)", "position_m", part=0), FormField("y (m)", "position_m", part=1)),
    "segment": (
        FormField("from x (m)", "start_m", part=0),
        FormField("from y (m)", "start_m", part=1),
        FormField("to x (m)", "end_m", part=0),
        FormField("to y (m)", "end_m", part=1),
    ),
    "rectangle": (*_CORNER, *_SIZE),
    "vehicle": (
        FormField("width of the vehicle (m)", "width_m"),
        FormField("places", "places", "integer", hint="the nearest places that count"),
        FormField(
            "places apart (m)", "apart_m", optional=True, hint="at least; else the vehicle's width"
        ),
    ),
}

_OF_STRUCTURE: Final = (
    FormField("protected", "protected", "switch"),
    FormField("height (m)", "height_m", optional=True, hint="of its top above the ground"),
    FormField(
        "base height (m)",
        "base_m",
        optional=True,
        hint="height of its underside: 0 on the ground; on a terrace, the terrace's height;"
        " else there is air below it, as below a canopy",
    ),
    FormField(
        "terrace",
        "carries",
        "switch",
        hint="barriers and buildings may stand on its top; it needs a height, and begins at 0",
    ),
)
_PANES: Final = "of all windows of the building; else the size of the component"
_FILLINGS: Final = frozenset({"glazing", "wall"})
_OF_STRUCTURES: Final[Mapping[str, tuple[FormField, ...]]] = {
    "ModularObstacle": (
        *_CORNER,
        FormField("columns", "columns", "integer"),
        FormField("rows", "rows", "integer"),
    ),
    "ConcreteSquare": (*_CORNER, FormField("modules a side", "side_modules", "integer")),
    "polygon": (),
}
_LAST_OF_STRUCTURE: Final = (
    FormField("weight", "weight"),
    FormField("assessed walls", "faces", "walls"),
    FormField("windows and walls of", "side", "of"),
    FormField("windows", "glazing", "glazing", optional=True, inside="facade"),
    FormField("wall panels", "wall", "wall", optional=True, inside="facade"),
    FormField("width of a pane (m)", "pane_width_m", optional=True, inside="facade", hint=_PANES),
    FormField("height of a pane (m)", "pane_height_m", optional=True, inside="facade", hint=_PANES),
    FormField(
        "storeys",
        "storeys",
        "integer",
        optional=True,
        inside="facade",
        hint="of equal height; else as many of the height below as there is room for",
    ),
    FormField(
        "height of a storey (m)",
        "storey_m",
        optional=True,
        inside="facade",
        hint="the ground floor has the remaining height of the building",
    ),
    FormField("width of a bay (m)", "bay_m", optional=True, inside="facade"),
)


def fields_of(
    scenario: Scenario, thing: SiteThing, side: WallName | None = None
) -> tuple[FormField, ...]:
    """Return the fields of a thing; its components are those of a side, if one is given."""
    kind = section_of(scenario, thing).get("kind", "")
    if thing.kind is ThingKind.CHARGE:
        return (*_OF_CHARGES, *_OF_CHARGE[kind])
    if thing.kind is ThingKind.STRUCTURE:
        name = FormField("name", "name", "text")
        last = [
            own
            if side is None or own.form not in _FILLINGS
            else own._replace(side=side, label=f"{own.label}, {side} side")
            for own in _LAST_OF_STRUCTURE
        ]
        return (name, *_OF_STRUCTURE, *_OF_STRUCTURES[kind], *last)
    return _FIELDS[thing.kind]


def value_of(section: Document, field: FormField) -> Any:
    """Return the value of a field, `None` if the file has none."""
    if field.inside:
        section = section.get(field.inside) or {}
    if field.side is not None:
        return getattr(FacadeSection.model_validate(section).of_side(field.side), field.key)
    value = section.get(field.key)
    if field.form == "walls":
        return list(value or WALLS)
    if field.form == "switch":
        return bool(value)
    return value if field.part is None or value is None else value[field.part]


def change_of(section: Document, field: FormField, typed: Any) -> dict[str, Any]:
    """Return the values for `edits.with_values` from the input in a field."""
    value = _of_form(field, typed)
    if field.part is not None:
        coordinates = [*section[field.key]]
        coordinates[field.part] = value
        value = coordinates
    if not field.inside:
        return {field.key: value}
    table = {**(section.get(field.inside) or {}), field.key: value}
    if field.inside == "facade":
        if field.side is not None:
            before = FacadeSection.model_validate(section.get(field.inside) or {})
            after = before.with_side(field.side, **{field.key: value})
            table = after.model_dump(mode="json", exclude_none=True)
        table = {key: own for key, own in table.items() if own is not None}
        is_empty = not (table.keys() & _FILLINGS or table.get("parts"))
        return {field.inside: None if field.key in _FILLINGS and is_empty else table}
    if value is None:
        return {field.inside: None}
    return {field.inside: {"width_m": 3.0, "between": "left_right"} | table}


def _of_form(field: FormField, typed: Any) -> Any:
    if typed is None or typed == "":
        return None
    return int(typed) if field.form == "integer" else typed
