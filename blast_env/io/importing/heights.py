"""Heights of buildings: those of a map's tags, and guesses where it has none."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from types import MappingProxyType
from typing import Final

import numpy as np

from blast_env.errors import MAX_TEXT, BlastEnvError, import_extra, value_text
from blast_env.io.importing.ledger import Deed, Ledger
from blast_env.io.importing.options import ImportOptions
from blast_env.io.importing.site_map import MapFeature
from blast_env.io.importing.things import Role, Thing
from blast_env.units import MODULE_SIDE_M
from blast_env.values import typed_number

with import_extra("maps", "maps and drawings"):
    import shapely

HEIGHT_KEYS: Final = ("height", "height_m", "building:height", "building_height")
_BASE_KEYS: Final = ("min_height", "building:min_height", "base_m")
_BASE_LEVEL_KEYS: Final = ("building:min_level", "min_level")
_LEVEL_KEYS: Final = ("building:levels", "levels", "storeys", "num_floors")

_FROM_GROUND: Final = (_BASE_KEYS[0], _BASE_LEVEL_KEYS[0])
_LENGTH: Final = re.compile(r"([0-9]+(?:[.,][0-9]*)?)\s*(m|metres|meters|ft|feet|')?")
_FEET_AND_INCHES: Final = re.compile(r"([0-9]+)\s*(?:'|ft)\s*([0-9]+(?:\.[0-9]*)?)\s*(?:\"|''|in)?")
_SEVERAL: Final = re.compile(r"[0-9.]+(?:\s*[;/-]\s*[0-9.]+)+")
_FOOT_M: Final = 0.3048
_INCH_M: Final = 0.0254

ROOFS: Final = frozenset({"roof", "canopy", "carport"})
"""Values of `building` for a roof on posts."""

_ROOF_M: Final = 4.5
_LEAST_NEIGHBOURS: Final = 3
_MOST_NEIGHBOURS: Final = 15
_NEIGHBOUR_M: Final = 150.0
_SMALL_M2: Final = 30.0
_LOW_SHARE: Final = 0.25

_STOREYS: Final[Mapping[str, tuple[int, int]]] = MappingProxyType(
    {
        **dict.fromkeys(
            ("garage", "garages", "shed", "hut", "cabin", "kiosk", "greenhouse", "toilets")
            + ("bungalow", "static_caravan", "service", "container", "ruins", "farm_auxiliary"),
            (1, 1),
        ),
        **dict.fromkeys(("house", "detached", "semidetached_house", "terrace", "farm"), (2, 1)),
        **dict.fromkeys(
            ("apartments", "dormitory", "hotel", "office", "commercial", "hospital", "public")
            + ("university", "government", "civic", "residential"),
            (4, 2),
        ),
        **dict.fromkeys(("industrial", "warehouse", "hangar", "barn", "church", "chapel"), (3, 2)),
        **dict.fromkeys(("cathedral", "tower", "water_tower", "silo", "chimney"), (6, 3)),
    }
)
"""Likely and low numbers of storeys by the value of `building` or `man_made`."""

_USUAL: Final = (2, 1)
_GENERAL: Final = ("", "yes")
_HIGH: Final = "too high is on the unsafe side for a building that shields: compare --low-heights"


def tagged_heights(
    feature: MapFeature, options: ImportOptions, ledger: Ledger
) -> tuple[float | None, float]:
    """Return the heights of top and underside in the tags of an object, m.

    The top is `None` if it is not known. The ledger gets heights that are unclear. An unreadable
    height does not hide a number of storeys. Of several numbers the largest counts.
    """
    tags = {str(name).lower(): value for name, value in feature.tags.items()}
    own = None if options.height_from is None else options.height_from.lower()
    keys = HEIGHT_KEYS if own is None else (own,)
    top_m = _first(feature, tags, keys, 1.0, ledger)
    if top_m is None and own is None:
        top_m = _first(feature, tags, _LEVEL_KEYS, options.level_height_m, ledger)
    base_m = _first(feature, tags, _BASE_KEYS, 1.0, ledger)
    if base_m is None:
        base_m = _first(feature, tags, _BASE_LEVEL_KEYS, options.level_height_m, ledger)
    return top_m, base_m or 0.0


def _first(
    feature: MapFeature,
    tags: Mapping[str, str | float | bool],
    keys: Sequence[str],
    unit_m: float,
    ledger: Ledger,
) -> float | None:
    """Return the first readable height of some tags, m."""
    for key in keys:
        if key not in tags:
            continue
        value = tags[key]
        number = length_m(value)
        if number is None and isinstance(value, str) and _SEVERAL.fullmatch(value.strip()):
            numbers = [length_m(each) for each in re.split(r"[;/-]", value[:MAX_TEXT])]
            number = max((each for each in numbers if each), default=None)
            detail = f"{key} is {value_text(value)}, the largest counts"
            ledger.add(Deed.GUESSED, "heights of several numbers", feature.place, detail=detail)
        if number is not None:
            return number * unit_m
        if keys[0] not in _FROM_GROUND or str(value) not in ("0", "0.0", "0 m"):
            detail = f"{key} is {value_text(value)}, which is no length in m or ft"
            ledger.add(Deed.GUESSED, "heights that cannot be read", feature.place, detail=detail)
    return None


def length_m(value: str | float | bool) -> float | None:
    """Return a length above 0 in metres, or `None` if the value is not one."""
    if isinstance(value, bool):
        return None
    if isinstance(value, str):
        text = value[:MAX_TEXT].strip()
        parts = _FEET_AND_INCHES.fullmatch(text)
        match = _LENGTH.fullmatch(text)
        try:
            if parts is not None:
                feet, inches = (typed_number("a length", parts[k]) for k in (1, 2))
                value = feet * _FOOT_M + inches * _INCH_M
            elif match is not None:
                metric = match[2] is None or match[2].startswith("m")
                value = typed_number("a length", match[1]) * (1.0 if metric else _FOOT_M)
            else:
                return None
        except BlastEnvError:
            return None
    return float(value) if isfinite(value) and value > 0.0 else None


def with_heights(
    things: Sequence[Thing], options: ImportOptions, ledger: Ledger
) -> tuple[Thing, ...]:
    """Return objects in site metres, with a height for each building; the ledger gets the guesses.

    A height is guessed from the known ones of the nearest buildings of the kind, then from the
    kind, and from those of all neighbours if the kind says nothing. A roof on posts is open below.
    """
    guess = _Guess([each for each in things if each.role is Role.BUILDING], options)
    found = []
    for thing in things:
        if thing.role is Role.BUILDING:
            if thing.carries and thing.height_m is None:
                kind = "terraces without a height, on which nothing stands"
                ledger.add(Deed.GUESSED, kind, thing.place, thing.name)
                thing = replace(thing, carries=False)
            if thing.height_m is None:
                height_m, kind, detail = guess.of(thing)
                ledger.add(Deed.GUESSED, kind, thing.place, thing.name, detail)
                thing = replace(thing, height_m=height_m)
            if thing.kind in ROOFS and thing.base_m == 0.0 and thing.height_m is not None:
                base_m = max(thing.height_m - MODULE_SIDE_M, 0.0)
                kind = "roofs on posts, open below"
                ledger.add(Deed.GUESSED, kind, thing.place, thing.name, f"from {base_m:g} m")
                thing = replace(thing, base_m=base_m)
        found.append(thing)
    return tuple(found)


class _Guess:
    """Guesses heights of buildings.

    Args:
        buildings: All buildings, in metres.
        options: Options of the import.
    """

    def __init__(self, buildings: Sequence[Thing], options: ImportOptions) -> None:
        self._options = options
        self._known = [each for each in buildings if each.height_m is not None]
        self._tree = shapely.STRtree([each.geometry for each in self._known])

    def of(self, thing: Thing) -> tuple[float, str, str]:
        """Return a height, m, with the kind of the guess and its words."""
        if self._options.default_height_m is not None:
            height_m = self._options.default_height_m
            return height_m, "heights not in the file, --default-height", f"{height_m:g} m"
        likely_m, low_m, by = next(self._guesses(thing))
        if self._options.low_heights:
            return low_m, "heights not in the file, low guess", f"{low_m:.1f} m {by}"
        return (
            likely_m,
            f"heights not in the file ({_HIGH})",
            (f"{likely_m:.1f} m {by}, low {low_m:.1f} m"),
        )

    def _guesses(self, thing: Thing) -> Iterator[tuple[float, float, str]]:
        """Yield likely and low heights, m, and their reason, the best first."""
        if thing.kind in ROOFS:
            yield _ROOF_M, _ROOF_M, "as a roof"
        level_m = self._options.level_height_m
        if thing.kind in _GENERAL and thing.geometry.area < _SMALL_M2:
            yield level_m, level_m, "as a small building"
        near = self._near(thing)
        alike = [each.height_m for each in near if each.kind == thing.kind and each.height_m]
        if len(alike) >= _LEAST_NEIGHBOURS:
            yield (*_middle(alike), f"as {len(alike)} neighbours")
        storeys = _STOREYS.get(thing.kind)
        if storeys is not None:
            yield storeys[0] * level_m, storeys[1] * level_m, "by its kind"
        around = [each.height_m for each in near if each.height_m]
        if len(around) >= _LEAST_NEIGHBOURS:
            yield (*_middle(around), f"as {len(around)} neighbours")
        yield _USUAL[0] * level_m, _USUAL[1] * level_m, "as usual"

    def _near(self, thing: Thing) -> list[Thing]:
        """Return the buildings of known height around one, the nearest first."""
        around = self._tree.query(thing.geometry, "dwithin", distance=_NEIGHBOUR_M)
        near = [self._known[index] for index in around]
        near.sort(key=lambda each: float(each.geometry.distance(thing.geometry)))
        return near[:_MOST_NEIGHBOURS]


def _middle(heights_m: Sequence[float]) -> tuple[float, float]:
    """Return the median and the lower quartile."""
    return float(np.median(heights_m)), float(np.quantile(heights_m, _LOW_SHARE))
