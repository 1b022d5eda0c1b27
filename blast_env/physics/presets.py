"""Named sets of simulation parameters."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from blast_env.errors import UnknownNameError
from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.resolution import with_resolution

# Dense, slightly dissipative air, in which a blast diffracts round walls. Found by
# `scripts/search_collisional.py` for balls of radius 1; the presets have finer ones.
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
        # air spacing, air mass and elasticity come from `scripts/search_ballistic.py`, which
        # matches the paper's UFC column and the shape of its own impulse-distance curve.
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
