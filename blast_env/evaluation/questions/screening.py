"""Screening: the response of facades and the stand-off they need, before any blast.

Loads are Kingery and Bulmash's in the open over rigid ground (`blast_env.curves.over_ground`). A
bay that faces the charge has the peak and the impulse of its middle by the angle of incidence,
others the side-on values of the same distance. The atlas of shielding (`blast_env.atlas`) changes
both by what stands around. Without the atlas, a bay out of sight has the
side-on load. The history is a triangle.

Stand-offs are for normal incidence. They end at both limits of validity: nearer than
1.7 m/kg^(1/3) walls may be breached, and the curves end at 40 m/kg^(1/3). Those of a charge above
the ground end at 2.9 m/kg^(1/3): nearer, gas dynamics can have more than screening.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import ceil, hypot, inf
from typing import Final, Literal

import numpy as np

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.atlas import Laws, SiteAtlas, Surroundings, Walls
from blast_env.bays import STOREY_M
from blast_env.curves import CURVES_SCALED_M, Ways, in_the_open, normally_reflected
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas_validation import bay_middles
from blast_env.gas.settings import CHECKED_SCALED_DISTANCE
from blast_env.geometry import Element
from blast_env.layout.build_site import build_site, vehicle_drive, worst_places
from blast_env.response.components import FacadeBay, Glazing, Wall, catalogue
from blast_env.response.damage import damage_numbers, triangle, under_triangle
from blast_env.response.facade import FacadeResponse, assumption_words, respond, response_words
from blast_env.response.glass import Pane, pane_of
from blast_env.response.levels import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.response.walls import Panel, panel_of
from blast_env.sections import PointM
from blast_env.site import AnySource, RectangleSource, Scenario, VehicleSource
from blast_env.site.blast_site import BlastSite, Charge, in_sight
from blast_env.site.sources import MassPreset, PlaceSource
from blast_env.units import MODULE_SIDE_M

LEFT_OUT: Final = (
    "left out: surroundings outside the range of the atlas, walls and pieces that fail or move,"
    " suction, and breaching nearer than 1.7 m/kg^(1/3); stand-offs are those of open ground and"
    " endless walls, and streets and courts need more"
)
"""What screening does not know."""

LEFT_OUT_IN_THE_OPEN: Final = (
    "left out: shielding (a wall out of sight has the side-on load), echoes between walls, clearing"
    " round edges, suction, and breaching nearer than 1.7 m/kg^(1/3)"
)
"""What it does not know without the atlas."""

_LEVELS: Final = tuple(sorted(LevelOfProtection, reverse=True)[:-1])
RAISED_SCALED_M: Final = 2.9
"""Scaled distance, m/kg^(1/3), nearer than which loads of charges above the ground are flagged."""

LOW_BY: Final = 1.02
"""Largest impulse of gas over screening's there, down to 1.8 m/kg^(1/3), for charges above the
ground (`python -m studies.response raised --cell 0.25 --distances 5,6.5,8 --heights
0,0.2,2,3,4,5`)."""

BEHIND_LOW_BY: Final = 1.48
"""Largest impulse of gas over screening's behind rows, on sites that no law of the atlas has met
(docs/engineers/atlas.md)."""

_APART_M: Final = 2.0
_MOST_PLACES: Final = 300
_MOST_STEPS: Final = 12  # along a side of an area
_MILLIMETRES: Final = 3  # digits
_POINTS: Final = 14  # of a table of damage, along each axis
_SHARES: Final = (-0.4, -0.2, 0.0, 0.2, 0.4)  # of the width and the height of a bay
_DISTANCES: Final = 400  # of stand-offs, each 0.8 % farther than the last


@dataclass(frozen=True)
class BayScreening:
    """A bay under one charge.

    Attributes:
        distance_m: Distance of its middle from the charge.
        in_sight: Whether the charge sees its middle.
        peak_pa: Peak of its load.
        impulse_pa_s: Impulse of its load.
        response: Response of its windows and wall panel.
        around: What stands around it and changes its load; empty in the open.
        unknown: What stands around it outside the range of the atlas.
        faces_charge: Whether its wall faces the charge, by the atlas.
        is_behind: Whether rows of pieces or houses stand before it, by the atlas.
        factor: What that does to the impulse: best estimate, lower and upper end.
        edges: What the edges of its wall and the angle of the wave do to the impulse of the curves.
        likely_pa_s: The best estimate of the impulse; what counts is on the safe side of it.
    """

    filled: FacadeBay
    distance_m: float
    in_sight: bool
    peak_pa: float
    impulse_pa_s: float
    response: FacadeResponse
    around: str = ""
    unknown: str = ""
    faces_charge: bool = True
    is_behind: bool = False
    factor: tuple[float, float, float] = (1.0, 1.0, 1.0)
    edges: float = 1.0
    likely_pa_s: float = 0.0
    likely_peak_pa: float = 0.0


@dataclass(frozen=True)
class OtherPlace:
    """A place that is the worst one by another measure than damage.

    Attributes:
        measure: What is worst there: the glass, the peak or the impulse.
        responses: The response of each bay.
    """

    measure: str
    charge: Charge
    responses: tuple[FacadeResponse, ...]

    def keeps(self, requirement: Requirement) -> bool:
        """Return whether every bay keeps a requirement there."""
        return all(map(requirement.kept_by, self.responses))


@dataclass(frozen=True)
class ThreatScreening:
    """The worst place of one threat.

    Attributes:
        charge: The charge at its worst place by damage.
        others: The places with the worst glass, the largest peak and the largest impulse, where
            they are not the worst one by damage.
        least_m: Distance of the bay's middle that is nearest to any of the places.
    """

    name: str
    charge: Charge
    places: int
    bays: tuple[BayScreening, ...]
    others: tuple[OtherPlace, ...] = ()
    least_m: float = inf

    @property
    def nearest_m(self) -> float:
        """Distance of the nearest bay's middle."""
        return min(bay.distance_m for bay in self.bays)

    @property
    def words(self) -> tuple[str, ...]:
        """The level of protection, the panes broken, the worst pane and the worst panel."""
        return response_words([bay.response for bay in self.bays])

    @property
    def may_breach(self) -> bool:
        """Whether a bay is so near to a place that its wall may be breached."""
        return self.scaled_m < CHECKED_SCALED_DISTANCE[0]

    @property
    def scaled_m(self) -> float:
        """Scaled distance of the bay's middle nearest to any place, m/kg^(1/3)."""
        return min(self.least_m, self.nearest_m) / float(np.cbrt(self.charge.tnt_kg))

    @property
    def may_be_low(self) -> bool:
        """Whether gas may have more: the charge is above the ground, and a bay is near."""
        return self.charge.height_m > 0.0 and self.scaled_m < RAISED_SCALED_M

    @property
    def behind(self) -> int:
        """Number of bays behind rows, whose loads may be low on sites unlike those of the atlas."""
        return sum(bay.is_behind for bay in self.bays)

    def doubts(self, required: Sequence[Requirement]) -> str:
        """Return the conditions of a verdict on requirements, in brackets; empty without any."""
        found = [bay.response for bay in self.bays]
        rests = any(
            assumption_words(found, requirement.level)
            for requirement in required
            if requirement.level
        )
        doubts = ["may be breached"] * self.may_breach
        doubts += ["loads may be low"] * (self.may_be_low or self.behind > 0)
        doubts += ["rests on assumptions"] * rests
        return f" ({', '.join(doubts)})" if doubts else ""

    def keeps(self, requirement: Requirement) -> bool:
        """Return whether every bay keeps a requirement, whichever the place of the charge."""
        here = all(requirement.kept_by(bay.response) for bay in self.bays)
        return here and all(place.keeps(requirement) for place in self.others)


@dataclass(frozen=True)
class StandOff:
    """The distances from which a component allows the levels of protection.

    Attributes:
        distances_m: Distance by level; infinite beyond the end of the curves.
        least_m: Least distance for which the response is valid; a distance equal to it may be less.
        most_m: Distance of the end of the curves.
    """

    name: str
    component: Glazing | Wall
    distances_m: Mapping[LevelOfProtection, float]
    least_m: float
    most_m: float

    def in_words(self, distance_m: float) -> str:
        """Return a distance in words, m, rounded up, with the limits of validity."""
        if np.isinf(distance_m):
            return f"> {self.most_m:.0f}"
        if distance_m <= self.least_m:
            return f"< {ceil(self.least_m)}"
        return str(ceil(distance_m))


@dataclass(frozen=True)
class Screening:
    """A site before any blast.

    Attributes:
        threats: The threats at their worst places.
        components: The components of the site and the catalogue, by name.
        present: Names of the components in the site's bays.
        parts: The panes and panels of the site's bays, each once, of the sizes that they have.
        storey_m: The most frequent height of a storey, the span of walls.
        knows_surroundings: Whether the atlas changed the loads.
        hidden: Buildings with a facade of which structures cover every bay.
    """

    threats: tuple[ThreatScreening, ...]
    components: Mapping[str, Glazing | Wall]
    present: frozenset[str]
    parts: tuple[Pane | Panel, ...]
    storey_m: float
    knows_surroundings: bool = True
    hidden: tuple[str, ...] = ()

    @property
    def left_out(self) -> str:
        """What this screening does not know."""
        return LEFT_OUT if self.knows_surroundings else LEFT_OUT_IN_THE_OPEN

    @cached_property
    def stand_offs(self) -> Mapping[str, tuple[StandOff, ...]]:
        """The stand-off of each component, by the name of the threat."""
        return {
            threat.name: stand_offs(self.components, threat.charge, self.storey_m)
            for threat in self.threats
        }

    def needed_m(self, threat: str, requirement: Requirement) -> float:
        """Return the stand-off at which all components of the site keep a requirement.

        Their panes and spans are as large as those of the site, not as in `stand_offs`.
        """
        curves = self._curves[threat]
        # The farthest of all: every component of the site, then limits of peak and impulse.
        own = [
            curves.stand_offs_m(part)[requirement.level]
            for part in self.parts
            if requirement.level in _LEVELS
            and not (requirement.glass_only and isinstance(part, Panel))
        ]
        own += [
            curves.reach_m(index, limit)
            for index, limit in ((1, requirement.peak_pa), (2, requirement.impulse_pa_s))
            if np.isfinite(limit)
        ]
        return max(own, default=0.0)

    @cached_property
    def _curves(self) -> Mapping[str, "_Curves"]:
        return {threat.name: _Curves(threat.charge) for threat in self.threats}


def screen(
    scenario: Scenario,
    layout: Sequence[Element] = (),
    threats: Iterable[MassPreset] = (),
    atlas: Laws | None = None,
) -> Screening:
    """Return the response of a site's facades before any blast, and the stand-offs they need.

    Measures of the layout, the vehicles it stops, and its pieces count. Loads are changed by the
    laws of an atlas (`blast_env.atlas.laws`); without one, pieces cut lines of sight, but do not
    shield. Given threats may go off at every place of the site's charges, in the place of
    these.
    """
    named = [*threats]
    # (1) The sources of each threat; (2) its places, of vehicles as far as the layout lets them;
    # (3) what each place sees of each bay; (4) the response by the curves at every place, of which
    # the worst one stands for the threat.
    sources = _by_threat(scenario, named)
    if len({part.name for part in named}) < len(named):
        raise BlastEnvError("threats: two have the same name, must differ")
    bays = scenario.bays_with(layout)
    if not bays:
        raise BlastEnvError(
            f"scenario {scenario.name!r}: no structure has a facade with bays: add"
            " [structures.facade], or give --glazing or --wall"
        )
    facade = _Facade.of(scenario, layout, bays)
    if not facade.bays:
        raise BlastEnvError(
            f"scenario {scenario.name!r}: other structures stand before all of each bay"
            f" ({bays[0].bay.name} and so on): no bay can be screened"
        )
    changed = None if atlas is None else SiteAtlas(facade.site, facade.walls, atlas)
    screened = []
    known_places: dict[object, Ways] = {}  # threats that differ in mass alone share them
    for name, own in sources.items():
        places = [*_places(scenario, own, layout, facade)]
        key = tuple((place.position_m, place.height_m) for place in places)
        if key not in known_places:
            known_places[key] = facade.ways_from(places, by_sight=atlas is None)
        screened.append(_screened(name, facade, places, known_places[key], changed))
    named_bays = scenario.named_bays(layout)
    storeys = [bay.bay.height_m for bay in bays]
    return Screening(
        tuple(screened),
        {**catalogue(), **scenario.components},
        frozenset(
            name for named_bay in named_bays for name in (named_bay.glazing, named_bay.wall) if name
        ),
        _parts_of(bays),
        max(set(storeys), key=storeys.count),
        atlas is not None,
        _hidden(scenario, bays, facade.bays),
    )


def _hidden(
    scenario: Scenario, bays: Iterable[FacadeBay], free: Iterable[FacadeBay]
) -> tuple[str, ...]:
    """Return the buildings of some bays that have none among the free ones."""
    names = scenario.building_names
    every, left = ([names[own.bay.structure] for own in group] for group in (bays, free))
    return tuple(name for name in dict.fromkeys(every) if name not in left)


def stand_offs(
    components: Mapping[str, Glazing | Wall], charge: Charge, storey_m: float = STOREY_M
) -> tuple[StandOff, ...]:
    """Return the stand-off that each component needs for each level of protection.

    The charge may be at any place. The height of a storey is the span of walls.
    """
    # One charge: every component is held against the same curves.
    curves = _Curves(charge)
    found = []
    for name, component in components.items():
        part = panel_of(component, storey_m) if isinstance(component, Wall) else pane_of(component)
        distances_m = curves.stand_offs_m(part)
        found.append(StandOff(name, component, distances_m, curves.least_m, curves.most_m))
    return tuple(found)


def likely_impulses(
    scenario: Scenario, layout: Sequence[Element], charges: Iterable[Charge], atlas: Laws
) -> Mapping[str, FloatArray]:
    """Return the best estimates of the impulses of bays, Pa s, by name; (charges,) each.

    The laws of an atlas count. Bays that a structure or piece covers are left out.
    """
    facade = _Facade.of(scenario, layout, scenario.bays_with(layout))
    laws, found = SiteAtlas(facade.site, facade.walls, atlas), []
    for charge in charges:
        (x_m, y_m), tnt_kg, height_m = charge
        place_m = (x_m, y_m, height_m)
        around = laws.around(place_m, float(np.cbrt(tnt_kg)))
        ways = Ways.between(place_m, facade.middles_m, facade.outward, around.faces)
        found.append(in_the_open("impulse", ways, tnt_kg, height_m) * around.likely[:, 0])
    names = (own.bay.name for own in facade.bays)
    return dict(zip(names, np.stack(found, axis=1), strict=True))


def _parts_of(bays: Iterable[FacadeBay]) -> tuple[Pane | Panel, ...]:
    """Return the panes and panels of bays, each once."""
    panes = dict.fromkeys(own.glazing for own in bays if own.glazing is not None)
    spans = ((own.wall, round(own.bay.height_m, 6)) for own in bays if own.wall is not None)
    return (*map(pane_of, panes), *(panel_of(*own) for own in dict.fromkeys(spans)))


class _Curves:
    """Kingery and Bulmash's loads of one charge in the open."""

    def __init__(self, charge: Charge) -> None:
        self._charge = charge
        self._known: dict[Pane | Panel, dict[LevelOfProtection, float]] = {}
        scale = float(np.cbrt(charge.tnt_kg))
        is_raised = charge.height_m > 0.0
        self.least_m = (RAISED_SCALED_M if is_raised else CHECKED_SCALED_DISTANCE[0]) * scale
        self.most_m = CURVES_SCALED_M[1] * scale

    @cached_property
    def reflected(self) -> FloatArray:
        """Distances, and the reflected peak and impulse there (3, distances)."""
        distances_m = np.geomspace(self.least_m, self.most_m, _DISTANCES)
        _, tnt_kg, height_m = self._charge
        loads = (normally_reflected(own, distances_m, tnt_kg, height_m) for own in _LOADS)
        return np.stack([distances_m, *loads])

    def stand_offs_m(self, part: Pane | Panel) -> dict[LevelOfProtection, float]:
        """Return the distances from which on a part allows each level."""
        if part not in self._known:
            self._known[part] = self._found_m(part)
        return self._known[part]

    def _found_m(self, part: Pane | Panel) -> dict[LevelOfProtection, float]:
        distances_m, *loads = self.reflected
        damage = damage_numbers(under_triangle(part, *loads))
        # Damage does not always fall with distance: longer loads break fewer panes of strong glass,
        # and throw these farther. What counts is the last distance that fails.
        fails = damage >= 5.0 - np.array(_LEVELS)[:, np.newaxis]  # damage of a level is less
        after = _DISTANCES - np.argmax(fails[:, ::-1], axis=1)
        reach_m = np.append(distances_m, np.inf)[np.where(fails.any(axis=1), after, 0)]
        return dict(zip(_LEVELS, reach_m.tolist(), strict=True))

    def reach_m(self, index: int, limit: float) -> float:
        """Return the distance from which a row of `reflected` keeps a limit; may be infinite."""
        kept = self.reflected[index] <= limit
        return float(self.reflected[0][np.argmax(kept)]) if kept.any() else np.inf


_LOADS: Final[tuple[Literal["overpressure", "impulse"], ...]] = ("overpressure", "impulse")


@dataclass(frozen=True, eq=False)
class _Facade:
    """The bays of a site in the open air.

    Attributes:
        middles_m: Their middles, before the modules of oblique walls (bays, 3).
        outward: Their outward normals (bays, 3).
        ends_m: Distances of the middles from the ends of the wall on the right and on the left
            (bays, 2).
        site: The site with a charge that does not count.
        covered: Whether a structure or a piece stands before the middle of each bay, not before all
            of it (bays,).
    """

    bays: tuple[FacadeBay, ...]
    middles_m: FloatArray
    outward: FloatArray
    ends_m: FloatArray
    site: BlastSite
    covered: BoolArray

    @classmethod
    def of(
        cls, scenario: Scenario, layout: Sequence[Element], bays: Sequence[FacadeBay]
    ) -> "_Facade":
        """Return the bays that structures do not cover wholly."""
        rectangles_m = {structure.name: structure.rectangle_m for structure in scenario.structures}
        middles_m, normals = bay_middles(rectangles_m, [own.bay for own in bays])
        before_m = middles_m + MODULE_SIDE_M * normals
        site = replace(build_site(scenario, layout), charge=Charge((0.0, 0.0), 1.0))
        free = ~_wholly_covered(site, bays, before_m, normals)
        kept = tuple(bay for bay, is_free in zip(bays, free.tolist(), strict=True) if is_free)
        covered, ends_m = _covered(site, before_m[free]), _ends_m(bays, normals)[free]
        return cls(kept, before_m[free], normals[free], ends_m, site, covered)

    @property
    def walls(self) -> Walls:
        """The bays on their walls."""
        high_m: dict[str, float] = {}
        for outline in self.site.structures:
            tops_m = [block.height_m for block in outline.blocks if block.height_m is not None]
            high_m[outline.name] = max(tops_m, default=0.0)
        names = tuple(own.bay.structure for own in self.bays)
        # On the wall again, but for oblique walls, whose modules reach beyond the line.
        oblique = np.abs(self.outward[:, :2]).max(axis=1) < 1.0 - 1e-9
        back_m = np.where(oblique, 0.0, MODULE_SIDE_M)
        return Walls(
            self.middles_m - back_m[:, np.newaxis] * self.outward,
            self.outward,
            names,
            np.array([high_m[name] for name in names]),
            self.ends_m,
            MODULE_SIDE_M - back_m,
        )

    @cached_property
    def kinds(self) -> tuple[IntArray, list[list[Pane | Panel]]]:
        """Number of the kind of each bay, and the parts of each: equal parts respond equally."""
        known: dict[object, int] = {}
        numbers, parts = [], []
        for bay in self.bays:
            key = bay.glazing, bay.wall, round(bay.bay.height_m, 6)
            if key not in known:
                known[key] = len(known)
                own: list[Pane | Panel] = [] if bay.glazing is None else [pane_of(bay.glazing)]
                own += [] if bay.wall is None else [panel_of(bay.wall, bay.bay.height_m)]
                parts.append(own)
            numbers.append(known[key])
        return np.array(numbers), parts

    def ways_from(self, places: Sequence[Charge], by_sight: bool) -> Ways:
        """Return the ways from places to the bays (places, bays).

        By sight, those in sight are seen, else none: the atlas needs no lines of sight.
        """
        found, nothing = [], np.zeros(len(self.bays), dtype=bool)
        for place in places:
            seen = self.sees(place) if by_sight else nothing
            charge_m = (*place.position_m, place.height_m)
            found.append(Ways.between(charge_m, self.middles_m, self.outward, seen))
        return Ways(*(np.stack(own) for own in zip(*found, strict=True)))

    def nearest_of(self, places_m: FloatArray) -> FloatArray:
        """Return the places (places, 2) that are nearest to each bay (bays, 2)."""
        ways_m = (
            np.hypot(*(places_m - middle_m).T) for middle_m in self.middles_m[:, np.newaxis, :2]
        )
        return places_m[[int(way_m.argmin()) for way_m in ways_m]]

    def sees(self, place: Charge) -> BoolArray:
        """Return whether each bay is in sight of a place (bays,).

        What stands before the middle of a bay hides a part of it, which takes nothing off.
        """
        way_m = np.array([*place.position_m, place.height_m]) - self.middles_m
        faces = (way_m * self.outward).sum(axis=1) > 0.0
        seen = in_sight(replace(self.site, charge=place), self.middles_m, self.outward)
        return np.asarray(seen | (faces & self.covered))


def _ends_m(bays: Sequence[FacadeBay], outward: FloatArray) -> FloatArray:
    """Return the distances of the middles of bays from the ends of their wall (bays, 2).

    First that on the right, then that on the left, seen from outside.
    """
    walls = [(own.bay.structure, own.bay.wall, own.bay.line_number) for own in bays]
    spans = np.array([(own.bay.left_m, own.bay.right_m) for own in bays])
    _, wall = np.unique([repr(key) for key in walls], return_inverse=True)
    low, high = np.full(wall.max() + 1, np.inf), np.full(wall.max() + 1, -np.inf)
    np.minimum.at(low, wall, spans[:, 0])
    np.maximum.at(high, wall, spans[:, 1])
    middle = spans.mean(axis=1)
    to_low, to_high = middle - low[wall], high[wall] - middle
    # A wall of a polygon goes on to the right, one of a rectangle to the east or to the north.
    is_line = np.array([own.bay.line is not None for own in bays])
    onwards = is_line | (outward[:, 1] - outward[:, 0] < 0.0)
    return np.column_stack([np.where(onwards, to_high, to_low), np.where(onwards, to_low, to_high)])


def _covered(site: BlastSite, points_m: FloatArray) -> BoolArray:
    """Return whether points lie inside a structure (n,)."""
    covered = np.zeros(len(points_m), dtype=bool)
    for block in (block for outline in site.structures for block in outline.blocks):
        left, bottom, right, top = block.rectangle_m
        high_m = np.inf if block.height_m is None else block.height_m
        low, high = np.array([left, bottom, block.base_m]), np.array([right, top, high_m])
        covered |= ((points_m > low) & (points_m < high)).all(axis=1)
    return covered


def _wholly_covered(
    site: BlastSite, bays: Sequence[FacadeBay], before_m: FloatArray, outward: FloatArray
) -> BoolArray:
    """Return whether structures cover all of each bay, as a building that it touches does (bays,).

    Args:
        before_m: Places before the middles of the bays (bays, 3).
        outward: Their outward normals (bays, 3).
    """
    built = tuple(outline for outline in site.structures if not outline.is_barrier)
    alone = replace(site, structures=built)
    wide_m, high_m = np.array([(own.bay.width_m, own.bay.height_m) for own in bays]).T
    along = np.column_stack([-outward[:, 1], outward[:, 0], outward[:, 2]])
    whole = np.ones(len(bays), dtype=bool)
    for across, up in product(_SHARES, repeat=2):
        points_m = before_m + (across * wide_m)[:, np.newaxis] * along
        points_m[:, 2] += up * high_m
        whole &= _covered(alone, points_m)
    return whole


def _by_threat(scenario: Scenario, named: Sequence[MassPreset]) -> dict[str, tuple[AnySource, ...]]:
    """Return the sources of each threat: all of one mass and height, given or of the site."""
    found: dict[str, tuple[AnySource, ...]] = {}
    for called, source in _named_sources(scenario, named):
        high = f", {source.height_m:g} m high" if source.height_m else ""
        name = f"{called}{high}"
        found[name] = (*found.get(name, ()), source)
    return found


def _named_sources(
    scenario: Scenario, named: Sequence[MassPreset]
) -> Iterator[tuple[str, AnySource]]:
    """Yield each source with the name of its mass: with each given mass, else with its own."""
    for own in named:
        for source in scenario.charge:
            yield own.name, source.model_copy(update={"tnt_kg": own.tnt_kg})
    for source in () if named else scenario.charge:
        mass = f"{source.tnt_kg:g} kg"
        alike = {part.tnt_kg for part in scenario.charge if part.threat == source.threat}
        called = source.threat or mass
        yield called if len(alike) == 1 or called == mass else f"{called}, {mass}", source


def _places(
    scenario: Scenario, sources: Sequence[AnySource], layout: Sequence[Element], facade: _Facade
) -> Iterator[Charge]:
    """Yield the places of a threat, at most `_APART_M` apart if they are not too many.

    Where they are farther apart, and of vehicles, those nearest to each wall are among them.
    """
    lengths_m = [hypot(*(b - a for a, b in zip(*_span(own), strict=True))) for own in sources]
    apart_m = max(_APART_M, sum(lengths_m) / _MOST_PLACES)
    for source, length_m in zip(sources, lengths_m, strict=True):
        points: Iterable[PointM]
        if isinstance(source, VehicleSource):
            reach_m = vehicle_drive(scenario, source, layout).places_m
            near_m = _before_each_wall(facade, facade.nearest_of(reach_m)) if len(reach_m) else []
            points = dict.fromkeys((*worst_places(scenario, source, layout).places_m, *near_m))
        elif isinstance(source, RectangleSource):
            is_coarse = max(source.size_m) > _MOST_STEPS * _APART_M
            points = _grid(source, apart_m) + (_nearest(source, facade) if is_coarse else [])
        else:
            (x0, y0), (x1, y1) = _span(source)
            shares = np.linspace(0.0, 1.0, ceil(length_m / apart_m) + 1)
            points = [(x0 + share * (x1 - x0), y0 + share * (y1 - y0)) for share in shares]
            points += _nearest(source, facade) if apart_m > _APART_M else []
        yield from (Charge((float(x), float(y)), source.tnt_kg, source.height_m) for x, y in points)


def _nearest(source: PlaceSource, facade: _Facade) -> list[PointM]:
    """Return the place of a source nearest to each wall, before its middle if there are several."""
    return _before_each_wall(facade, source.nearest_m(facade.middles_m[:, :2]))


def _before_each_wall(facade: _Facade, places_m: FloatArray) -> list[PointM]:
    """Return the nearest place to each wall, of those nearest to each of its bays (bays, 2)."""
    away_m = np.hypot(*(places_m - facade.middles_m[:, :2]).T).round(_MILLIMETRES)
    off_middle_m = np.abs(np.diff(facade.ends_m, axis=1)[:, 0])
    found: dict[object, int] = {}
    for index in np.lexsort((off_middle_m, away_m)).tolist():
        bay = facade.bays[index].bay
        found.setdefault((bay.structure, bay.wall, bay.line_number), index)
    return [(x_m, y_m) for x_m, y_m in places_m[[*found.values()]].tolist()]


def _span(source: AnySource) -> tuple[PointM, PointM]:
    if isinstance(source, VehicleSource | RectangleSource):
        return (0.0, 0.0), (0.0, 0.0)
    return source.segment_m


def _grid(source: RectangleSource, apart_m: float) -> list[PointM]:
    left, bottom, right, top = source.rectangle_m
    x_m, y_m = (
        np.linspace(low, high, min(ceil((high - low) / apart_m), _MOST_STEPS) + 1)
        for low, high in ((left, right), (bottom, top))
    )
    return [(x, y) for x in x_m.tolist() for y in y_m.tolist()]


def _screened(
    name: str,
    facade: _Facade,
    places: Sequence[Charge],
    ways: Ways,
    atlas: SiteAtlas | None,
) -> ThreatScreening:
    """Return the place of a threat with the worst level, then the largest sum of damage."""
    _, tnt_kg, height_m = places[0]
    seen, around = ways, None
    if atlas is not None:
        charges_m = np.array([(*own.position_m, own.height_m) for own in places])
        around = atlas.at(charges_m, float(np.cbrt(tnt_kg)))
        # What hides a bay that faces the charge is in the factors; outside the atlas's range it
        # takes nothing off.
        seen = ways._replace(seen=around.faces.reshape(ways.away_m.shape))
    peaks, impulses = (in_the_open(part, seen, tnt_kg, height_m) for part in _LOADS)
    likely = peaks, impulses
    if around is not None:
        factors = around.likely.reshape((*impulses.shape, 2))
        likely = peaks * factors[..., 1], impulses * factors[..., 0]
        factors = around.counted.reshape((*impulses.shape, 2))
        impulses, peaks = impulses * factors[..., 0], peaks * factors[..., 1]
    numbers, parts = facade.kinds
    damage = np.zeros(peaks.shape)
    for kind, own_parts in enumerate(parts):
        which = numbers == kind
        of_parts = [_damage(part, peaks[:, which], impulses[:, which]) for part in own_parts]
        damage[:, which] = np.max(of_parts, axis=0, initial=0.0)
    order = [(int(other.max()), float(other.sum())) for other in damage]
    worst = max(range(len(places)), key=lambda index: order[index])
    own, in_view = _named(atlas, places[worst]), facade.sees(places[worst])
    load_pa, load_pa_s = peaks[worst], impulses[worst]
    responses = respond(facade.bays, *triangle(load_pa, load_pa_s)).each()
    bays = []
    for index, (filled, response) in enumerate(zip(facade.bays, responses, strict=True)):
        load = float(load_pa[index]), float(load_pa_s[index])
        away_m, is_seen = float(ways.away_m[worst, index]), bool(in_view[index])
        found = BayScreening(filled, away_m, is_seen, *load, response)
        peak_pa, pa_s = (float(part[worst, index]) for part in likely)
        found = replace(found, likely_pa_s=pa_s, likely_peak_pa=peak_pa)
        if own is not None:
            middle, low, high = (float(part[index, 0]) for part in own.factors[:3])
            found = replace(
                found,
                around=own.words[index],
                unknown=own.unknown[index],
                faces_charge=bool(own.faces[index]),
                is_behind=bool(own.is_behind[index]),
                factor=(middle, low, high),
                edges=float(own.edges.middle[index, 0]),
            )
        bays.append(found)
    others = _others(facade, places, worst, peaks, impulses)
    least_m = float(ways.away_m.min())
    return ThreatScreening(name, places[worst], len(places), tuple(bays), others, least_m)


def _others(
    facade: _Facade,
    places: Sequence[Charge],
    worst: int,
    peaks: FloatArray,
    impulses: FloatArray,
) -> tuple[OtherPlace, ...]:
    """Return the worst places by glass, peak and impulse, but for the worst one by damage.

    A requirement on one of these is kept only if it is kept there.
    """
    numbers, parts = facade.kinds
    glass = np.zeros(len(places))
    if any(isinstance(part, Panel) for own in parts for part in own):
        for kind, own in enumerate(parts):
            which = numbers == kind
            for pane in (part for part in own if isinstance(part, Pane)):
                damage = _damage(pane, peaks[:, which], impulses[:, which])
                glass = np.maximum(glass, damage.max(axis=1))
    measures = {
        "glass": glass,
        "peak": peaks.max(axis=1),
        "impulse": impulses.max(axis=1),
    }
    found: dict[int, list[str]] = {}
    for measure, most in measures.items():
        if most.max() > most[worst]:
            found.setdefault(int(most.argmax()), []).append(measure)
    return tuple(
        OtherPlace(
            " and ".join(words),
            places[index],
            tuple(respond(facade.bays, *triangle(peaks[index], impulses[index])).each()),
        )
        for index, words in found.items()
    )


def _named(atlas: SiteAtlas | None, place: Charge) -> Surroundings | None:
    """Return what surrounds the bays for one place, with names; `None` without an atlas."""
    if atlas is None:
        return None
    return atlas.around((*place.position_m, place.height_m), float(np.cbrt(place.tnt_kg)))


def _damage(part: Pane | Panel, peak_pa: FloatArray, impulse_pa_s: FloatArray) -> FloatArray:
    """Return the damage of a pane or panel under many loads (places, bays).

    It is that of a table, but exact for loads whose level decides and is not that of all of the
    table's points around them.
    """
    damage, least, most = _tabulated(part, peak_pa, impulse_pa_s)
    # The worst level is at least that of the loads whose level is clear.
    reached = int(least.max())
    unclear = (least.astype(int) < most.astype(int)) & (most.astype(int) >= reached)
    if unclear.any():
        exact = under_triangle(part, peak_pa[unclear], impulse_pa_s[unclear])
        damage[unclear] = damage_numbers(exact)
    return damage


def _tabulated(
    part: Pane | Panel, peak_pa: FloatArray, impulse_pa_s: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the damage of a pane or panel under many loads, by a table of it.

    The second and the third are the least and the most of the points around each load.
    """
    axes = [
        np.linspace(own.min(), own.max() + 1e-6, _POINTS)
        for own in (np.log(peak_pa), np.log(impulse_pa_s))
    ]
    # Bilinear: SciPy's interpolators take longer to import than this table takes.
    (row, down), (column, across) = (
        _between(axis, np.log(own)) for axis, own in zip(axes, (peak_pa, impulse_pa_s), strict=True)
    )
    # Loads fall together with distance, so that most of the table is not asked for.
    asked = np.zeros((_POINTS, _POINTS), dtype=bool)
    for more in product((0, 1), repeat=2):
        asked[row + more[0], column + more[1]] = True
    table, places = np.zeros(asked.shape), np.nonzero(asked)
    loads = [np.exp(axis[index]) for axis, index in zip(axes, places, strict=True)]
    table[places] = damage_numbers(under_triangle(part, *loads))
    corners = [table[row + more[0], column + more[1]] for more in product((0, 1), repeat=2)]
    first, last = ((1.0 - across) * low + across * high for low, high in (corners[:2], corners[2:]))
    damage = np.asarray((1.0 - down) * first + down * last)
    return damage, np.min(corners, axis=0), np.max(corners, axis=0)


def _between(axis: FloatArray, values: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the interval of an even axis in which each value lies, and its share of it."""
    at = (values - axis[0]) / (axis[1] - axis[0])
    index = np.clip(at.astype(int), 0, len(axis) - 2)
    return index, at - index
