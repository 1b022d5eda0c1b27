"""A layout on its site as DXF, for CAD: units are metres, a layer a kind of feature."""

from pathlib import Path
from typing import Final, NamedTuple

from blast_env.atomic import write_atomically
from blast_env.errors import BlastEnvError
from blast_env.export.plan import Feature, FeatureKind, LayoutPlan

try:
    from ezdxf import units
    from ezdxf.document import Drawing
    from ezdxf.enums import TextEntityAlignment
    from ezdxf.filemanagement import new
    from ezdxf.layouts.layout import Modelspace
except ImportError as error:
    raise BlastEnvError(
        f"DXF files need {error.name!r}, which is not installed: pip install blast-env[agents]"
    ) from error

VERSION: Final = "R2010"
APPLICATION: Final = "BLAST_ENV"
"""Under this name the outline of a module has its identifier, as extended data."""

_STRING: Final = 1000  # group code of a text in extended data
_TEXT_HEIGHT_M: Final = 0.4
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


def layer_name(kind: FeatureKind) -> str:
    """Return the layer that a kind of feature is on: `KEEP_OUT`."""
    return kind.value.upper()


def drawing(plan: LayoutPlan) -> Drawing:
    """Return a drawing of everything on the site; the layers are those of all kinds."""
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
    for kind, style in _STYLES.items():
        document.layers.add(layer_name(kind), color=style.colour, linetype=style.line_type)
    space = document.modelspace()
    for feature in plan.features:
        _draw(space, feature)
    site = plan.scenario.site.rectangle_m
    document.set_modelspace_vport(height=1.1 * max(site.right, site.top), center=site.centre)
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
