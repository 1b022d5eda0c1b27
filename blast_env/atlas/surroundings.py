"""The surroundings of bays on a site: which laws of the atlas apply, and by how much.

Of several rows between charge and bay the one that takes most counts alone; it and echoes multiply.
`python -m studies.atlas rules` compares that with gas dynamics. Where the law of rows does not know
one, it takes nothing off the load; echoes outside the range of their law are the nearest ones in
it.
"""

import re
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.atlas import between, echoes, edges, shadow
from blast_env.atlas.laws import Factors, Laws, packaged_laws
from blast_env.site.blast_site import BlastSite

_NOTICED: Final = 0.02
"""Change of a load from which surroundings have a name in the answer."""

BARRIER: Final = "barrier"
"""In the place of the structure's name, for pieces of a layout."""

_PLACE: Final = re.compile(r"_x[-\d.]+_y[-\d.]+$")  # in the names of pieces


@dataclass(frozen=True, eq=False)
class Solid:
    """The boxes of a site, over the cube root of the charge.

    Attributes:
        boxes: Low x, y, high x, y, base and top (boxes, 6).
        names: Names of the boxes, with the height in m.
        structures: Name of the structure of each; "barrier" for its pieces.
    """

    boxes: FloatArray
    names: tuple[str, ...]
    structures: tuple[str, ...]

    @cached_property
    def is_building(self) -> BoolArray:
        """Whether each box is no piece of a layout (boxes,)."""
        return np.array([name != BARRIER for name in self.structures], dtype=bool)

    @classmethod
    def of(cls, site: BlastSite) -> "Solid":
        """Return the boxes of a site in m."""
        rows, names, structures = [], [], []
        for outline in site.structures:
            for block in outline.blocks:
                left, bottom, right, top = block.rectangle_m
                high_m = site.air_height_m if block.height_m is None else block.height_m
                rows.append((left, bottom, right, top, block.base_m or 0.0, high_m))
                names.append(f"{_PLACE.sub('', block.name) or outline.name} {high_m:g} m")
                structures.append(BARRIER if outline.is_barrier else outline.name)
        return cls(np.array(rows, dtype=float).reshape(-1, 6), tuple(names), tuple(structures))


@dataclass(frozen=True, eq=False)
class Walls:
    """The walls that bays lie on.

    Attributes:
        middles_m: Middles of the bays (bays, 3).
        normals: Their outward normals (bays, 3).
        structures: Name of the structure of each bay.
        high_m: Height of it (bays,).
        ends_m: Distances of the middles from both ends of the wall (bays, 2).
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
class Surroundings:
    """What surrounds the bays of a site for one place of a charge.

    Attributes:
        edges: Factors on the loads of the curves, in the open: for the edges of the wall and the
            angle of the wave. 1 for walls that face away.
        factors: Factors on those loads for what stands around.
        faces: Whether each bay faces the charge (bays,).
        words: What each bay has, with the name of the obstacle; empty in the open.
        unknown: What each bay has outside the range of the laws; empty if nothing.
    """

    edges: Factors
    factors: Factors
    faces: BoolArray
    words: tuple[str, ...]
    unknown: tuple[str, ...]

    @property
    def likely(self) -> FloatArray:
        """Best estimates of the factors (bays, 2)."""
        return self.edges.middle * self.factors.middle

    @property
    def counted(self) -> FloatArray:
        """Factors for the loads (bays, 2), of impulses and peaks."""
        return self.edges.times(self.factors).counted


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
        """Return the surroundings of all bays.

        Args:
            charge_m: Place of the charge.
            scale: Cube root of its mass, kg^(1/3).
        """
        walls, count = self._walls, len(self._walls.middles_m)
        charge = np.array(charge_m) / scale
        solid = replace(self._solid, boxes=self._solid.boxes / scale)
        own_edges, factors = _ones(count), _ones(count)
        words, unknown = [""] * count, [""] * count
        faces = np.zeros(count, dtype=bool)
        for bays in self._groups:
            wall = _Wall(
                charge,
                walls.middles_m[bays] / scale,
                walls.normals[bays[0]],
                walls.high_m[bays] / scale,
                walls.ends_m[bays] / scale,
            )
            before = float(walls.before_m[bays[0]]) / scale
            if float((charge - wall.middles[0]) @ wall.normal) > -before:
                faces[bays] = True
                own = self._facing(wall, solid)
            else:
                own = self._away(wall, solid, walls.structures[bays[0]])
            for whole, part in ((own_edges, own.edges), (factors, own.factors)):
                for target, values in zip(whole, part, strict=True):
                    target[bays] = values
            for index, name, missing in zip(bays.tolist(), own.words, own.unknown, strict=True):
                words[index], unknown[index] = name, missing
        return Surroundings(own_edges, factors, faces, tuple(words), tuple(unknown))

    def _edges(self, wall: "_Wall") -> tuple[Factors, str]:
        """Return what the edges of a wall do, and a word if the charge is too near to it."""
        law = self._laws.edges
        numbers = edges.numbers_of_edges(
            wall.charge, wall.middles, wall.normal, wall.ends, wall.high
        )
        near = "a charge that stands against the wall" if edges.is_against(law, numbers) else ""
        return edges.factors_of_edges(law, numbers), near

    def _facing(self, wall: "_Wall", solid: Solid) -> Surroundings:
        """Return what shields a wall that faces the charge, and what throws waves back on it."""
        count = len(wall.middles)
        (own_edges, near), every = self._edges(wall), np.ones(count, dtype=bool)
        factors, words, unknown = Factors.none(count), [""] * count, [near] * count
        governing: list[tuple[Factors, str]] = []
        for row in between.rows_between(wall.charge, wall.middles, wall.normal, solid.boxes):
            own = self._laws.between.factors(between.numbers_between(row, wall.charge))
            tallest = row.members[int(solid.boxes[row.members, 5].argmax())]
            governing.append((own, f"behind {solid.names[tallest]}"))
            factors = factors.least(own.where_known())
        for own, name in governing:
            counts = own.middle[:, 0] <= factors.middle[:, 0]  # the row that takes most
            _note(words, unknown, name, own, counts)
        # Pieces throw the wave back like fronts: a row behind a charge, or beside a bay.
        boxes = solid.boxes[between.lies_before(wall.middles, wall.normal, solid.boxes)]
        if not len(boxes):
            return Surroundings(own_edges, factors, every, tuple(words), tuple(unknown))
        numbers = echoes.numbers_of_echoes(wall.charge, wall.middles, wall.normal, boxes, wall.high)
        for law, name in (
            (self._laws.opposite, "a front opposite"),
            (self._laws.beside, "walls beside"),
        ):
            if law.gate(numbers).max() == 0.0:
                continue
            own = law.factors(numbers)
            _note(words, unknown, name, own, every)
            factors = factors.times(own)
        return Surroundings(own_edges, factors, every, tuple(words), tuple(unknown))

    def _away(self, wall: "_Wall", solid: Solid, structure: str) -> Surroundings:
        """Return the shadow on a wall of a rectangular building that faces away.

        The law is of buildings that stand alone: one behind throws the wave back into the shadow.
        """
        count = len(wall.middles)
        own = [index for index, name in enumerate(solid.structures) if name == structure]
        alone, hidden, nothing = Factors.none(count), np.zeros(count, dtype=bool), ("",) * count
        if len(own) != 1:
            return Surroundings(alone, alone, hidden, nothing, nothing)
        box = solid.boxes[own[0]]
        normals = np.broadcast_to(wall.normal, (count, 3))
        numbers = shadow.numbers_of_shadow(wall.charge, wall.middles, normals, box)
        factors = self._laws.shadow.factors(numbers)
        others = solid.is_building & (np.arange(len(solid.boxes)) != own[0])
        name = "in the shadow of its building"
        if between.lies_before(wall.middles, wall.normal, solid.boxes[others]).any():
            factors = factors._replace(in_range=np.zeros(count, dtype=bool))
            name = f"{name}, with another behind that may add load"
        words, unknown = [""] * count, [""] * count
        every = np.ones(count, dtype=bool)
        _note(words, unknown, name, factors, every)
        return Surroundings(alone, factors.where_known(), hidden, tuple(words), tuple(unknown))


@dataclass(frozen=True, eq=False)
class _Wall:
    """The bays of one wall and the charge, over the cube root of its mass."""

    charge: FloatArray
    middles: FloatArray
    normal: FloatArray
    high: FloatArray
    ends: FloatArray


def _ones(bays: int) -> Factors:
    """Return factors of 1 in arrays of their own, to be filled."""
    return Factors(*(own.copy() for own in Factors.none(bays)))


def _note(
    words: list[str], unknown: list[str], name: str, factors: Factors, counts: BoolArray
) -> None:
    """Add the name of an obstacle to the bays that it changes, or to those outside its range."""
    changed = np.abs(np.log(factors.middle)).max(axis=1) > _NOTICED
    for index in np.flatnonzero(changed & factors.in_range & counts).tolist():
        words[index] = f"{words[index]}, {name}" if words[index] else name
    for index in np.flatnonzero(changed & ~factors.in_range).tolist():
        unknown[index] = f"{unknown[index]}, {name}" if unknown[index] else name
