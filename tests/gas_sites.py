"""A small site with heights, on which a blast of gas dynamics takes a fraction of a second."""

from typing import Any

import numpy as np
import pandas as pd

from blast_env.evaluation.engines.gas import GasResult
from blast_env.site import Scenario
from tests import builders
from tests.builders import block, point, zone

WALL = tuple((row, 0) for row in range(6))
"""In front of the building, between it and the charge."""


def site_document(**changes: Any) -> dict[str, Any]:
    """Return a charge of 5 kg in the west, a zone of 2 x 6 cells, a hut in the east."""
    document = builders.site_document(
        "hut",
        (10.0, 8.0, 5.0),
        point(2.0, 4.0, 5.0),
        block("hut", 6.0, 3.0, 4, 4, height_m=2.0, protected=True),
        build_zone=zone(4.0, 2.5, 6, 2, stock=6, height_m=1.5),
        gauges=[
            {"name": "front", "position_m": [5.75, 4.25, 0.25]},
            {"name": "behind", "position_m": [9.0, 4.25, 0.25]},
        ],
    )
    return document | changes


def hut(**changes: Any) -> Scenario:
    """Return the site, with other sections where some are given."""
    return Scenario.from_document(site_document(**changes), "hut")


def glazed_hut() -> Scenario:
    """Return the site, its hut with small windows in brick walls."""
    document = site_document()
    pane = {"width_m": 0.8, "height_m": 0.6, "thickness_mm": 3.78}
    window = {"kind": "glazing", "title": "small window", "source": "made for tests", **pane}
    document["components"] = {"small_window": window}
    document["structures"][0]["facade"] = {
        "bay_m": 1.0,
        "glazing": "small_window",
        "wall": "brick_215",
    }
    return Scenario.from_document(document, "glazed_hut")


def column(name: str, x_m: float, y_m: float, diameter_m: float) -> dict[str, Any]:
    """Return a column of eight corners."""
    turns = np.pi / 8.0 + np.pi / 4.0 * np.arange(8)
    places = [x_m, y_m] + 0.5 * diameter_m * np.stack((np.cos(turns), np.sin(turns)), axis=1)
    return {"kind": "polygon", "name": name, "outline_m": places.round(6).tolist()}


def net_on_modules(result: GasResult) -> pd.DataFrame:
    """Return the modules of a blast with their running impulses at its end, `net_pa_s`."""
    keys = ["structure", "module_id", "face"]
    by_module = result.faces.groupby(keys)["net_impulse_pa_s"].mean()
    return result.modules.join(by_module.rename("net_pa_s"), on=keys)
