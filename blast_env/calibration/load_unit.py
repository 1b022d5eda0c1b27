"""In what unit the loads of a blast of particles are shown."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from blast_env.calibration.model import ScaledImpulse, seen_width_m
from blast_env.physics.scene import Charge
from blast_env.physics.structure import ModularObstacle
from blast_env.units import MODULE_SIDE_M

LOAD_LABEL: Final = "impulse per module (simulation units)"


@dataclass(frozen=True)
class LoadUnit:
    """In what unit the loads of a blast of particles are shown: Pa s where a calibration gives it.

    A calibration converts the load on a whole structure. A module's is its share of that, by m|v|
    a metre of facade, with the factor of the protected structure that is loaded most.

    Attributes:
        factor: From a module's m|v| to the unit.
        label: What a module's load is, with the unit.
        of_structures: The load on each structure in the unit, by its name; those that were hit.
    """

    factor: float = 1.0
    label: str = LOAD_LABEL
    of_structures: Mapping[str, "CalibratedLoad"] = field(default_factory=dict)

    @property
    def is_calibrated(self) -> bool:
        """Whether it is Pa s."""
        return bool(self.of_structures)

    @classmethod
    def of(
        cls,
        obstacles: Sequence[ModularObstacle],
        charge: Charge,
        convert: Callable[[ModularObstacle], ScaledImpulse],
    ) -> "LoadUnit":
        """Return the unit for a blast and those that are compared with it.

        Simulation units if nothing was hit.

        Args:
            obstacles: The structures after the blast, perhaps with a barrier.
            charge: The charge.
            convert: Gives the impulse per area on a structure.
        """
        structures = [obstacle for obstacle in obstacles if obstacle.cells is None]
        protected = [obstacle for obstacle in structures if obstacle.protected] or structures
        main = max(protected, key=lambda obstacle: obstacle.impulse)
        if main.impulse == 0.0:
            return cls()
        loads = {
            each.name: CalibratedLoad(each.impulse, convert(each))
            for each in structures
            if each.impulse > 0.0
        }
        width_m = seen_width_m(main.rectangle_m, charge.position_m)
        factor = loads[main.name].factor * width_m / MODULE_SIDE_M
        return cls(factor, f"impulse per module (Pa s, calibrated on {main.name})", loads)

    def with_loads_of(self, other: "LoadUnit") -> "LoadUnit":
        """Return this unit of modules with the loads on structures of another blast.

        A law need not be linear, so each blast has its own factor of a structure's load.
        """
        return replace(self, of_structures={**self.of_structures, **other.of_structures})

    def factor_of(self, structure: str) -> float | None:
        """Return the factor from m|v| on a structure to Pa s, None where there is none."""
        load = self.of_structures.get(structure)
        return None if load is None else load.factor

    def of_structure(self, obstacle: ModularObstacle) -> str:
        """Return the load on a structure so far, in words."""
        factor = self.factor_of(obstacle.name)
        if factor is None:
            return f"{obstacle.impulse:,.0f} (sim)"
        return f"{factor * obstacle.impulse:,.0f} Pa s"


@dataclass(frozen=True)
class CalibratedLoad:
    """The load on a structure through a calibration.

    Attributes:
        impulse_sim: Sum of m |v|, simulation units.
        scaled: The same per area, and whether the calibration was made for it.
    """

    impulse_sim: float
    scaled: ScaledImpulse

    @property
    def factor(self) -> float:
        """From m |v| to Pa s."""
        return self.scaled.pa_s / self.impulse_sim
