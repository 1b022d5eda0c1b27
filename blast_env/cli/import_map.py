"""`blast-env import`: a site from a map or drawing."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blast_env.cli.command import Command, argument, option
from blast_env.cli.output import (
    make_table,
    print_json,
    print_line,
    result_console,
    save_pictures,
)
from blast_env.cli.targets import PICTURES
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


@dataclass(frozen=True, kw_only=True)
class ImportCommand(Command):
    """Make a scenario of a map or drawing: GeoJSON, OpenStreetMap, DXF.

    The site is turned to the direction of most walls and buildings are cut into modules of 0.5 m;
    the table says how far each is from its outline.
    """

    file: Path = argument(".geojson, .osm, .osm.pbf or .dxf.")
    out: Path = option(..., "Scenario file to write: .toml.", writes=(".toml",))
    name: str | None = option(None, "Name of the scenario.")
    origin: Place | None = option(None, f"The site's lower left corner. {_PLACE}", metavar="X Y")
    centre: Place | None = option(None, "The site's middle, instead of --origin.", metavar="X Y")
    size_m: Place | None = option(
        None,
        "The site's extents, m.",
        metavar="WIDTH HEIGHT",
        show_default="as much as everything in the file needs",
    )
    margin_m: float = option(10, "Ground around everything without --size, m.")
    rotation_deg: float | None = option(
        None,
        "Direction of the site's x axis, degrees from east, counterclockwise.",
        show_default="that of most walls",
    )
    crs: str | None = option(
        None,
        "Reference system of the coordinates: EPSG:25832, or local for plain metres.",
        show_default="what GeoJSON says, else EPSG:4326; none for DXF",
    )
    units: str | None = option(None, "Unit of a drawing: m, mm, cm, dm, km, in, ft.")
    buildings_from: tuple[str, ...] = option(
        (), "What is a building: KEY, KEY=VALUE, or a layer of a drawing."
    )
    charges_from: tuple[str, ...] = option(
        (), "Where charges may be, named in the same way.", show_default="streets, car parks"
    )
    zone_from: tuple[str, ...] = option((), "Where barriers may stand, named in the same way.")
    keep_outs_from: tuple[str, ...] = option((), "What must stay empty, named in the same way.")
    protect: tuple[str, ...] = option((), "Name of a building whose load counts.")
    protect_near: Place | None = option(
        None, "Protect the building nearest to this.", metavar="X Y"
    )
    tnt_kg: float = option(100.0, "Mass of the charges, kg TNT.", metavar="KG")
    charge_at: tuple[str, ...] = option((), "A further place of a charge.", metavar="X,Y")
    zone_m: tuple[float, float, float, float] | None = option(
        None, "The build zone, site metres.", metavar="LEFT BOTTOM WIDTH HEIGHT"
    )
    zone_around_m: float | None = option(
        None, "Zone around what is protected, so many metres wide."
    )
    stock: int = option(20, "Modules that there are to place.", min=1)
    wall_height_m: float = option(3.0, "Height of the modules, m.")
    clearance_m: float = option(1.0, "Least distance of modules from structures, m.", min=0.0)
    preset: str = option("collisional", "Parameters of the particle model.")
    height_from: str | None = option(None, "Property with the height.")
    default_height_m: float | None = option(
        None, "Height of buildings without one, m.", show_default="as high as the air"
    )
    level_height_m: float = option(3.0, "Height of a storey, m.")
    least_area_m2: float = option(4.0, "Leave out smaller buildings, m2.")
    most_area_deviation: float = option(
        0.2, "Refuse a building of which modules miss more, share of area."
    )
    most_outline_deviation_m: float = option(
        1.0, "Refuse a building whose outline is farther off, m."
    )
    most_rectangles: int = option(16, "Rectangles that a building may take; coarser blocks beyond.")
    repair: bool = option(False, "Put outlines right that cross themselves.")
    picture: Path | None = option(
        None, "Write a plan, outlines over modules: .png, .svg, .pdf.", writes=PICTURES
    )
    as_json: bool = option(False, "Print the report as JSON.", flag="--json")

    def __call__(self) -> None:
        """Convert the file, write the scenario and say how far it is from the file."""
        # Here, because maps need the extra `maps`.
        from blast_env.importing import ImportOptions, import_site

        given: dict[str, Any] = {
            each.name: getattr(self, each.name) for each in fields(ImportOptions)
        }
        given["charge_at"] = tuple(_place(text) for text in self.charge_at)
        imported = import_site(self.file, ImportOptions(**given))
        save_scenario(imported.scenario, self.out)
        written = [self.out, *save_pictures(lambda: _pictures(imported, self.picture))]
        if self.as_json:
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
