"""Objects of a city model in CityJSON 1.1 and 2.0, with their surfaces in space.

Source: cityjson.org/specs/2.0.1, and 1.1.3, whose geometry is the same.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, named, value_text
from blast_env.io.importing.properties import tags_of
from blast_env.io.importing.site_map import MOST_FEATURES, Tags, check_count

VERSIONS: Final = ("1.1", "2.0")

_SHELLS: Final[Mapping[str, int]] = MappingProxyType(
    {
        **dict.fromkeys(("MultiSurface", "CompositeSurface"), 0),
        "Solid": 1,
        **dict.fromkeys(("MultiSolid", "CompositeSolid"), 2),
    }
)
"""How many arrays deeper than in a list of surfaces the surfaces of a geometry are."""

_LINES: Final = ("MultiPoint", "MultiLineString")
_INSTANCE: Final = "GeometryInstance"
_RING: Final = 3


@dataclass(frozen=True, eq=False)
class Surface:
    """A plane surface.

    Attributes:
        rings: Its outer border and its holes, each (n, 3), in the coordinates of the file.
        kind: What it is, as `RoofSurface`; an empty string if the file does not say it.
    """

    rings: tuple[FloatArray, ...]
    kind: str


@dataclass(frozen=True, eq=False)
class CityGeometry:
    """The geometry of an object in one level of detail.

    Attributes:
        surfaces: Its surfaces, of solids the outer ones.
        lines: Its lines, each (n, 3).
        cavities: Number of the hollows of its solids.
        crumbs: Number of its surfaces with fewer than three corners.
    """

    lod: float
    surfaces: tuple[Surface, ...] = ()
    lines: tuple[FloatArray, ...] = ()
    cavities: int = 0
    crumbs: int = 0

    @property
    def rings(self) -> Iterator[FloatArray]:
        """The rings of its surfaces, then its lines, each (n, 3)."""
        for surface in self.surfaces:
            yield from surface.rings
        yield from self.lines

    def with_rings(self, rings: Iterator[FloatArray]) -> "CityGeometry":
        """Return it with other places of its rings and lines, in their order."""
        surfaces = [
            Surface(tuple(next(rings) for _ in surface.rings), surface.kind)
            for surface in self.surfaces
        ]
        lines = [next(rings) for _ in self.lines]
        return replace(self, surfaces=tuple(surfaces), lines=tuple(lines))


@dataclass(frozen=True, eq=False)
class CityObject:
    """An object of a city model.

    Attributes:
        key: Its id.
        kind: Its type, as `BuildingPart`.
        tags: Its attributes.
        parents: The ids of those of which it is a part.
    """

    key: str
    kind: str
    tags: Tags
    parents: tuple[str, ...]
    geometries: tuple[CityGeometry, ...]

    @property
    def place(self) -> str:
        """Its place in the file."""
        return f"{named(self.kind)} {named(self.key)}"


def city_objects(path: Path, documents: Sequence[Mapping[str, Any]]) -> dict[str, CityObject]:
    """Return the objects of a city model by their ids.

    Args:
        documents: A CityJSON object, and the `CityJSONFeature`s that follow it.
    """
    head = documents[0]
    version = head.get("version")
    if version not in VERSIONS:
        raise BlastEnvError(
            f"{path}: version is {value_text(version)}, must be one of {', '.join(VERSIONS)}; "
            "convert it: cjio old.city.json upgrade save new.city.json"
        )
    # Vertices are whole numbers, to be scaled and shifted (CityJSON 2.0, section 4).
    scale, shift = (_triple(path, head.get("transform"), name) for name in ("scale", "translate"))
    templates = _templates(path, head)
    found: dict[str, CityObject] = {}
    for number, document in enumerate(documents):
        where = f"{path}: line {number + 1}" if number else str(path)
        vertices = _places(where, document, "vertices") * scale + shift
        objects = document.get("CityObjects")
        if not isinstance(objects, dict):
            raise BlastEnvError(f"{where}: CityObjects is missing or no object")
        check_count(path, len(found) + len(objects), MOST_FEATURES, "objects")
        for key, item in objects.items():
            at = f"{where}: CityObjects.{named(key)}"
            if not isinstance(item, dict) or not isinstance(item.get("type"), str):
                raise BlastEnvError(f"{at}: is no object with a type")
            if key in found:
                raise BlastEnvError(f"{at}: is there twice, must have an id of its own")
            found[key] = CityObject(
                key,
                item["type"],
                tags_of({"properties": item.get("attributes"), "id": key}),
                tuple(filter(_is_text, _listed(at, item, "parents"))),
                tuple(
                    _geometry(f"{at}.geometry[{k}]", geometry, vertices, templates)
                    for k, geometry in enumerate(_listed(at, item, "geometry"))
                ),
            )
    return found


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _listed(at: str, item: Mapping[str, Any], name: str) -> list[Any]:
    """Return an array of an object; an empty one if it is missing or null."""
    value = item.get(name)
    if value is not None and not isinstance(value, list):
        raise BlastEnvError(f"{at}: {name} is {type(value).__name__}, must be an array")
    return value or []


def _triple(path: Path, transform: Any, name: str) -> FloatArray:
    value = transform.get(name) if isinstance(transform, dict) else None
    numbers = _numbers(value)
    if numbers is None or numbers.shape != (3,):
        raise BlastEnvError(f"{path}: transform.{name} is missing or not of three numbers")
    return numbers


def _places(where: str, item: Mapping[str, Any], name: str) -> FloatArray:
    """Return an array of places of an object, (n, 3)."""
    places = _numbers(item.get(name))
    if places is not None and not places.size:
        return np.empty((0, 3))
    if places is None or places.ndim != 2 or places.shape[1] != 3:
        raise BlastEnvError(f"{where}: {name} is missing or no array of arrays of three numbers")
    return places


def _numbers(value: Any) -> FloatArray | None:
    """Return an array of finite numbers; `None` of anything else."""
    try:
        numbers = np.array(value) if isinstance(value, list) else None
    except (ValueError, OverflowError):  # of different lengths, or too deep
        return None
    if numbers is None or (numbers.size and numbers.dtype.kind not in "iuf"):
        return None
    numbers = numbers.astype(float)
    return numbers if np.isfinite(numbers).all() else None


def _templates(path: Path, head: Mapping[str, Any]) -> tuple[list[Any], FloatArray] | None:
    """Return the templates of a file with their vertices; `None` if it has none."""
    given = head.get("geometry-templates")
    if not isinstance(given, dict) or not given:
        return None
    where = f"{path}: geometry-templates"
    return _listed(where, given, "templates"), _places(where, given, "vertices-templates")


def _geometry(
    at: str,
    geometry: Any,
    vertices: FloatArray,
    templates: tuple[list[Any], FloatArray] | None,
) -> CityGeometry:
    """Return a geometry, of a template where its instance has it."""
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    # 1. A template, with its vertices where the instance puts it.
    if kind == _INSTANCE:
        return _geometry(at, *_instance(at, geometry, vertices, templates), None)
    if kind not in (*_SHELLS, *_LINES):
        raise BlastEnvError(
            f"{at}: type is {value_text(kind)}, must be one of "
            f"{', '.join((*_SHELLS, *_LINES, _INSTANCE))}"
        )
    lod = _lod(at, geometry.get("lod"))
    boundaries = geometry.get("boundaries")
    if not isinstance(boundaries, list):
        raise BlastEnvError(f"{at}: boundaries is missing or no array")
    # 2. Lines and points have no surfaces; points are left out.
    if kind in _LINES:
        is_lines = kind == "MultiLineString"
        lines = [_ring(at, line, vertices) for line in boundaries if is_lines]
        return CityGeometry(lod, lines=tuple(line for line in lines if len(line) > 1))
    # 3. Surfaces, each with its outer ring and its holes, and what it is.
    kinds, values = _semantics(geometry.get("semantics"))
    found, cavities = [], 0
    for surfaces, numbers, hollows in _shells(at, boundaries, values, _SHELLS[kind]):
        cavities += hollows
        for k, surface in enumerate(surfaces):
            rings = [_ring(at, ring, vertices) for ring in _array(at, surface)]
            number = numbers[k] if isinstance(numbers, list) and k < len(numbers) else None
            found.append((rings, _kind_of(kinds, number)))
    # 4. Without those of fewer than three places, which files of real cities have.
    sound = [
        Surface((rings[0], *(hole for hole in rings[1:] if len(hole) >= _RING)), name)
        for rings, name in found
        if rings and len(rings[0]) >= _RING
    ]
    return CityGeometry(lod, tuple(sound), (), cavities, len(found) - len(sound))


def _kind_of(kinds: Sequence[str], number: Any) -> str:
    """Return what the surfaces of a number are; an empty string for none."""
    return kinds[number] if isinstance(number, int) and 0 <= number < len(kinds) else ""


def _lod(at: str, value: Any) -> float:
    """Return a level of detail: a text such as 2.2, in some files a number."""
    try:
        lod = float(value) if isinstance(value, str | int | float) else -1.0
    except (ValueError, OverflowError):
        lod = -1.0
    if not 0.0 <= lod < 5.0:
        raise BlastEnvError(f"{at}: lod is {value_text(value)}, must be '0' to '4'")
    return lod


def _array(at: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise BlastEnvError(f"{at}: boundaries has {value_text(value)} instead of an array")
    return value


def _shells(
    at: str, boundaries: list[Any], values: Any, depth: int
) -> Iterator[tuple[list[Any], Any, int]]:
    """Yield the surfaces of each outer shell, their semantics, and the number of inner shells."""
    # Boundaries nest by kind: a surface list, a shell of it (the first is the outer one), a solid
    # of shells. Semantics nest in the same way, but for holes.
    if depth == 0:
        yield boundaries, values, 0
    elif depth == 1:
        if boundaries:
            yield _array(at, boundaries[0]), _inner(values, 0), len(boundaries) - 1
    else:
        for k, solid in enumerate(boundaries):
            yield from _shells(at, _array(at, solid), _inner(values, k), depth - 1)


def _inner(values: Any, k: int) -> Any:
    return values[k] if isinstance(values, list) and k < len(values) else None


def _semantics(semantics: Any) -> tuple[list[str], Any]:
    """Return the kinds of surfaces, and the arrays of their numbers; none of what is not sound."""
    if not isinstance(semantics, dict) or not isinstance(semantics.get("surfaces"), list):
        return [], None
    kinds = [
        str(surface.get("type", "")) if isinstance(surface, dict) else ""
        for surface in semantics["surfaces"]
    ]
    return kinds, semantics.get("values")


def _ring(at: str, ring: Any, vertices: FloatArray) -> FloatArray:
    """Return the places of a ring or line."""
    numbers = _numbers(ring)
    if numbers is None or numbers.ndim != 1 or (numbers % 1.0).any():
        raise BlastEnvError(f"{at}: boundaries has no array of whole numbers where one must be")
    if not numbers.size:
        return np.empty((0, 3))
    if not 0 <= numbers.min() <= numbers.max() < len(vertices):
        wrong = numbers.min() if numbers.min() < 0 else numbers.max()
        raise BlastEnvError(
            f"{at}: boundaries has the vertex {wrong:.0f}, must be 0 to {len(vertices) - 1}"
        )
    return np.asarray(vertices[numbers.astype(int)])


def _instance(
    at: str,
    geometry: Mapping[str, Any],
    vertices: FloatArray,
    templates: tuple[list[Any], FloatArray] | None,
) -> tuple[Any, FloatArray]:
    """Return the template of an instance, and its vertices where the instance has them."""
    listed, own = templates or ([], np.empty((0, 3)))
    number = geometry.get("template")
    if not isinstance(number, int) or not 0 <= number < len(listed):
        raise BlastEnvError(
            f"{at}: template is {value_text(number)}, but the file has {len(listed)} templates"
        )
    matrix = _numbers(geometry.get("transformationMatrix"))
    if matrix is None or matrix.shape != (16,):
        raise BlastEnvError(f"{at}: transformationMatrix is missing or not of 16 numbers")
    place = _ring(at, geometry.get("boundaries"), vertices)
    if len(place) != 1:
        raise BlastEnvError(f"{at}: boundaries has {len(place)} vertices, must have one")
    turned = np.column_stack((own, np.ones(len(own)))) @ matrix.reshape(4, 4).T
    return listed[number], turned[:, :3] + place
