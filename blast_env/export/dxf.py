"""A layout on its site as DXF, for CAD: units are metres, a layer a kind of feature.

What has no place of its own is in notes above the site; how near modules may come to structures is
a dashed line around each of these.
"""

from math import ceil
from pathlib import Path
from typing import Final, NamedTuple

from blast_env.atomic import write_atomically
from blast_env.errors import BlastEnvError
from blast_env.export.notes import clearance_outlines, note_lines
from blast_env.export.plan import Feature, FeatureKind, LayoutPlan
from blast_env.geometry import Rectangle

try:
    from ezdxf import units
    from ezdxf.document import Drawing
    from ezdxf.enums import MTextEntityAlignment, TextEntityAlignment
    from ezdxf.filemanagement import new
    from ezdxf.layouts.layout import Modelspace
except ImportError as error:
    raise BlastEnvError(
        f"DXF files need {error.name!r}, which is not installed: pip install blast-env[agents]"
    ) from error

VERSION: Final = "R2010"
APPLICATION: Final = "BLAST_ENV"
"""Under this name the outline of a module has its identifier, as extended data."""

CLEARANCE_LAYER: Final = "CLEARANCE"
NOTES_LAYER: Final = "NOTES"

_STRING: Final = 1000  # group code of a text in extended data
_TEXT_HEIGHT_M: Final = 0.4
_LINE_SPACING: Final = 5.0 / 3.0  # of lines of text, in heights of the text
_POINT_SIZE_M: Final = 1.0
_CROSS_IN_CIRCLE: Final = 35  # how points are drawn ($PDMODE)


class _Style(NamedTuple):
    """How a layer is drawn: a colour of AutoCAD's index, and a line type."""

    colour: int
    line_type: str = "CONTINUOUS"


_STYLES: Final = {
    FeatureKind.SITE: _Style(8),
    FeatureKind.BUILD_ZONE: _Style(3, "DASHED"),
    FeatureKind.COST_AREA: _Style(6, "DASHED"),
    FeatureKind.KEEP_OUT: _Style(30, "DASHED"),
    FeatureKind.STRUCTURE: _Style(7),
    FeatureKind.PROTECTED_STRUCTURE: _Style(132),
    FeatureKind.CHARGE_PLACE: _Style(1, "DASHED"),
    FeatureKind.CHARGE: _Style(1),
    FeatureKind.BARRIER: _Style(140),
}
_OTHER_STYLES: Final = {CLEARANCE_LAYER: _Style(52, "DASHED"), NOTES_LAYER: _Style(7)}


def layer_name(kind: FeatureKind) -> str:
    """Return the layer that a kind of feature is on: `KEEP_OUT`."""
    return kind.value.upper()


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
    styles = {layer_name(kind): style for kind, style in _STYLES.items()} | _OTHER_STYLES
    for layer, style in styles.items():
        document.layers.add(layer, color=style.colour, linetype=style.line_type)
    space = document.modelspace()
    for feature in plan.features:
        _draw(space, feature)
    _draw_clearance(space, plan)
    shown = _write_notes(space, plan)
    document.set_modelspace_vport(height=1.1 * max(shown.right, shown.top), center=shown.centre)
    return document


def write_dxf(plan: LayoutPlan, path: Path) -> None:
    """Write the drawing.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    with write_atomically(path) as temporary:
        drawing(plan).saveas(temporary)


def _draw(space: Modelspace, feature: Feature) -> None:
    """Draw a point, a line or a closed outline, and write the name of what has one."""
    attributes = {"layer": layer_name(feature.kind)}
    places = feature.places_m
    if len(places) == 1:
        space.add_point(places[0], attributes)
    elif len(places) == 2:
        space.add_line(*places, attributes)
    else:
        outline = space.add_lwpolyline(places, close=True, dxfattribs=attributes)
        if feature.kind is FeatureKind.BARRIER:
            outline.set_xdata(APPLICATION, [(_STRING, feature.name)])
            return
    _write_name(space, feature)


def _write_name(space: Modelspace, feature: Feature) -> None:
    """Write a name in the middle of a structure, and beside the first place of anything else."""
    # A line break would end the text in the middle of the file.
    text = space.add_text(
        " ".join(feature.name.split()),
        height=_TEXT_HEIGHT_M,
        dxfattribs={"layer": layer_name(feature.kind)},
    )
    x_m, y_m = feature.places_m[0]
    if feature.kind in (FeatureKind.STRUCTURE, FeatureKind.PROTECTED_STRUCTURE):
        right_m, top_m = feature.places_m[2]
        middle = ((x_m + right_m) / 2.0, (y_m + top_m) / 2.0)
        text.set_placement(middle, align=TextEntityAlignment.MIDDLE_CENTER)
    else:
        gap_m = _TEXT_HEIGHT_M / 2.0
        # The charge is where one may be: its name goes below that of the place.
        up_m = -gap_m - _TEXT_HEIGHT_M if feature.kind is FeatureKind.CHARGE else gap_m
        text.set_placement((x_m + gap_m, y_m + up_m))


def _draw_clearance(space: Modelspace, plan: LayoutPlan) -> None:
    """Draw how near modules may come to the structures, if there is a bound."""
    for outline in clearance_outlines(plan):
        attributes = {"layer": CLEARANCE_LAYER}
        space.add_lwpolyline(outline, format="xyb", close=True, dxfattribs=attributes)


def _write_notes(space: Modelspace, plan: LayoutPlan) -> Rectangle:
    """Write the notes above everything; return the site with them.

    They are as high as fits the width of the site. Where that would be too small to read, lines
    wrap; the text grows upwards, so it never covers the site.
    """
    lines = note_lines(plan)
    site, width_m = plan.scenario.site.rectangle_m, plan.scenario.site.width_m
    # Signs are at most as wide as high, whatever typeface a program has.
    height_m = max(width_m / max(map(len, lines)), _TEXT_HEIGHT_M)
    ends_m = [y for outline in clearance_outlines(plan) for _, y, _ in outline]
    bottom_m = max([site.top, *ends_m]) + 2.0 * height_m
    notes = space.add_mtext(
        "\\P".join(lines),
        {"layer": NOTES_LAYER, "char_height": height_m, "width": width_m},
    )
    notes.set_location((site.left, bottom_m), attachment_point=MTextEntityAlignment.BOTTOM_LEFT)
    count = sum(ceil(len(line) * height_m / width_m) for line in lines)
    return site._replace(top=bottom_m + count * _LINE_SPACING * height_m)
