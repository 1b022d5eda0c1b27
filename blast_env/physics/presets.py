"""Named sets of simulation parameters."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from blast_env.errors import UnknownNameError
from blast_env.physics.parameters import SimulationParameters

PRESETS: Final[Mapping[str, SimulationParameters]] = MappingProxyType(
    {
        # Sparse air, as the paper's figures suggest: balls fly almost free between collisions.
        # v0, N, the radii, C_e and the 10 % and 30 % rules are the paper's or set beforehand;
        # air spacing, air mass and elasticity come from `scripts/search_ballistic.py`, which
        # matches the paper's UFC column and the shape of its own impulse-distance curve.
        "ballistic": SimulationParameters(),
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
