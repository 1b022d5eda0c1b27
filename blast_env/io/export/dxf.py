"""DXF drawings of a layout on its site: outlines, labels, clearances, and notes."""

import textwrap
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, inf, sqrt
from pathlib import Path
from typing import Final, NamedTuple

import shapely

from blast_env.errors import import_extra
from blast_env.files import write_atomically
from blast_env.geometry import Piece, Rectangle
from blast_env.io.export.bill import MODULE, LayoutPlan, stock_of
from blast_env.io.importing.options import APPLICATION, CHARGE_KEYS, STRUCTURE_KEYS, VEHICLE_KEY
from blast_env.layout import LayoutState
from blast_env.plots.labels import Label, settled_labels
from blast_env.plots.plan import SITE_KINDS, Feature, FeatureKind, Kinds, on_levels
from blast_env.sections import PointM
from blast_env.site import BuildZone
from blast_env.units import MODULE_SIDE_M
from blast_env.values import letters

with import_extra("export", "DXF files"):
    from ezdxf import units
    from ezdxf.document import Drawing
    from ezdxf.entities.dxfgfx import DXFGraphic
    from ezdxf.enums import MTextEntityAlignment, TextEntityAlignment
    from ezdxf.filemanagement import new
    from ezdxf.layouts.layout import Modelspace

VERSION: Final = "R2010"

CLEARANCE_LAYER: Final = "CLEARANCE"
NOTES_LAYER: Final = "NOTES"

ITEMS_LAYER: Final = "ITEMS"
"""Layer of the texts in the pieces of a catalogue; it can be hidden."""

_STRUCTURES: Final = (Kinds.TERRACE, Kinds.STRUCTURE, Kinds.PROTECTED_STRUCTURE)
_STRING: Final = 1000  # group code of a text in extended data
_TEXT_HEIGHT_M: Final = 0.4
_ROUNDING: Final = 1e-6  # of a count of signs
_LINE_SPACING: Final = 5.0 / 3.0  # of lines of text, in heights of the text
_POINT_SIZE_M: Final = 1.0
_CROSS_IN_CIRCLE: Final = 35  # style of points ($PDMODE)
_SIGN_WIDTH: Final = 0.75  # width over height of a letter, in most typefaces for drawings
_DIGITS: Final = 9  # decimals of a metre: the rest is rounding error


def note_lines(plan: LayoutPlan) -> tuple[str, ...]:
    """Return the notes of a drawing, one line per subject, without the key to the letters."""
    lines = [
        f"Scenario: {plan.scenario.name}",
        "Units: metres, from the lower left corner of the site",
        f"Charge: {_charge(plan)}",
    ]
    zone = plan.scenario.build_zone
    if zone is None:
        return tuple(lines)
    counts = Counter(
        element.item if isinstance(element, Piece) else MODULE for element in plan.layout
    )
    measures = {measure.name for measure in zone.measures}
    for stock_line in stock_of(plan.scenario):
        if stock_line.item not in measures:
            high = "" if stock_line.height_m is None else f", {_number(stock_line.height_m)} m high"
            size = f"{_number(stock_line.length_m)} m x {_number(stock_line.thickness_m)} m{high}"
            count = f"{counts[stock_line.item]} of a stock of {stock_line.in_stock}"
            lines.append(f"{stock_line.item}: {count}, {size}")
        elif counts[stock_line.item]:
            lines.append(f"{stock_line.item}: taken")
    lines += _conditions(zone)
    if zone.budget is not None:
        cost = LayoutState.of(plan.scenario, plan.layout).cost
        lines.append(f"Budget: {_number(zone.budget)}, of which the layout takes {_number(cost)}")
    return tuple(lines)


def _conditions(zone: BuildZone) -> tuple[str, str]:
    """Return the clearance between modules and structures, and the access way, in words."""
    clearance, way = "none required", "none required"
    if zone.clearance_m > 0.0:
        clearance = f"{_number(zone.clearance_m)} m at least between modules and structures"
    if zone.access_way is not None:
        sides = zone.access_way.between.replace("_", " to ")
        width = _number(zone.access_way.width_m)
        way = f"{width} m wide, from {sides} of the build zone, to be kept open"
    return f"Clearance: {clearance}", f"Access way: {way}"


def _charge(plan: LayoutPlan) -> str:
    if plan.charge is not None:
        (x_m, y_m), tnt_kg = plan.charge.position_m, plan.charge.tnt_kg
        return f"{_number(tnt_kg)} kg TNT at ({x_m:.2f}, {y_m:.2f})"
    masses_kg = sorted({source.tnt_kg for source in plan.scenario.charge})
    return f"{' or '.join(map(_number, masses_kg))} kg TNT, anywhere on the layer CHARGE_PLACE"


def _number(value: float) -> str:
    return f"{value:.10g}"


def clearance_outlines(plan: LayoutPlan) -> tuple[tuple[PointM, ...], ...]:
    """Return the outlines of the clearance around structures; none if modules may touch them.

    The clearance is the least distance of any two points of module and structure. So the corners of
    the outlines are rounded by it, in short straight lines.
    """
    zone = plan.scenario.build_zone
    if zone is None or zone.clearance_m == 0.0:
        return ()
    plans = [
        shapely.union_all([shapely.box(*box) for box in structure.boxes_m])
        for structure in plan.scenario.structures
    ]
    return tuple(
        tuple((round(x, _DIGITS), round(y, _DIGITS)) for x, y in ring.coords[:-1])
        for ring in shapely.get_rings(shapely.buffer(plans, zone.clearance_m, quad_segs=16))
    )


@dataclass(frozen=True)
class Text:
    """A text on the drawing: a name inside a structure or piece, a letter beside the others.

    Attributes:
        centre_m: Its middle.
        upright: Whether it is turned by 90 degrees.
    """

    text: str
    feature: Feature
    centre_m: PointM
    height_m: float
    upright: bool = False

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height of the text, m."""
        long, short = _SIGN_WIDTH * len(self.text) * self.height_m, self.height_m
        return (short, long) if self.upright else (long, short)

    @property
    def box_m(self) -> Rectangle:
        """The rectangle around the text."""
        (width, height), (x, y) = self.size_m, self.centre_m
        return Rectangle(x - width / 2.0, y - height / 2.0, x + width / 2.0, y + height / 2.0)


def key_of(plan: LayoutPlan) -> dict[str, str]:
    """Return the letter of each name that the notes explain; the same name has the same letter."""
    names = dict.fromkeys(_name(feature) for feature in plan.features if _has_letter(feature))
    return {name: letters(number) for number, name in enumerate(names)}


def texts_of(plan: LayoutPlan, height_m: float) -> tuple[Text, ...]:
    """Return all texts on the site.

    Args:
        height_m: Height of the letters; names inside things are smaller if they must fit.
    """
    inside = [
        _text_inside(feature, height_m) for feature in plan.features if _words_inside(feature)
    ]
    key = key_of(plan)
    labels = [
        Label(key[_name(feature)], feature) for feature in plan.features if _has_letter(feature)
    ]
    settled = settled_labels(
        plan.features,
        labels,
        [Text(label.text, label.feature, (0.0, 0.0), height_m).size_m for label in labels],
        lambda label: label.bounds_m.grown(MODULE_SIDE_M if len(label.places_m) == 1 else 0.0),
        lambda label: label.bounds_m if len(label.places_m) > 2 else None,
        plan.scenario.site.rectangle_m.grown(4.0 * height_m),
        gap=0.4 * height_m,
        far=inf,
        others=[text.box_m for text in inside],
    )
    letters = [
        Text(thing.label.text, thing.label.feature, thing.place.centre, height_m)
        for thing in settled
    ]
    return (*inside, *letters)


def _name(feature: Feature) -> str:
    return " ".join(feature.name.split())  # a line break would end a text


def _has_letter(feature: Feature) -> bool:
    return feature.kind.named == "letter"


def _words_inside(feature: Feature) -> str:
    """Return the text inside a structure or a piece; empty for the others."""
    if feature.kind.named == "inside":
        return _name(feature)
    if "item" in feature.properties:
        return f"{feature.properties['item']} {feature.properties['height_m']:g} m"
    return ""


def _text_inside(feature: Feature, height_m: float) -> Text:
    """Return a text along the middle of a feature, as high as fits."""
    text, outline = _words_inside(feature), _room_m(feature)
    width_m, depth_m = outline.right - outline.left, outline.top - outline.bottom
    signs = _SIGN_WIDTH * len(text)
    upright = depth_m > width_m and signs * height_m > width_m
    long_m, short_m = (depth_m, width_m) if upright else (width_m, depth_m)
    piece_m = MODULE_SIDE_M / 2.0 if feature.kind is Kinds.BARRIER else height_m
    fitting_m = min(height_m, piece_m, 0.6 * short_m, 0.95 * long_m / signs)
    return Text(text, feature, outline.centre, fitting_m, upright)


def _room_m(feature: Feature) -> Rectangle:
    """Return the rectangle around a feature; a square within it if its middle is not in it.

    A name in a courtyard or a notch would be that of another building.
    """
    outline = feature.bounds_m
    area = shapely.Polygon(feature.places_m, feature.holes_m)
    if shapely.contains_xy(area, *outline.centre):
        return outline
    radius = shapely.maximum_inscribed_circle(area)  # a line from its middle
    x, y = radius.coords[0]
    return Rectangle(x, y, x, y).grown(radius.length / sqrt(2.0))


def wrapped(lines: Sequence[str], characters: int) -> list[str]:
    """Return the lines broken between words to at most `characters`."""
    return [part for line in lines for part in textwrap.wrap(line, characters)]


class _Style(NamedTuple):
    """The style of a layer: a colour of AutoCAD's index, and a line type."""

    colour: int
    line_type: str = "CONTINUOUS"


_OTHER_STYLES: Final = {
    CLEARANCE_LAYER: _Style(52, "DASHED"),
    NOTES_LAYER: _Style(7),
    ITEMS_LAYER: _Style(140),
}


def _style_of(kind: FeatureKind) -> _Style:
    return _Style(kind.look.cad_colour, "DASHED" if kind.look.drawn_dashed else "CONTINUOUS")


def layer_name(kind: FeatureKind) -> str:
    """Return the layer of a kind of feature: `KEEP_OUT`."""
    return kind.name.upper()


def drawing(plan: LayoutPlan) -> Drawing:
    """Return a drawing of everything on the site, with notes; the layers are always the same."""
    document = new(VERSION, setup=["linetypes"], units=units.M)
    document.header["$PDMODE"] = _CROSS_IN_CIRCLE
    document.header["$PDSIZE"] = _POINT_SIZE_M
    document.header["$LTSCALE"] = 0.5
    document.appids.add(APPLICATION)
    for name, value in (
        ("scenario", plan.scenario.name),
        ("scenario_hash", plan.scenario.content_hash),
        ("coordinates", "local site metres, x to the right, y upwards from the lower left corner"),
    ):
        document.header.custom_vars.append(name, value)
    kinds = dict.fromkeys((*SITE_KINDS, *(feature.kind for feature in plan.features)))
    styles = {layer_name(kind): _style_of(kind) for kind in kinds} | _OTHER_STYLES
    for layer, style in styles.items():
        document.layers.add(layer, color=style.colour, linetype=style.line_type)
    space = document.modelspace()
    for feature in plan.features:
        parts = tuple(on_levels((feature,), plan.scenario.structures))
        _draw(space, parts[0] if len(parts) == 1 else feature)  # across an edge, on the ground
    _draw_clearance(space, plan)
    height_m = text_height_m(plan)
    for text in texts_of(plan, height_m):
        _write(space, text)
    shown = _write_notes(space, plan, height_m)
    document.set_modelspace_vport(height=1.1 * max(shown.right, shown.top), center=shown.centre)
    return document


def write_dxf(plan: LayoutPlan, path: Path) -> None:
    """Write the drawing."""
    with write_atomically(path) as temporary:
        drawing(plan).saveas(temporary)


def _draw(space: Modelspace, feature: Feature) -> None:
    """Draw a point, a line or a closed outline."""
    attributes = {"layer": layer_name(feature.kind)}
    places = feature.places_m
    if len(places) == 1:
        _describe(space.add_point(places[0], attributes), feature)
    elif len(places) == 2:
        _describe(space.add_line(*places, attributes), feature)
    else:
        for ring in feature.rings_m:
            outline = space.add_lwpolyline(ring, close=True, dxfattribs=attributes)
            _describe(outline, feature)
            outline.dxf.elevation = feature.base_m
            height_m = feature.properties.get("height_m")
            if isinstance(height_m, float):
                outline.dxf.thickness = height_m - feature.base_m  # extruded to its top
            if feature.kind is Kinds.BARRIER:
                texts = [(_STRING, text) for text in _barrier_texts(feature)]
                outline.set_xdata(APPLICATION, texts)


def _describe(entity: DXFGraphic, feature: Feature) -> None:
    """Give an entity what no layer says: of charges, and of structures and the ground below."""
    if feature.kind is Kinds.CHARGE_PLACE:
        keys = (key for key in (*CHARGE_KEYS, VEHICLE_KEY) if key in feature.properties)
        said = [f"{key}={feature.properties[key]}" for key in keys]
    elif feature.kind in _STRUCTURES:
        own = {"ground_m": 0, **feature.properties}
        said = [f"{key}={own[key]}" for key in STRUCTURE_KEYS if key in own]
    else:
        return
    entity.set_xdata(APPLICATION, [(_STRING, text) for text in said])


def _barrier_texts(feature: Feature) -> list[str]:
    """Return the data of a module or piece: its name, and for a piece its item and height, m."""
    if "item" not in feature.properties:
        return [feature.name]
    top_m = feature.properties["height_m"]
    assert isinstance(top_m, float)
    height = f"height_m={top_m - feature.base_m:g}"
    return [feature.name, f"item={feature.properties['item']}", height]


def _write(space: Modelspace, text: Text) -> None:
    """Write a text; those of pieces are on the layer `ITEMS_LAYER`."""
    kind = text.feature.kind
    entity = space.add_text(
        text.text,
        height=text.height_m,
        rotation=90.0 if text.upright else 0.0,
        dxfattribs={"layer": ITEMS_LAYER if kind is Kinds.BARRIER else layer_name(kind)},
    )
    entity.set_placement(text.centre_m, align=TextEntityAlignment.MIDDLE_CENTER)


def _draw_clearance(space: Modelspace, plan: LayoutPlan) -> None:
    for outline in clearance_outlines(plan):
        attributes = {"layer": CLEARANCE_LAYER}
        space.add_lwpolyline(outline, close=True, dxfattribs=attributes)


def text_height_m(plan: LayoutPlan) -> float:
    """Return the height of the notes, m: as fits the width of the site, but readable."""
    # Characters are at most as wide as high in any typeface.
    return max(plan.scenario.site.width_m / max(map(len, note_lines(plan))), _TEXT_HEIGHT_M)


def _write_notes(space: Modelspace, plan: LayoutPlan, height_m: float) -> Rectangle:
    """Write the notes above everything; return the site with them.

    Lines longer than the width of the site are broken here, not by the viewing program. The text
    grows upwards, so it never covers the site.
    """
    site, width_m = plan.scenario.site.rectangle_m, plan.scenario.site.width_m
    key = [f"{letter}: {name}" for name, letter in key_of(plan).items()]
    lines = wrapped([*note_lines(plan), *key], floor(width_m / height_m + _ROUNDING))
    ends_m = [y for outline in clearance_outlines(plan) for _, y in outline]
    bottom_m = max([site.top, *ends_m]) + 2.0 * height_m
    notes = space.add_mtext(
        "\\P".join(map(_escaped, lines)),
        {"layer": NOTES_LAYER, "char_height": height_m, "width": width_m},
    )
    notes.set_location((site.left, bottom_m), attachment_point=MTextEntityAlignment.BOTTOM_LEFT)
    return site._replace(top=bottom_m + len(lines) * _LINE_SPACING * height_m)


def _escaped(line: str) -> str:
    """Return a line with the control characters of DXF texts escaped."""
    return line.replace("\\", "\\\\").replace("{", "\\{").replace("}", "\\}")
