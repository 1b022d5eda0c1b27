"""Placing of the site on a map: its rectangle, its direction and its objects."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, named
from blast_env.io.importing.joining import closed, with_courtyards
from blast_env.io.importing.ledger import Fate, Ledger
from blast_env.io.importing.options import MARGIN_M, MOST_MARGIN_M, MOST_SITE_M, ImportOptions
from blast_env.io.importing.outlines import dominant_direction_deg, grid_offset_m
from blast_env.io.importing.plane import Plane, plane_around, rotated
from blast_env.io.importing.site_map import SiteMap
from blast_env.io.importing.things import Role, Thing
from blast_env.sections import AnyGeoreference
from blast_env.units import MODULE_SIDE_M

OUTSIDE: Final = "outside the site"
OUTSIDE_OWN: Final = "outside the outline of the site in the file, its layer or kind `site`"
_EXCHANGED: Final = ": are longitude and latitude exchanged?"
_ROUNDING: Final = 0.1  # of a module: rounding of a map must not add a row of modules
_WIDER: Final = "ground around buildings, widened to the nearest street"
_LEAST_STREET_M: Final = 1.0
_MOST_LISTED: Final = 20
_TO_BORDER_M: Final = 1.0  # of charges


@dataclass(frozen=True)
class SitePlacement:
    """A site on a map, with its objects in metres from the site's lower left corner.

    Attributes:
        ledger: The ledger of the import.
        plane: The plane in which the map is measured.
        rotation_deg: From the plane's x axis to the site's, counterclockwise.
        corner_m: The site's lower left corner in the turned plane.
        shape: Rows and columns of modules.
        things: Objects on the site or near it.
        faulty: Objects on the site or of an unknown place that cannot be used, and buildings that
            are below the ground or part of others.
        layers: Layers of a drawing.
    """

    path: Path
    options: ImportOptions
    ledger: Ledger
    plane: Plane
    rotation_deg: float
    corner_m: tuple[float, float]
    shape: tuple[int, int]
    things: tuple[Thing, ...]
    faulty: tuple[Thing, ...] = ()
    layers: tuple[str, ...] = ()

    @property
    def size_m(self) -> tuple[float, float]:
        """Extents along x and y, m."""
        return self.shape[1] * MODULE_SIDE_M, self.shape[0] * MODULE_SIDE_M

    @property
    def beyond(self) -> tuple[Fate, str]:
        """Fate and kind of buildings and charges outside the site.

        They are left out where no option but an outline in the file cuts the site.
        """
        own = self.options.size_m is None and bool(self.of_role(Role.SITE))
        return (Fate.LEFT_OUT, OUTSIDE_OWN) if own else (Fate.PASSED, OUTSIDE)

    @cached_property
    def box(self) -> BaseGeometry:
        """The whole site."""
        return shapely.box(0.0, 0.0, *self.size_m)

    @property
    def georeference(self) -> AnyGeoreference:
        """The georeference of the site."""
        corner = rotated(np.array([self.corner_m]), self.rotation_deg)[0]
        return self.plane.georeference((float(corner[0]), float(corner[1])), self.rotation_deg)

    def of_role(self, role: Role) -> tuple[Thing, ...]:
        """Return the things of a role."""
        return tuple(thing for thing in self.things if thing.role is role)

    def hint_of_exchange(self, place: tuple[float, float]) -> str:
        """Return a hint for a place outside the site that is inside with x and y exchanged."""
        x_m, y_m = self.to_site(np.array([place[::-1]]))[0]
        return _EXCHANGED if shapely.intersects_xy(self.box, x_m, y_m) else ""

    def to_site(self, places: FloatArray) -> FloatArray:
        """Return places of the map (n, 2) in metres of the site (n, 2)."""
        turned = rotated(self.plane.to_metres(places), -self.rotation_deg)
        return np.asarray(turned - np.array(self.corner_m))


def place_site(site_map: SiteMap, things: Sequence[Thing]) -> SitePlacement:
    """Return the site that the options specify, or one around all objects of the map.

    Lines that close become outlines. The ledger gets the objects that are elsewhere or cannot be
    used.
    """
    options, ledger = site_map.options, site_map.ledger
    faulty = [thing for thing in things if thing.fault]
    things = [thing for thing in things if not thing.fault]
    if not things:
        raise _nothing(site_map, faulty)
    # 1. A plane in metres around the site; 2. lines that close, and courtyards; 3. the direction of
    # most walls; 4. a grid along it, whose lines follow the walls as well as they can.
    plane = plane_around(site_map.crs, site_map.unit_m, _reference(things, options))
    near = closed(_near(site_map, things, plane), ledger)
    if site_map.has_layers:
        near = with_courtyards(near, ledger)
    open_lines = [thing for thing in near if thing.fault]
    near = [thing for thing in near if not thing.fault]
    if not near or (options.size_m is None and Role.BUILDING not in {thing.role for thing in near}):
        raise _nothing(site_map, [*faulty, *open_lines])
    rotation_deg = _rotation_deg(near, options)
    turned = _moved(near, lambda places: rotated(places, -rotation_deg))
    corner_m, shape = _grid(site_map, turned, plane, rotation_deg)
    layers = sorted(
        {str(feature.tags["layer"]) for feature in site_map.features if "layer" in feature.tags}
    )
    site = SitePlacement(
        path=site_map.path,
        options=options,
        ledger=ledger,
        plane=plane,
        rotation_deg=rotation_deg,
        corner_m=corner_m,
        shape=shape,
        things=tuple(_moved(turned, lambda places: places - np.array(corner_m))),
        layers=tuple(layers),
    )
    lines = _moved(open_lines, lambda places: rotated(places, -rotation_deg) - np.array(corner_m))
    return replace(site, faulty=tuple(_faults([*lines, *_moved(faulty, site.to_site)], site)))


def _faults(faulty: Iterable[Thing], site: SitePlacement) -> Iterator[Thing]:
    """Yield the faulty objects on a site or of an unknown place, and enter all in the ledger."""
    is_whole_file = site.options.size_m is None
    for thing in faulty:
        if is_whole_file or thing.geometry.is_empty or shapely.intersects(thing.geometry, site.box):
            site.ledger.add(Fate.LEFT_OUT, thing.fault, thing.place, thing.name)
            yield thing
        else:
            site.ledger.add(Fate.PASSED, OUTSIDE, thing.place, thing.name)


def _nothing(site_map: SiteMap, faulty: Sequence[Thing]) -> BlastEnvError:
    """Return the error of a map without a building."""
    if not site_map.features:
        return BlastEnvError(f"{site_map.path}: is empty: it has no outline, line or point")
    chosen = site_map.options.buildings_from
    faults = Counter(thing.fault for thing in faulty if thing.role is Role.BUILDING)
    reasons = "; ".join(f"{count} {fault}" for fault, count in faults.most_common(_MOST_LISTED))
    if reasons:
        return BlastEnvError(f"{site_map.path}: has no building that can be used, but {reasons}")
    advice = "define them with --buildings-from and --charges-from"
    if chosen:
        advice = f"--buildings-from {' '.join(map(named, chosen[:_MOST_LISTED]))} chooses nothing"
    return BlastEnvError(f"{site_map.path}: has no building that is marked as such; {advice}")


def _reference(things: Sequence[Thing], options: ImportOptions) -> tuple[float, float]:
    """Return a place of the map near the site: that of the options, or the objects' middle."""
    asked = options.origin or options.centre
    if asked is not None:
        return asked
    shown = _chief(things)
    left, bottom, right, top = shapely.total_bounds([thing.geometry for thing in shown])
    return float(left + right) / 2.0, float(bottom + top) / 2.0


def _chief(things: Sequence[Thing]) -> Sequence[Thing]:
    """Return the objects that fix the site: its outline, or all objects but streets and texts."""
    own = [thing for thing in things if thing.role is Role.SITE]
    if own:
        return own
    fixed = [
        thing
        for thing in things
        if thing.role is not Role.NAME and not (thing.role is Role.CHARGE and thing.is_line)
    ]
    return fixed or things


def _near(site_map: SiteMap, things: Sequence[Thing], plane: Plane) -> list[Thing]:
    """Return the objects that may lie on the site, in metres of the plane."""
    options = site_map.options
    measured = _moved(things, plane.to_metres)
    geometries = [thing.geometry for thing in measured]
    reference = options.origin or options.centre
    if options.size_m is None or reference is None:
        if not np.isfinite(shapely.bounds(geometries)).all():
            raise BlastEnvError(
                f"{site_map.path}: reaches too far for one site: say --centre or --origin, and "
                "--size"
            )
        return measured
    # The corner or the middle is the plane's reference; the site turns around it.
    middle = plane.to_metres(np.array([reference]))[0]
    around = shapely.Point(middle).buffer(2.0 * float(np.hypot(*options.size_m)))
    is_near = shapely.intersects(geometries, around)
    for index in np.flatnonzero(~is_near):
        far = measured[int(index)]
        site_map.ledger.add(Fate.PASSED, OUTSIDE, far.place, far.name)
    if not is_near.any():
        x, y = reference
        left, bottom, right, top = shapely.total_bounds([thing.geometry for thing in things])
        flag = "--origin" if options.centre is None else "--centre"
        hint = _EXCHANGED if left <= y <= right and bottom <= x <= top else ""
        raise BlastEnvError(
            f"{site_map.path}: has nothing near {flag} {x:.10g},{y:.10g}, but from "
            f"{left:.10g},{bottom:.10g} to {right:.10g},{top:.10g}{hint}"
        )
    return [measured[index] for index in np.flatnonzero(is_near)]


def _moved(things: Sequence[Thing], move: Callable[[FloatArray], FloatArray]) -> list[Thing]:
    """Return things with all coordinates transformed in one call."""
    geometries = shapely.transform([thing.geometry for thing in things], move)
    return [replace(thing, geometry=new) for thing, new in zip(things, geometries, strict=True)]


def _rotation_deg(things: Sequence[Thing], options: ImportOptions) -> float:
    """Return the direction of the site: that of the options, or that of most walls."""
    if options.rotation_deg is not None:
        return options.rotation_deg
    own = [thing.geometry for thing in things if thing.role is Role.SITE]
    walls = own or [thing.geometry for thing in things if thing.role is Role.BUILDING]
    return dominant_direction_deg(walls)


def _grid(
    site_map: SiteMap, things: Sequence[Thing], plane: Plane, rotation_deg: float
) -> tuple[tuple[float, float], tuple[int, int]]:
    """Return the site's corner in the turned plane, and its rows and columns of modules."""
    options = site_map.options
    left, bottom, right, top = _bounds_m(site_map, things, plane, rotation_deg)
    size_m = right - left, top - bottom
    if max(size_m) > MOST_SITE_M:
        raise BlastEnvError(
            f"{site_map.path}: the site would be {size_m[0]:,.0f} x {size_m[1]:,.0f} m, must be at "
            f"most {MOST_SITE_M:g} m long and wide: say --centre or --origin, and --size"
        )
    box = shapely.box(left, bottom, right, top)
    # The offset at which most walls lie on grid lines, so that modules keep their outlines.
    own = [thing.geometry for thing in things if thing.role is Role.SITE]
    buildings = np.array([thing.geometry for thing in things if thing.role is Role.BUILDING])
    offsets_m = grid_offset_m(own or buildings[shapely.intersects(buildings, box)].tolist())
    corner_m, counts = [], []
    for low_m, high_m, offset_m in zip((left, bottom), (right, top), offsets_m, strict=True):
        steps = (low_m - offset_m) / MODULE_SIDE_M
        is_fixed = options.size_m is not None
        line = np.round(steps) if is_fixed else np.floor(steps + _ROUNDING)
        corner_m.append(float(offset_m + line * MODULE_SIDE_M))
        end_m = corner_m[-1] + high_m - low_m if is_fixed else high_m
        counts.append(int(np.ceil((end_m - corner_m[-1]) / MODULE_SIDE_M - _ROUNDING)))
    return (corner_m[0], corner_m[1]), (counts[1], counts[0])


def _bounds_m(
    site_map: SiteMap, things: Sequence[Thing], plane: Plane, rotation_deg: float
) -> tuple[float, float, float, float]:
    """Return the site's rectangle in the turned plane."""
    options = site_map.options
    if options.size_m is not None:
        asked = options.origin or options.centre
        place = rotated(plane.to_metres(np.array([asked])), -rotation_deg)[0]
        size = np.array(options.size_m)
        low = place - (0.0 if options.origin is not None else 0.5 * size)
        far = low + size
        return float(low[0]), float(low[1]), float(far[0]), float(far[1])
    chief = _chief(things)
    bounds_m = shapely.total_bounds([thing.geometry for thing in chief])
    margin_m = options.margin_m
    if chief[0].role is Role.SITE:
        margin_m = 0.0
    elif margin_m is None:
        margin_m = _margin_m(site_map, things, bounds_m)
    left, bottom, right, top = (float(bound_m) for bound_m in bounds_m)
    return left - margin_m, bottom - margin_m, right + margin_m, top + margin_m


def _margin_m(site_map: SiteMap, things: Sequence[Thing], bounds_m: FloatArray) -> float:
    """Return the usual margin, or one that reaches beyond the nearest street if that has none.

    A wider margin is a guess in the ledger.
    """
    streets = [thing for thing in things if thing.role is Role.CHARGE]
    if site_map.options.charge_at or not streets or not all(street.is_line for street in streets):
        return MARGIN_M
    # Metre by metre outwards, until a street has enough of its length on the site.
    lines = [shapely.union_all(list(street.kerbs)) for street in streets]
    for margin_m in np.arange(MARGIN_M, MOST_MARGIN_M + 1.0):
        inside_m = margin_m - _TO_BORDER_M
        box = shapely.box(*(bounds_m + inside_m * np.array([-1.0, -1.0, 1.0, 1.0])))
        lengths_m = shapely.length(shapely.intersection(lines, box))
        if lengths_m.max() >= _LEAST_STREET_M:
            break
    else:
        return MARGIN_M
    if margin_m > MARGIN_M:
        nearest = streets[lengths_m.argmax()]
        margin_m += np.ceil(nearest.width_m or 0.0)
        detail = f"--margin {margin_m:g} for {MARGIN_M:g}"
        site_map.ledger.add(Fate.GUESSED, _WIDER, nearest.place, nearest.name, detail)
    return float(margin_m)
