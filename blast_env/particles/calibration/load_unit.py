"""The unit of the loads of a blast by particles in tables and pictures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from blast_env.particles.calibration.model import structure_width_m
from blast_env.particles.objects import ModularObstacle
from blast_env.results import ScaledImpulse
from blast_env.site.blast_site import Charge
from blast_env.units import MODULE_SIDE_M

LOAD_LABEL: Final = "impulse per module (simulation units)"


@dataclass(frozen=True)
class LoadUnit:
    """Unit for displaying the loads of a blast by particles: Pa s with a calibration.

    A calibration converts the load on a whole structure. A module's load is its share of that by
    m|v| per metre of facade, with the factor of the protected structure of the largest load.

    Attributes:
        factor: Factor from a module's m|v| to the unit.
        label: Label of a module's load, with the unit.
        of_structures: The loads on the structures that were hit, by name.
    """

    factor: float = 1.0
    label: str = LOAD_LABEL
    of_structures: Mapping[str, "LoadCalibration"] = field(default_factory=dict)

    @property
    def is_calibrated(self) -> bool:
        """Whether the unit is Pa s."""
        return bool(self.of_structures)

    @classmethod
    def of(
        cls,
        obstacles: Sequence[ModularObstacle],
        charge: Charge,
        convert: Callable[[ModularObstacle], ScaledImpulse],
    ) -> "LoadUnit":
        """Return the unit for a blast and the blasts compared with it.

        Simulation units if no structure was hit.

        Args:
            obstacles: The obstacles after the blast; barriers are ignored.
            charge: The charge.
            convert: Returns the impulse per area on a structure.
        """
        structures = [obstacle for obstacle in obstacles if not obstacle.is_barrier]
        protected = [obstacle for obstacle in structures if obstacle.protected] or structures
        main = max(protected, key=lambda obstacle: obstacle.impulse)
        if main.impulse == 0.0:
            return cls()
        loads = {
            structure.name: LoadCalibration(structure.impulse, convert(structure))
            for structure in structures
            if structure.impulse > 0.0
        }
        width_m = structure_width_m(main, charge.position_m)
        factor = loads[main.name].factor * width_m / MODULE_SIDE_M
        return cls(factor, f"impulse per module (Pa s, calibrated on {main.name})", loads)

    def with_loads_of(self, other: "LoadUnit") -> "LoadUnit":
        """Return this unit for modules with the loads on structures of another blast.

        A law need not be linear, so that the factors of a structure's load differ between blasts.
        """
        return replace(self, of_structures={**self.of_structures, **other.of_structures})

    def factor_of(self, structure: str) -> float | None:
        """Return the factor from m|v| on a structure to Pa s; `None` without a calibrated load."""
        load = self.of_structures.get(structure)
        return None if load is None else load.factor

    def of_structure(self, obstacle: ModularObstacle) -> str:
        """Return the current load on a structure as text, with the unit."""
        factor = self.factor_of(obstacle.name)
        if factor is None:
            return f"{obstacle.impulse:,.0f} (sim)"
        return f"{factor * obstacle.impulse:,.0f} Pa s"


@dataclass(frozen=True)
class LoadCalibration:
    """The calibrated load on a structure.

    Attributes:
        impulse_sim: Sum of m |v|, simulation units.
        scaled: Impulse per area, and whether it is within the calibration's range.
    """

    impulse_sim: float
    scaled: ScaledImpulse

    @property
    def factor(self) -> float:
        """Factor from m |v| to Pa s."""
        return self.scaled.pa_s / self.impulse_sim
