"""Damage of bays as numbers, for each component that they have or may be given.

A damage increases within its level and from level to level (`blast_env.response.levels`), so that a
search has a gradient everywhere. The damage of other components needs no new blast.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.response.components import Alternatives
from blast_env.response.facade import FacadeResponse, peak_corrected, respond
from blast_env.response.glass import GlazingResponses, Pane, glazing_responses
from blast_env.response.levels import BayDamage
from blast_env.response.walls import Panel, PanelResponses, panel_responses


def bay_damages(
    bays: Sequence[Alternatives],
    time_s: FloatArray,
    pressure_pa: FloatArray,
    peak_factor: float = 1.0,
) -> tuple[BayDamage, ...]:
    """Return the damage of bays with each of their possible components.

    Cells clip peaks. To keep searches from exploiting that, the result is the worse of the damage
    under the histories and under sharper ones of the same impulse.

    Args:
        time_s: Times of the histories, ascending: (times,), or (bays, times) if they differ.
        pressure_pa: Mean overpressure on each bay, inwards positive (bays, times).
        peak_factor: Factor on peaks to make them as sharp as in the open; 1 without clipping.
    """
    # (1) One row per component that a bay may have; (2) the damage under the histories as they are;
    # (3) under sharper ones; (4) the worse by bay and component.
    places = [
        (index, name, filled)
        for index, bay in enumerate(bays)
        for name, filled in (*bay.glazing.items(), *bay.wall.items())
    ]
    filled, of_bay = [place for *_, place in places], [index for index, *_ in places]
    own_s = time_s if time_s.ndim == 1 else time_s[of_bay]
    damage = _numbers(respond(filled, own_s, pressure_pa[of_bay]))
    if peak_factor > 1.0:
        times_s, sharper_pa = peak_corrected(time_s, pressure_pa, peak_factor)
        damage = np.maximum(damage, _numbers(respond(filled, times_s, sharper_pa[of_bay])))
    of_bays: list[dict[str, float]] = [{} for _ in bays]
    for (index, name, _), value in zip(places, damage.tolist(), strict=True):
        of_bays[index][name] = value
    return tuple(
        BayDamage(bay.name, bay.structure, *_areas(bay), damages)
        for bay, damages in zip(bays, of_bays, strict=True)
    )


def _numbers(found: FacadeResponse) -> FloatArray:
    """Return the damage of bays with either windows or a wall panel (bays,)."""
    damage = np.zeros(len(found.bays))
    damage[found.glazed] = found.glazing.hazard
    damage[found.walled] = found.walls.damage
    return damage


class TriangularLoads:
    """Bays under triangular loads: a rough estimate without histories.

    Args:
        bays: The bays.
    """

    def __init__(self, bays: Sequence[Alternatives]) -> None:
        kinds: dict[object, int] = {}  # bays that respond alike have one number
        self._bays = [(kinds.setdefault(_kind(bay), len(kinds)), bay, _areas(bay)) for bay in bays]
        self._found: dict[tuple[int, float, float], dict[str, float]] = {}

    def damages(
        self,
        peak_pa: float | FloatArray,
        impulse_pa_s: float | FloatArray,
        peak_factor: float = 1.0,
    ) -> tuple[BayDamage, ...]:
        """Return the damage of the bays.

        Args:
            peak_pa: Peaks, reached at once, from which the pressure falls linearly to 0: of all
                bays (bays,), or a common one.
            impulse_pa_s: Impulses, which determine the durations, likewise.
            peak_factor: As for `bay_damages`.
        """
        loads = (np.broadcast_to(own, len(self._bays)) for own in (peak_pa, impulse_pa_s))
        peaks_pa, impulses_pa_s = (own.tolist() for own in loads)
        damages = self._under(peaks_pa, impulses_pa_s)
        if peak_factor > 1.0:
            sharper = self._under([peak_factor * own for own in peaks_pa], impulses_pa_s)
            damages = [
                {name: max(value, other[name]) for name, value in own.items()}
                for own, other in zip(damages, sharper, strict=True)
            ]
        return tuple(
            BayDamage(bay.name, bay.structure, *areas, damage)
            for (_, bay, areas), damage in zip(self._bays, damages, strict=True)
        )

    def _under(
        self, peaks_pa: Sequence[float], impulses_pa_s: Sequence[float]
    ) -> list[dict[str, float]]:
        """Return the damage of the components of each bay under its load."""
        # Bays that are alike respond alike under one load: each kind and load once.
        asked = [
            (kind, peak_pa, impulse_pa_s)
            for (kind, *_), peak_pa, impulse_pa_s in zip(
                self._bays, peaks_pa, impulses_pa_s, strict=True
            )
        ]
        if len(self._found) + len(asked) > _MOST_KEPT:  # a training meets ever new loads
            self._found.clear()
        new = {
            key: bay
            for key, (_, bay, _) in zip(asked, self._bays, strict=True)
            if key not in self._found
        }
        if new:
            loads = np.array([key[1:] for key in new])
            made = bay_damages([*new.values()], *triangle(loads[:, 0], loads[:, 1]))
            self._found.update({key: own.damage for key, own in zip(new, made, strict=True)})
        return [self._found[key] for key in asked]


_MOST_KEPT: Final = 20_000
"""Most loads of which responses are kept: some megabytes."""

_STATIC_S: Final = 0.5
"""Longest triangular load; longer ones have no further effect."""


def under_triangle(
    part: Pane | Panel, peak_pa: float | FloatArray, impulse_pa_s: float | FloatArray
) -> GlazingResponses | PanelResponses:
    """Return the responses of one pane or panel to triangular loads without a rise time.

    Args:
        peak_pa: Peaks of the loads (loads,), or of one.
        impulse_pa_s: Impulses, which determine the durations.
    """
    time_s, pressure_pa = triangle(peak_pa, impulse_pa_s)
    if isinstance(part, Panel):
        return panel_responses([part] * len(time_s), time_s, pressure_pa)
    return glazing_responses([part] * len(time_s), time_s, pressure_pa)


def triangle(
    peak_pa: float | FloatArray, impulse_pa_s: float | FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the times, s, and the histories of such loads (loads, 2) each."""
    peak_pa = np.atleast_1d(peak_pa)
    lasts_s = np.minimum(2.0 * np.atleast_1d(impulse_pa_s) / peak_pa, _STATIC_S)
    nothing = np.zeros(len(peak_pa))
    return np.column_stack([nothing, lasts_s]), np.column_stack([peak_pa, nothing])


def damage_numbers(found: GlazingResponses | PanelResponses) -> FloatArray:
    """Return the damage of panes or panels as numbers (loads,)."""
    return found.damage if isinstance(found, PanelResponses) else found.hazard


def _kind(bay: Alternatives) -> tuple[object, ...]:
    """Return what determines the response of a bay, besides the load."""
    height_m = next(iter((*bay.glazing.values(), *bay.wall.values()))).bay.height_m
    # Panes of one name may have the sizes of several facades.
    panes = ((name, filled.glazing) for name, filled in bay.glazing.items())
    panels = ((name, filled.wall) for name, filled in bay.wall.items())
    return round(height_m, 6), *panes, None, *panels


def _areas(bay: Alternatives) -> tuple[float, float]:
    """Return the area of a bay, and the largest area of panes of its components, m2."""
    filled = (*bay.glazing.values(), *bay.wall.values())
    glazed_m2 = max((other_glass.glazed_m2 for other_glass in filled), default=0.0)
    return filled[0].bay.area_m2, glazed_m2
