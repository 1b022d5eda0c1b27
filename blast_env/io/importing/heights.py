"""Heights of buildings in the tags of a map: keys, units, storeys."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from blast_env.errors import MAX_TEXT, value_text
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.options import FOOT_M, UNITS_M, length_m
from blast_env.io.importing.plane import unit_of
from blast_env.io.importing.site_map import MapFeature, SiteMap

_HEIGHT_KEYS: Final = (
    *("height", "height_m", "building:height", "building_height", "est_height"),
    *("measuredheight", "measured_height"),
)
_FEET_KEYS: Final = tuple(f"{key}_{unit}" for key in _HEIGHT_KEYS for unit in ("ft", "feet"))
ROOF_KEYS: Final = ("heightroof", "height_roof")
"""Keys of the footprints of New York City, whose heights are feet above the ground."""

MOST_HEIGHT_M: Final = 2000.0
"""Most height of a structure in a scenario file, m."""

_BASE_KEYS: Final = ("min_height", "minheight", "building:min_height", "base_m")
_BASE_LEVEL_KEYS: Final = ("building:min_level", "min_level", "minlevel", "min_floor")
_LEVEL_KEYS: Final = ("building:levels", "levels", "storeys", "num_floors")
_ROOF_LEVEL_KEYS: Final = ("roof:levels", "building:roof:levels")
_ROOF_HEIGHT_KEYS: Final = ("roof:height", "roof_height", "roofheight")

_SEVERAL: Final = re.compile(r"[0-9.]+(?:\s*[;/-]\s*[0-9.]+)+")
_FEET: Final = "heights in feet, as the coordinates of the file (--height-unit)"
_ROOF_FEET: Final = "heights of roofs in feet, as New York City has them (--height-unit)"
_NEAR_FOOT_M: Final = 1e-5  # the feet of several countries


@dataclass(frozen=True)
class HeightReader:
    """Reads the heights of the buildings of a map; unclear ones are on its ledger.

    Attributes:
        unit_m: Length of the unit of numbers without one, m.
        remark: The kind of guess that this unit is; an empty string if it is none.
    """

    site_map: SiteMap
    unit_m: float = 1.0
    remark: str = ""

    @classmethod
    def of(cls, site_map: SiteMap) -> "HeightReader":
        """Return the reader of a map: in the unit of the options, else feet if its system is."""
        asked, crs = site_map.options.height_unit, site_map.crs
        if asked is not None:
            return cls(site_map, UNITS_M[asked])
        if (
            crs is not None
            and not site_map.has_layers
            and abs(unit_of(crs) - FOOT_M) < _NEAR_FOOT_M
        ):
            return cls(site_map, FOOT_M, _FEET)
        return cls(site_map)

    def heights_m(self, feature: MapFeature) -> tuple[float | None, float]:
        """Return the heights of top and underside of a building above the ground, m.

        The top is `None` if it is not known. An unreadable height does not hide a number of
        storeys. Of several numbers the largest counts.
        """
        # 1. The underside; 2. the top as a height, if the options name no other key; 3. else
        # storeys, with a roof by its height or its storeys.
        own = self.site_map.options.height_from
        lower = {str(name).lower(): value for name, value in feature.tags.items()}
        reading = _Reading(self, lower, feature.place)
        base_m = reading.length_m(_BASE_KEYS) or reading.storeys_m(_BASE_LEVEL_KEYS) or 0.0
        top_m = reading.length_m((own.lower(),) if own else _all_heights())
        if top_m is None and own is None:
            roof_m = reading.length_m(_ROOF_HEIGHT_KEYS)
            top_m = reading.storeys_m(_LEVEL_KEYS, () if roof_m else _ROOF_LEVEL_KEYS)
            top_m = top_m and top_m + (roof_m or 0.0)
        if not top_m:
            return None, base_m
        if top_m <= base_m:
            kind = "heights not above the underside, taken as the distance from it"
            detail = f"{top_m:g} m, underside {base_m:g} m"
            self.site_map.ledger.add(Fate.GUESSED, kind, feature.place, detail=detail)
            top_m += base_m
        return top_m, base_m


def _all_heights() -> tuple[str, ...]:
    return (*_HEIGHT_KEYS, *_FEET_KEYS, *ROOF_KEYS)


@dataclass(frozen=True)
class _Reading:
    """Reads the tags, in lower case, of an object at a place of a file."""

    reader: HeightReader
    tags: Mapping[str, str | float | bool]
    place: str

    def length_m(self, keys: tuple[str, ...]) -> float | None:
        """Return the first readable length above 0 of some tags, m."""
        for key in keys:
            if key not in self.tags:
                continue
            unit_m, remark = self._unit(key)
            length = self._number(key, unit_m)
            if not length or length > MOST_HEIGHT_M:
                self._unread(key, length)
                continue
            if remark and length_m(self.tags[key], 1.0) != length:
                self._guessed(remark, f"{key} is {value_text(self.tags[key])}: {length:.2f} m")
            return length
        return None

    def storeys_m(self, keys: tuple[str, ...], more: tuple[str, ...] = ()) -> float | None:
        """Return the height of the first readable number of storeys, and of more of them, m.

        It is `None` where only the others are known: storeys in a roof are no height of a building.
        """
        count = self._storeys(keys)
        if count is None:
            return None
        total = (count + (self._storeys(more) or 0.0)) * self.reader.site_map.options.level_height_m
        if total > MOST_HEIGHT_M:
            self._unread(next(key for key in (*keys, *more) if key in self.tags), total)
        return total if 0.0 < total <= MOST_HEIGHT_M else None

    def _storeys(self, keys: tuple[str, ...]) -> float | None:
        for key in keys:
            if key in self.tags:
                count = self._number(key, 1.0)
                if count is not None:
                    return count
                self._unread(key, None)
        return None

    def _unit(self, key: str) -> tuple[float, str]:
        """Return the unit of plain numbers of a key, m, with the remark if that is a guess."""
        # A key with a unit, then New York, then the unit of the options or of the file.
        if key.endswith(("_ft", "_feet")):
            return FOOT_M, ""
        if key.endswith("_m"):
            return 1.0, ""
        if key in ROOF_KEYS and self.reader.site_map.options.height_unit is None:
            return FOOT_M, _ROOF_FEET
        return self.reader.unit_m, self.reader.remark

    def _number(self, key: str, unit_m: float) -> float | None:
        value = self.tags[key]
        number = length_m(value, unit_m)
        if number is None and isinstance(value, str) and _SEVERAL.fullmatch(value.strip()):
            numbers = [length_m(part, unit_m) for part in re.split(r"[;/-]", value[:MAX_TEXT])]
            number = max((item for item in numbers if item), default=None)
            detail = f"{key} is {value_text(value)}, the largest counts"
            self._guessed("heights of several numbers", detail)
        return number

    def _unread(self, key: str, length: float | None) -> None:
        """Enter a height that cannot be read or is too large; an underside of 0 is no height."""
        if length is None or length > 0.0 or key not in _BASE_KEYS:
            detail = f"{key} is {value_text(self.tags[key])}, "
            is_large = length is not None and length > MOST_HEIGHT_M
            detail += (
                f"more than {MOST_HEIGHT_M:g} m" if is_large else "which is no length in m or ft"
            )
            self._guessed("heights that cannot be read", detail)

    def _guessed(self, kind: str, detail: str) -> None:
        self.reader.site_map.ledger.add(Fate.GUESSED, kind, self.place, detail=detail)
