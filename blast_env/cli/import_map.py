"""`blast-env import`: a site from a map or drawing."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from blast_env.cli.output import (
    make_table,
    print_json,
    print_line,
    result_console,
    save_pictures,
    user_errors,
)
from blast_env.cli.targets import PICTURES, FileTarget, checked_targets
from blast_env.errors import BlastEnvError
from blast_env.scenario import save_scenario

if TYPE_CHECKING:
    from blast_env.importing import FittedBuilding, ImportedSite

_PLACE = (
    "In the coordinates of the file: longitude and latitude, or as --crs or a drawing has them."
)

_HEADERS = (
    *("building", "protected", "parts", "height (m)", "area (m2)", "modules (m2)"),
    *("area off (%)", "outline off (m)", "blocks (m)"),
)

Place = tuple[float, float]


def import_map(
    file: Annotated[Path, typer.Argument(help=".geojson, .osm, .osm.pbf or .dxf.")],
    out: Annotated[Path, typer.Option(help="Scenario file to write: .toml.")],
    name: Annotated[str | None, typer.Option(help="Name of the scenario.")] = None,
    origin: Annotated[
        Place | None,
        typer.Option(metavar="X Y", help=f"The site's lower left corner. {_PLACE}"),
    ] = None,
    centre: Annotated[
        Place | None, typer.Option(metavar="X Y", help="The site's middle, instead of --origin.")
    ] = None,
    size: Annotated[
        Place | None,
        typer.Option(
            metavar="WIDTH HEIGHT",
            help="The site's extents, m.",
            show_default="as much as everything in the file needs",
        ),
    ] = None,
    margin: Annotated[float, typer.Option(help="Ground around everything without --size, m.")] = 10,
    rotation: Annotated[
        float | None,
        typer.Option(
            help="Direction of the site's x axis, degrees from east, counterclockwise.",
            show_default="that of most walls",
        ),
    ] = None,
    crs: Annotated[
        str | None,
        typer.Option(
            help="Reference system of the coordinates: EPSG:25832, or local for plain metres.",
            show_default="what GeoJSON says, else EPSG:4326; none for DXF",
        ),
    ] = None,
    units: Annotated[
        str | None, typer.Option(help="Unit of a drawing: m, mm, cm, dm, km, in, ft.")
    ] = None,
    buildings_from: Annotated[
        list[str] | None,
        typer.Option(help="What is a building: KEY, KEY=VALUE, or a layer of a drawing."),
    ] = None,
    charges_from: Annotated[
        list[str] | None,
        typer.Option(help="Where charges may be, likewise.", show_default="streets, car parks"),
    ] = None,
    zone_from: Annotated[
        list[str] | None, typer.Option(help="Where barriers may stand, likewise.")
    ] = None,
    keep_outs_from: Annotated[
        list[str] | None, typer.Option(help="What must stay empty, likewise.")
    ] = None,
    protect: Annotated[
        list[str] | None, typer.Option(help="Name of a building whose load counts.")
    ] = None,
    protect_near: Annotated[
        Place | None, typer.Option(metavar="X Y", help="Protect the building nearest to this.")
    ] = None,
    tnt_kg: Annotated[
        float, typer.Option("--tnt-kg", metavar="KG", help="Mass of the charges, kg TNT.")
    ] = 100.0,
    charge_at: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y", help="A further place of a charge."),
    ] = None,
    zone: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(metavar="LEFT BOTTOM WIDTH HEIGHT", help="The build zone, site metres."),
    ] = None,
    zone_around: Annotated[
        float | None, typer.Option(help="Zone around what is protected, so many metres wide.")
    ] = None,
    stock: Annotated[int, typer.Option(min=1, help="Modules that there are to place.")] = 20,
    wall_height: Annotated[float, typer.Option(help="Height of the modules, m.")] = 3.0,
    clearance: Annotated[
        float, typer.Option(min=0.0, help="Least distance of modules from structures, m.")
    ] = 1.0,
    preset: Annotated[str, typer.Option(help="Parameters of the particle model.")] = "collisional",
    height_from: Annotated[str | None, typer.Option(help="Property with the height.")] = None,
    default_height: Annotated[
        float | None,
        typer.Option(help="Height of buildings without one, m.", show_default="as high as the air"),
    ] = None,
    level_height: Annotated[float, typer.Option(help="Height of a storey, m.")] = 3.0,
    least_area: Annotated[float, typer.Option(help="Leave out smaller buildings, m2.")] = 4.0,
    most_area_deviation: Annotated[
        float, typer.Option(help="Refuse a building of which modules miss more, share of area.")
    ] = 0.2,
    most_outline_deviation: Annotated[
        float, typer.Option(help="Refuse a building whose outline is farther off, m.")
    ] = 1.0,
    most_rectangles: Annotated[
        int, typer.Option(help="Rectangles that a building may take; coarser blocks beyond.")
    ] = 16,
    repair: Annotated[
        bool, typer.Option("--repair", help="Put outlines right that cross themselves.")
    ] = False,
    picture: Annotated[
        Path | None, typer.Option(help="Write a plan, outlines over modules: .png, .svg, .pdf.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Make a scenario of a map or drawing: GeoJSON, OpenStreetMap, DXF.

    The site is turned to the direction of most walls and buildings are cut into modules of 0.5 m;
    the table says how far each is from its outline.
    """
    files = {"--out": FileTarget(out, (".toml",)), "--picture": FileTarget(picture, PICTURES)}
    with user_errors(), checked_targets(files):
        # Here, because maps need the extra `maps`.
        from blast_env.importing import ImportOptions, import_site

        options = ImportOptions(
            name=name,
            crs=crs,
            units=units,
            origin=origin,
            centre=centre,
            size_m=size,
            margin_m=margin,
            rotation_deg=rotation,
            buildings_from=tuple(buildings_from or ()),
            charges_from=tuple(charges_from or ()),
            zone_from=tuple(zone_from or ()),
            keep_outs_from=tuple(keep_outs_from or ()),
            protect=tuple(protect or ()),
            protect_near=protect_near,
            tnt_kg=tnt_kg,
            charge_at=tuple(_place(text) for text in charge_at or ()),
            zone_m=zone,
            zone_around_m=zone_around,
            stock=stock,
            wall_height_m=wall_height,
            clearance_m=clearance,
            preset=preset,
            height_from=height_from,
            default_height_m=default_height,
            level_height_m=level_height,
            least_area_m2=least_area,
            most_area_deviation=most_area_deviation,
            most_outline_deviation_m=most_outline_deviation,
            most_rectangles=most_rectangles,
            repair=repair,
        )
        imported = import_site(file, options)
        save_scenario(imported.scenario, out)
        written = [out, *save_pictures(lambda: _pictures(imported, picture))]
    if as_json:
        print_json(_record(imported, written))
    else:
        _print(imported, written)


def _place(text: str) -> Place:
    """Return a place from `x,y`."""
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise BlastEnvError(f"--charge-at is {text!r}, must be two numbers as X,Y") from None
    return x, y


def _pictures(imported: "ImportedSite", path: Path | None) -> list[Path]:
    if path is None:
        return []
    from blast_env.rendering.figures import save_figure
    from blast_env.rendering.imported_site import imported_plan

    return [save_figure(imported_plan(imported), path)]


def _print(imported: "ImportedSite", written: list[Path]) -> None:
    width_m, height_m = imported.site.size_m
    table = make_table(
        f"{imported.scenario.name}: {width_m:g} x {height_m:g} m, turned by "
        f"{imported.site.rotation_deg:.2f} degrees",
        _HEADERS,
    )
    for each in imported.buildings:
        table.add_row(
            each.name + (" (cut)" if each.is_cut else ""),
            "yes" if each.protected else "no",
            f"{len(each.rectangles)}",
            "air" if each.height_m is None else f"{each.height_m:g}",
            f"{each.outline.area:,.1f}",
            f"{each.area_m2:,.1f}",
            f"{100.0 * each.deviation.area_share:.1f}",
            f"{each.deviation.outline_m:.2f}",
            f"{each.block_m:g}",
        )
    result_console().print(table)
    print_line(
        f"places of charges: {len(imported.scenario.charge)}; particle engines use the preset "
        f"{imported.scenario.simulation.preset}"
    )
    for note in imported.notes:
        print_line(f"note: {note}")
    for path in written:
        print_line(f"wrote {path}")


def _record(imported: "ImportedSite", written: list[Path]) -> dict[str, Any]:
    """Return the report as plain data."""
    georeference = imported.scenario.georeference
    return {
        "scenario": imported.scenario.name,
        "scenario_hash": imported.scenario.content_hash,
        "georeference": None if georeference is None else georeference.model_dump(),
        "buildings": [_building(each) for each in imported.buildings],
        "charges": len(imported.scenario.charge),
        "notes": list(imported.notes),
        "files": [str(path) for path in written],
    }


def _building(building: "FittedBuilding") -> dict[str, Any]:
    return {
        "name": building.name,
        "title": building.title,
        "place": building.place,
        "structures": list(building.part_names),
        "protected": building.protected,
        "height_m": building.height_m,
        "area_m2": building.outline.area,
        "modules_m2": building.area_m2,
        "area_deviation": building.deviation.area_share,
        "outline_deviation_m": building.deviation.outline_m,
        "block_m": building.block_m,
        "is_cut": building.is_cut,
    }
