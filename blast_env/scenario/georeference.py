"""Where on a map or drawing a site lies, so that a layout can be put back there."""

from typing import Annotated, Literal

from pydantic import Field, StrictFloat

from blast_env.scenario.sections import FOR_PEOPLE, Section

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
        crs: Coordinate reference system in which layouts go back to the map, as pyproj reads it:
            `EPSG:4326` (longitude, latitude), `EPSG:25832`.
    """

    kind: Literal["map"] = "map"
    longitude_deg: Degrees
    latitude_deg: Annotated[StrictFloat, Field(ge=-89.0, le=89.0)]
    crs: Annotated[str, Field(min_length=1, max_length=500), FOR_PEOPLE] = "EPSG:4326"


class DrawingGeoreference(Georeference):
    """The place of a site in a drawing whose place on the Earth nobody said.

    Attributes:
        x_m: The site's lower left corner along the drawing's x axis, in metres.
        y_m: The same along y.
        metres_per_unit: Length of the drawing's unit: 0.001 for millimetres.
    """

    kind: Literal["drawing"] = "drawing"
    x_m: Annotated[StrictFloat, Field(ge=-1e9, le=1e9)]
    y_m: Annotated[StrictFloat, Field(ge=-1e9, le=1e9)]
    metres_per_unit: Annotated[StrictFloat, Field(gt=0.0, le=1e6)] = 1.0


AnyGeoreference = Annotated[MapGeoreference | DrawingGeoreference, Field(discriminator="kind")]
