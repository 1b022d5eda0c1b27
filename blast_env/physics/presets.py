"""Sets of parameters: presets, finer resolutions, other masses of charge."""

from collections.abc import Callable, Mapping
from math import sqrt
from types import MappingProxyType
from typing import Final

from pydantic import ValidationError

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.physics.parameters import (
    BallParameters,
    ChargeScaling,
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


# Dense, slightly dissipative air, in which a blast diffracts round walls. Found by a
# search over distance law, shielding and cost, for balls of radius 1; the presets have finer ones.
_COLLISIONAL_AIR: Final = with_overrides(
    SimulationParameters(),
    {
        "explosive": {
            "mass": 0.8,
            "ball_count": 900,
            "elasticity": 0.98894,
            "thermal_share": 0.75,
            "charge_scaling": "hopkinson_cranz",
        },
        "air": {"mass": 0.0614, "spacing_units": 3.82, "elasticity": 0.98894},
        "contact": {"module_restitution": 0.9, "air_shrink": 0.91},
        "stepping": {"time_limit_s": 1.0},
    },
)


PRESETS: Final[Mapping[str, SimulationParameters]] = MappingProxyType(
    {
        # Sparse air, as the paper's figures suggest: balls fly almost free between collisions.
        # v0, N, the radii, C_e and the 10 % and 30 % rules are the paper's or set beforehand;
        # air spacing, air mass and elasticity come from `python -m studies.ballistic search`, and
        # match the paper's UFC column and the shape of its own impulse-distance curve.
        "ballistic": SimulationParameters(),
        # Balls of 0.2 m radius: coarse, and affordable in training.
        "collisional": with_resolution(_COLLISIONAL_AIR, 1.25),
        # The same air and charge with balls of half the size.
        "collisional_fine": with_resolution(_COLLISIONAL_AIR, 2.5),
    }
)


def preset(name: str) -> SimulationParameters:
    """Return the parameters of a preset.

    Args:
        name: One of `PRESETS`.

    Raises:
        UnknownNameError: If there is no such preset; the message names the nearest one.
    """
    if name not in PRESETS:
        raise UnknownNameError("preset", name, PRESETS)
    return PRESETS[name]


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
