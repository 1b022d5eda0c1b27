"""The same air and charge made of smaller or larger balls."""

from math import sqrt

from blast_env.errors import BlastEnvError
from blast_env.physics.parameters import (
    BallParameters,
    ContactParameters,
    SimulationParameters,
    with_overrides,
)


def with_resolution(parameters: SimulationParameters, factor: float) -> SimulationParameters:
    """Return parameters for the same air and the same charge, with balls 1 / `factor` the size.

    What a layout feels stays: the mass of the air per area, its packing fraction, the mass and
    the energy of the charge. What happens per collision is softened, because a way of the same
    length meets `factor` times as many: the loss of energy (1 - restitution), the shrinking of
    explosive balls at air, and the base impulse. Sizes in metres do not change: a module stays
    0.5 m and a charge stays where it is.

    Args:
        parameters: What to start from.
        factor: Above 1 for finer balls; the number of air balls grows with its square, the time
            of a blast with about its cube.

    Raises:
        BlastEnvError: If balls so large would lose more in a collision than there is.
        pydantic.ValidationError: If another value gets out of bounds.
    """
    air, explosive, contact = parameters.air, parameters.explosive, parameters.contact
    count = round(explosive.ball_count * factor)
    return with_overrides(
        parameters,
        {
            "air": {
                "radius_units": air.radius_units / factor,
                "spacing_units": air.spacing_units / factor,
                "mass": air.mass / factor**2,
                "elasticity": softened_elasticity(air, factor),
            },
            "explosive": {
                "radius_units": explosive.radius_units / factor,
                "ball_count": count,
                "mass": explosive.mass * explosive.ball_count / count,
                "elasticity": softened_elasticity(explosive, factor),
            },
            "contact": {
                "air_shrink": softened_air_shrink(contact, factor),
                "minimum_radius_units": contact.minimum_radius_units / factor,
                "base_impulse": contact.base_impulse / factor**3,
            },
        },
    )


def softened_elasticity(of_kind: BallParameters, factor: float) -> float:
    """Return the elasticity with which two balls of a kind lose 1 / `factor` as much.

    Raises:
        BlastEnvError: If they would lose more than there is: then `factor` is too small.
    """
    loss = 1.0 - of_kind.elasticity**2
    if loss > factor:
        raise BlastEnvError(
            f"balls 1 / {factor:.3g} the size would lose {loss / factor:.3g} of a collision's "
            f"approach, must be at most 1: with elasticity {of_kind.elasticity:g} a ball may grow "
            f"by a factor of at most {1.0 / loss:.3g}"
        )
    return sqrt(1.0 - loss / factor)


def softened_air_shrink(contact: ContactParameters, factor: float) -> float:
    """Return the shrinking of which `factor` times as many make the same."""
    return float(contact.air_shrink ** (1.0 / factor))
