"""Layouts as CSV, GeoJSON, DXF, IFC, glTF and JSON."""

import json
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from blast_env.errors import BlastEnvError, suggestion
from blast_env.files import make_folder, write_text
from blast_env.io.export.bill import LayoutPlan, bill_of_quantities, element_table
from blast_env.layout import write_layout
from blast_env.plots.plan import Feature
from blast_env.sections import AnyGeoreference, PointM
from blast_env.tables import write_csv
from blast_env.values import path_of

_DIGITS: Final = 9  # of a coordinate on a map: a tenth of a millimetre in degrees

SITE_METRES: Final = (
    "local site metres: x to the right and y upwards from the lower left corner of the site; "
    "not longitude and latitude (not WGS 84)"
)
"""Coordinates of a site without a map."""

_LONGITUDE_LATITUDE: Final = "longitude and latitude (WGS 84)"


def feature_collection(plan: LayoutPlan) -> dict[str, Any]:
    """Return a FeatureCollection of everything on the site, as plain data.

    With a georeference of the scenario, its coordinates are longitude and latitude, the rule of
    GeoJSON, or those of the map, named in the member `crs` of the older GeoJSON.
    """
    georeference = plan.scenario.georeference
    # Repeated in every feature, because many programs read features alone.
    words = _coordinate_words(georeference)
    collection: dict[str, Any] = {
        "type": "FeatureCollection",
        "name": plan.scenario.name,
        "coordinate_system": words,
        "scenario_hash": plan.scenario.content_hash,
        "features": [_feature(feature, words, georeference) for feature in plan.features],
    }
    if georeference is not None and georeference.kind == "map" and words != _LONGITUDE_LATITUDE:
        collection["crs"] = {"type": "name", "properties": {"name": georeference.crs}}
    return collection


def _coordinate_words(georeference: AnyGeoreference | None) -> str:
    if georeference is None:
        return SITE_METRES
    if georeference.kind == "drawing":
        unit = georeference.metres_per_unit
        return f"those of the drawing that the site was imported from, in units of {unit:g} m"
    from blast_env.io.importing.plane import is_longitude_latitude

    return _LONGITUDE_LATITUDE if is_longitude_latitude(georeference.crs) else georeference.crs


def write_geojson(plan: LayoutPlan, path: Path) -> None:
    """Write the collection, one feature per line."""
    collection = feature_collection(plan)
    features = ",\n".join(
        json.dumps(feature, allow_nan=False) for feature in collection["features"]
    )
    others = {key: value for key, value in collection.items() if key != "features"}
    head = json.dumps(others, indent=0, allow_nan=False).removesuffix("\n}")
    write_text(path, f'{head},\n"features": [\n{features}\n]\n}}\n')


def _feature(
    feature: Feature, coordinate_words: str, georeference: AnyGeoreference | None
) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {
            "kind": feature.kind.name,
            "name": feature.name,
            **feature.properties,
            "coordinate_system": coordinate_words,
        },
        "geometry": _geometry(
            _on_map(feature.places_m, georeference),
            [_on_map(hole_m, georeference) for hole_m in feature.holes_m],
        ),
    }


def _on_map(places_m: Sequence[PointM], georeference: AnyGeoreference | None) -> list[list[float]]:
    """Return places of the site in the coordinates of its map, or in site metres without one."""
    if georeference is None:
        return [list(place) for place in places_m]
    # Here, because sites without a map do not need the extra `maps`.
    from blast_env.io.importing.plane import to_map

    return [
        [round(value, _DIGITS) for value in place]
        for place in to_map(georeference, np.array(places_m)).tolist()
    ]


def _geometry(places: list[list[float]], holes: list[list[list[float]]]) -> dict[str, Any]:
    if len(places) == 1:
        return {"type": "Point", "coordinates": places[0]}
    if len(places) == 2:
        return {"type": "LineString", "coordinates": places}
    rings = [[*hole, hole[0]] for hole in (places, *holes)]
    return {"type": "Polygon", "coordinates": rings}


def _write_json(plan: LayoutPlan, path: Path) -> None:
    """Write the layout file that `load_layout` reads, with the charge in its provenance."""
    provenance = dict(plan.provenance)
    if plan.charge is not None:
        position_m, tnt_kg = plan.charge.position_m, plan.charge.tnt_kg
        provenance["charge"] = {"position_m": list(position_m), "tnt_kg": tnt_kg}
    write_layout(path, plan.scenario, plan.layout, provenance)


def _write_dxf(plan: LayoutPlan, path: Path) -> None:
    # Here, because the other formats do not need the extra `export`.
    from blast_env.io.export.dxf import write_dxf

    write_dxf(plan, path)


def _write_ifc(plan: LayoutPlan, path: Path) -> None:
    from blast_env.io.export.ifc import write_ifc  # it needs the extra `ifc`

    write_ifc(plan, path)


def _write_glb(plan: LayoutPlan, path: Path) -> None:
    from blast_env.io.export.scene import write_layout_scene

    write_layout_scene(plan, path)


_WRITERS: Final[Mapping[str, Callable[[LayoutPlan, Path], object]]] = MappingProxyType(
    {
        ".json": _write_json,
        ".csv": lambda plan, path: write_csv(element_table(plan), path),
        ".bill.csv": lambda plan, path: write_csv(bill_of_quantities(plan), path),
        ".geojson": write_geojson,
        ".dxf": _write_dxf,
        ".glb": _write_glb,
        ".ifc": _write_ifc,
    }
)
_NEEDS: Final[Mapping[str, str]] = MappingProxyType({".dxf": "dxf", ".ifc": "ifc"})
"""Modules with packages of an extra, whose error names it."""

_ALONE: Final = ".ifc"
"""The format that a folder gets only where it is asked for by its suffix: its extra is large."""


SUFFIXES: Final = tuple(_WRITERS)
"""Suffixes of the formats of a layout."""


def export_layout(plan: LayoutPlan, path: str | Path) -> Path:
    """Write a layout in the format of the suffix.

    Args:
        plan: The layout on its site.
        path: `.json` (a layout file), `.csv` (the modules or pieces), `.bill.csv` (the bill of
            quantities), `.geojson`, `.dxf` or `.glb` (everything on the site), `.ifc` (the pieces
            as walls); an existing file is replaced as a whole.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is unknown, the file cannot be written, or a required package
            is not installed.
    """
    path = path_of(path)
    check_target(path)
    suffix = _suffix(path)
    if suffix not in _WRITERS:
        raise BlastEnvError(f"{path}: has no suffix, must be {_named_suffixes()}")
    _WRITERS[suffix](plan, path)
    return path


def export_to(plan: LayoutPlan, target: str | Path) -> list[Path]:
    """Write a layout to a file, or to a folder in all formats but IFC.

    Args:
        plan: The layout on its site.
        target: A file as for `export_layout`; otherwise a folder, created if it is missing.

    Returns:
        The files.

    Raises:
        BlastEnvError: As for `export_layout`.
    """
    target = Path(target)
    check_target(target)
    if is_file(target):
        return [export_layout(plan, target)]
    make_folder(target)
    suffixes = [suffix for suffix in SUFFIXES if suffix != _ALONE]
    return [export_layout(plan, target / f"layout{suffix}") for suffix in suffixes]


def check_target(target: str | Path) -> None:
    """Refuse an unusable target of `export_to` before any work is done for it.

    Raises:
        BlastEnvError: If the suffix is unknown, or a required package is not installed.
    """
    target = Path(target)
    suffix = _suffix(target)
    if suffix and suffix not in SUFFIXES and not target.is_dir():
        raise BlastEnvError(
            f"{target}: suffix is {suffix!r}{suggestion(suffix, SUFFIXES)}, must be "
            f"{_named_suffixes()}, or nothing for a folder"
        )
    needed = _NEEDS.get(suffix) if is_file(target) else _NEEDS[".dxf"]
    if needed is not None:
        import_module(f"blast_env.io.export.{needed}")  # its error names the missing extra


def is_file(target: Path) -> bool:
    """Return whether a target is one file, rather than a folder."""
    return _suffix(target) in SUFFIXES and not target.is_dir()


def _suffix(path: Path) -> str:
    """Return the suffix of the format: the last two suffixes if they are known, else the last."""
    both = "".join(path.suffixes[-2:]).lower()
    return both if both in SUFFIXES else path.suffix.lower()


def _named_suffixes() -> str:
    return f"{', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"
