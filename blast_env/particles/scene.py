"""The scene of a particle engine: the site of a blast, its balls and their parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.geometry import TOLERANCE_M, Element, Rectangle
from blast_env.layout.build_site import build_site, random_streams
from blast_env.particles.balls import Balls, air_lattice, explosion_fan
from blast_env.particles.structure import ModularObstacle, obstacle_of
from blast_env.problems import Problem, ScenarioError
from blast_env.site import AnyCharge, PointSource, Scenario
from blast_env.site.blast_site import BlastSite, Charge, StructureOutline
from blast_env.site.parameters import SimulationParameters, for_charge
from blast_env.site.zone import distance_m
from blast_env.units import UNITS_PER_M, in_units


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene(BlastSite):
    """The initial state of one blast by particles; the balls are in simulation units.

    Attributes:
        balls: All balls; air first, then the charge.
        parameters: Parameters of the blast model for this charge.
    """

    balls: Balls
    parameters: SimulationParameters

    @cached_property
    def site(self) -> Rectangle:
        """The simulated area, units."""
        return self.site_m.scaled(UNITS_PER_M)

    @cached_property
    def charge_centre(self) -> tuple[float, float]:
        """Centre of the charge, units."""
        return in_units(self.charge.position_m)

    @cached_property
    def impulse_quantum(self) -> float:
        """The power of two, simulation units, of which every recorded impulse is a multiple.

        It is about 2^-36 of the largest initial momentum, which is negligible. Sums of recorded
        impulses, up to 2^17 such momenta, are then exact in any order and partition: the rewards
        of an episode add up to the impulse of the blast.
        """
        momentum = self.balls.mass * np.hypot(*self.balls.velocity.T)
        return float(2.0 ** (np.ceil(np.log2(momentum.max())) - 36))

    @property
    def largest_exact_impulse(self) -> float:
        """Bound below which sums of recorded impulses are exact, simulation units."""
        return self.impulse_quantum * 2.0**53

    def round_impulse(self, impulse: float) -> float:
        """Return an impulse rounded to a multiple of the quantum."""
        return round(impulse / self.impulse_quantum) * self.impulse_quantum

    def obstacles(self) -> tuple[ModularObstacle, ...]:
        """Return new obstacles without hits, in the order of `structures`."""
        return tuple(map(obstacle_of, self.structures))


def build_scene(
    scenario: Scenario,
    layout: Sequence[Element] = (),
    seed: int = 0,
    charge: AnyCharge | None = None,
) -> Scene:
    """Return the scene of one blast by particles, which is two-dimensional.

    Args:
        layout: (row, column) of the build-zone cells with a barrier module, or pieces.
        seed: Seed of the charge (if the scenario has several), the fan's phase and the air's
            jitter. None of them depends on the barrier.
        charge: The charge, instead of one drawn from the scenario.

    Raises:
        LayoutError: If the layout does not fit the build zone, or the charge.
        ScenarioError: If the charge is not clear of a structure or the border, or is over a roof:
            without heights it would be inside the structure; or a structure begins above the
            ground, or is a terrace.
        BlastEnvError: If the mass of the charge is out of bounds of the parameters.
        ValueError: If the seed is negative.
    """
    base = build_site(scenario, layout, seed, charge, with_zone=False)
    if any(structure.base_m or structure.carries for structure in scenario.structures):
        scenario.check_for_particles()
    _check_not_over_a_roof(scenario, base.charge)
    try:
        parameters = for_charge(scenario.parameters, base.charge.tnt_kg)
    except BlastEnvError as error:
        message = f"{scenario.name}: charge: {error}; engine 'gas' takes this charge"
        raise BlastEnvError(message) from error
    # Separate streams for charge, fan and air: a barrier or another fan leaves the air as it is.
    _, fan_rng, air_rng = random_streams(seed)
    centre = in_units(base.charge.position_m)
    air = air_lattice(
        parameters.air,
        base.site_m.scaled(UNITS_PER_M),
        _solid_rectangles(base.structures),
        centre,
        parameters.explosive.offset_units + parameters.explosive.radius_units,
        air_rng,
    )
    fan = explosion_fan(parameters.explosive, centre, fan_rng)
    return Scene(
        site_m=base.site_m,
        charge=base.charge,
        balls=Balls.concatenate((air, fan)),
        structures=base.structures,
        gauges=base.gauges,
        air_height_m=base.air_height_m,
        parameters=parameters,
    )


def _check_not_over_a_roof(scenario: Scenario, charge: Charge) -> None:
    """Refuse a raised charge that is inside a structure in plan."""
    if charge.height_m == 0.0:
        return
    x_m, y_m = charge.position_m
    place = PointSource.at(charge)
    for structure in scenario.structures:
        # In plan a charge on a roof lies inside the building.
        away_m = min(distance_m(place, box) for box in structure.boxes_m)
        if away_m < scenario.charge_radius_m - TOLERANCE_M:
            message = (
                f"is at ({x_m:g}, {y_m:g}) m, {charge.height_m:g} m high, over {structure.name!r}"
                f" of {structure.height_m:g} m: the particle engines know no heights and would put"
                " it inside, must be clear of it in plan, or the engine one with heights"
            )
            raise ScenarioError(scenario.name, [Problem("charge", message)])


def _solid_rectangles(structures: Sequence[StructureOutline]) -> list[Rectangle]:
    """Return rectangles that cover the modules, in simulation units."""
    rectangles: list[Rectangle] = []
    for outline in structures:
        if not outline.is_barrier:
            rectangles.extend(box.scaled(UNITS_PER_M) for box in outline.boxes_m)
        else:
            rectangles.extend(part.rectangle for part in obstacle_of(outline).parts)
    return rectangles
