"""Parts of a scenario: gauges, simulation, georeference."""

from collections.abc import Mapping
from functools import cached_property
from itertools import chain
from typing import Annotated, Any, Final, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    StrictFloat,
    StrictInt,
    ValidationError,
)

from blast_env.errors import type_word
from blast_env.problems import (
    Problem,
    ScenarioError,
    problems_from,
    unknown_key,
    unknown_name,
)
from blast_env.sections import FOR_PEOPLE, Coordinate, Name, Section
from blast_env.site.parameters import PRESETS, SimulationParameters, preset, with_overrides

Count = Annotated[StrictInt, Field(ge=1, le=1000)]

MOST_MODULES: Final = 250_000
"""Most modules of a scene: 250 m x 250 m of buildings, which add 2 s to a blast."""


class GaugeSection(Section):
    """A gauge of overpressure in the air.

    Attributes:
        name: Name in tables and pictures.
        position_m: X, y, and height above the ground.
    """

    name: Name
    position_m: tuple[Coordinate, Coordinate, Coordinate]


def _check_preset(name: str) -> str:
    """Refuse the name of a preset that does not exist."""
    if name not in PRESETS:
        raise ScenarioError("preset", [Problem("", unknown_name("preset", name, PRESETS))])
    return name


PresetName = Annotated[str, AfterValidator(_check_preset)]
"""Name of a preset of the particle model."""


def _check_overrides(overrides: dict[str, Any]) -> dict[str, Any]:
    """Refuse overrides of unknown parameters, and values out of bounds."""
    groups = (_group_problems(group, values) for group, values in overrides.items())
    problems = tuple(chain.from_iterable(groups))
    if problems:
        raise ScenarioError("overrides", problems)
    return overrides


def _group_problems(group: str, values: object) -> tuple[Problem, ...]:
    """Return the problems of the overrides of one group of parameters."""
    field = SimulationParameters.model_fields.get(group)
    if field is None:
        return (unknown_key((group,), SimulationParameters.model_fields),)
    model = field.annotation
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        raise TypeError(f"SimulationParameters.{group} is not a group of parameters")
    if not isinstance(values, Mapping):
        return (Problem(group, f"is {type_word(values)}, must be a table"),)
    try:
        # A group's values are independent and have defaults, so the overrides can be checked
        # alone, and every problem concerns a given key.
        model.model_validate(values, strict=True)
    except ValidationError as error:
        return problems_from(error, model, (group,))
    return ()


class SimulationSection(Section):
    """The particle model's parameters: a preset by name, with overrides.

    Attributes:
        preset: A name in `blast_env.site.parameters.PRESETS`.
        overrides: Nested like `SimulationParameters`: `{"air": {"spacing_units": 3.0}}`.
    """

    preset: PresetName = "ballistic"
    overrides: Annotated[dict[str, Any], AfterValidator(_check_overrides)] = Field(
        default_factory=dict
    )

    @cached_property
    def parameters(self) -> SimulationParameters:
        """The preset with the overrides applied."""
        return with_overrides(preset(self.preset), self.overrides)


Degrees = Annotated[StrictFloat, Field(ge=-180.0, le=180.0)]


class Georeference(Section):
    """Base of the georeferences.

    Attributes:
        rotation_deg: From east, or the drawing's x axis, to the site's x axis, counterclockwise.
    """

    rotation_deg: Degrees = 0.0


class MapGeoreference(Georeference):
    """The place of a site on the Earth.

    The site's metres are those of a transverse Mercator projection around its lower left corner
    (WGS 84, scale 1): true lengths to within 1e-7 over 2 km, and true north there.

    Attributes:
        longitude_deg: Longitude of the site's lower left corner, WGS 84.
        latitude_deg: Its latitude.
        crs: Coordinate reference system of layouts exported to the map, as pyproj reads it:
            `EPSG:4326` (longitude, latitude), `EPSG:25832`.
    """

    kind: Literal["map"] = "map"
    longitude_deg: Degrees
    latitude_deg: Annotated[StrictFloat, Field(ge=-89.0, le=89.0)]
    crs: Annotated[str, Field(min_length=1, max_length=500), FOR_PEOPLE] = "EPSG:4326"


class DrawingGeoreference(Georeference):
    """The place of a site in a drawing without a place on the Earth.

    Attributes:
        x_m: The site's lower left corner along the drawing's x axis, in metres.
        y_m: The same along y.
        metres_per_unit: Length of the drawing's unit: 0.001 for millimetres.
    """

    kind: Literal["drawing"] = "drawing"
    x_m: Annotated[StrictFloat, Field(ge=-1e9, le=1e9)]
    y_m: Annotated[StrictFloat, Field(ge=-1e9, le=1e9)]
    metres_per_unit: Annotated[StrictFloat, Field(ge=1e-12, le=1e6)] = 1.0


AnyGeoreference = Annotated[MapGeoreference | DrawingGeoreference, Field(discriminator="kind")]
