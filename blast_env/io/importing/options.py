"""The options of an import, and lengths as maps write them, with or without a unit."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType
from typing import Final

from blast_env.errors import MAX_TEXT, BlastEnvError, value_text
from blast_env.units import MODULE_SIDE_M
from blast_env.values import typed_number

FOOT_M: Final = 0.3048
"""Length of the international foot; that of the American survey foot differs by 2e-6."""

UNITS_M: Final[Mapping[str, float]] = MappingProxyType(
    {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "dm": 0.1, "km": 1e3, "in": 0.0254, "ft": FOOT_M}
)
"""Lengths of units in metres, by the names that options take."""

APPLICATION: Final = "BLAST_ENV"
"""Application name of the extended data of a DXF file of blast-env."""

CHARGE_KEYS: Final = ("tnt_kg", "above_ground_m", "weight")
"""What a file of blast-env says of a place of a charge: mass, height above the ground, weight."""

STRUCTURE_KEYS: Final = ("carries", "ground_m", "weight", "faces")
"""What a drawing of blast-env says of a structure: whether it is a terrace, the ground, 0, its
weight and its walls that count."""

VEHICLE_KEY: Final = "width_m"
"""What it says of the entry of a vehicle in addition: the width of the vehicle, m."""

_WORDS: Final[Mapping[str, float]] = MappingProxyType(
    {
        **UNITS_M,
        **dict.fromkeys(("metre", "metres", "meter", "meters"), 1.0),
        **dict.fromkeys(("'", "foot", "feet"), FOOT_M),
        **dict.fromkeys(('"', "inch", "inches"), UNITS_M["in"]),
    }
)
_PRIMES: Final = str.maketrans({"\u2032": "'", "\u2019": "'", "\u2033": '"', "\u201d": '"'})
_LENGTH: Final = re.compile(r"([0-9]+(?:[.,][0-9]*)?)\s*([a-z'\"]*)\.?")
_FEET_AND_INCHES: Final = re.compile(r"([0-9]+)\s*(?:'|ft)\s*([0-9]+(?:\.[0-9]*)?)\s*(?:\"|''|in)?")


def length_m(value: str | float | bool, unit_m: float = 1.0) -> float | None:
    """Return a length of at least 0 in metres, or `None` if the value is not one.

    Args:
        value: A number, or a text with a number: `12`, `12,5 m`, `40'`, `29'6"`.
        unit_m: Length of the unit of numbers without one, m.
    """
    if isinstance(value, bool):
        return None
    if isinstance(value, str):
        text = value[: MAX_TEXT + 1].strip().lower().translate(_PRIMES)
        if len(text) > MAX_TEXT:
            return None
        parts, match = _FEET_AND_INCHES.fullmatch(text), _LENGTH.fullmatch(text)
        try:
            if parts is not None:
                feet, inches = (typed_number("a length", parts[k]) for k in (1, 2))
                number, unit_m = feet + inches / 12.0, FOOT_M
            elif match is not None and (not match[2] or match[2] in _WORDS):
                number = typed_number("a length", match[1])
                unit_m = _WORDS[match[2]] if match[2] else unit_m
            else:
                return None
        except BlastEnvError:
            return None
    else:
        try:
            number = float(value)
        except OverflowError:  # an integer of hundreds of digits
            return None
    length = number * unit_m
    return length if isfinite(length) and length >= 0.0 else None


PlaceXY = tuple[float, float]

MOST_SITE_M: Final = 2000.0
"""Longest side of a site in a scenario file, m."""

MARGIN_M: Final = 10.0
"""Ground around everything, m, if a street is on it."""

MOST_MARGIN_M: Final = 100.0
"""Most ground around everything to reach the nearest street, m."""

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
    }
)


@dataclass(frozen=True)
class ImportOptions:
    """The options of an import; places are in the coordinates of the file.

    Attributes:
        name: Name of the scenario.
        origin: The site's lower left corner.
        centre: The site's middle, instead of `origin`.
        size_m: The site's extents; by default as much as everything in the file needs.
        margin_m: Ground around everything without `size_m`; by default `MARGIN_M`, or as much as
            the nearest street needs, to `MOST_MARGIN_M`.
        rotation_deg: Direction of the site's x axis from east, counterclockwise; by default that of
            most walls.
        crs: Reference system of the coordinates: EPSG:25832, or local for plain metres; by default
            that of the GeoJSON file, else EPSG:4326; none for DXF.
        units: Unit of a drawing: m, mm, cm, dm, km, in, ft.
        buildings_from: Features that are buildings: KEY, KEY=VALUE, or a layer of a drawing.
        charges_from: Where charges may be, named in the same way; by default streets, car parks.
        zone_from: Where barriers may stand, named in the same way.
        keep_outs_from: Areas to be kept empty, named in the same way.
        protect: Names of buildings whose loads count.
        protect_near: Protect the building nearest to this.
        tnt_kg: Mass of the charges, kg TNT.
        charge_at: Further places of a charge.
        zone_m: The build zone, site metres: left, bottom, width, height.
        zone_around_m: Width of a zone around the protected buildings.
        stock: Modules that there are to place.
        wall_height_m: Height of the modules.
        height_from: Property with the height.
        height_unit: Unit of heights, widths and diameters without one: m, mm, cm, dm, km, in, ft;
            by default m, or ft, as a guess, if the coordinates are in feet.
        default_height_m: Height of buildings without one; guessed from neighbours and kind.
        low_heights: Take the low guess of heights that the file does not have.
        level_height_m: Height of a storey.
        least_area_m2: Leave out smaller buildings.
        repair: Put outlines right that cross themselves.
        strict: Refuse a file where anything was guessed or left out.

    Raises:
        BlastEnvError: If a value is out of bounds, or two options exclude each other.
    """

    name: str | None = None
    origin: PlaceXY | None = None
    centre: PlaceXY | None = None
    size_m: PlaceXY | None = None
    margin_m: float | None = None
    rotation_deg: float | None = None
    crs: str | None = None
    units: str | None = None
    buildings_from: tuple[str, ...] = ()
    charges_from: tuple[str, ...] = ()
    zone_from: tuple[str, ...] = ()
    keep_outs_from: tuple[str, ...] = ()
    protect: tuple[str, ...] = ()
    protect_near: PlaceXY | None = None
    tnt_kg: float = 100.0
    charge_at: tuple[PlaceXY, ...] = ()
    zone_m: tuple[float, float, float, float] | None = None
    zone_around_m: float | None = None
    stock: int = 20
    wall_height_m: float = 3.0
    height_from: str | None = None
    height_unit: str | None = None
    default_height_m: float | None = None
    low_heights: bool = False
    level_height_m: float = 3.0
    least_area_m2: float = 4.0
    repair: bool = False
    strict: bool = False

    def __post_init__(self) -> None:
        """Check the options; see the class for the errors."""
        for name, (low, high) in _BOUNDS.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise BlastEnvError(f"{_option(name)} is {value:g}, must be {low:g} to {high:g}")
        for side_m in self.size_m or ():
            if not 2.0 <= side_m <= MOST_SITE_M:
                raise BlastEnvError(f"--size is {side_m:g}, must be 2 to {MOST_SITE_M:g} m")
        if self.height_unit is not None and self.height_unit not in UNITS_M:
            raise BlastEnvError(
                f"--height-unit is {value_text(self.height_unit)}, must be one of "
                f"{', '.join(UNITS_M)}"
            )
        _refuse_both("--origin", self.origin, "--centre", self.centre)
        _refuse_both("--zone", self.zone_m, "--zone-around", self.zone_around_m)
        _refuse_both("--zone-from", self.zone_from or None, "--zone", self.zone_m)
        _refuse_both("--zone-from", self.zone_from or None, "--zone-around", self.zone_around_m)
        for flag, place in (("--origin", self.origin), ("--centre", self.centre)):
            if place is not None and self.size_m is None:
                raise BlastEnvError(f"{flag} needs --size: how large the site is to be")
        if self.size_m is not None and self.origin is None and self.centre is None:
            raise BlastEnvError("--size needs --origin or --centre: where the site is to be")

    def refuse(self, what: str, *names: str) -> None:
        """Refuse options that are not for a kind of file.

        Raises:
            BlastEnvError: If one of them is given.
        """
        for name in names:
            if getattr(self, name) is not None:
                raise BlastEnvError(f"{_option(name)} is not for {what}")


def _option(name: str) -> str:
    """Return the command-line option of a value."""
    for suffix in ("_m2", "_m", "_deg"):
        name = name.removesuffix(suffix)
    return f"--{name.replace('_', '-')}"


def _refuse_both(one: str, value: object, other: str, other_value: object) -> None:
    if value is not None and other_value is not None:
        raise BlastEnvError(f"{one} and {other} exclude each other")
