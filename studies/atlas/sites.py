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
from blast_env.evaluation.questions.screening import BayScreening, screen
from blast_env.files import make_folder, write_text
from blast_env.gas.settings import CHECKED_SCALED_DISTANCE
from blast_env.geometry import Layout
from blast_env.layout import load_layout
from blast_env.response.sdof import impulses
from blast_env.site import Scenario, load_scenario
from blast_env.site.blast_site import Charge

SITES: Final = (
    *("clinic_front", "control_room", "guard_post", "hotel_forecourt", "ministry_kerb"),
    *("school_and_clinic", "school_wing", "shopping_street", "visitor_entrance"),
)
"""Bundled sites with heights whose blast takes seconds."""

CELL_M: Final = 0.25
"""Side of the cells of gas dynamics on the others."""

LARGE: Final = ("government_forecourt", "street_front")
"""Large bundled sites, on cells that grow from 0.25 m."""

_BEST: Final = Path("docs/data/best_found")
_ALONG: Final = 0.9  # cosine between normals of the same wall


@dataclass(frozen=True, eq=False)
class SiteLoads:
    """Loads on the bays of a site under one charge, not nearer than where walls may be breached.

    Attributes:
        site: Name of the site.
        has_layout: Whether the best known layout stands on it.
        bays: The bays by screening with the atlas.
        gas: Impulses and peaks of the mean pressures by gas dynamics (bays, 2).
        without: Those by screening without the atlas.
        atlas: Those with it.
        likely: Those by its best estimates (bays, 2).
    """

    site: str
    has_layout: bool
    bays: tuple[BayScreening, ...]
    gas: FloatArray
    without: FloatArray
    atlas: FloatArray
    likely: FloatArray


def on_site(name: str, has_layout: bool, known: Laws, folder: Path) -> Iterator[SiteLoads]:
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
        own = under_charge(site, threat.charge)
        by_gas = bays_by_gas(own, layout, path)
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
                np.array([(bay.likely_pa_s, bay.likely_peak_pa) for bay, _ in chosen]),
            )


def bays_by_gas(site: Scenario, layout: Layout, path: Path) -> Mapping[str, tuple[float, float]]:
    """Return impulse and peak of each bay by gas dynamics, from a file if it exists.

    Cells clip peaks, more so near the charge, and a slanting wave crosses a bay in time. So a peak
    is the curves' for the building alone in the open, times what gas has on the same cells with all
    that stands around over without it.
    """
    if not path.exists():
        found, loads = {}, _loads(site, layout)
        for structure in {bay.split("/")[0] for bay in loads}:
            alone = _alone(site, structure)
            is_alone = not layout and len(site.structures) == 1
            in_the_open = loads if is_alone else _loads(alone, ())
            (threat,) = screen(alone, (), (), None).threats
            for bay in threat.bays:
                name = bay.filled.bay.name
                if name in loads:
                    impulse, peak = loads[name]
                    clipped = bay.peak_pa / in_the_open[name][1] if bay.in_sight else 1.0
                    found[name] = (impulse, peak * clipped)
        make_folder(path.parent)
        write_text(path, json.dumps(found))
    rows: dict[str, tuple[float, float]] = parse_json(path.read_text("utf-8"))
    return rows


def _loads(scenario: Scenario, layout: Layout) -> dict[str, tuple[float, float]]:
    """Return the impulse of each bay, and the peak of its mean pressure, on the cells."""
    is_large = scenario.name in LARGE
    engine = GasEngine(cells="fine") if is_large else GasEngine(cell_m=CELL_M)
    result = GasBlast(scenario, layout, engine=engine).run()
    time_s, pressure_pa = result.bay_loads.histories
    loads = zip(impulses(time_s, pressure_pa).max(axis=1), pressure_pa.max(axis=1), strict=True)
    names = [own.bay.name for own in result.bay_loads.bays]
    rows = ((float(impulse), float(peak)) for impulse, peak in loads)
    return dict(zip(names, rows, strict=True))


def _alone(site: Scenario, structure: str) -> Scenario:
    """Return a site with one building alone."""
    document: dict[str, Any] = site.model_dump(mode="json", exclude_none=True)
    kept = [own for own in document["structures"] if own["name"] == structure]
    return Scenario.from_document({**document, "structures": kept}, site.name)


def under_charge(site: Scenario, charge: Charge) -> Scenario:
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
