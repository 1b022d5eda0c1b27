"""What a user decides about an import."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from blast_env.errors import BlastEnvError
from blast_env.units import MODULE_SIDE_M

PlaceXY = tuple[float, float]

CALIBRATIONS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "ballistic": "ballistic_kb_100kg",
        "collisional": "collisional_kb",
        "collisional_fine": "collisional_fine_kb",
    }
)
"""The stored calibration of each preset of the particle model."""

MOST_SITE_M: Final = 2000.0
"""The longest side of a site, as scenario files have it."""


_BOUNDS: Final[Mapping[str, tuple[float, float]]] = MappingProxyType(
    {
        "margin_m": (0.0, MOST_SITE_M),
        "rotation_deg": (-180.0, 180.0),
        "zone_around_m": (MODULE_SIDE_M, MOST_SITE_M),
        "wall_height_m": (MODULE_SIDE_M, MOST_SITE_M),
        "default_height_m": (MODULE_SIDE_M, MOST_SITE_M),
        "level_height_m": (1.0, 100.0),
        "least_area_m2": (MODULE_SIDE_M**2, 1e6),
        "most_area_deviation": (0.001, 1.0),
        "most_outline_deviation_m": (0.05, 100.0),
        "most_rectangles": (1, 100),
    }
)


@dataclass(frozen=True)
class ImportOptions:
    """What a user decides about an import; places are in the coordinates of the file.

    Attributes:
        name: Name of the scenario; without it, that of the file.
        crs: Reference system of GeoJSON's coordinates; see `read_geojson`.
        units: Unit of a drawing; see `read_dxf`.
        origin: Where the site's lower left corner is to be.
        centre: Where its middle is to be, instead.
        size_m: Its extents along x and y; without them, as much as everything needs.
        margin_m: How far the site then reaches beyond what is on it.
        rotation_deg: Direction of the site's x axis from east; without it, that of most walls.
        buildings_from: What in the file is a building; see `Selector`.
        charges_from: Where charges may be.
        zone_from: What is the build zone.
        keep_outs_from: What must stay empty.
        protect: Names of buildings whose load counts.
        protect_near: A place: the building nearest to it counts.
        tnt_kg: Mass of charges of which the file says none.
        charge_at: Places of further charges.
        zone_m: The build zone in site metres: left, bottom, width, height.
        zone_around_m: Instead, how far the zone reaches around the protected buildings.
        stock: How many modules there are to place.
        wall_height_m: Height of the modules.
        clearance_m: Least clear distance between modules and structures.
        preset: Parameters of the particle model.
        height_from: The tag with the height; without it, the usual ones.
        default_height_m: Height of buildings of which the file says none; without it, they are
            as high as the air.
        level_height_m: Height of a storey, where only their number is known.
        least_area_m2: Smaller buildings are left out.
        most_area_deviation: Largest share of a building's area by which modules may miss it.
        most_outline_deviation_m: Largest distance of its outline from that of the modules.
        most_rectangles: Rectangles that a building may take.
        repair: Whether outlines that cross themselves are put right.

    Raises:
        BlastEnvError: If something is out of bounds, or two of them exclude each other.
    """

    name: str | None = None
    crs: str | None = None
    units: str | None = None
    origin: PlaceXY | None = None
    centre: PlaceXY | None = None
    size_m: PlaceXY | None = None
    margin_m: float = 10.0
    rotation_deg: float | None = None
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
    clearance_m: float = 1.0
    preset: str = "collisional"
    height_from: str | None = None
    default_height_m: float | None = None
    level_height_m: float = 3.0
    least_area_m2: float = 4.0
    most_area_deviation: float = 0.2
    most_outline_deviation_m: float = 1.0
    most_rectangles: int = 16
    repair: bool = False

    def __post_init__(self) -> None:
        """Check them."""
        for name, (low, high) in _BOUNDS.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise BlastEnvError(f"{_option(name)} is {value:g}, must be {low:g} to {high:g}")
        for side_m in self.size_m or ():
            if not 2.0 <= side_m <= MOST_SITE_M:
                raise BlastEnvError(f"--size is {side_m:g}, must be 2 to {MOST_SITE_M:g} m")
        _refuse_both("--origin", self.origin, "--centre", self.centre)
        _refuse_both("--zone", self.zone_m, "--zone-around", self.zone_around_m)
        _refuse_both("--zone-from", self.zone_from or None, "--zone", self.zone_m)
        _refuse_both("--zone-from", self.zone_from or None, "--zone-around", self.zone_around_m)
        for option, place in (("--origin", self.origin), ("--centre", self.centre)):
            if place is not None and self.size_m is None:
                raise BlastEnvError(f"{option} needs --size: how large the site is to be")
        if self.size_m is not None and self.origin is None and self.centre is None:
            raise BlastEnvError("--size needs --origin or --centre: where the site is to be")


def _option(name: str) -> str:
    """Return how the command line calls a value."""
    for suffix in ("_m2", "_m", "_deg"):
        name = name.removesuffix(suffix)
    return f"--{name.replace('_', '-')}"


def _refuse_both(one: str, value: object, other: str, other_value: object) -> None:
    if value is not None and other_value is not None:
        raise BlastEnvError(f"{one} and {other} exclude each other")
