"""`blast-env import`: a site from a map or drawing."""

from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from blast_env.answers.imported import import_answer
from blast_env.cli.command import PICTURES, writes
from blast_env.cli.interruptions import Interruptions
from blast_env.cli.options import GlazingOption, WallOption, numbers
from blast_env.cli.output import print_outcome, print_record, save_pictures
from blast_env.io.importing.options import MARGIN_M, MOST_MARGIN_M, ImportOptions
from blast_env.site import save_scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from blast_env.io.importing import SiteImport

_PLACE: Final = (
    "In the coordinates of the file: longitude and latitude, or as --crs or a drawing has them."
)

_OriginOption = Annotated[
    str | None, typer.Option(help=f"The site's lower left corner. {_PLACE}", metavar="X,Y")
]
_CentreOption = Annotated[
    str | None, typer.Option(help="The site's middle, instead of --origin.", metavar="X,Y")
]
_SizeOption = Annotated[
    str | None,
    typer.Option(
        "--size",
        help="The site's extents, m.",
        metavar="WIDTH,HEIGHT",
        show_default="as much as everything in the file needs",
    ),
]
_MarginOption = Annotated[
    float | None,
    typer.Option(
        "--margin",
        help="Ground around everything without --size, m.",
        show_default=f"{MARGIN_M:g}, or to a street within {MOST_MARGIN_M:g}",
    ),
]
_RotationOption = Annotated[
    float | None,
    typer.Option(
        "--rotation",
        help="Direction of the site's x axis, degrees from east, counterclockwise.",
        show_default="that of most walls",
    ),
]
_CrsOption = Annotated[
    str | None,
    typer.Option(
        help="Reference system of the coordinates: EPSG:25832, or local for plain metres.",
        show_default="that of the GeoJSON file, else EPSG:4326; none for DXF",
    ),
]
_ProtectNearOption = Annotated[
    str | None, typer.Option(help="Protect the building nearest to this.", metavar="X,Y")
]
_TntKgOption = Annotated[
    float, typer.Option("--tnt-kg", help="Mass of the charges, kg TNT.", metavar="KG")
]
_ZoneOption = Annotated[
    str | None,
    typer.Option("--zone", help="The build zone, site metres.", metavar="LEFT,BOTTOM,WIDTH,HEIGHT"),
]
_ZoneAroundOption = Annotated[
    float | None,
    typer.Option("--zone-around", help="Width of a zone around the protected buildings, m."),
]
_HeightUnitOption = Annotated[
    str | None,
    typer.Option(
        help="Unit of heights, widths and diameters without one: m, mm, cm, dm, km, in, ft.",
        show_default="m; ft, as a guess, if the coordinates are in feet",
    ),
]
_DefaultHeightOption = Annotated[
    float | None,
    typer.Option(
        "--default-height",
        help="Height of buildings without one, m.",
        show_default="guessed from neighbours and kind",
    ),
]
_LowHeightsOption = Annotated[
    bool,
    typer.Option(
        "--low-heights", help="Take the low guess of heights that the file does not have."
    ),
]
_LeastAreaOption = Annotated[
    float, typer.Option("--least-area", help="Leave out smaller buildings, m2.")
]
_RepairOption = Annotated[
    bool, typer.Option("--repair", help="Put outlines right that cross themselves.")
]
_StrictOption = Annotated[
    bool, typer.Option("--strict", help="Refuse a file where anything was guessed or left out.")
]


def import_map(
    context: typer.Context,
    file: Path = typer.Argument(help=".geojson, .city.json, .osm, .osm.pbf, .dxf, .ifc, ..."),
    out: Path = writes("Scenario file to write", ".toml", default=...),
    picture: Path | None = writes("Write a plan, outlines over modules", *PICTURES),
    ledger: Path | None = writes(
        "Write the ledger, all that was read, merged, closed, guessed and left out", ".txt", ".json"
    ),
    as_json: bool = typer.Option(False, "--json", help="Print the report as JSON."),
    name: str | None = typer.Option(None, help="Name of the scenario."),
    origin: _OriginOption = None,
    centre: _CentreOption = None,
    size_m: _SizeOption = None,
    margin_m: _MarginOption = None,
    rotation_deg: _RotationOption = None,
    crs: _CrsOption = None,
    units: str | None = typer.Option(None, help="Unit of a drawing: m, mm, cm, dm, km, in, ft."),
    buildings_from: list[str] = typer.Option(
        [], help="Features that are buildings: KEY, KEY=VALUE, or a layer of a drawing."
    ),
    charges_from: list[str] = typer.Option(
        [],
        help="Where charges may be, named in the same way.",
        show_default="streets, car parks",
    ),
    zone_from: list[str] = typer.Option(
        [], help="Where barriers may stand, named in the same way."
    ),
    keep_outs_from: list[str] = typer.Option(
        [], help="Areas to be kept empty, named in the same way."
    ),
    protect: list[str] = typer.Option([], help="Name of a building whose load counts."),
    protect_near: _ProtectNearOption = None,
    tnt_kg: _TntKgOption = 100.0,
    charge_at: list[str] = typer.Option([], help="A further place of a charge.", metavar="X,Y"),
    zone_m: _ZoneOption = None,
    zone_around_m: _ZoneAroundOption = None,
    glazing: GlazingOption = None,
    wall: WallOption = None,
    height_from: str | None = typer.Option(None, help="Property with the height."),
    height_unit: _HeightUnitOption = None,
    default_height_m: _DefaultHeightOption = None,
    low_heights: _LowHeightsOption = False,
    level_height_m: float = typer.Option(3.0, "--level-height", help="Height of a storey, m."),
    least_area_m2: _LeastAreaOption = 4.0,
    repair: _RepairOption = False,
    strict: _StrictOption = False,
) -> None:
    """Make a scenario from a map, drawing or model: GeoJSON, IFC and others.

    The site is turned to the direction of most walls, and buildings are polygons; the table gives
    the deviation of the modules of each building from its outline.
    """
    imported = _imported(file, _options(context), glazing, wall)
    save_scenario(imported.scenario, out)
    written = [out, *save_pictures((picture, partial(_plan, imported)))]
    if ledger is not None:
        written.append(imported.ledger.save(ledger))
    if as_json:
        print_record(imported.record, written)
    else:
        print_outcome(import_answer(imported), written)


def _imported(
    file: Path, options: ImportOptions, glazing: str | None, wall: str | None
) -> "SiteImport":
    """Import the site; protected structures without a facade get the given one."""
    # Here, because maps need the extra `maps`.
    with Interruptions.current().at_once():
        from blast_env.io.importing import import_site

    imported = import_site(file, options)
    return replace(imported, scenario=imported.scenario.with_facades(glazing, wall))


def _options(context: typer.Context) -> ImportOptions:
    """Return the options of the command line, with the numbers of those that have commas."""
    values = dict(context.params)
    for parameter in context.command.params:
        name, form = parameter.name or "", getattr(parameter, "metavar", None) or ""
        given = values.get(name)
        if isinstance(given, str) and "," in form:
            values[name] = numbers(parameter.opts[0], given, form)
        elif isinstance(given, list | tuple):
            texts = [str(text) for text in given]
            values[name] = tuple(numbers(parameter.opts[0], x, form) if form else x for x in texts)
    known = {field.name for field in fields(ImportOptions)}
    return ImportOptions(**{name: value for name, value in values.items() if name in known})


def _plan(imported: "SiteImport") -> "Figure":
    from blast_env.io.imported_site import imported_plan

    return imported_plan(imported)
