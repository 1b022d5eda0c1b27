"""The parameters of a blast with another charge than the reference charge."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from pydantic import ValidationError

from blast_env.errors import BlastEnvError
from blast_env.physics.parameters import ChargeScaling, SimulationParameters, with_overrides
from blast_env.physics.resolution import softened_air_shrink, softened_elasticity


def for_charge(parameters: SimulationParameters, tnt_kg: float) -> SimulationParameters:
    """Return the parameters of a blast with a charge of a given mass.

    Args:
        parameters: Parameters for `explosive.reference_tnt_kg`; `explosive.charge_scaling` says
            how another charge follows from them.
        tnt_kg: TNT-equivalent mass of the charge.

    Returns:
        The parameters for `tnt_kg`, which is their `reference_tnt_kg`.

    Raises:
        BlastEnvError: If a parameter gets out of bounds, because the charge is too small or too
            large for such balls.
    """
    ratio = tnt_kg / parameters.explosive.reference_tnt_kg
    if ratio == 1.0:
        return parameters
    try:
        scaled = _SCALINGS[parameters.explosive.charge_scaling](parameters, ratio)
        return with_overrides(scaled, {"explosive": {"reference_tnt_kg": tnt_kg}})
    except (ValidationError, BlastEnvError) as error:
        raise BlastEnvError(
            f"tnt_kg is {tnt_kg:g}: the parameters, which are for "
            f"{parameters.explosive.reference_tnt_kg:g} kg, do not reach so far: {_reason(error)}"
        ) from error


def _reason(error: ValidationError | BlastEnvError) -> str:
    if isinstance(error, BlastEnvError):
        return str(error)
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    return f"{key} would be {first['input']:g} ({first['msg']})"


def _with_mass(parameters: SimulationParameters, ratio: float) -> SimulationParameters:
    """Return the same fan of balls with other masses."""
    return with_overrides(parameters, {"explosive": {"mass": parameters.explosive.mass * ratio}})


def _hopkinson_cranz(parameters: SimulationParameters, ratio: float) -> SimulationParameters:
    """Return the reference blast enlarged geometrically, with balls as small as before.

    Enlarged by the cube root of `ratio`: lengths and times grow with it, speeds and densities
    stay, and so the mass of the charge in the plane grows with its square. The balls do not grow:
    in comparison with the blast they are finer, as in `resolution.with_resolution`, and what they
    lose in a collision is less. Nor does the circle on which the charge's balls start, which is no
    larger than a few of them.
    """
    scale = ratio ** (1.0 / 3.0)
    air, explosive, contact = parameters.air, parameters.explosive, parameters.contact
    count = max(1, round(explosive.ball_count * scale))
    return with_overrides(
        parameters,
        {
            "air": {"elasticity": softened_elasticity(air, scale)},
            "explosive": {
                "ball_count": count,
                "mass": explosive.mass * explosive.ball_count * scale**2 / count,
                "elasticity": softened_elasticity(explosive, scale),
            },
            "contact": {
                "air_shrink": softened_air_shrink(contact, scale),
                "base_impulse": contact.base_impulse / scale,
            },
            "stepping": {"time_limit_s": parameters.stepping.time_limit_s * scale},
        },
    )


_SCALINGS: Final[
    Mapping[ChargeScaling, Callable[[SimulationParameters, float], SimulationParameters]]
] = MappingProxyType({"mass": _with_mass, "hopkinson_cranz": _hopkinson_cranz})
