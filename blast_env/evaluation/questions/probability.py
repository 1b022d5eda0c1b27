"""The probability of a level of protection, and the part of each uncertain quantity in it.

Five quantities are uncertain, and drawn once for all charges and bays:

- the mass of each charge: normal, with bounds that the user gives as an interval of 95 %;
- the load: log-normal, with the scatter from test to test and the error of the engine;
- the cells: log-normal, with the grid convergence index as an interval of 95 %;
- the strength of a pane: the share of panes that are weaker is uniform, so that its breakage is
  that of `blast_env.response.glass`;
- the resistance of wall panels: log-normal.

No blast is run: histories are scaled (Hopkinson-Cranz). At the distance of each bay, Kingery and
Bulmash's reflected peak and impulse of both charges give the factors on the pressures and on the
times of its history. This leaves shielding and echoes as they are. Errors of the load multiply the
pressures, so that the impulse scatters as much as the peak.

Only the bays that can decide are drawn: of each component those with the largest damage, peak and
impulse. The response that counts is the worst of those with and without suction and with and
without sharper peaks, as in a verdict; which of them is found without draws.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isnan, log, nan, sqrt
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray, IntArray
from blast_env.curves import Load, normally_reflected
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas_validation import bay_places
from blast_env.evaluation.questions.grid_error import GridError, impulse_of
from blast_env.evaluation.questions.verdict import BuildingResponse, Consequences
from blast_env.response.components import Glazing, Wall
from blast_env.response.facade import LoadDraws, drawn_levels, pushes, rescaled, respond
from blast_env.response.levels import LevelOfProtection
from blast_env.response.sdof import impulses
from blast_env.site.blast_site import Charge
from blast_env.values import generator, whole_number

MASS_RANGE: Final = 1.3
"""Largest factor on the mass of a charge, and on its inverse, for which histories are scaled."""


def load_factors(
    charge: Charge,
    distance_m: FloatArray | float,
    other_kg: FloatArray | float,
    other_m: FloatArray | float,
) -> tuple[FloatArray, FloatArray]:
    """Return the factors on pressures and on times for another mass or distance.

    Distances are those from the charge and from the other one; the masses of the other one have a
    shape that broadcasts with them.
    """
    # Hopkinson and Cranz's scaling by the curves: the impulse is peak times duration, so the
    # duration takes what the peak leaves.
    old_m, old_kg, new_m, new_kg = np.broadcast_arrays(distance_m, charge.tnt_kg, other_m, other_kg)
    loads: tuple[Load, Load] = ("overpressure", "impulse")
    peaks, impulses = (
        normally_reflected(load, new_m, new_kg, charge.height_m)
        / normally_reflected(load, old_m, old_kg, charge.height_m)
        for load in loads
    )
    return peaks, impulses / peaks


def scaled_to(judged: Consequences, charge: Charge) -> Consequences:
    """Return the consequences of another charge for buildings with a facade, without a blast.

    It may be of another mass or at another place than the one charge of `judged`.
    """
    return Consequences(
        tuple(_scaled(response, charge) for response in judged.responses),
        unchecked=judged.unchecked,
        unjudged=judged.unjudged,
        unloaded=judged.unloaded,
    )


def _scaled(response: BuildingResponse, charge: Charge) -> BuildingResponse:
    assert response.site is not None
    # 1. The distance of each bay from the new place; 2. its history, stretched in pressure and time
    # by the ratio of the curves; 3. the response to that.
    facade, old = response.on_cells, response.site.charge
    site = replace(response.site, charge=charge)
    other_m = bay_places(site, [bay.bay for bay in facade.bays]).distance_m
    factors = load_factors(old, response.places.distance_m, charge.tnt_kg, other_m)
    histories = rescaled(facade.time_s, facade.pressure_pa, *factors)
    on_cells = respond(facade.bays, *histories)
    return replace(response, charge=charge, site=site, on_cells=on_cells, counted_peak_pa=nan)


DRAWS: Final = 1000
"""Default number of draws."""

_MOST_DRAWS: Final = 1_000_000

_DRIVERS: Final = ("charge", "load model", "cells", "glass", "panels")
_OF_INTERVAL: Final = 1.959964
_CLASSES: Final = 20
_OF_CLASS: Final = 2
"""Least draws in a class: of one, chance is not known."""

DECIDING: Final = 3
"""Default number of bays of each component that are drawn, by damage, by peak and by impulse."""


@dataclass(frozen=True)
class Uncertainty:
    """The uncertain quantities. Shares are standard deviations of logarithms, unless stated.

    Attributes:
        mass: Half the width of the 95 % interval of the masses of charges, as a share.
        scatter: Scatter of loads from test to test. Yang & Luo 2020 (J. Civil Environ. Eng. 42(2),
            115) find 0.13 to 0.20 for peaks at 1.5 to 6 m/kg^(1/3), the most for reflected ones.
        in_sight: Error of the engine on bays in sight of the charge: reflected impulses are within
            0.06 of Kingery and Bulmash's (docs/engineers/gas.md).
        in_shade: Its error on other bays: the spread of the experiments behind corners, 0.10 of
            0.57, among which its means are.
        cells: Half the width of the 95 % interval of the grid error, as a share.
        panels: Scatter of the resistance of wall panels; an assumption of this project.
    """

    mass: float = 0.1
    scatter: float = 0.2
    in_sight: float = 0.06
    in_shade: float = 0.18
    cells: float = 0.0
    panels: float = 0.15

    @classmethod
    def of(cls, mass: float, error: GridError | None) -> "Uncertainty":
        """Return the uncertain quantities with the grid error of the impulse, if known."""
        share = nan if error is None else error.of_load(impulse_of)
        return cls(mass=mass, cells=0.0 if isnan(share) else share)

    def __post_init__(self) -> None:
        """Check the shares."""
        for name, value in vars(self).items():
            if not 0.0 <= value < np.inf:
                raise BlastEnvError(f"{name} is {value}, must be at least 0")
        if self.mass > MASS_RANGE - 1.0 + 1e-9:
            raise BlastEnvError(f"mass is {self.mass}, must be at most 0.3: histories are scaled")


@dataclass(frozen=True, eq=False)
class LevelProbability:
    """Levels of protection of buildings in draws of the uncertain quantities.

    Attributes:
        levels: The lowest level of any building under any charge in each draw (draws,).
        quantiles: The quantile of each uncertain quantity, above 0 and below 1 (draws, 5).
    """

    levels: FloatArray
    quantiles: FloatArray

    def of(self, level: LevelOfProtection) -> float:
        """Return the probability that all buildings reach a level under every charge."""
        return float((self.levels >= level).mean())

    def drivers(self, level: LevelOfProtection) -> dict[str, float]:
        """Return the first-order index of each uncertain quantity, the largest first.

        It is the share of the variance of "the level is reached" that the quantity explains alone,
        from the means of 20 classes of it, or fewer so that each has two draws, less what chance
        leaves in them. Empty if the level is always reached, or never, or of fewer than four draws.
        """
        reached = (self.levels >= level).astype(np.float64)
        total = float(reached.var())
        count = min(_CLASSES, len(reached) // _OF_CLASS)
        if total == 0.0 or count < 2:
            return {}
        found: dict[str, float] = {}
        for name, quantile in zip(_DRIVERS, self.quantiles.T, strict=True):
            # First-order index: the variance of the class means over the whole variance, less what
            # means of so few draws vary by chance.
            classes = np.array_split(reached[np.argsort(quantile)], count)
            between = np.var([members.mean() for members in classes])
            chance = np.mean([members.var() / (len(members) - 1) for members in classes])
            found[name] = max(float(between - chance), 0.0) / total
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def words(self, level: LevelOfProtection) -> str:
        """Return the probability and what drives it: `medium with 0.84; driven by ...`."""
        text = f"{level.label!r} with {probability_text(self.of(level), len(self.levels))}"
        drivers = self.drivers(level).items()
        main = [f"{name} ({share:.1f})" for name, share in drivers if round(share, 1) > 0.0][:2]
        return f"{text}; driven by {' and '.join(main)}" if main else text


def probability_text(value: float, draws: int) -> str:
    """Return a probability as text; at an end, its bound of 95 % confidence.

    It is a share of some draws; of none, the bound is the probability with which as many draws all
    miss it in one case of twenty.
    """
    bound = 1.0 - 0.05 ** (1.0 / draws)
    if value >= 1.0:
        return f"more than {1.0 - bound:.3f}"
    if value <= 0.0:
        return f"less than {bound:.3f}"
    return f"{value:.3f}" if min(value, 1.0 - value) < 0.01 else f"{value:.2f}"


def level_probability(
    judged: Consequences,
    uncertainty: Uncertainty,
    draws: int = DRAWS,
    seed: int = 0,
    deciding: int = DECIDING,
) -> LevelProbability:
    """Return the levels of protection in draws of the uncertain quantities.

    `deciding` is the number of bays of each component that are drawn, by damage, by peak and by
    impulse.
    """
    draws = whole_number("draws", draws, 1, _MOST_DRAWS)
    deciding = whole_number("deciding", deciding, 1, _MOST_DRAWS)
    judged.check_judged()
    # 1. Quantiles of all uncertain quantities; 2. in each draw the lowest level of any deciding
    # bay: the level of a building is that of its worst bay.
    quantiles = _latin(draws, seed)
    levels = np.full(draws, int(LevelOfProtection.HIGH))
    for own in _deciding(judged.responses, deciding):
        own.lower(levels, uncertainty, quantiles)
    return LevelProbability(levels, quantiles)


def _latin(draws: int, seed: int) -> FloatArray:
    """Return a Latin hypercube of quantiles (draws, 5)."""
    rng = generator(seed)
    # Latin hypercube: each quantity has one draw in each of as many equal intervals, in random
    # order.
    order = np.argsort(rng.random((draws, len(_DRIVERS))), axis=0)
    return (order + rng.uniform(1e-6, 1.0 - 1e-6, order.shape)) / draws


@dataclass(frozen=True, eq=False)
class _Component:
    """A component of a bay under a charge."""

    response: BuildingResponse
    index: int
    is_window: bool
    damage: float
    peak_pa: float
    impulse_pa_s: float

    @property
    def kind(self) -> tuple[str, Glazing | Wall | None]:
        filled = self.response.on_cells.bays[self.index]
        return self.response.building, filled.glazing if self.is_window else filled.wall

    def lower(self, levels: IntArray, uncertainty: Uncertainty, quantiles: FloatArray) -> None:
        """Lower the level of protection of each draw to that by the component (draws,)."""
        from scipy.special import ndtri  # a quarter of a second to import

        # (1) Standard normal quantities; (2) the mass, within the range in which histories scale;
        # (3) the error of peaks, log-normal: scatter and engine in squares, then the grid; (4)
        # factors on peaks and durations; (5) the lowest level under the histories with and without
        # suction.
        normal = np.clip(ndtri(quantiles), -4.0, 4.0)
        mass = 1.0 + uncertainty.mass / _OF_INTERVAL * normal[:, 0]
        mass = np.clip(mass, 1.0 / MASS_RANGE, MASS_RANGE)
        places = self.response.places
        engine = uncertainty.in_sight if places.seen[self.index] else uncertainty.in_shade
        error = np.exp(sqrt(log(1.0 + uncertainty.scatter**2) + engine**2) * normal[:, 1])
        error *= np.exp(uncertainty.cells / _OF_INTERVAL * normal[:, 2])
        charge, away_m = self.response.charge, places.distance_m[self.index]
        peaks, durations = load_factors(charge, away_m, mass * charge.tnt_kg, away_m)
        draws = LoadDraws(
            error * peaks,
            durations,
            quantiles[:, 3],
            np.exp(uncertainty.panels * normal[:, 4]),
        )
        facade = self.response.on_cells
        filled = facade.bays[self.index]
        for pressure_pa, factor in self._histories:
            (left,) = np.nonzero(levels > LevelOfProtection.BELOW_STANDARDS)  # the lowest stay so
            if not left.size:
                return
            sharper = draws.sharper(factor, left)
            found = drawn_levels(filled, self.is_window, facade.time_s, pressure_pa, sharper)
            levels[left] = np.minimum(levels[left], found)

    @property
    def _histories(self) -> list[tuple[FloatArray, float]]:
        """The histories with and without suction, each with the factors on its peak.

        The worst one differs from draw to draw.
        """
        facade, own_pa = self.response.on_cells, self.response.on_cells.pressure_pa[self.index]
        pushed_pa = pushes(facade.time_s, own_pa[np.newaxis])[0]
        factors = {max(self.response.peak_factor, 1.0), 1.0}
        return [(history_pa, factor) for history_pa in (pushed_pa, own_pa) for factor in factors]


def _deciding(responses: Sequence[BuildingResponse], count: int) -> Iterator[_Component]:
    """Yield the components that can decide: of each kind, those with the largest numbers."""
    # Draws move all components of a kind alike, so the worst few of it decide; which one is worst
    # may differ between short and long loads, hence three orders.
    kinds: dict[object, list[_Component]] = {}
    for response in responses:
        facade = response.facade
        peaks_pa = facade.pressure_pa.max(axis=1)
        impulses_pa_s = impulses(facade.time_s, facade.pressure_pa).max(axis=1)
        parts = ((facade.glazed, facade.glazing.hazard), (facade.walled, facade.walls.damage))
        for is_window, (rows, damage) in zip((True, False), parts, strict=True):
            for index, number in zip(rows.astype(int).tolist(), damage.tolist(), strict=True):
                loads = float(peaks_pa[index]), float(impulses_pa_s[index])
                component = _Component(response, index, is_window, number, *loads)
                kinds.setdefault(component.kind, []).append(component)
    for own in kinds.values():
        kept: dict[int, _Component] = {}
        for name in ("damage", "peak_pa", "impulse_pa_s"):
            largest = sorted(own, key=lambda component: -float(getattr(component, name)))
            kept |= {id(component): component for component in largest[:count]}
        yield from kept.values()
