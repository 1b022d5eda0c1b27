"""Threats: the blasts that layouts are compared on."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.physics.scene import Charge
from blast_env.scenario import Scenario
from blast_env.scenario.build_scene import draw_charge


@dataclass(frozen=True)
class Threat:
    """One blast that may happen, whatever stands in its way.

    Two layouts that meet the same threat meet the same charge, fan and air: the difference
    between their loads is then due to the layouts alone (common random numbers).

    Attributes:
        charge: The charge.
        seed: Decides the fan and the air.
    """

    charge: Charge
    seed: int

    def __post_init__(self) -> None:
        """Make the values plain Python numbers, so that a threat can be a key and be written.

        Raises:
            BlastEnvError: If the seed is not an integer of at least 0, or the charge is not a
                pair of coordinates and a mass.
        """
        try:
            (x_m, y_m), tnt_kg = self.charge
            charge = Charge((float(x_m), float(y_m)), float(tnt_kg))
        except (TypeError, ValueError):
            raise BlastEnvError(
                f"charge is {self.charge!r}, must be ((x, y) in m, kg of TNT)"
            ) from None
        object.__setattr__(self, "charge", charge)
        object.__setattr__(self, "seed", _seed(self.seed, "seed"))


def draw_threats(scenario: Scenario, seeds: Iterable[int]) -> tuple[Threat, ...]:
    """Return one threat a seed, its charge drawn from the scenario as `simulate` draws it.

    Args:
        scenario: The scenario.
        seeds: At least one, none twice; each is the seed of its blast as well.

    Raises:
        BlastEnvError: If there are no seeds, or one is repeated, negative or no integer.
    """
    plain = [_seed(seed, f"seeds[{index}]") for index, seed in enumerate(seeds)]
    if not plain:
        raise BlastEnvError("seeds: there are none, must be at least one")
    for index, seed in enumerate(plain):
        if seed in plain[:index]:
            raise BlastEnvError(f"seeds[{index}] is {seed}, is there already: must be none twice")
    return tuple(Threat(draw_charge(scenario, seed), seed) for seed in plain)


def _seed(seed: int, place: str) -> int:
    """Return a seed as a plain integer; `place` says where it came from."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
        raise BlastEnvError(f"{place} is {seed!r}, must be an integer")
    if seed < 0:
        raise BlastEnvError(f"{place} is {seed}, must be at least 0")
    return int(seed)
