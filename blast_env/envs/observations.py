"""Observations of an agent by name: planes, an image, a vector, a dictionary."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.envs.observable import (
    FULL_STOCK,
    Array,
    BatchObservation,
    Observable,
    Observation,
    Plane,
    charge_share,
    cost_shares,
    height_share,
    item_values,
    items_left,
    stand_offs_m,
    stock_shares,
    variant_values,
)
from blast_env.envs.planes import GridObservation, ImageEpisode, ImageObservation
from blast_env.errors import BlastEnvError
from blast_env.layout.batch import Placements
from blast_env.site import (
    Scenario,
)
from blast_env.site.zone import source_bounds_m

MOST_STRUCTURES: Final = 8
"""Most structures that fit the vector."""

_SHARES: Final = 3
_BESIDES_PLACES: Final = _SHARES + 6 + 2
_FIXED: Final = _BESIDES_PLACES + MOST_STRUCTURES * 6
_SITE: Final = _FIXED - _SHARES


@dataclass(frozen=True)
class FeaturesObservation:
    """A vector of float32 from 0 to 1; x is divided by the site's width, y by its height.

    | from | length | values |
    |---|---|---|
    | 0 | 3 | modules left / modules at first; modules left / 100, at most 1; budget left / budget |
    | 3 | 4 | left, bottom, right, top of the smallest box around places of the charge |
    | 7 | 2 | least and largest possible mass of the charge, (mass / 1000 kg)^(1/3), at most 1 |
    | 9 | 2 | x and y of the lower left corner of the build zone |
    | 11 | 8 x 6 | of each structure: left, bottom, right, top; 1; its weight / the largest weight |
    | 59 | cells | 1 where a module stands, row by row |
    | 59 + cells | cells | 1 where a module may be placed now, row by row |
    | 59 + 2 cells | cells | cost of a module / the highest, row by row |

    Protected structures come first, in the order of the scenario. The weight of other structures
    is 0, and unused places for structures have six zeros.

    If the build zone has a catalogue, more values follow; heights are shares of 12 m, and the
    values of cells are row by row:

    | length | values |
    |---|---|
    | 8 | height of each structure, in the order above; 1 where it is as high as the air |
    | items | height of each item |
    | items | cost of each item / the budget (or the dearest item's cost), at most 1 |
    | items | pieces of each item that may still be placed / pieces at first |
    | cells | height of the module on a cell |
    | cells | 1 where a module stops vehicles |
    | variants x cells | 1 where a piece may have its lower left cell now, variant by variant |

    If the scenario has a vehicle, the box from 3 on encloses its entries. For such scenarios, and
    for those drawn among others with a vehicle, one more value comes last: the stand-off of the
    vehicle with the modules placed so far, as a share of the site's diagonal; 1 without a vehicle.

    With `action="suggestion"` the environment adds seven values for each rule, one after the other
    (`env.unwrapped.suggestions` begins with their names). Those of the next piece are 0 without
    one:

    1. has a next piece (1 or 0)
    2. pieces placed / pieces of its layout
    3. lines of sight that its layout cuts / all (by weight)
    4. next piece: cost / budget (or / the dearest element's cost)
    5. next piece: height / 12 m
    6. next piece: distance along the line of sight / its length (0 at the charge)
    7. next piece: distance to the left of that line / 20 m + 0.5

    The line of sight leads from the (mean) place of the charge to the middle of what is protected.

    `OBSERVATIONS["features"].names(scenario)` names each value before these.
    """

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space: (features,)."""
        zone, catalogue = scenario.zone, scenario.zone.catalogue
        cells = zone.rows * zone.columns
        length = _FIXED + 3 * cells + bool(scenario.vehicles)
        if catalogue.has_items:
            length += (
                MOST_STRUCTURES + 3 * len(catalogue.names) + (2 + len(catalogue.variants)) * cells
            )
        return spaces.Box(0.0, 1.0, (length,), np.float32)

    def names(self, scenario: Scenario) -> tuple[str, ...]:
        """Return what each value is, in the order of the vector (features,); all are shares.

        Args:
            scenario: The scenario.
        """
        zone, catalogue = scenario.zone, scenario.zone.catalogue
        cells = [f"cell ({row}, {column})" for row, column in np.ndindex(zone.shape)]
        sides = ("left", "bottom", "right", "top")
        found = ["modules left / at first", "modules left / 100", "budget left / at first"]
        found += [f"charge: {side}" for side in sides]
        found += ["charge: least cube root of mass", "charge: largest cube root of mass"]
        found += ["build zone: left", "build zone: bottom"]
        for number in range(MOST_STRUCTURES):
            parts = (*sides, "is there", "weight / largest weight")
            found += [f"structure {number}: {part}" for part in parts]
        for what in ("module", "legal", "cost / highest cost"):
            found += [f"{cell}: {what}" for cell in cells]
        if catalogue.has_items:
            found += [f"structure {number}: height / 12 m" for number in range(MOST_STRUCTURES)]
            for what in ("height / 12 m", "cost / budget", "pieces left / at first"):
                found += [f"{name}: {what}" for name in catalogue.names]
            for what in ("height of the module / 12 m", "stops vehicles"):
                found += [f"{cell}: {what}" for cell in cells]
            for variant in catalogue.variants:
                turned = ", turned" if variant.turned else ""
                found += [f"{cell}: {variant.name}{turned} is legal" for cell in cells]
        if scenario.vehicles:
            found.append("vehicle: stand-off / diagonal of the site")
        return tuple(found)

    def episode(self, observable: Observable) -> "FeaturesEpisode":
        """Compute the constant values.

        Raises:
            BlastEnvError: If the scenario has more than `MOST_STRUCTURES` structures.
        """
        scenario, kept = observable.scenario, observable.of_site
        if "features" not in kept:
            kept["features"] = _site_features(scenario)
        of_site, variants = kept["features"]
        charge = [min(max(value, 0.0), 1.0) for value in _charge_and_corner(observable)]
        constants = np.concatenate((np.array(charge, dtype=np.float32), of_site))
        return FeaturesEpisode(constants, variants, observable)


def _site_features(scenario: Scenario) -> tuple[Plane, Plane]:
    """Return the constant values of a site: structures, costs and items; and of variants."""
    structures, zone = _structures(scenario), scenario.zone
    items = (structures[:, -1], *item_values(zone)) if zone.items else ()
    parts = structures[:, :-1].ravel(), cost_shares(zone).ravel(), *items
    return np.concatenate(parts).clip(0.0, 1.0).astype(np.float32), variant_values(zone)


@dataclass(frozen=True, eq=False)
class FeaturesEpisode(BatchObservation):
    """The vector of one episode.

    Attributes:
        constants: Values that no layout changes: charge, corner and structures (56,), costs of
            cells (cells,) and, with a catalogue, heights of structures, heights and costs of items.
        variants: Values of cells by the variant on them; see `variant_values`.
        observable: The observable part of the episode, whose stand-off is the last value if it
            shows vehicles; 1 without a vehicle.
    """

    constants: Plane
    variants: Plane
    observable: Observable

    @staticmethod
    def observe_many(episodes: Sequence["FeaturesEpisode"], placements: Placements) -> Array:
        """Return the vectors of several episodes (episodes, features)."""
        has_items = placements.rules[0].catalogue.has_items
        position = {episode: number for number, episode in enumerate(dict.fromkeys(episodes))}
        own = np.array([position[episode] for episode in episodes])
        constants = np.array([episode.constants for episode in position])
        variants = np.array([episode.variants for episode in position])
        _, kinds, rows, columns = placements.legal.shape
        legal = placements.legal.view(np.uint8).reshape(-1, kinds, rows * columns)
        occupancy = placements.occupancy.reshape(-1, rows * columns)
        length = _SHARES + constants.shape[1] + 2 * rows * columns
        if has_items:
            length += placements.left.shape[1] - 1 + (2 + kinds) * rows * columns
        shows_vehicles = episodes[0].observable.shows_vehicles
        vectors = placements.room((len(episodes), length + shows_vehicles))
        _kernels().put_vectors(
            *(own, constants, variants, placements.left, placements.stock),
            *(placements.budget_left, placements.budget, legal, occupancy, has_items),
            *(FULL_STOCK, _SITE, vectors),
        )
        if shows_vehicles:
            stand_offs = _stand_offs([episode.observable for episode in episodes], placements)
            vectors[:, -1] = np.clip(stand_offs[:, 0], 0.0, 1.0)
        return vectors


@cache
def _kernels() -> Any:
    from blast_env.envs import observation_kernels  # Numba takes long to import

    return observation_kernels


def _joined(parts: Sequence[NDArray[Any]]) -> Plane:
    """Return values of several episodes (episodes, ...) as vectors (episodes, n), from 0 to 1."""
    vectors = [part.reshape(len(part), -1) for part in parts]
    joined: Plane = np.clip(np.hstack(vectors), 0.0, 1.0).astype(np.float32)
    return joined


def _structures(scenario: Scenario) -> FloatArray:
    """Return left, bottom, right, top, 1, weight and height of each structure, as shares.

    The shape is (MOST_STRUCTURES, 7), with the protected ones first.
    """
    structures = sorted(scenario.structures, key=lambda structure: not structure.protected)
    if len(structures) > MOST_STRUCTURES:
        raise BlastEnvError(
            f"scenario {scenario.name!r} has {len(structures)} structures, the observation"
            f" 'features' has room for {MOST_STRUCTURES}: use 'grid'"
        )
    largest = max(
        (structure.weight for structure in structures if structure.protected), default=1.0
    )
    width_m, height_m = scenario.site.width_m, scenario.site.height_m
    rows = np.zeros((MOST_STRUCTURES, 7))
    for row, part in zip(rows, structures, strict=False):
        left, bottom, right, top = part.rectangle_m
        row[:4] = left / width_m, bottom / height_m, right / width_m, top / height_m
        row[4:] = 1.0, part.weight / largest if part.protected else 0.0, height_share(part.height_m)
    return rows


# ---- A dictionary.


@dataclass(frozen=True)
class DictObservation:
    """Planes, a vector and the mask of legal actions, for policies with several inputs.

    | key | space |
    |---|---|
    | `planes` | those of `ImageObservation` |
    | `vector` | float32 from 0 to 1, see below |
    | `action_mask` | `MultiBinary(actions)`, added by the environment: `info["action_mask"]` |

    The vector has the values that belong to no place: x is divided by the site's width, y by its
    height.

    | from | length | values |
    |---|---|---|
    | 0 | 3 | modules left / modules at first; modules left / 100, at most 1; budget left / budget |
    | 3 | 4 | left, bottom, right, top of the smallest box around places of the charge |
    | 7 | 2 | least and largest possible mass of the charge, (mass / 1000 kg)^(1/3), at most 1 |
    | 9 | 2 | x and y of the lower left corner of the build zone |
    | 11 | items | with a catalogue: height of each item |
    | | items | cost of each item / the budget (or the dearest item's cost), at most 1 |
    | | items | pieces of each item that may still be placed / pieces at first |
    | last | 1 | with vehicles: stand-off / the site's diagonal, as in `FeaturesObservation` |

    Attributes:
        planes: The observation that gives the planes.
    """

    planes: ImageObservation = field(default_factory=ImageObservation)

    def space(self, scenario: Scenario) -> spaces.Space[Any]:
        """Return the space, without the mask."""
        items = scenario.zone.catalogue
        length = _BESIDES_PLACES + 3 * len(items.names) * items.has_items + bool(scenario.vehicles)
        vector = spaces.Box(0.0, 1.0, (length,), np.float32)
        return spaces.Dict({"planes": self.planes.space(scenario), "vector": vector})

    def episode(self, observable: Observable) -> "DictEpisode":
        """Compute the constant values."""
        zone = observable.scenario.zone
        items = item_values(zone) if zone.items else ()
        return DictEpisode(
            self.planes.episode(observable),
            np.concatenate((_charge_and_corner(observable), *items)),
            observable,
        )


@dataclass(frozen=True, eq=False)
class DictEpisode(BatchObservation):
    """The dictionaries of one episode.

    Attributes:
        planes: The images of the episode.
        site: Values of charge, corner of the build zone and items.
        observable: The observable part of the episode, whose stand-off is the last value if it
            shows vehicles.
    """

    planes: ImageEpisode
    site: FloatArray
    observable: Observable

    @staticmethod
    def observe_many(episodes: Sequence["DictEpisode"], placements: Placements) -> dict[str, Array]:
        """Return planes and vectors of several episodes, with a leading axis (episodes, ...)."""
        parts = [stock_shares(placements), np.array([episode.site for episode in episodes])]
        if placements.rules[0].catalogue.has_items:
            parts.append(items_left(placements))
        if episodes[0].observable.shows_vehicles:
            parts.append(_stand_offs([episode.observable for episode in episodes], placements))
        planes = ImageEpisode.observe_many([episode.planes for episode in episodes], placements)
        return {"planes": planes, "vector": _joined(parts)}


def _charge_and_corner(observable: Observable) -> list[float]:
    """Return the box around the charge, its masses and the corner of the build zone (8,)."""
    site, zone = observable.scenario.site, observable.scenario.zone
    boxes = [source_bounds_m(source) for source in observable.sources]
    left_m, bottom_m, right_m, top_m = zip(*boxes, strict=True)
    charges = [charge_share(source.tnt_kg) for source in observable.sources]
    return [
        *(min(left_m) / site.width_m, min(bottom_m) / site.height_m),
        *(max(right_m) / site.width_m, max(top_m) / site.height_m),
        *(min(charges), max(charges)),
        *(zone.corner_m[0] / site.width_m, zone.corner_m[1] / site.height_m),
    ]


def _stand_offs(episodes: Sequence[Observable], placements: Placements) -> FloatArray:
    """Return the stand-off of each episode as a share of the site's diagonal (episodes, 1)."""
    diagonals_m = np.array([episode.diagonal_m for episode in episodes])
    shares: FloatArray = stand_offs_m(episodes, placements) / diagonals_m
    return shares[:, np.newaxis]


OBSERVATIONS: Final[Mapping[str, Observation]] = MappingProxyType(
    {
        "dict": DictObservation(),
        "grid": GridObservation(),
        "image": ImageObservation(),
        "features": FeaturesObservation(),
    }
)
"""The observations, by their names."""

SINGLE_ARRAYS: Final = tuple(name for name in OBSERVATIONS if name != "dict")
"""Names of the observations that are a single array."""
