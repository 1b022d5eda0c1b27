"""Pressure-time history of a facade, from the collisions with it.

The momentum that the particles really transfer to a facade, in bins of time and per area of the
facade, is a pressure; per metre of its length in the plane, and simulation units instead of Pa s
until a calibration gives the scale. It is the mean over seeds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
import pandas as pd

from blast_env.arrays import FloatArray
from blast_env.calibration.laws import checked_array
from blast_env.calibration.references import Friedlander, fit_friedlander
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.recording.tables import faces_hit
from blast_env.simulation import BlastResult
from blast_env.units import UNITS_PER_M

Face = Literal["left", "right", "bottom", "top"]
"""A facade of a structure, by the side that its normal points to."""

ARRIVAL_SHARE: Final = 0.05
"""Share of the peak pressure that a bin must pass for the blast to have arrived."""

DURATION_SHARE: Final = 0.95
"""Share of the impulse that comes within the positive duration."""

_MOST_BINS: Final = 10_000

_LEAST_BINS_FOR_FIT: Final = 4

_MOST_RUNNER_BINS: Final = 40


@dataclass(frozen=True, eq=False)
class PressureHistory:
    """The pressure on a facade over time.

    The unit of pressure is simulation impulse / (s m) where `scale` is None, else Pa.

    Attributes:
        structure: Name of the structure.
        face: The facade.
        length_m: Length of the facade in the plane.
        scale: Pa s per simulation impulse and metre that the pressures are multiplied with.
        edges_s: Edges of the bins, from the detonation (n + 1,).
        pressure_by_seed: Mean pressure in each bin, for each blast (seeds, n).
    """

    structure: str
    face: Face
    length_m: float
    scale: float | None
    edges_s: FloatArray
    pressure_by_seed: FloatArray

    @property
    def pressure(self) -> FloatArray:
        """Mean pressure over the seeds in each bin (n,)."""
        mean: FloatArray = self.pressure_by_seed.mean(axis=0)
        return mean

    @property
    def std_error(self) -> FloatArray:
        """Standard error of `pressure` (n,); NaN for a single seed."""
        return _std_error(self.pressure_by_seed)

    @property
    def impulse_by_seed(self) -> FloatArray:
        """Integral of the pressure over time (seeds,), unit of pressure times s."""
        return self.pressure_by_seed @ np.diff(self.edges_s)

    @property
    def impulse(self) -> float:
        """Integral of `pressure` over time: the transferred impulse per metre, times `scale`."""
        return float(self.impulse_by_seed.mean())

    @property
    def impulse_std_error(self) -> float:
        """Standard error of `impulse`; NaN for a single seed."""
        return float(_std_error(self.impulse_by_seed[:, None])[0])

    @property
    def peak(self) -> float:
        """Largest pressure of a bin; it depends on the width of the bins."""
        return float(self.pressure.max())

    @property
    def arrival_s(self) -> float:
        """Start of the first bin above `ARRIVAL_SHARE` of the peak; NaN without hits."""
        if self.peak == 0.0:
            return float("nan")
        return float(self.edges_s[self._arrival_bin])

    @property
    def positive_duration_s(self) -> float:
        """Time from the arrival until `DURATION_SHARE` of the impulse has come; NaN without hits.

        Particles only push, so the pressure has no zero to end at, and a single straggler must
        not stretch the duration. For a Friedlander wave it is 0.57 to 0.78 of t_2 (decay 3 to 0).
        """
        if self.peak == 0.0:
            return float("nan")
        come = np.cumsum(self.pressure * np.diff(self.edges_s))
        last = int(np.searchsorted(come, DURATION_SHARE * come[-1]))
        return float(self.edges_s[last + 1] - self.edges_s[self._arrival_bin])

    @property
    def _arrival_bin(self) -> int:
        return int(np.argmax(self.pressure > ARRIVAL_SHARE * self.peak))

    def friedlander(self) -> Friedlander:
        """Fit a Friedlander waveform (paper, equation 1).

        Least squares over arrival, peak, duration and decay, of the mean pressure in each bin
        from `arrival_s` on; all bins count alike. The arrival is the start of one of the bins up
        to the one of the peak: a particle front has runners ahead of it, a shock has none. The
        mean of the waveform over a bin is exact.

        Raises:
            BlastEnvError: If fewer than four bins have any pressure.
        """
        filled = int(np.count_nonzero(self.pressure))
        if filled < _LEAST_BINS_FOR_FIT:
            raise BlastEnvError(
                f"the {self.face} facade of {self.structure!r} was hit in {filled} bins of time, "
                f"must be at least {_LEAST_BINS_FOR_FIT} for a Friedlander fit: take shorter bins "
                "or more seeds"
            )
        first, last = self._arrival_bin, int(np.argmax(self.pressure))
        starts = range(max(first, last - _MOST_RUNNER_BINS), last + 1)
        edges_s, pressure = self.edges_s, self.pressure
        fits = (fit_friedlander(edges_s[start:], pressure[start:]) for start in starts)
        return min(fits, key=lambda wave: self._squared_error(wave, first))

    def _squared_error(self, wave: Friedlander, first: int) -> float:
        edges_s = self.edges_s[first:]
        means = np.diff(wave.impulse_until(edges_s)) / np.diff(edges_s)
        return float(((means - self.pressure[first:]) ** 2).sum())


def facade_history(
    results: Sequence[BlastResult],
    structure: str,
    face: Face,
    bin_s: float,
    scale: float | None = None,
) -> PressureHistory:
    """Return the pressure on a facade over time, as the mean over blasts.

    A hit on a corner counts on the facade that its normal points to the more, as a whole.

    Args:
        results: Blasts that differ in their seeds only.
        structure: Name of the structure; all blasts have it in the same place.
        face: The facade.
        bin_s: Width of the bins.
        scale: Pa s that one simulation impulse per metre of facade stands for, from a
            calibration; None leaves the simulation's unit.

    Raises:
        UnknownNameError: If there is no such structure or facade; names the nearest one.
        BlastEnvError: If there are no results, if the structure is not the same in all of them,
            has no facades (a barrier), or if a number is out of bounds.
    """
    if face not in get_args(Face):
        raise UnknownNameError("facade", face, get_args(Face))
    bin_width_s = float(checked_array("bin_s", bin_s, above=0.0, dimensions=0))
    if scale is not None:
        checked_array("scale", scale, above=0.0, dimensions=0)
    length_m = _facade_length_m(results, structure, face)
    hits = [_hits(result.collisions, structure, face) for result in results]
    end_s = max(max(result.time_s for result in results), *(_last(own) for own in hits))
    edges_s = _edges_s(end_s, bin_width_s)
    impulse = np.array([_impulse_in_bins(own, edges_s) for own in hits])
    pressure = (1.0 if scale is None else scale) / length_m * impulse / np.diff(edges_s)
    return PressureHistory(structure, face, length_m, scale, edges_s, pressure)


def _facade_length_m(results: Sequence[BlastResult], structure: str, face: Face) -> float:
    """Return the length of a facade that all blasts share."""
    if not len(results):
        raise BlastEnvError("results is empty, must have at least one blast")
    obstacles = [result.obstacle(structure) for result in results]
    if any(obstacle.cells is not None for obstacle in obstacles):
        raise BlastEnvError(f"structure {structure!r} is made of single cells: it has no facades")
    rectangle = obstacles[0].rectangle
    for index, obstacle in enumerate(obstacles):
        if obstacle.rectangle != rectangle:
            raise BlastEnvError(
                f"results[{index}]: structure {structure!r} is {obstacle.rectangle}, "
                f"must be {rectangle} as in results[0]"
            )
    if face in ("left", "right"):
        return (rectangle.top - rectangle.bottom) / UNITS_PER_M
    return (rectangle.right - rectangle.left) / UNITS_PER_M


def _hits(collisions: pd.DataFrame, structure: str, face: Face) -> pd.DataFrame:
    return collisions[(collisions["structure"] == structure) & (faces_hit(collisions) == face)]


def _impulse_in_bins(hits: pd.DataFrame, edges_s: FloatArray) -> FloatArray:
    """Return the transferred impulse in each bin (n,)."""
    in_bins, _ = np.histogram(hits["time_s"], edges_s, weights=hits["transferred_impulse_sim"])
    return in_bins


def _last(hits: pd.DataFrame) -> float:
    return float(hits["time_s"].max()) if len(hits) else 0.0


def _edges_s(end_s: float, bin_s: float) -> FloatArray:
    """Return the edges of bins from 0 to at least `end_s`."""
    if end_s / bin_s > _MOST_BINS:
        raise BlastEnvError(
            f"bin_s is {bin_s:g}, must be at least {end_s / _MOST_BINS:g} for a run of {end_s:g} s"
        )
    count = max(int(np.ceil(end_s / bin_s)), 1)
    edges_s: FloatArray = bin_s * np.arange(count + 1, dtype=np.float64)
    # The product may end a rounding before the last hit.
    edges_s[-1] = max(edges_s[-1], end_s)
    return edges_s


def _std_error(by_seed: FloatArray) -> FloatArray:
    """Return the standard error over the rows (seeds, n)."""
    seeds = len(by_seed)
    if seeds < 2:
        return np.full(by_seed.shape[1], np.nan)
    error: FloatArray = np.std(by_seed, axis=0, ddof=1) / np.sqrt(seeds)
    return error
