"""How an environment was made, as plain data, so that its specification survives JSON."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from gymnasium.envs.registration import EnvSpec

from blast_env.scenario import Scenario


class PlainSpec:
    """A mixin for environments: keeps the arguments of `gymnasium.make` as plain data.

    A scenario becomes its document, a path becomes text. Whatever else is no plain data stays as
    it is, and `EnvSpec.to_json` refuses it.
    """

    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """What `gymnasium.make` made the environment from; `None` if it was made otherwise."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            kwargs = {name: _plain(value) for name, value in spec.kwargs.items()}
            spec = replace(spec, kwargs=kwargs)
        self._spec = spec


def _plain(value: Any) -> Any:
    if isinstance(value, Scenario):
        return value.model_dump(mode="json", exclude_none=True)
    return str(value) if isinstance(value, Path) else value
