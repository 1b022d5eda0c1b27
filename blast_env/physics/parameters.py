"""The parameters of the blast model (paper, sections 2.3 to 2.8), with units and bounds.

Every default is the `ballistic` preset's value; `blast_env.physics.presets` gives the reasons.
"""

import json
from collections.abc import Mapping
from hashlib import sha256
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0, le=1e9, allow_inf_nan=False)]
ChargeScaling = Literal["mass", "hopkinson_cranz"]


class Parameters(BaseModel):
    """Base of all parameter groups: frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class BallParameters(Parameters):
    """Properties of one kind of ball (section 2.5).

    Attributes:
        mass: Mass, simulation mass units.
        radius_units: Radius, simulation units (4 units are 1 m).
        elasticity: Chipmunk multiplies the two elasticities of a contact: 0.8 on both is a
            restitution of 0.64.
        friction: Coulomb friction; multiplied over the two sides of a contact as well.
        inertia_factor: Moment of inertia as a multiple of m r^2; 0.5 is a solid disc.
    """

    mass: Annotated[float, Field(ge=1e-6, le=1e6)]
    radius_units: Annotated[float, Field(ge=0.01, le=100.0)]
    elasticity: Fraction
    friction: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    inertia_factor: Annotated[float, Field(ge=0.01, le=1.0)] = 0.5


class ExplosiveParameters(BallParameters):
    """The charge: a fan of `ExplosionBall`s (section 2.3).

    Attributes:
        ball_count: N, the number of balls at the angles 2 pi i / N.
        speed_units_per_s: v0, the radial speed that every ball starts with.
        offset_units: Distance of the ball centres from the charge's centre at the start.
        fan_phase: `"random"` turns the whole fan by an angle drawn from the seed; `"fixed"` does
            not turn it.
        collide_within_charge: Whether balls of one charge collide with each other.
        thermal_share: Share of the kinetic energy that is random in direction at the start,
            beside the radial part; 0 in the paper's model. Particle blast methods give their
            detonation products such a part, for their pressure.
        reference_tnt_kg: The TNT-equivalent mass that all parameters stand for.
        charge_scaling: What follows for another charge (`charge_scaling.for_charge`). The
            specific energy of TNT is a constant, so v0 stays. `"mass"`: the mass of the balls is
            proportional to the charge's. `"hopkinson_cranz"`: the blast is the reference blast
            enlarged by the cube root of the charge's mass, with balls of the same size; charge
            mass in the plane, number of balls, losses in collisions and the time limit follow.
    """

    mass: Annotated[float, Field(ge=1e-6, le=1e6)] = 1.0
    radius_units: Annotated[float, Field(ge=0.01, le=100.0)] = 1.0
    elasticity: Fraction = 0.74
    ball_count: Annotated[int, Field(ge=1, le=100_000)] = 720
    speed_units_per_s: Annotated[float, Field(gt=0.0, le=1e6)] = 2000.0
    offset_units: Annotated[float, Field(ge=0.0, le=1000.0)] = 1.0
    fan_phase: Literal["fixed", "random"] = "random"
    collide_within_charge: bool = False
    thermal_share: Fraction = 0.0
    reference_tnt_kg: Positive = 100.0
    charge_scaling: ChargeScaling = "mass"


class AirParameters(BallParameters):
    """The air: `AirBall`s on a square lattice (section 2.3).

    Attributes:
        spacing_units: Distance between neighbours; 0 means no air at all.
        jitter: How far a seed may move each ball off its lattice point, as a fraction of the
            gap that keeps neighbours apart, (spacing - 2 radius) / 2; 0 is the bare lattice.
        lattice_offset: `"random"` shifts the whole lattice by less than a spacing, drawn from the
            seed; `"centred"` keeps it centred in the site. A lattice that lies the same way in
            every blast leaves free lanes, always to the same modules.
    """

    mass: Annotated[float, Field(ge=1e-6, le=1e6)] = 0.79
    radius_units: Annotated[float, Field(ge=0.01, le=100.0)] = 1.0
    elasticity: Fraction = 0.74
    spacing_units: Annotated[float, Field(ge=0.0, le=1e6)] = 11.5
    jitter: Fraction = 1.0
    lattice_offset: Literal["centred", "random"] = "random"


class ContactParameters(Parameters):
    """What a collision does beside the rebound (section 2.4).

    Attributes:
        module_restitution: C_e, the restitution of a ball's contact with a `ModularPart`.
        module_friction: Friction of a `ModularPart`, multiplied with the ball's.
        module_shrink: Factor on radius and mass of an explosive ball that hits a module; the
            paper's "scaled by 30 %" is read as reduced by 30 %.
        air_shrink: Factor on radius and mass of an explosive ball that hits an air ball.
        minimum_radius_units: r_min; an explosive ball that shrinks below it is removed.
        base_impulse: I_b, mass units times units per second, which any two balls get along the
            normal of a new contact, equal and opposite.
    """

    module_restitution: Fraction = 0.5
    module_friction: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    module_shrink: Annotated[float, Field(gt=0.0, le=1.0)] = 0.7
    air_shrink: Annotated[float, Field(gt=0.0, le=1.0)] = 0.9
    minimum_radius_units: Annotated[float, Field(ge=1e-3, le=100.0)] = 0.1
    base_impulse: Annotated[float, Field(ge=0.0, le=1e9)] = 0.0


class SteppingParameters(Parameters):
    """How the motion is integrated and when it ends.

    Attributes:
        step_radii: Distance that the fastest ball may cover in one step, in radii of the
            smallest ball (or half modules, if those are smaller).
        longest_step_s: Bound of the time step, however slow the balls are.
        solver_iterations: Iterations of Chipmunk's contact solver.
        time_limit_s: Simulated time after which the run ends in any case; that of the reference
            charge, where `explosive.charge_scaling` is `"hopkinson_cranz"`.
        contact_time_s: Event engine: collisions of a ball that follow each other within this time
            are one contact, which loses energy only once. It stands for the time that a real
            contact lasts, and keeps pressed balls from colliding infinitely often.
        most_collisions: Event engine: collisions after which the run ends in any case.
    """

    step_radii: Annotated[float, Field(ge=0.01, le=0.5)] = 0.5
    longest_step_s: Annotated[float, Field(ge=1e-7, le=1.0)] = 0.002
    solver_iterations: Annotated[int, Field(ge=1, le=100)] = 10
    time_limit_s: Annotated[float, Field(gt=0.0, le=60.0)] = 2.0
    contact_time_s: Annotated[float, Field(ge=1e-9, le=0.01)] = 1e-6
    most_collisions: Annotated[int, Field(ge=1, le=10**12)] = 100_000_000


class SimulationParameters(Parameters):
    """All parameters of the blast model."""

    explosive: ExplosiveParameters = ExplosiveParameters()
    air: AirParameters = AirParameters()
    contact: ContactParameters = ContactParameters()
    stepping: SteppingParameters = SteppingParameters()


ENGINE_SETTINGS: Final[Mapping[str, frozenset[str]]] = MappingProxyType(
    {
        "pymunk": frozenset({"step_radii", "longest_step_s", "solver_iterations"}),
        "event": frozenset({"contact_time_s", "most_collisions"}),
    }
)
"""Settings in `SteppingParameters` that one engine alone heeds."""


def parameters_digest(parameters: SimulationParameters, engine: str) -> str:
    """Return the SHA-256 of all parameters that an engine heeds; a calibration is bound to it."""
    content = parameters.model_dump(mode="json")
    for name, settings in ENGINE_SETTINGS.items():
        if name != engine:
            for setting in settings:
                del content["stepping"][setting]
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def with_overrides(
    parameters: SimulationParameters, overrides: Mapping[str, Any]
) -> SimulationParameters:
    """Return `parameters` with some values replaced.

    Args:
        parameters: The parameters to start from.
        overrides: Nested like `SimulationParameters`: `{"air": {"spacing_units": 3.0}}`.

    Raises:
        pydantic.ValidationError: If a key is unknown or a value is out of bounds.
    """
    merged = parameters.model_dump()
    for group, values in overrides.items():
        if isinstance(values, Mapping) and isinstance(merged.get(group), dict):
            merged[group] = {**merged[group], **values}
        else:
            merged[group] = values
    return SimulationParameters.model_validate(merged)
