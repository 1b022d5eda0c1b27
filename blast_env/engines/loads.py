"""The loads that one blast puts on the structures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blast_env.scenario import AnyScenario, ObjectiveSection, find_scenario


@dataclass(frozen=True)
class StructureLoad:
    """The load on one structure.

    Attributes:
        name: Name of the structure.
        protected: Whether its load counts.
        weight: How much it counts among the protected structures.
        impulse_sim: Sum of m |v| over the collisions, simulation units.
        transferred_impulse_sim: Momentum really transferred, simulation units.
        impulse_pa_s: Impulse per area, calibrated where the engine needs that, Pa*s.
        peak_pa: Largest overpressure on its walls, Pa; `None` for particles, which know none.
        peak_weight: How much that counts among the protected structures.
        in_range: Whether the calibration was made for this distance and charge.
        notes: Why not, a sentence each.
    """

    name: str
    protected: bool
    weight: float
    impulse_sim: float
    transferred_impulse_sim: float
    impulse_pa_s: float
    peak_pa: float | None
    peak_weight: float
    in_range: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class BlastLoads:
    """The loads of one blast on all structures; the barrier is none.

    Attributes:
        structures: One load a structure, in the order of the scene.
        module_impulse_sim: Sum of m |v| on each module of the structures, in the order of the
            scene, simulation units (modules,); for gas dynamics the momentum on its walls, N s.
    """

    structures: tuple[StructureLoad, ...]
    module_impulse_sim: NDArray[np.float64]

    def are_for(self, scenario: AnyScenario) -> bool:
        """Return whether these can be loads of a scenario: finite, one a structure and module."""
        structures = find_scenario(scenario).structures
        names = [structure.name for structure in structures]
        modules = sum(structure.rows * structure.columns for structure in structures)
        impulses = np.array([load.impulse_pa_s for load in self.structures])
        return (
            [load.name for load in self.structures] == names
            and self.module_impulse_sim.shape == (modules,)
            and bool(np.isfinite(impulses).all() and np.isfinite(self.module_impulse_sim).all())
        )

    @property
    def protected(self) -> tuple[StructureLoad, ...]:
        """The loads on the protected structures."""
        return tuple(load for load in self.structures if load.protected)

    @property
    def protected_impulse_pa_s(self) -> float:
        """Impulses of the protected structures, by weight, added up, Pa*s."""
        return sum(load.weight * load.impulse_pa_s for load in self.protected)

    @property
    def protected_impulse_sim(self) -> float:
        """Impulses of the protected structures, by weight, added up, simulation units."""
        return sum(load.weight * load.impulse_sim for load in self.protected)

    @property
    def protected_peak_pa(self) -> float:
        """The largest overpressure on any wall of a protected structure, Pa; NaN for particles."""
        peaks = [load.peak_pa for load in self.protected]
        return max((np.nan if peak is None else peak for peak in peaks), default=0.0)

    def load(self, objective: ObjectiveSection) -> float:
        """Return the load of the protected structures in the unit of the objective.

        Args:
            objective: Says which load counts.
        """
        return sum(
            objective.load(load.impulse_pa_s, load.peak_pa or 0.0, load.weight, load.peak_weight)
            for load in self.protected
        )

    @property
    def in_range(self) -> bool:
        """Whether the calibration was made for this distance to every protected structure."""
        return all(load.in_range for load in self.protected)
