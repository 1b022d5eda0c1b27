"""The loads that one blast puts on the structures."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from blast_env.calibration.model import Calibration
from blast_env.geometry import Element
from blast_env.physics.engine import Engine
from blast_env.physics.structure import ModularObstacle
from blast_env.scenario import AnyCharge, AnyScenario, ObjectiveSection, Scenario, find_scenario
from blast_env.simulation import BlastResult
from blast_env.units import PA_PER_PSI

if TYPE_CHECKING:
    from blast_env.simulation.gas import GasResult


@dataclass(frozen=True)
class StructureLoad:
    """The load on one structure.

    Attributes:
        name: Name of the structure.
        protected: Whether its load counts.
        weight: How much it counts among the protected structures.
        impulse_sim: Sum of m |v| over the collisions, simulation units.
        transferred_impulse_sim: Momentum really transferred, simulation units.
        impulse_psi_s: Calibrated impulse per area, psi*s.
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
    impulse_psi_s: float
    peak_pa: float | None
    peak_weight: float
    in_range: bool
    notes: tuple[str, ...]

    @property
    def impulse_pa_s(self) -> float:
        """Calibrated impulse per area, Pa*s."""
        return self.impulse_psi_s * PA_PER_PSI


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
        impulses = np.array([load.impulse_psi_s for load in self.structures])
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
    def protected_impulse_psi_s(self) -> float:
        """Calibrated impulses of the protected structures, by weight, added up, psi*s."""
        return sum(load.weight * load.impulse_psi_s for load in self.protected)

    @property
    def protected_impulse_pa_s(self) -> float:
        """Calibrated impulses of the protected structures, by weight, added up, Pa*s."""
        return self.protected_impulse_psi_s * PA_PER_PSI

    @property
    def protected_impulse_sim(self) -> float:
        """Impulses of the protected structures, by weight, added up, simulation units."""
        return sum(load.weight * load.impulse_sim for load in self.protected)

    @property
    def protected_peak_pa(self) -> float:
        """The largest overpressure on any wall of a protected structure, Pa; NaN for particles."""
        peaks = [load.peak_pa for load in self.protected]
        return max((np.nan if peak is None else peak for peak in peaks), default=0.0)

    def counted(self, objective: ObjectiveSection) -> float:
        """Return the load of the protected structures as rewards are paid: psi s, psi or no unit.

        Args:
            objective: Says which load counts.
        """
        return sum(
            objective.counted(
                load.impulse_psi_s, load.peak_pa or 0.0, load.weight, load.peak_weight
            )
            for load in self.protected
        )

    def load(self, objective: ObjectiveSection) -> float:
        """Return the load of the protected structures in the unit of the objective."""
        return objective.in_si(self.counted(objective))

    @property
    def in_range(self) -> bool:
        """Whether the calibration was made for this distance to every protected structure."""
        return all(load.in_range for load in self.protected)


@runtime_checkable
class LoadModel(Engine, Protocol):
    """An engine that tells loads without running a blast; it has no noise and no calibration."""

    def loads(self, scenario: Scenario, layout: Sequence[Element], charge: AnyCharge) -> BlastLoads:
        """Return the loads behind a layout; peaks where the scenario's objective counts them.

        Args:
            scenario: The scenario.
            layout: A legal layout.
            charge: What goes off: where it does, or the vehicle that brings it.
        """


def blast_loads(result: BlastResult, calibration: Calibration) -> BlastLoads:
    """Return the loads of a blast.

    Args:
        result: The blast.
        calibration: The calibration of its scenario, checked against parameters and engine.
    """
    structures = [obstacle for obstacle in result.obstacles if obstacle.cells is None]
    impulse = [part.impulse for obstacle in structures for part in obstacle.parts]
    return BlastLoads(
        structures=tuple(_structure_load(result, each, calibration) for each in structures),
        module_impulse_sim=np.array(impulse, dtype=np.float64),
    )


def gas_loads(result: "GasResult") -> BlastLoads:
    """Return the loads of a blast of gas dynamics, which has no simulation units (NaN)."""
    table = result.structures
    structures = []
    peak_weights = {
        each.name: each.counted_peak_weight for each in result.blast.scenario.structures
    }
    for row in table.to_dict("records"):
        scaled = result.impulse(row["structure"])
        structures.append(
            StructureLoad(
                name=row["structure"],
                protected=row["protected"],
                weight=row["weight"],
                impulse_sim=np.nan,
                transferred_impulse_sim=np.nan,
                impulse_psi_s=scaled.psi_s,
                peak_pa=float(row["peak_pa"]),
                peak_weight=peak_weights[row["structure"]],
                in_range=scaled.in_range,
                notes=scaled.notes,
            )
        )
    return BlastLoads(tuple(structures), result.module_impulse_n_s)


def _structure_load(
    result: BlastResult, obstacle: ModularObstacle, calibration: Calibration
) -> StructureLoad:
    scaled = result.impulse(obstacle.name, calibration)
    return StructureLoad(
        name=obstacle.name,
        protected=obstacle.protected,
        weight=obstacle.weight,
        impulse_sim=obstacle.impulse,
        transferred_impulse_sim=obstacle.transferred_impulse,
        impulse_psi_s=scaled.psi_s,
        peak_pa=None,
        peak_weight=obstacle.weight,
        in_range=scaled.in_range,
        notes=scaled.notes,
    )
