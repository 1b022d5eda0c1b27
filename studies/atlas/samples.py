"""Samples of the atlas: numbers and changed loads of bays, from the groups that were run."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.atlas.between import numbers_between, rows_between
from blast_env.atlas.echoes import numbers_of_echoes
from blast_env.atlas.shadow import numbers_of_shadow
from blast_env.curves import Ways, in_the_open
from studies.atlas.scenes import CUBE_ROOT, MODULES


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

    @property
    def high(self) -> FloatArray:
        """Height of the building of each bay (bays,)."""
        return np.full(len(self.middles), self.judged[5])


def scenes_with_loads(groups: Iterable[Mapping[str, Any]]) -> Iterator[Bays]:
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
            loads = np.column_stack([scene["impulse"], scene["peak"]])
            if group["family"] == "shadow":
                before = side_on(bays)
            else:
                before = np.array([known[name] for name in scene["bays"]])
            yield replace(bays, log_change=np.log(loads / before))


def _boxes(boxes: list[Mapping[str, float]]) -> FloatArray:
    rows = [
        (
            *(box["x"], box["y"], box["x"] + box["depth"], box["y"] + box["width"]),
            *(box["base"], box["top"]),
        )
        for box in boxes
    ]
    return np.array(rows, dtype=float).reshape(-1, 6) / MODULES


def side_on(bays: Bays) -> FloatArray:
    """Return the side-on impulse over the cube root and the side-on peak of bays (bays, 2)."""
    unseen = np.zeros(len(bays.middles), dtype=bool)
    x_m, y_m, z_m = (CUBE_ROOT * bays.charge).tolist()
    ways = Ways.between((x_m, y_m, z_m), CUBE_ROOT * bays.middles, bays.normals, unseen)
    impulse, peak = (
        in_the_open(load, ways, CUBE_ROOT**3, z_m) for load in ("impulse", "overpressure")
    )
    return np.column_stack([impulse / CUBE_ROOT, peak])


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a law.

    Attributes:
        numbers: Numbers of the law (bays, numbers).
        log_change: Logarithms of the changes of impulse and peak (bays, 2).
        family: Family of each bay (bays,).
        group: Family and group (bays,).
        scene: Family, group and scene (bays,).
    """

    numbers: FloatArray
    log_change: FloatArray
    family: np.ndarray[Any, np.dtype[np.str_]]
    group: np.ndarray[Any, np.dtype[np.str_]]
    scene: np.ndarray[Any, np.dtype[np.str_]]


Numbers = Callable[[Bays], tuple[FloatArray, BoolArray]]


def samples(scenes: Iterable[Bays], numbers_of: Numbers) -> Samples:
    """Return the samples of a law, of bays that it is for."""
    numbers, changes, families, groups, names = [], [], [], [], []
    for bays in scenes:
        own, chosen = numbers_of(bays)
        count = int(chosen.sum())
        if not count:
            continue
        numbers.append(own[chosen])
        changes.append(bays.log_change[chosen])
        families += [bays.family] * count
        groups += [f"{bays.family}/{bays.group}"] * count
        names += [f"{bays.family}/{bays.group}/{bays.scene}"] * count
    return Samples(
        np.concatenate(numbers),
        np.concatenate(changes),
        np.array(families),
        np.array(groups),
        np.array(names),
    )


def row_between(bays: Bays) -> list[tuple[FloatArray, FloatArray]]:
    """Return the numbers of every row between, and the shares that it takes."""
    rows = rows_between(bays.charge, bays.middles, bays.normals[0], bays.boxes)
    return [(numbers_between(row, bays.charge), row.taken) for row in rows]


def samples_between(bays: Bays) -> tuple[FloatArray, BoolArray]:
    """Return the numbers of obstacles between, of scenes with one row."""
    normal = bays.normals[0]
    rows = rows_between(bays.charge, bays.middles, normal, bays.boxes)
    if len(rows) != 1:
        return np.empty((len(bays.middles), 0)), np.zeros(len(bays.middles), dtype=bool)
    found = numbers_between(rows[0], bays.charge)
    return found, np.ones(len(found), dtype=bool)


def samples_echoes(bays: Bays) -> tuple[FloatArray, BoolArray]:
    """Return the numbers of echoes, of bays that no obstacle hides."""
    normal = bays.normals[0]
    found = numbers_of_echoes(bays.charge, bays.middles, normal, bays.boxes, bays.high)
    hidden = np.zeros(len(found), dtype=bool)
    for row in rows_between(bays.charge, bays.middles, normal, bays.boxes):
        hidden |= row.taken[:, 0] > 0.5
    return found, ~hidden


def samples_shadow(bays: Bays) -> tuple[FloatArray, BoolArray]:
    """Return the numbers of shadows, of walls that face away."""
    found = numbers_of_shadow(bays.charge, bays.middles, bays.normals, bays.judged)
    away = ((bays.charge - bays.middles) * bays.normals).sum(axis=1) < 0.0
    return found, away
