"""The section of a scenario that sets the parameters of the blast model."""

from collections.abc import Mapping
from itertools import chain
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, Field, ValidationError

from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.presets import PRESETS, preset
from blast_env.scenario.problems import (
    Problem,
    ScenarioError,
    problems_from,
    unknown_key,
    unknown_name,
)
from blast_env.scenario.sections import Section
from blast_env.scenario.wording import type_word


def _check_preset(name: str) -> str:
    """Refuse the name of a preset that does not exist."""
    if name not in PRESETS:
        raise ScenarioError("preset", [Problem("", unknown_name("preset", name, PRESETS))])
    return name


def _check_overrides(overrides: dict[str, Any]) -> dict[str, Any]:
    """Refuse overrides of parameters that do not exist and values out of bounds."""
    groups = (_group_problems(group, values) for group, values in overrides.items())
    problems = tuple(chain.from_iterable(groups))
    if problems:
        raise ScenarioError("overrides", problems)
    return overrides


def _group_problems(group: str, values: object) -> tuple[Problem, ...]:
    """Return what is wrong with the overrides of one group of parameters."""
    field = SimulationParameters.model_fields.get(group)
    if field is None:
        return (unknown_key((group,), SimulationParameters.model_fields),)
    model = field.annotation
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        raise TypeError(f"SimulationParameters.{group} is not a group of parameters")
    if not isinstance(values, Mapping):
        return (Problem(group, f"is {type_word(values)}, must be a table"),)
    try:
        # A group's values are independent of each other and all have defaults, so the overrides
        # can be checked alone and every complaint is about a key that was written.
        model.model_validate(values, strict=True)
    except ValidationError as error:
        return problems_from(error, model, (group,))
    return ()


class SimulationSection(Section):
    """The blast model's parameters: a preset by name, and what differs from it.

    Attributes:
        preset: Name of one of `blast_env.physics.presets.PRESETS`.
        overrides: Nested like `SimulationParameters`: `{"air": {"spacing_units": 3.0}}`.
    """

    preset: Annotated[str, AfterValidator(_check_preset)] = "ballistic"
    overrides: Annotated[dict[str, Any], AfterValidator(_check_overrides)] = Field(
        default_factory=dict
    )

    @property
    def parameters(self) -> SimulationParameters:
        """The preset with the overrides applied."""
        return with_overrides(preset(self.preset), self.overrides)
