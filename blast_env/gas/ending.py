"""The end of a gas-dynamics blast, as soon as its loads are known.

A load is the largest value of a running impulse (`blast_env.gas.probes`). It is known when

1. sound has had the time to travel from the charge to every corner of the watched structures, and
2. the running impulse has fallen by a tenth of its largest value; for the load of a wall, on nine
   tenths of its area.

Later waves are weaker than the first ones, and must make up for that tenth before they affect a
load. `python -m studies.gas ending` compares with runs four times as long. A wall in a corner may
retain its overpressure; a run that waits for it ends at the time limit, and its load is not known.
The module does not import Numba, because estimates of cost use it.
"""

from collections.abc import Sequence
from math import cbrt, hypot
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Rectangle
from blast_env.site.blast_site import BlastSite

FALLEN: Final = 0.1
"""Fall of a running impulse from its largest value, relative to it, for a known load."""

AREA: Final = 0.9
"""Share of the area of a wall that must have known loads for the load of the wall to be known."""

SOUND_M_S: Final = 340.0

_MOST_TRAVEL_TIMES: Final = 3.0
_MOST_AFTER_S: Final = 0.15  # for 100 kg; grows with the cube root of the mass


def is_known(impulse_pa_s: FloatArray | float, net_impulse_pa_s: FloatArray | float) -> BoolArray:
    """Return whether loads are known from their running impulses, once sound has arrived.

    Args:
        impulse_pa_s: Largest values up to now, Pa s (n,).
        net_impulse_pa_s: Current values, Pa s (n,).
    """
    impulse = np.asarray(impulse_pa_s)
    return np.asarray((impulse > 0.0) & (net_impulse_pa_s <= (1.0 - FALLEN) * impulse))


def sound_s(site: BlastSite, places_m: Sequence[tuple[float, ...]]) -> float:
    """Return the longest travel time of sound from the charge to places in plan, s."""
    x_m, y_m = site.charge.position_m
    return max((hypot(x - x_m, y - y_m) for x, y, *_ in places_m), default=0.0) / SOUND_M_S


def limit_s(site: BlastSite, travel_s: float) -> float:
    """Return the time limit of a run, s.

    Args:
        site: The site with its charge.
        travel_s: Longest travel time of sound to the places that the run waits for.
    """
    return _MOST_TRAVEL_TIMES * travel_s + _MOST_AFTER_S * cbrt(site.charge.tnt_kg / 100.0)


def watched_structures(site: BlastSite, until: str | float) -> list[int]:
    """Return the indices of the structures that a run waits for.

    They are the protected ones, or all without the barrier if none is or if `until` is "walls".
    """
    structures = [k for k, outline in enumerate(site.structures) if not outline.is_barrier]
    protected = [k for k in structures if site.structures[k].protected]
    return structures if until == "walls" else protected or structures


def corners_m(site: BlastSite, structures: Sequence[int]) -> list[tuple[float, float]]:
    """Return the corners of structures in plan."""
    return [
        (x, y)
        for left, bottom, right, top in (box for k in structures for box in _boxes_m(site, k))
        for x in (left, right)
        for y in (bottom, top)
    ]


def _boxes_m(site: BlastSite, structure: int) -> Sequence[Rectangle]:
    """Return the rectangle of a structure, or those around the walls of a polygon."""
    outline = site.structures[structure]
    return [wall.bounds_m for wall in outline.walls] or [outline.rectangle_m]
