"""A building of an IFC model: its ground, its parts and their windows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from blast_env.io.importing.bodies import LEAST_STOREY_M, BodyPart, Faces, common, enclosed
from blast_env.io.importing.ledger import Fate, Ledger
from blast_env.io.importing.options import ImportOptions
from blast_env.io.importing.site_map import MapFeature, Tags

_GROUND: Final = "ground under buildings of a model"
_NARROW: Final = "eaves, balconies and other narrow overhangs of buildings"
_CURTAIN: Final = "glass of curtain walls, which no facade has"
_ONE_SIZE: Final = "outer windows"
_SIZES: Final = "outer windows of several sizes, each with the largest pane of its part"
_LOW: Final = "lower than a storey"
_SMALL: Final = "beside a building, thin or small"

_BASE_M: Final = 0.5
_SLAB_M: Final = 0.35
"""Largest distance of the top of a floor slab from its storey."""

_STOREY_M: Final = 2.0
"""Least height between floors; levels between are no storeys."""

_OUTER_M: Final = 0.75
"""Largest distance of an outer window from the outside of the walls."""

_BESIDE_M: Final = 0.5
"""Largest distance of what hangs at an outer wall."""

_ROOF_SHARE: Final = 0.8
"""A window whose depth in plan is more than this share of its rise lies in a roof."""

_HALF: Final = 0.5
_BAYS_M: Final = (1.0, 50.0)
_PANES_M: Final = (0.05, 20.0)
_SILLS_M: Final = (0.0, 10.0)
_LEAST_M2: Final = 1.0
_DIGITS: Final = 2


@dataclass(frozen=True, eq=False)
class Solid:
    """An element with a shape.

    Attributes:
        place: Its place in the file.
        is_post: Whether it is no part of a building, but may carry one or close a gap of its walls.
    """

    element: Any
    place: str
    is_post: bool
    faces: Faces

    @cached_property
    def low_m(self) -> float:
        """Its lowest height."""
        return float(self.faces.low_m.min())

    @cached_property
    def high_m(self) -> float:
        """Its highest height."""
        return float(self.faces.high_m.max())

    @cached_property
    def shadow(self) -> BaseGeometry:
        """The area below it."""
        return self.faces.shadow

    @property
    def feet(self) -> list[BaseGeometry]:
        """Its area and its vertical faces in plan."""
        return [self.shadow, *self.faces.plans[~self.faces.is_area]]

    @cached_property
    def sides_m(self) -> tuple[float, float]:
        """Its longer and shorter side in plan, m."""
        around = shapely.get_coordinates(shapely.minimum_rotated_rectangle(self._corners))
        if len(around) < 2:
            return 0.0, 0.0
        lengths_m = np.hypot(*np.diff(around[:3], axis=0).T)
        shorter_m = float(lengths_m.min()) if len(lengths_m) > 1 else 0.0
        return float(lengths_m.max()), shorter_m

    @cached_property
    def middle(self) -> BaseGeometry:
        """Its middle in plan."""
        return shapely.centroid(self._corners)

    @property
    def _corners(self) -> BaseGeometry:
        return shapely.MultiPoint(shapely.get_coordinates(list(self.faces.plans)))

    @property
    def middle_m(self) -> float:
        """Its middle height."""
        return 0.5 * (self.low_m + self.high_m)

    def parts(
        self, ground_m: float, least_m2: float, least_height_m: float | None
    ) -> list[BodyPart]:
        """Return it as a building of its own; a wall of a lower height if one is given."""
        lowest_m = LEAST_STOREY_M if least_height_m is None else least_height_m
        if self.high_m <= ground_m + lowest_m:
            return []
        feet = list(self.faces.plans[self.faces.low_m <= ground_m + LEAST_STOREY_M])
        found = self.faces.parts(ground_m, feet, least_m2, lowest_m)
        if found or least_height_m is None or self.shadow.is_empty:
            return found
        return [BodyPart(self.shadow, max(self.low_m, ground_m), self.high_m)]


def is_window(solid: Solid) -> bool:
    """Return whether a solid is a window."""
    return bool(solid.element.is_a("IfcWindow"))


@dataclass(frozen=True, eq=False)
class Building:
    """A building of a model.

    Attributes:
        place: Its place in the file.
        name: Its name, or an empty string.
        solids: Its elements.
        storeys_m: Heights of its storeys in the model, by the ids of their entities.
        placed_m: Height at which it is placed in the model.
        stated_m: Heights that the model states for the ground, with words on each.
    """

    place: str
    name: str
    solids: tuple[Solid, ...]
    storeys_m: Mapping[int, float]
    placed_m: float
    stated_m: tuple[tuple[str, float], ...]
    options: ImportOptions

    @property
    def ground_m(self) -> float:
        """Height of the ground in the model."""
        return self._ground[1]

    @cached_property
    def parts(self) -> list[MapFeature]:
        """Its parts, relative to the ground: each is a feature at its place."""
        found = []
        tags: Tags = {"building": "yes", "name": self.name}
        for number, part in enumerate(self._bodies):
            extent_m = part.base_m - self.ground_m, part.top_m - self.ground_m
            facade = self._facade(part, self._windows.get(number, ()))
            found.append(
                MapFeature(
                    part.outline,
                    tags,
                    self.place,
                    facade=facade,
                    extent_m=extent_m,
                    part_of=self.place if len(self._bodies) > 1 else "",
                )
            )
        return found

    @cached_property
    def read(self) -> tuple[tuple[Solid, str], ...]:
        """Its elements that are read, with what they are; an empty text for the usual."""
        outer = {solid for own in self._windows.values() for solid in own}
        found = []
        for solid in self.solids:
            if is_window(solid):
                is_inner = solid not in outer
                if not (is_inner and _is_in_roof(solid)):
                    words = "windows of inner walls, in no facade" if is_inner else "windows"
                    found.append((solid, words))
            elif not solid.is_post and not self.reason(solid):
                found.append((solid, ""))
        return tuple(found)

    def reason(self, solid: Solid) -> str:
        """Return why an element is no part of the building; an empty text if it may be one."""
        if solid.is_post:
            return ""
        if is_window(solid):
            return "in roofs" if _is_in_roof(solid) else ""
        shadow, near = solid.shadow, shapely.buffer(self._outline, _BESIDE_M)
        if shapely.intersection(shadow, near).area >= _HALF * shadow.area:
            return ""
        return _LOW if solid.high_m <= self.ground_m + LEAST_STOREY_M else _SMALL

    def note(self, ledger: Ledger) -> None:
        """Enter the ground that was found, what is narrow, and the windows."""
        words, ground_m = self._ground
        is_sure = words == "where it is placed"
        fate = Fate.NOTED if is_sure else Fate.GUESSED
        ledger.add(fate, _GROUND, self.place, self.name, f"at {ground_m:g} m, {words}")
        # What is narrower than a module is cut off, and said.
        lost_m2 = self._shadow.area - self._outline.area
        if lost_m2 > _LEAST_M2:
            ledger.add(Fate.CUT, _NARROW, self.place, self.name, f"{lost_m2:.1f} m2")
        for number, windows in self._windows.items():
            sizes = {_size_m(window) for window in windows}
            width_m, height_m = _largest(windows)
            glass_m2 = sum(np.prod(_size_m(window)) for window in windows)
            detail = (
                f"{len(windows)} with {glass_m2:.1f} m2 of glass, to {self._bodies[number].top_m:g}"
                f" m, {len(sizes)} sizes, the largest {width_m:g} x {height_m:g} m"
            )
            kind = _SIZES if len(sizes) > 1 else _ONE_SIZE
            fate = Fate.GUESSED if len(sizes) > 1 else Fate.NOTED
            ledger.add(fate, kind, self.place, self.name, detail)
        for solid in self.solids:
            if _is_curtain(solid):
                size_m = f"{solid.sides_m[0]:.2f} x {solid.high_m - solid.low_m:.2f} m"
                ledger.add(Fate.GUESSED, _CURTAIN, solid.place, detail=size_m)

    @cached_property
    def _walls(self) -> tuple[Solid, ...]:
        """What it is made of: no windows, no posts."""
        return tuple(solid for solid in self.solids if not solid.is_post and not is_window(solid))

    @cached_property
    def _ground(self) -> tuple[str, float]:
        """The height of the ground, with words: the first one that fits to the elements.

        A building begins within a storey of its ground, or below it.
        """
        walls = self._walls
        if not walls:
            return "where it is placed", self.placed_m
        # What the model says comes first, if it is possible; then what its elements say.
        low_m = min(solid.low_m for solid in self.solids)
        top_m = max(wall.high_m for wall in walls)
        candidates = [("where it is placed", self.placed_m), *self.stated_m]
        if self.storeys_m:
            candidates.append(("its lowest storey", min(self.storeys_m.values())))
        for words, ground_m in candidates:
            within = low_m - self.options.level_height_m <= ground_m <= top_m - LEAST_STOREY_M
            if within:
                return words, ground_m
        return "its lowest element", low_m

    @cached_property
    def _bodies(self) -> list[BodyPart]:
        """Its parts, in the heights of the model."""
        walls = self._walls
        if not walls or max(wall.high_m for wall in walls) <= self.ground_m + LEAST_STOREY_M:
            return []
        limit_m = self.ground_m + LEAST_STOREY_M
        # The plan of what stands on the ground closes the outline where walls have gaps.
        feet = [solid for solid in self.solids if solid.low_m <= limit_m < solid.high_m]
        plans = [plan for solid in feet for plan in solid.feet]
        faces = Faces.joined(wall.faces for wall in walls)
        parts = faces.parts(self.ground_m, plans, self.options.least_area_m2)
        if parts or self._shadow.is_empty:
            return parts
        return [BodyPart(self._shadow, self.ground_m, max(wall.high_m for wall in walls))]

    @cached_property
    def _outline(self) -> BaseGeometry:
        return shapely.union_all([body.outline for body in self._bodies])

    @cached_property
    def _shadow(self) -> BaseGeometry:
        """The area below what is higher than a storey."""
        limit_m = self.ground_m + LEAST_STOREY_M
        return shapely.union_all([wall.shadow for wall in self._walls if wall.high_m > limit_m])

    @cached_property
    def _windows(self) -> dict[int, list[Solid]]:
        """Its outer windows, by the number of their part."""
        found: dict[int, list[Solid]] = {}
        insides: dict[float, BaseGeometry] = {}
        for solid in filter(is_window, self.solids):
            height_m = solid.middle_m
            around = [
                number
                for number, body in enumerate(self._bodies)
                if body.base_m <= height_m <= body.top_m
            ]
            if not around or _is_in_roof(solid):
                continue
            # What walls enclose is costly to find: once for all windows of a height.
            key = round(height_m, 1)
            if key not in insides:
                insides[key] = self._inside(height_m, around)
            inside = insides[key]
            is_within = inside.contains(solid.middle)
            if is_within and inside.boundary.distance(solid.middle) > _OUTER_M:
                continue
            outlines = [self._bodies[number].outline for number in around]
            nearest = int(np.argmin(shapely.distance(outlines, solid.middle)))
            found.setdefault(around[nearest], []).append(solid)
        return dict(sorted(found.items()))

    def _inside(self, height_m: float, around: Sequence[int]) -> BaseGeometry:
        """Return the area that walls enclose at a height, as far as it is built over."""
        section = shapely.union_all([self._bodies[number].outline for number in around])
        walls = [wall.shadow for wall in self._walls if wall.low_m < height_m < wall.high_m]
        inside = common(enclosed(walls), section) if walls else section
        return inside if inside.area else section

    @cached_property
    def _floors_m(self) -> list[float]:
        """Heights of the storeys on which windows stand, or that have a slab."""
        tops_m = [wall.high_m for wall in self._walls if wall.element.is_a("IfcSlab")]
        used = {self._floor_m(window) for own in self._windows.values() for window in own}
        slabs = {
            floor_m
            for floor_m in self.storeys_m.values()
            if any(abs(floor_m - top_m) <= _SLAB_M for top_m in tops_m)
        }
        return sorted((used | slabs) - {None})

    def _floor_m(self, window: Solid) -> Any:
        """Return the height of the storey that holds a window, or of the highest one below it."""
        for holds in getattr(window.element, "ContainedInStructure", None) or ():
            floor_m = self.storeys_m.get(holds.RelatingStructure.id())
            if floor_m is not None and floor_m <= window.low_m + _BASE_M:
                return floor_m
        below = [
            storey_m for storey_m in self.storeys_m.values() if storey_m <= window.low_m + _BASE_M
        ]
        return max(below, default=None)

    def _facade(self, part: BodyPart, windows: Sequence[Solid]) -> dict[str, float]:
        """Return the storeys and windows of a part; empty without windows."""
        if not windows:
            return {}
        # 1. Storeys, from the underside up; 2. the largest pane stands for all, as it breaks first;
        # 3. its sill above the floor below it; 4. bays as wide as windows are apart on the outline.
        floors_m = [part.base_m]
        for floor_m in self._floors_m:
            if floor_m - floors_m[-1] >= _STOREY_M and floor_m <= part.top_m - LEAST_STOREY_M:
                floors_m.append(floor_m)
        width_m, height_m = _largest(windows)
        large = [window for window in windows if _size_m(window) == (width_m, height_m)]
        sills_m = [
            solid.low_m - max((at for at in floors_m if at <= solid.low_m), default=solid.low_m)
            for solid in large
        ]
        apart_m = max(part.outline.length * len(floors_m) / len(windows), 1.1 * width_m)
        return {
            "storeys": float(len(floors_m)),
            "width": width_m,
            "height": height_m,
            "sill": round(float(np.clip(np.median(sills_m), *_SILLS_M)), _DIGITS),
            "bay": round(float(np.clip(apart_m, *_BAYS_M)), 1),
        }


def _is_in_roof(window: Solid) -> bool:
    """Return whether a window lies rather than stands."""
    return window.sides_m[1] > _ROOF_SHARE * (window.high_m - window.low_m)


def _is_curtain(solid: Solid) -> bool:
    """Return whether a solid is a curtain wall, or a plate of one."""
    if solid.element.is_a("IfcCurtainWall"):
        return True
    above = [
        relation.RelatingObject for relation in getattr(solid.element, "Decomposes", None) or ()
    ]
    return bool(solid.element.is_a("IfcPlate")) and (
        getattr(solid.element, "PredefinedType", None) == "CURTAIN_PANEL"
        or any(whole.is_a("IfcCurtainWall") for whole in above)
    )


def _size_m(window: Solid) -> tuple[float, float]:
    """Return width and height of a window as of one pane, in whole centimetres."""
    sides_m = (window.sides_m[0], window.high_m - window.low_m)
    width_m, height_m = (round(float(np.clip(side_m, *_PANES_M)), _DIGITS) for side_m in sides_m)
    return width_m, height_m


def _largest(windows: Sequence[Solid]) -> tuple[float, float]:
    """Return the size of the pane with the largest area, which breaks first."""
    return max((_size_m(window) for window in windows), key=lambda size_m: size_m[0] * size_m[1])
