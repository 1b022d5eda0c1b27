"""The first, spherical stage of a blast before the grid takes over.

The solver's recorders begin when the charge is mapped onto the grid, with its front already at
some distance. They miss the front at points nearer to the charge.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blast_env.gas.source import GasCharge

_RADII: Final = 240

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SphericalStage:
    """Overpressure over time and distance from the charge until the grid takes over.

    Attributes:
        centre_m: Centre of the blast: x, y, and height above the ground.
        end_s: Time at which the grid takes over.
        front_m: Radius of the front at that time.
        time_s: Times (steps,).
        radius_m: Distances, from the surface of the charge to the front (n,).
        overpressure_pa: Overpressures (steps, n).
    """

    centre_m: tuple[float, float, float]
    end_s: float
    front_m: float
    time_s: Floats
    radius_m: Floats
    overpressure_pa: Floats

    def at(self, time_s: float, distance_m: ArrayLike) -> Floats:
        """Return the overpressures at distances at a time, Pa, 0 beyond the front.

        Within the charge they are those at its surface.
        """
        step = max(int(np.searchsorted(self.time_s, time_s, side="right")) - 1, 0)
        return self._over_distance(self.overpressure_pa[step], distance_m)

    def overpressures_pa(self, distance_m: ArrayLike) -> Floats:
        """Return the overpressures over time at distances, Pa (steps, n)."""
        distances_m = np.atleast_1d(np.asarray(distance_m, dtype=np.float64))
        return np.stack([self._over_distance(row, distances_m) for row in self.overpressure_pa])

    def peak_pa(self, distance_m: ArrayLike) -> Floats:
        """Return the largest overpressures of the stage at distances, Pa, 0 beyond the front."""
        return self._over_distance(self.overpressure_pa.max(axis=0, initial=0.0), distance_m)

    def impulses_pa_s(self, distance_m: ArrayLike) -> tuple[Floats, Floats]:
        """Return the running impulses at the end of the stage and their maxima in it, Pa s."""
        # Left sums: each overpressure holds until the next time, the last one until the end.
        step_s = np.diff(self.time_s, append=self.end_s)
        running = np.cumsum(step_s[:, np.newaxis] * self.overpressure_pa, axis=0)
        return (
            self._over_distance(running[-1], distance_m),
            self._over_distance(running.max(axis=0, initial=0.0), distance_m),
        )

    def _over_distance(self, values: Floats, distance_m: ArrayLike) -> Floats:
        return np.interp(np.asarray(distance_m), self.radius_m, values, right=0.0)


@lru_cache(maxsize=4)
def spherical_stage(charge: GasCharge, radius_m: float) -> SphericalStage:
    """Compute the first stage of a blast, in somewhat less than a second.

    Args:
        radius_m: Radius of the front at which the grid takes over.
    """
    # 1. The blast at the time when the grid takes over: where its front is, and when.
    profile = charge.profile(radius_m)
    # 2. The same blast once more, recorded between the surface of the charge and that front.
    surface_m = charge.least_radius_m * (1.0 + 1e-9)
    radii = np.linspace(surface_m, max(profile.front_m, surface_m), _RADII)
    blast = charge.explosive.in_free_air(charge.free_air_kg, radii)
    if profile.time_s > 0.0:
        blast.advance(until_s=profile.time_s)
    history = blast.history
    if not len(history):
        history = np.zeros((1, 1 + _RADII))
    x_m, y_m, z_m = charge.position_m
    centre_m = (x_m, y_m, 0.0 if charge.on_ground else z_m)
    return SphericalStage(
        centre_m, profile.time_s, profile.front_m, history[:, 0], radii, history[:, 1:]
    )
