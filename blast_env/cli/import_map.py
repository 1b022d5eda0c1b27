"""`blast-env import`: a site from a map or drawing."""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blast_env.cli.command import Command, argument, option
from blast_env.cli.output import (
    ResultTable,
    print_json,
    print_line,
    print_written,
    result_console,
    save_pictures,
    titled,
)
from blast_env.cli.targets import PICTURES
from blast_env.files import write_atomically
from blast_env.io.importing.options import ImportOptions
from blast_env.site import save_scenario

if TYPE_CHECKING:
    from blast_env.io.importing import FittedBuilding, ImportedSite

_HEADERS = (
    *("building", "protected", "parts", "height (m)", "area (m2)", "modules (m2)"),
    *("area off (%)", "outline off (m)"),
)


@dataclass(frozen=True, kw_only=True)
class ImportCommand(ImportOptions, Command):
    """Make a scenario from a map or drawing: GeoJSON, OpenStreetMap, DXF.

    The site is turned to the direction of most walls, and buildings are polygons; the table gives
    the deviation of the modules of each building from its outline.
    """

    file: Path = argument(".geojson, .osm, .osm.pbf, .dxf or .ifc.")
    out: Path = option(..., "Scenario file to write: .toml.", writes=(".toml",))
    picture: Path | None = option(
        None, "Write a plan, outlines over modules: .png, .svg, .pdf.", writes=PICTURES
    )
    ledger: Path | None = option(
        None,
        "Write the ledger, all that was read, merged, closed, guessed and left out: .txt, .json.",
        writes=(".txt", ".json"),
    )
    as_json: bool = option(False, "Print the report as JSON.", flag="--json")

    def __call__(self) -> None:
        """Convert the file, write the scenario and print its deviations from the file."""
        # Here, because maps need the extra `maps`.
        from blast_env.io.importing import import_site

        imported = import_site(self.file, self)
        save_scenario(imported.scenario, self.out)
        written = [self.out, *save_pictures(lambda: _pictures(imported, self.picture))]
        if self.ledger is not None:
            _write_ledger(imported, self.ledger)
            written.append(self.ledger)
        if self.as_json:
            print_json(_record(imported, written))
        else:
            _print(imported, written)


def _pictures(imported: "ImportedSite", path: Path | None) -> list[Path]:
    if path is None:
        return []
    from blast_env.io.imported_site import imported_plan
    from blast_env.plots.figures import save_figure

    return [save_figure(imported_plan(imported), path)]


def _write_ledger(imported: "ImportedSite", path: Path) -> None:
    is_json = path.suffix.lower() == ".json"
    text = json.dumps(imported.ledger.record, indent=1) if is_json else imported.ledger.text
    with write_atomically(path) as target:
        target.write_text(text, encoding="utf-8")


def _print(imported: "ImportedSite", written: list[Path]) -> None:
    width_m, height_m = imported.site.size_m
    table = ResultTable(
        f"{imported.scenario.name}: {width_m:g} x {height_m:g} m, turned by "
        f"{imported.site.rotation_deg:.2f} degrees",
        _HEADERS,
    )
    for each in imported.buildings:
        table.add_row(
            _words(each),
            "yes" if each.protected else "no",
            f"{len(each.polygons)}",
            "air" if each.height_m is None else f"{each.height_m:g}",
            f"{each.outline.area:,.1f}",
            f"{each.area_m2:,.1f}",
            f"{100.0 * each.deviation.area_share:.1f}",
            f"{each.deviation.outline_m:.2f}",
        )
    result_console().print(table)
    print_line(
        f"places of charges: {len(imported.scenario.charge)}; particle engines use the preset "
        f"{imported.scenario.simulation.preset}"
    )
    sums = Counter(each.deed for each in imported.ledger.entries)
    print_line(f"ledger: {', '.join(f'{deed} {count}' for deed, count in sums.items())}")
    for note in imported.notes:
        print_line(f"note: {note}")
    print_written(written)


def _words(building: "FittedBuilding") -> str:
    """Return the name of a building, with its name on the map if that is another."""
    return titled(building.name, building.title) + (" (cut)" if building.is_cut else "")


def _record(imported: "ImportedSite", written: list[Path]) -> dict[str, Any]:
    georeference = imported.scenario.georeference
    return {
        "scenario": imported.scenario.name,
        "scenario_hash": imported.scenario.content_hash,
        "georeference": None if georeference is None else georeference.model_dump(),
        "buildings": [_building(each) for each in imported.buildings],
        "charges": len(imported.scenario.charge),
        "notes": list(imported.notes),
        "ledger": imported.ledger.record,
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
        "is_cut": building.is_cut,
    }
