"""The options of an import."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.option_fields import option
from blast_env.units import MODULE_SIDE_M

PlaceXY = tuple[float, float]

_PLACE: Final = (
    "In the coordinates of the file: longitude and latitude, or as --crs or a drawing has them."
)

CALIBRATIONS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "ballistic": "ballistic_kb_100kg",
        "collisional": "collisional_kb",
        "collisional_fine": "collisional_fine_kb",
    }
)
"""The stored calibration of each preset of the particle model."""

MOST_SITE_M: Final = 2000.0
"""Longest side of a site in a scenario file, m."""

_BOUNDS: Final[Mapping[str, tuple[float, float]]] = MappingProxyType(
    {
        "margin_m": (0.0, MOST_SITE_M),
        "rotation_deg": (-180.0, 180.0),
        "zone_around_m": (MODULE_SIDE_M, MOST_SITE_M),
        "wall_height_m": (MODULE_SIDE_M, MOST_SITE_M),
        "default_height_m": (MODULE_SIDE_M, MOST_SITE_M),
        "level_height_m": (1.0, 100.0),
        "least_area_m2": (MODULE_SIDE_M**2, 1e6),
        "tnt_kg": (0.01, 100_000.0),
        "clearance_m": (0.0, MOST_SITE_M),
    }
)


@dataclass(frozen=True)
class ImportOptions:
    """The options of an import; places are in the coordinates of the file.

    Raises:
        BlastEnvError: If a value is out of bounds, or two options exclude each other.
    """

    name: str | None = option(None, "Name of the scenario.")
    origin: PlaceXY | None = option(None, f"The site's lower left corner. {_PLACE}", metavar="X,Y")
    centre: PlaceXY | None = option(None, "The site's middle, instead of --origin.", metavar="X,Y")
    size_m: PlaceXY | None = option(
        None,
        "The site's extents, m.",
        metavar="WIDTH,HEIGHT",
        show_default="as much as everything in the file needs",
    )
    margin_m: float = option(10.0, "Ground around everything without --size, m.")
    rotation_deg: float | None = option(
        None,
        "Direction of the site's x axis, degrees from east, counterclockwise.",
        show_default="that of most walls",
    )
    crs: str | None = option(
        None,
        "Reference system of the coordinates: EPSG:25832, or local for plain metres.",
        show_default="that of the GeoJSON file, else EPSG:4326; none for DXF",
    )
    units: str | None = option(None, "Unit of a drawing: m, mm, cm, dm, km, in, ft.")
    buildings_from: tuple[str, ...] = option(
        (), "Features that are buildings: KEY, KEY=VALUE, or a layer of a drawing."
    )
    charges_from: tuple[str, ...] = option(
        (), "Where charges may be, named in the same way.", show_default="streets, car parks"
    )
    zone_from: tuple[str, ...] = option((), "Where barriers may stand, named in the same way.")
    keep_outs_from: tuple[str, ...] = option((), "Areas to be kept empty, named in the same way.")
    protect: tuple[str, ...] = option((), "Name of a building whose load counts.")
    protect_near: PlaceXY | None = option(
        None, "Protect the building nearest to this.", metavar="X,Y"
    )
    tnt_kg: float = option(100.0, "Mass of the charges, kg TNT.", metavar="KG")
    charge_at: tuple[PlaceXY, ...] = option((), "A further place of a charge.", metavar="X,Y")
    zone_m: tuple[float, float, float, float] | None = option(
        None, "The build zone, site metres.", metavar="LEFT,BOTTOM,WIDTH,HEIGHT"
    )
    zone_around_m: float | None = option(None, "Width of a zone around the protected buildings, m.")
    stock: int = option(20, "Modules that there are to place.", min=1)
    wall_height_m: float = option(3.0, "Height of the modules, m.")
    clearance_m: float = option(1.0, "Least distance of modules from structures, m.", min=0.0)
    preset: str = option("collisional", "Parameters of the particle model.")
    height_from: str | None = option(None, "Property with the height.")
    default_height_m: float | None = option(
        None,
        "Height of buildings without one, m.",
        show_default="guessed from neighbours and kind",
    )
    low_heights: bool = option(False, "Take the low guess of heights that the file does not have.")
    level_height_m: float = option(3.0, "Height of a storey, m.")
    least_area_m2: float = option(4.0, "Leave out smaller buildings, m2.")
    repair: bool = option(False, "Put outlines right that cross themselves.")
    strict: bool = option(False, "Refuse a file where anything was guessed or left out.")

    def __post_init__(self) -> None:
        """Check the options; see the class for the errors."""
        for name, (low, high) in _BOUNDS.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise BlastEnvError(f"{_option(name)} is {value:g}, must be {low:g} to {high:g}")
        if self.preset not in CALIBRATIONS:
            raise UnknownNameError("preset", self.preset, CALIBRATIONS)
        for side_m in self.size_m or ():
            if not 2.0 <= side_m <= MOST_SITE_M:
                raise BlastEnvError(f"--size is {side_m:g}, must be 2 to {MOST_SITE_M:g} m")
        _refuse_both("--origin", self.origin, "--centre", self.centre)
        _refuse_both("--zone", self.zone_m, "--zone-around", self.zone_around_m)
        _refuse_both("--zone-from", self.zone_from or None, "--zone", self.zone_m)
        _refuse_both("--zone-from", self.zone_from or None, "--zone-around", self.zone_around_m)
        for flag, place in (("--origin", self.origin), ("--centre", self.centre)):
            if place is not None and self.size_m is None:
                raise BlastEnvError(f"{flag} needs --size: how large the site is to be")
        if self.size_m is not None and self.origin is None and self.centre is None:
            raise BlastEnvError("--size needs --origin or --centre: where the site is to be")


def _option(name: str) -> str:
    """Return the command-line option of a value."""
    for suffix in ("_m2", "_m", "_deg"):
        name = name.removesuffix(suffix)
    return f"--{name.replace('_', '-')}"


def _refuse_both(one: str, value: object, other: str, other_value: object) -> None:
    if value is not None and other_value is not None:
        raise BlastEnvError(f"{one} and {other} exclude each other")


def plain(title: str) -> str:
    """Return a title with `_` for spaces, as in the names of a scenario."""
    return "_".join(title.split())
