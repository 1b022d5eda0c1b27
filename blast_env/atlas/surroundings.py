"""The surroundings of bays on a site: which laws of the atlas apply, and by how much.

Rows between charge and bay count together; they and echoes multiply. Where the law of rows does not
know them, they take nothing off the load; echoes outside the range of their law are the nearest
ones in it.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.atlas import attached, between, echoes, edges, shadow
from blast_env.atlas.laws import Factors, Laws, packaged_laws
from blast_env.site.blast_site import BlastSite

Names = np.ndarray[Any, np.dtype[np.str_]]

_NOTICED: Final = 0.02
"""Change of a load from which surroundings have a name in the answer."""

_AT_ONCE: Final = 1_000_000
"""Pairs of bays and boxes that are looked at together."""

BARRIER: Final = "barrier"
"""In the place of the structure's name, for pieces of a layout."""

_ALONG: Final = 1.0 - 1e-9
"""Least part of a normal along an axis of a wall that is parallel to the sides of the site."""

_PLACE: Final = re.compile(r"_x[-\d.]+_y[-\d.]+$")  # in the names of pieces


@dataclass(frozen=True, eq=False)
class Solid:
    """The boxes of a site, over the cube root of the charge.

    Attributes:
        boxes: Low x, y, high x, y, base and top (boxes, 6).
        names: Names of the boxes, with the height in m.
        structures: Name of the structure of each; "barrier" for its pieces.
        walls: Start x, y, end x, y, outward normal x, y, base and top of the walls of structures
            that stand at an angle, whose boxes are stairs (walls, 8).
        owners: Name of the structure of each of these walls.
    """

    boxes: FloatArray
    names: tuple[str, ...]
    structures: tuple[str, ...]
    walls: FloatArray
    owners: tuple[str, ...]

    def only(self, chosen: BoolArray) -> "Solid":
        """Return some of the boxes, and the walls of structures that have any of them."""
        which = np.flatnonzero(chosen).tolist()
        names, structures = (tuple(own[k] for k in which) for own in (self.names, self.structures))
        own = [name in structures for name in self.owners]
        owners = tuple(name for name in self.owners if name in structures)
        return Solid(self.boxes[chosen], names, structures, self.walls[own], owners)

    def over(self, scale: float) -> "Solid":
        """Return it with all lengths over the cube root of a mass."""
        lengths = np.array([scale] * 4 + [1.0] * 2 + [scale] * 2)
        return replace(self, boxes=self.boxes / scale, walls=self.walls / lengths)

    @cached_property
    def is_upright(self) -> BoolArray:
        """Whether the sides of each box are those of its structure, no stairs (boxes,)."""
        return np.array([name not in self.owners for name in self.structures], dtype=bool)

    @cached_property
    def is_building(self) -> BoolArray:
        """Whether each box is no piece of a layout (boxes,)."""
        return np.array([name != BARRIER for name in self.structures], dtype=bool)

    @classmethod
    def of(cls, site: BlastSite) -> "Solid":
        """Return the boxes of a site in m."""
        rows, names, structures = [], [], []
        walls: list[tuple[float, ...]] = []
        owners: list[str] = []
        for outline in site.structures:
            if any(max(map(abs, wall.normal)) < _ALONG for wall in outline.walls):
                top_m = site.air_height_m if outline.height_m is None else outline.height_m
                owners += [outline.name] * len(outline.walls)
                walls += [
                    (*wall.start_m, *wall.end_m, *wall.normal, outline.base_m, top_m)
                    for wall in outline.walls
                ]
            for block in outline.blocks:
                left, bottom, right, top = block.rectangle_m
                high_m = site.air_height_m if block.height_m is None else block.height_m
                rows.append((left, bottom, right, top, block.base_m or 0.0, high_m))
                names.append(f"{_PLACE.sub('', block.name) or outline.name} {high_m:g} m")
                structures.append(BARRIER if outline.is_barrier else outline.name)
        boxes = np.array(rows, dtype=float).reshape(-1, 6)
        own = np.array(walls, dtype=float).reshape(-1, 8)
        return cls(boxes, tuple(names), tuple(structures), own, tuple(owners))


@dataclass(frozen=True, eq=False)
class Walls:
    """The walls that bays lie on.

    Attributes:
        middles_m: Middles of the bays (bays, 3).
        normals: Their outward normals (bays, 3).
        structures: Name of the structure of each bay.
        high_m: Height of it (bays,).
        ends_m: Distances of the middles from the ends of the wall on the right and on the left,
            seen from outside (bays, 2).
        before_m: How far they lie before the wall (bays,).
    """

    middles_m: FloatArray
    normals: FloatArray
    structures: tuple[str, ...]
    high_m: FloatArray
    ends_m: FloatArray
    before_m: FloatArray

    def groups(self) -> list[IntArray]:
        """Return the bays of each wall, by their indices."""
        offset = (self.middles_m * self.normals).sum(axis=1)
        keys = np.column_stack([self.normals, offset]).round(3)
        _, wall = np.unique(keys, axis=0, return_inverse=True)
        return [np.flatnonzero(wall == number) for number in range(int(wall.max(initial=-1)) + 1)]


@dataclass(frozen=True, eq=False)
class PlaceFactors:
    """Factors on the loads of the curves, for bays and one or several places of a charge.

    Attributes:
        edges: For the edges of the wall and the angle of the wave, in the open; 1 for walls that
            face away.
        factors: For what stands around, on top of these.
        faces: Whether each bay faces the charge (bays,).
    """

    edges: Factors
    factors: Factors
    faces: BoolArray

    @property
    def likely(self) -> FloatArray:
        """Best estimates of the factors (bays, 2), of impulses and peaks."""
        return self.edges.middle * self.factors.middle

    @property
    def counted(self) -> FloatArray:
        """Factors for the loads (bays, 2), of impulses and peaks."""
        return self.edges.times(self.factors).counted


@dataclass(frozen=True, eq=False)
class Surroundings(PlaceFactors):
    """What surrounds the bays of a site for one place of a charge.

    Attributes:
        words: What each bay has, with the name of the obstacle; empty in the open.
        unknown: What each bay has outside the range of the laws; empty if nothing.
        is_behind: Whether rows of pieces or houses change the load of each bay, or might outside
            the range (bays,).
    """

    words: tuple[str, ...]
    unknown: tuple[str, ...]
    is_behind: BoolArray


class SiteAtlas:
    """The atlas on one site.

    Args:
        site: The site; its charge does not count.
        walls: The bays.
        known: The laws; the packaged ones by default.
    """

    def __init__(self, site: BlastSite, walls: Walls, known: Laws | None = None) -> None:
        self._solid = Solid.of(site)
        self._walls = walls
        self._groups = walls.groups()
        self._laws = packaged_laws() if known is None else known

    def around(self, charge_m: tuple[float, float, float], scale: float) -> Surroundings:
        """Return the surroundings of all bays, with their names.

        Args:
            charge_m: Place of the charge.
            scale: Cube root of its mass, kg^(1/3).
        """
        found, notes = self._found(np.array([charge_m]) / scale, scale)
        words, unknown = [""] * len(found.faces), [""] * len(found.faces)
        is_behind = np.zeros(len(found.faces), dtype=bool)
        for rows, note in notes:
            _add(words, rows[note.counts & note.in_range], note.name)
            _add(unknown, rows[~note.in_range], note.name)
            is_behind[rows[note.counts | ~note.in_range]] |= note.is_row
        return Surroundings(
            found.edges, found.factors, found.faces, tuple(words), tuple(unknown), is_behind
        )

    def at(self, charges_m: FloatArray, scale: float) -> PlaceFactors:
        """Return the factors for many places of a charge, of all bays (places * bays, ...).

        Args:
            charges_m: The places (places, 3).
            scale: Cube root of the mass, kg^(1/3).
        """
        charges = np.asarray(charges_m) / scale
        per_place = max(len(self._walls.middles_m) * len(self._solid.boxes), 1)
        several = max(_AT_ONCE // per_place, 1)
        found = [
            self._found(charges[start : start + several], scale)[0]
            for start in range(0, len(charges), several)
        ]
        return PlaceFactors(
            _joined([own.edges for own in found]),
            _joined([own.factors for own in found]),
            np.concatenate([own.faces for own in found]),
        )

    def _found(
        self, charges: FloatArray, scale: float
    ) -> tuple[PlaceFactors, list[tuple[IntArray, "_Note"]]]:
        """Return the factors for places of a charge, and what they come from, by their rows."""
        walls, count = self._walls, len(self._walls.middles_m)
        names = np.array(walls.structures)
        solid = self._solid.over(scale)
        own_edges, factors = _ones(len(charges) * count), _ones(len(charges) * count)
        faces, notes = np.zeros(len(charges) * count, dtype=bool), []
        for bays in self._groups:
            middles, normal = walls.middles_m[bays] / scale, walls.normals[bays[0]]
            before = float(walls.before_m[bays[0]]) / scale
            facing = (charges - middles[0]) @ normal > -before
            for is_facing in (True, False):
                places = np.flatnonzero(facing == is_facing)
                if not len(places):
                    continue
                rows = (places[:, np.newaxis] * count + bays).ravel()
                times = len(places)
                wall = _Wall(
                    np.repeat(charges[places], len(bays), axis=0),
                    np.tile(middles, (times, 1)),
                    normal,
                    np.tile(walls.high_m[bays] / scale, times),
                    np.tile(walls.ends_m[bays] / scale, (times, 1)),
                )
                if is_facing:
                    own = self._facing(wall, solid, np.tile(names[bays], times))
                else:
                    own = self._away(wall, solid, walls.structures[bays[0]])
                faces[rows] = is_facing
                for whole, part in ((own_edges, own.edges), (factors, own.factors)):
                    for target, values in zip(whole, part, strict=True):
                        target[rows] = values
                notes += [(rows, note) for note in own.notes]
        return PlaceFactors(own_edges, factors, faces), notes

    def _facing(self, wall: "_Wall", solid: Solid, structures: Names) -> "_BaySurroundings":
        """Return what shields a wall that faces the charge, and what throws waves back on it.

        Args:
            wall: The bays.
            solid: The boxes of the site.
            structures: Name of the structure of each bay (bays,).
        """
        count = len(wall.middles)
        every = np.ones(count, dtype=bool)
        own_edges, near = self._edges(wall)
        adjoins = attached.is_attached(wall.middles, wall.normal, solid.boxes)
        before = between.lies_before(wall.middles, wall.normal, solid.boxes)
        before &= ~adjoins | (solid.boxes[:, 4] == 0.0)  # what hangs on the wall is no front
        everything = wall.echoes_of(solid.only(before))
        has_pieces = bool((before & ~solid.is_building).any())
        buildings = everything
        if has_pieces:
            buildings = wall.echoes_of(solid.only(before & solid.is_building))
        fronts = echoes.fronts_among(everything, buildings)
        factors, notes = Factors.none(count), [near]
        free = solid.only(~adjoins)
        rows = between.rows_between(wall.charge, wall.middles, wall.normal, free.boxes)
        if rows:
            own_box = structures[:, np.newaxis] == np.array(free.structures)
            is_other = ~own_box & free.is_building, ~own_box & ~free.is_building
            around = between.around_of(wall.middles, wall.normal, free.boxes, *is_other)
            numbers = between.numbers_between(
                *(rows, wall.charge, wall.middles, wall.normal, wall.high),
                *(fronts, everything, around),
            )
            own = self._laws.between.factors(numbers)
            factors = own.where_known()
            most = np.argmax([row.gate for row in rows], axis=0)  # the row that takes most
            for index, row in enumerate(rows):
                tallest = row.members[int(free.boxes[row.members, 5].argmax())]
                name = f"behind {free.names[tallest]}"
                notes.append(replace(_Note.of(name, own, every).only(most == index), is_row=True))
        for law, name in (
            (self._laws.opposite, "a front opposite"),
            (self._laws.beside, "walls beside"),
        ):
            if law.gate(fronts).max() == 0.0:
                continue
            # Pieces throw the wave back as well, as far as the law knows such fronts.
            own = law.factors(fronts).where_in_range(law.factors(buildings))
            notes.append(_Note.of(name, own, every))
            factors = factors.times(own)
        if adjoins.any():
            own, note = self._adjoining(wall, solid.only(adjoins))
            factors = factors.times(own)
            notes.append(note)
        return _BaySurroundings(own_edges, factors, notes)

    def _adjoining(self, wall: "_Wall", solid: Solid) -> tuple[Factors, "_Note"]:
        """Return what canopies and podiums do; outside the range they take nothing off."""
        numbers = attached.numbers_of_attached(
            wall.charge, wall.middles, wall.normal, solid.boxes, wall.high
        )
        own = self._laws.attached.factors(numbers)
        note = _Note.of(
            f"{solid.names[0]} against its wall", own, np.ones(len(numbers), dtype=bool)
        )
        kept = own.in_range[:, np.newaxis]
        middle, low, high = (np.where(kept, part, np.maximum(part, 1.0)) for part in own[:3])
        return Factors(middle, low, high, own.in_range), note

    def _edges(self, wall: "_Wall") -> tuple[Factors, "_Note"]:
        """Return what the edges of a wall do, and a note if the charge is too near to it."""
        own = wall.charge, wall.middles, wall.normal, wall.ends
        numbers, to_wall = edges.numbers_of_edges(*own, wall.high), edges.to_the_wall(*own)
        against = edges.is_against(to_wall)
        note = _Note("a charge that stands against the wall", ~against, np.zeros_like(against))
        return edges.factors_of_edges(self._laws.edges, numbers, to_wall), note

    def _away(self, wall: "_Wall", solid: Solid, structure: str) -> "_BaySurroundings":
        """Return the shadow on a wall of a rectangular building that faces away.

        The law is of buildings that stand alone: another one throws the wave back into the shadow.
        """
        count = len(wall.middles)
        own = [index for index, name in enumerate(solid.structures) if name == structure]
        alone = Factors.none(count)
        if len(own) != 1:
            return _BaySurroundings(alone, alone, [])
        box = solid.boxes[own[0]]
        normals = np.broadcast_to(wall.normal, (count, 3))
        numbers = shadow.numbers_of_shadow(wall.charge, wall.middles, normals, box)
        factors = self._laws.shadow.factors(numbers)
        others = solid.is_building & (np.arange(len(solid.boxes)) != own[0])
        name = "in the shadow of its building"
        if others.any():
            factors = factors._replace(in_range=np.zeros(count, dtype=bool))
            name = f"{name}, with another on the site that may add load"
        note = _Note.of(name, factors, np.ones(count, dtype=bool))
        return _BaySurroundings(alone, factors.where_known(), [note])


@dataclass(frozen=True, eq=False)
class _Wall:
    """The bays of one wall and the charge, over the cube root of its mass."""

    charge: FloatArray
    middles: FloatArray
    normal: FloatArray
    high: FloatArray
    ends: FloatArray

    def echoes_of(self, solid: Solid) -> FloatArray:
        """Return the numbers of the echoes of some boxes and walls (bays, numbers)."""
        boxes = solid.boxes[solid.is_upright]
        own = self.charge, self.middles, self.normal
        return echoes.numbers_of_echoes(*own, boxes, self.high, solid.walls)


def _ones(bays: int) -> Factors:
    """Return factors of 1 in arrays of their own, to be filled."""
    one = Factors.none(bays)
    return Factors(one.middle.copy(), one.low.copy(), one.high.copy(), one.in_range.copy())


def _joined(parts: Sequence[Factors]) -> Factors:
    middle, low, high, in_range = (np.concatenate(own) for own in zip(*parts, strict=True))
    return Factors(middle, low, high, in_range)


@dataclass(frozen=True, eq=False)
class _Note:
    """The name of what stands around, and which bays it changes in range, or outside it."""

    name: str
    in_range: BoolArray
    counts: BoolArray
    is_row: bool = False

    @classmethod
    def of(cls, name: str, factors: Factors, counts: BoolArray) -> "_Note":
        """Return the note on factors; those that change nothing are in range, and do not count."""
        changed = np.abs(np.log(factors.middle)).max(axis=1) > _NOTICED
        return cls(name, factors.in_range | ~changed, changed & counts)

    def only(self, chosen: BoolArray) -> "_Note":
        """Return the note for some of the bays."""
        return _Note(self.name, self.in_range | ~chosen, self.counts & chosen)


@dataclass(frozen=True, eq=False)
class _BaySurroundings:
    """What is around the bays of one wall."""

    edges: Factors
    factors: Factors
    notes: list[_Note]


def _add(texts: list[str], rows: IntArray, name: str) -> None:
    for index in rows.tolist():
        texts[index] = f"{texts[index]}, {name}" if texts[index] else name
