"""What the surrogate predicts: loads of layouts with their spreads, and what follows from them."""

from collections.abc import Sequence
from math import isnan, nan
from typing import Any, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.geometry import Element
from blast_env.response.levels import BayDamage
from blast_env.surrogate.walls import SurrogateSite


class Guess(NamedTuple):
    """Predicted loads of layouts.

    Attributes:
        impulse_pa_s: Mean impulse on each protected structure, NaN if no air touches its assessed
            walls (layouts, structures).
        spread: Standard deviation of its logarithm among the members (layouts, structures).
        peak_pa: Largest overpressure on each protected structure, NaN as of the impulse (layouts,
            structures); `None` if the objective counts no peaks.
        peak_spread: Standard deviation of its logarithm among the members (layouts, structures).
        on_bays: The same of the bays of all structures, the loads by which facades respond, in the
            order of `SurrogateSite.alternatives`; `None` if the response does not count.
        peak_factors: What makes these peaks as sharp as in the open, against the charge of each
            layout (layouts,); see `response.facade.peak_factor`.
    """

    impulse_pa_s: FloatArray
    spread: FloatArray
    peak_pa: FloatArray | None = None
    peak_spread: FloatArray | None = None
    on_bays: "Guess | None" = None
    peak_factors: FloatArray | None = None

    def loads(self, site: SurrogateSite, layouts: Sequence[Sequence[Element]] = ()) -> FloatArray:
        """Return the load of each layout, in the objective's unit (layouts,).

        That of a building is the mean over the area of its parts. It is NaN if a building has no
        load. If the objective counts the response of facades, each bay has a triangular load with
        its own predicted impulse and peak, or a sharper one, as by gas dynamics. The peak is the
        largest one on the bay, not that of the mean over it.

        Args:
            site: The site of the prediction.
            layouts: The layouts; required if the objective counts the response of facades.
        """
        load, structures = site.scenario.objective.load, site.protected
        if site.scenario.objective.is_response:
            return np.array(
                [self._response(site, index, layout) for index, layout in enumerate(layouts)]
            )
        peak_pa = np.zeros_like(self.impulse_pa_s) if self.peak_pa is None else self.peak_pa
        both = np.stack(site.of_buildings(self.impulse_pa_s, peak_pa), axis=2).tolist()
        return np.array(
            [
                sum(
                    load(impulse, peak, structure.weight, structure.counted_peak_weight)
                    for structure, (impulse, peak) in zip(structures, of_layout, strict=True)
                )
                for of_layout in both
            ]
        )

    def without(self, hidden: BoolArray) -> "Guess":
        """Return no loads, which are NaN, on hidden structures (layouts, structures)."""
        impulse_pa_s = np.where(hidden, nan, self.impulse_pa_s)
        peak_pa = None if self.peak_pa is None else np.where(hidden, nan, self.peak_pa)
        return self._replace(impulse_pa_s=impulse_pa_s, peak_pa=peak_pa)

    def bays(self, site: SurrogateSite, index: int) -> tuple[BayDamage, ...]:
        """Return the damage of the bays behind a layout, by its index, under triangular loads."""
        loads = self._bay_loads(index)
        found: list[BayDamage] = []
        for structure, on_it_pa_s in zip(site.protected, self.impulse_pa_s[index], strict=True):
            if not isnan(on_it_pa_s):
                found += site.bay_damages(structure.name, *loads)
        return tuple(found)

    def _response(self, site: SurrogateSite, index: int, layout: Sequence[Element]) -> float:
        assert self.peak_pa is not None
        loads = self._bay_loads(index)
        # A building without a load has no response. A part of another one counts as 0.
        of_buildings, _ = site.of_buildings(self.impulse_pa_s[index : index + 1], self.peak_pa[:1])
        if np.isnan(of_buildings).any():
            return nan
        return sum(
            structure.weight * site.response(structure.name, layout, *loads)
            for structure, on_it_pa_s in zip(site.protected, self.impulse_pa_s[index], strict=True)
            if not isnan(on_it_pa_s)
        )

    def _bay_loads(self, index: int) -> tuple[FloatArray, FloatArray, float]:
        """Return peaks, Pa, and impulses, Pa s, on bays (bays,), and the factor on the peaks."""
        assert self.on_bays is not None
        assert self.on_bays.peak_pa is not None
        assert self.peak_factors is not None
        factor = float(self.peak_factors[index])
        return self.on_bays.peak_pa[index], self.on_bays.impulse_pa_s[index], factor


def guess_of(loads: Sequence[FloatArray], columns: slice) -> Guess:
    """Return some columns of impulses, their spreads and, if there are any, the same of peaks."""
    impulse_pa_s, spread, *of_peaks = (own[:, columns] for own in loads)
    if not of_peaks:
        return Guess(impulse_pa_s, spread)
    peak_pa, peak_spread = of_peaks
    return Guess(impulse_pa_s, spread, peak_pa, peak_spread)


def joined(made: Sequence[Guess], order: IntArray) -> Guess:
    """Return the guess of all layouts of several guesses, in another order."""

    def whole(parts: Sequence[Any]) -> Any:
        if parts[0] is None:
            return None
        return joined(parts, order) if isinstance(parts[0], Guess) else np.concatenate(parts)[order]

    return Guess(*(whole(parts) for parts in zip(*made, strict=True)))
