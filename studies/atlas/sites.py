"""The atlas on sites, beside gas dynamics: with and without a layout, bay by bay."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.atlas import Laws
from blast_env.documents import parse_json
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.evaluation.engines.gas_validation import bay_middles
from blast_env.evaluation.questions.screening import BayScreening, screen
from blast_env.files import make_folder, write_text
from blast_env.gas.settings import CHECKED_SCALED_DISTANCE
from blast_env.geometry import Layout
from blast_env.layout import load_layout
from blast_env.response.sdof import impulses
from blast_env.site import Scenario, load_scenario
from blast_env.site.blast_site import Charge
from studies.atlas.clipping import Clipping

SITES: Final = (
    *("clinic_front", "control_room", "guard_post", "hotel_forecourt", "ministry_kerb"),
    *("school_and_clinic", "school_wing", "shopping_street", "visitor_entrance"),
)
"""Bundled sites with heights whose blast takes seconds."""

_BEST: Final = Path("docs/data/best_found")
_LEAST_CELLS: Final = 8.0  # per m/kg^(1/3)


@dataclass(frozen=True, eq=False)
class SiteLoads:
    """Loads on the bays of a site under one charge, not nearer than where walls may be breached.

    Attributes:
        site: Name of the site.
        has_layout: Whether the best known layout stands on it.
        bays: The bays by screening with the atlas.
        gas: Impulses and peaks by gas dynamics, peaks as sharp as those of the curves are to the
            same cells on a wall in the open, at the bay's distance and angle (bays, 2).
        without: Those by screening without the atlas.
        atlas: Those with it.
        likely: Impulses by its best estimates (bays,).
    """

    site: str
    has_layout: bool
    bays: tuple[BayScreening, ...]
    gas: FloatArray
    without: FloatArray
    atlas: FloatArray
    likely: FloatArray


def on_site(
    name: str, has_layout: bool, known: Laws, clipping: Clipping, folder: Path
) -> Iterator[SiteLoads]:
    """Yield the loads on a site under each threat, at its worst place by screening without atlas.

    Blasts are kept in a folder.
    """
    site = load_scenario(name)
    if not site.bays:
        site = site.with_facades("window_annealed_6", None)
    layout: Layout = ()
    if has_layout:
        layout = tuple(load_layout(_BEST / f"{site.name}.json", site))
    for number, threat in enumerate(screen(site, layout).threats):
        path = folder / f"{name}_{'layout' if has_layout else 'alone'}_{number}.json"
        by_gas = _by_gas(site, layout, threat.charge, clipping, path)
        own = _under(site, threat.charge)
        before, after = (screen(own, layout, (), atlas).threats[0] for atlas in (None, known))
        least_m = CHECKED_SCALED_DISTANCE[0] * float(np.cbrt(threat.charge.tnt_kg))
        chosen = [
            (with_atlas, without)
            for with_atlas, without in zip(after.bays, before.bays, strict=True)
            if with_atlas.filled.bay.name in by_gas and with_atlas.distance_m >= least_m
        ]
        if chosen:
            yield SiteLoads(
                name,
                has_layout,
                tuple(bay for bay, _ in chosen),
                np.array([by_gas[bay.filled.bay.name] for bay, _ in chosen]),
                np.array([(bay.impulse_pa_s, bay.peak_pa) for _, bay in chosen]),
                np.array([(bay.impulse_pa_s, bay.peak_pa) for bay, _ in chosen]),
                np.array([bay.likely_pa_s for bay, _ in chosen]),
            )


def _by_gas(
    site: Scenario, layout: Layout, charge: Charge, clipping: Clipping, path: Path
) -> Mapping[str, tuple[float, float]]:
    """Return impulse and peak of each bay by gas dynamics, from a file if it exists."""
    scale = float(np.cbrt(charge.tnt_kg))
    cell_m = _cell_m(scale)
    if not path.exists():
        loads = GasBlast(site, layout, 0, GasEngine(cell_m=cell_m), charge).run().bay_loads
        time_s, pressure_pa = loads.histories
        peaks = pressure_pa.max(axis=1).tolist()
        rows = zip(impulses(time_s, pressure_pa).max(axis=1).tolist(), peaks, strict=True)
        names = [bay.bay.name for bay in loads.bays]
        make_folder(path.parent)
        write_text(path, json.dumps(dict(zip(names, rows, strict=True))))
    found: dict[str, tuple[float, float]] = parse_json(path.read_text("utf-8"))
    bays = [own.bay for own in site.bays_with(layout) if own.bay.name in found]
    rectangles_m = {structure.name: structure.rectangle_m for structure in site.structures}
    middles_m, normals = bay_middles(rectangles_m, bays)
    way_m = np.array([*charge.position_m, charge.height_m]) - middles_m
    away_m = np.linalg.norm(way_m, axis=1)
    cosine = (way_m * normals).sum(axis=1) / away_m
    sharper = clipping.sharpening(scale / cell_m, away_m / scale, cosine)
    return {
        bay.name: (found[bay.name][0], found[bay.name][1] * factor)
        for bay, factor in zip(bays, sharper.tolist(), strict=True)
    }


def _cell_m(scale: float) -> float:
    """Return the side of the cells for a cube root of the mass."""
    return 0.5 if scale / 0.5 >= _LEAST_CELLS else 0.25


def _under(site: Scenario, charge: Charge) -> Scenario:
    """Return a site whose charge is at one place."""
    x_m, y_m = charge.position_m
    point = {
        "kind": "point",
        "position_m": [x_m, y_m],
        "tnt_kg": charge.tnt_kg,
        "height_m": charge.height_m,
    }
    document: dict[str, Any] = site.model_dump(mode="json", exclude_none=True)
    return Scenario.from_document({**document, "charge": [point]}, site.name)
