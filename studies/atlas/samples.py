"""Samples of the atlas: numbers and changed loads of bays, from the groups that were run."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.atlas.attached import numbers_of_attached
from blast_env.atlas.between import WIDTHS, Row, around_of, numbers_between, rows_between
from blast_env.atlas.echoes import fronts_among, numbers_of_echoes
from blast_env.atlas.edges import NUMBERS as EDGES
from blast_env.atlas.edges import is_against, numbers_of_edges, to_the_wall
from blast_env.atlas.laws import SMALL, Factors, Law
from blast_env.atlas.shadow import numbers_of_shadow
from blast_env.curves import Ways, in_the_open
from studies.atlas.scenes import CUBE_ROOT, MODULES

Group = Mapping[str, Any]
"""A group of scenes as plain data, from a file or a table."""

LEAST_DISTANCE: Final = 1.3
"""Nearest bays of the law of edges, m/kg^(1/3); walls may be breached from 1.7 inwards."""

OF_PIECES: Final = ("wall", "posts", "raised", "far", "pieces", "shaft", "distant", "slant")
"""Families whose boxes are pieces of layouts; of others the first ones are buildings."""

OPEN: Final = "open"
"""Family of walls in the open; the first scenes of the others count among them."""


@dataclass(frozen=True, eq=False)
class Bays:
    """The bays of one scene.

    Attributes:
        family: Its family.
        group: Its group.
        scene: Its number in the group.
        numbers: The design's numbers.
        charge: Place of the charge, m/kg^(1/3) (3,).
        middles: Middles of the bays (bays, 3).
        normals: Their outward normals (bays, 3).
        boxes: Low x, y, high x, y, base and top of other boxes (boxes, 6).
        judged: The box with the bays (6,).
        log_change: Logarithms of the impulse and the peak over those without obstacle (bays, 2).
        known: Ends below and above of the intervals of what was taken off that (2, bays, 2).
    """

    family: str
    group: int
    scene: int
    numbers: Mapping[str, float]
    charge: FloatArray
    middles: FloatArray
    normals: FloatArray
    boxes: FloatArray
    judged: FloatArray
    log_change: FloatArray
    known: FloatArray | None = None

    @property
    def is_building(self) -> BoolArray:
        """Whether each other box is a building, not a piece of a layout (boxes,)."""
        houses = self.numbers.get("houses", 0 if self.family in OF_PIECES else len(self.boxes))
        return np.arange(len(self.boxes)) < houses

    @property
    def high(self) -> FloatArray:
        """Height of the building of each bay (bays,)."""
        return np.full(len(self.middles), self.judged[5])


def scenes_with_loads(groups: Iterable[Group]) -> Iterator[Bays]:
    """Yield the scenes of groups with the change of their loads.

    Loads are relative to those of the group's first scene, those of shadows to the side-on load.
    """
    for group in groups:
        scenes = group["scenes"]
        first = scenes[0]
        known = {
            name: loads
            for name, *loads in zip(first["bays"], first["impulse"], first["peak"], strict=True)
        }
        for number, scene in enumerate(scenes):
            if scene["up"] != first["up"] or (number == 0) != (group["family"] == "shadow"):
                continue
            bays, loads = _bays_of(group, number)
            if group["family"] == "shadow":
                before = curves_at(bays, False)
            else:
                before = np.array([known[name] for name in scene["bays"]])
            yield replace(bays, log_change=np.log(loads / before))


def walls_in_the_open(groups: Iterable[Group]) -> Iterator[Bays]:
    """Yield the first scenes of groups, a building in the open; loads over those of the curves."""
    for number, group in enumerate(groups):
        bays, loads = _bays_of(group, 0)
        change = np.log(loads / curves_at(bays, True))
        yield replace(bays, family=OPEN, group=number, log_change=change)


def impulses_in_the_open(groups: Iterable[Group]) -> Iterator[Bays]:
    """Yield walls in the open with the peaks of the curves: cells clip them, edges do not."""
    for bays in walls_in_the_open(groups):
        yield replace(bays, log_change=bays.log_change * np.array([1.0, 0.0]))


def _bays_of(group: Group, number: int) -> tuple[Bays, FloatArray]:
    """Return the bays of a scene without changes, and their impulses and peaks (bays, 2)."""
    scene = group["scenes"][number]
    bays = Bays(
        family=group["family"],
        group=group["group"],
        scene=number,
        numbers=scene["numbers"],
        charge=np.array([0.0, 0.0, scene["up"] / MODULES]),
        middles=np.array(scene["middles"]),
        normals=np.array(scene["normals"]),
        boxes=_boxes(scene["others"]),
        judged=_boxes([scene["judged"]])[0],
        log_change=np.empty((0, 2)),
    )
    return bays, np.column_stack([scene["impulse"], scene["peak"]])


def _boxes(boxes: list[Mapping[str, float]]) -> FloatArray:
    rows = [
        (
            *(box["x"], box["y"], box["x"] + box["depth"], box["y"] + box["width"]),
            *(box["base"], box["top"]),
        )
        for box in boxes
    ]
    return np.array(rows, dtype=float).reshape(-1, 6) / MODULES


def curves_at(bays: Bays, facing: bool) -> FloatArray:
    """Return the impulse over the cube root and the peak of bays by the curves (bays, 2).

    Args:
        bays: The bays.
        facing: Whether walls that face the charge reflect; else all loads are side-on.
    """
    seen = np.full(len(bays.middles), facing) & ~away_from(bays)
    x_m, y_m, z_m = (CUBE_ROOT * bays.charge).tolist()
    ways = Ways.between((x_m, y_m, z_m), CUBE_ROOT * bays.middles, bays.normals, seen)
    impulse, peak = (
        in_the_open(load, ways, CUBE_ROOT**3, z_m) for load in ("impulse", "overpressure")
    )
    return np.column_stack([impulse / CUBE_ROOT, peak])


def away_from(bays: Bays) -> BoolArray:
    """Return whether bays lie on walls that face away from the charge (bays,)."""
    return np.asarray(((bays.charge - bays.middles) * bays.normals).sum(axis=1) < 0.0)


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a law.

    Attributes:
        numbers: Numbers of the law (bays, numbers).
        log_change: Logarithms of the changes of impulse and peak (bays, 2).
        family: Family of each bay (bays,).
        group: Family and group (bays,).
        scene: Family, group and scene (bays,).
        known: Ends of the intervals of what was taken off the changes before, below and above (2,
            bays, 2).
    """

    numbers: FloatArray
    log_change: FloatArray
    family: np.ndarray[Any, np.dtype[np.str_]]
    group: np.ndarray[Any, np.dtype[np.str_]]
    scene: np.ndarray[Any, np.dtype[np.str_]]
    known: FloatArray

    def with_known(self, own: Factors) -> Factors:
        """Return factors with the intervals of what was taken off as well."""
        one = np.ones_like(own.middle)
        low, high = np.exp(-self.known[0]), np.exp(self.known[1])
        return own.times(Factors(one, low, high, own.in_range))

    def less_known(self, off: FloatArray) -> FloatArray:
        """Return what errors are beyond the intervals of what was taken off (bays, 2).

        Intervals of factors that multiply add up by their squares.
        """
        known = np.where(off < 0.0, self.known[0], self.known[1])
        return np.asarray(np.sign(off) * np.sqrt(np.maximum(off**2 - known**2, 0.0)))


Numbers = Callable[[Bays], tuple[FloatArray, BoolArray]]


def samples(scenes: Iterable[Bays], numbers_of: Numbers) -> Samples:
    """Return the samples of a law, of bays that it is for."""
    numbers, changes, families, groups, names, known = [], [], [], [], [], []
    for bays in scenes:
        own, chosen = numbers_of(bays)
        count = int(chosen.sum())
        if not count:
            continue
        numbers.append(own[chosen])
        changes.append(bays.log_change[chosen])
        nothing = np.zeros((2, len(chosen), 2))
        known.append((nothing if bays.known is None else bays.known)[:, chosen])
        families += [bays.family] * count
        groups += [f"{bays.family}/{bays.group}"] * count
        names += [f"{bays.family}/{bays.group}/{bays.scene}"] * count
    return Samples(
        np.concatenate(numbers),
        np.concatenate(changes),
        np.array(families),
        np.array(groups),
        np.array(names),
        np.concatenate(known, axis=1),
    )


def less_echoes(scenes: Iterable[Bays], laws: Sequence[Law]) -> Iterator[Bays]:
    """Yield scenes with what is left of their changes apart from laws of echoes."""
    if not laws:
        yield from scenes
        return
    for bays in scenes:
        found = fronts_of(bays)
        echo = reduce(Factors.times, [law.factors(found) for law in laws])
        middle, low, high = (np.log(part) for part in echo[:3])
        known = np.stack([middle - low, high - middle])
        yield replace(bays, log_change=bays.log_change - middle, known=known)


def fronts_of(bays: Bays) -> FloatArray:
    """Return the numbers of the echoes that count apart from rows (bays, numbers)."""
    everything = echoes_of(bays, bays.boxes)
    if bays.is_building.all():
        return everything
    return fronts_among(everything, echoes_of(bays, bays.boxes[bays.is_building]))


def echoes_of(bays: Bays, boxes: FloatArray) -> FloatArray:
    """Return the numbers of the echoes of some boxes (bays, numbers)."""
    return numbers_of_echoes(bays.charge, bays.middles, bays.normals[0], boxes, bays.high)


def rows_of(bays: Bays) -> list[Row]:
    """Return the rows between."""
    return rows_between(bays.charge, bays.middles, bays.normals[0], bays.boxes)


def numbers_of(bays: Bays, rows: Sequence[Row]) -> FloatArray:
    """Return the numbers of some rows together (bays, numbers)."""
    normal = bays.normals[0]
    around = around_of(bays.middles, normal, bays.boxes, bays.is_building, ~bays.is_building)
    fronts, everything = fronts_of(bays), echoes_of(bays, bays.boxes)
    return numbers_between(
        rows, bays.charge, bays.middles, normal, bays.high, fronts, everything, around
    )


def samples_between(bays: Bays) -> tuple[FloatArray, BoolArray]:
    """Return the numbers of obstacles between, of bays from which they take something away."""
    rows, count = rows_of(bays), len(bays.middles)
    if not rows:
        return np.empty((count, 0)), np.zeros(count, dtype=bool)
    found = numbers_of(bays, rows)
    return found, np.asarray(found[:, : len(WIDTHS)].mean(axis=1) >= SMALL)


def samples_echoes(bays: Bays) -> tuple[FloatArray, BoolArray]:
    """Return the numbers of echoes, of bays that no obstacle hides."""
    found = fronts_of(bays)
    hidden = np.zeros(len(found), dtype=bool)
    for row in rows_of(bays):
        hidden |= row.taken[:, 0] > 0.5
    return found, ~hidden


def samples_attached(bays: Bays) -> tuple[FloatArray, BoolArray]:
    """Return the numbers of what adjoins a wall, of bays that it does not cover."""
    normal, up = bays.normals[0], bays.middles[:, 2, np.newaxis]
    found = numbers_of_attached(bays.charge, bays.middles, normal, bays.boxes, bays.high)
    covered = (up >= bays.boxes[:, 4]) & (up <= bays.boxes[:, 5])
    return found, np.asarray(~covered.any(axis=1))


def samples_shadow(bays: Bays) -> tuple[FloatArray, BoolArray]:
    """Return the numbers of shadows, of walls that face away."""
    found = numbers_of_shadow(bays.charge, bays.middles, bays.normals, bays.judged)
    return found, away_from(bays)


def samples_edges(bays: Bays) -> tuple[FloatArray, BoolArray]:
    """Return the numbers of walls in the open, of those that face the charge."""
    low, high = bays.judged[:2], bays.judged[2:4]
    found, to_wall = np.empty((len(bays.middles), len(EDGES))), np.empty(len(bays.middles))
    for normal in np.unique(bays.normals, axis=0):
        own = (bays.normals == normal).all(axis=1)
        along = int(abs(normal[0]) > 0.5)  # a wall to the west or east runs along y
        place = bays.middles[own, along]
        ends = np.column_stack([high[along] - place, place - low[along]])
        if normal[0] - normal[1] < 0.0:  # to the west or north it goes on to the left
            ends = ends[:, ::-1]
        lies = bays.charge, bays.middles[own], normal, ends
        found[own], to_wall[own] = numbers_of_edges(*lies, bays.high[own]), to_the_wall(*lies)
    distance = np.linalg.norm(bays.charge - bays.middles, axis=1)
    return found, (distance >= LEAST_DISTANCE) & ~away_from(bays) & ~is_against(to_wall)
