"""Generated sites by name, such as `item_sites/10400` or `close_sites/18/10400`.

A name is a kind of sites and a seed. Tables of blasts name their sites so.
"""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from blast_env.bundled import LARGE_SITES
from blast_env.errors import BlastEnvError
from blast_env.evaluation import draw_threats
from blast_env.geometry import OUTWARDS
from blast_env.site import Scenario, load_scenario
from blast_env.sites import HELD_OUT_SITES, SITE_KINDS, close_ranges, generate_site, large_ranges

CLOSE_SITES: Final = "close_sites"
"""Kind of `close_ranges`; the side in m follows."""

FRONT_SITES: Final = "front_sites"
"""Kind of close sites on which only the walls that face the charge count."""

_LEAST_SEEN_M: Final = 1.0
"""Distance of the charge in front of a wall beyond which the wall faces it."""


def scenario_of(name: str) -> Scenario:
    """Return the scenario of a name in a table of blasts.

    Args:
        name: A bundled scenario, or the KIND/SEED of a generated site, where the kind is
            one of `SITE_KINDS`, or of `close_sites/18`, `front_sites/18` and `large_sites/60` with
            the side in m.

    Raises:
        BlastEnvError: If there is no such scenario or kind, or as `generate_site`.
    """
    kind, _, seed = name.rpartition("/")
    if not kind or not seed.isdecimal():
        return load_scenario(name)
    return _maker(kind)(int(seed))


def held_out_names(kind: str, count: int) -> list[str]:
    """Return the names of the first generated sites of a kind that are held out from training.

    Raises:
        BlastEnvError: If there is no such kind, or there are fewer.
    """
    _maker(kind)
    if count > HELD_OUT_SITES:
        raise BlastEnvError(f"{kind}: count is {count}, must be at most {HELD_OUT_SITES}")
    return [f"{kind}/{seed}" for seed in range(count)]


def site_names(kinds: Iterable[str], first: int, count: int) -> list[str]:
    """Return the names of generated sites of the seeds of training.

    Args:
        kinds: The kinds, as in `scenario_of`.
        first: How many of each kind are left out.
        count: How many of each kind there are.

    Raises:
        BlastEnvError: If there is no such kind.
    """
    seeds, found = range(HELD_OUT_SITES + first, HELD_OUT_SITES + first + count), []
    for kind in kinds:
        _maker(kind)  # refuses a kind that there is not
        found += [f"{kind}/{seed}" for seed in seeds]
    return found


def _maker(kind: str) -> Callable[[int], Scenario]:
    """Return what makes the sites of a kind from their seeds."""
    family, _, side = kind.partition("/")
    if not side and family in SITE_KINDS:
        return SITE_KINDS[family]
    if side and family in _SIZED:
        try:
            side_m = float(side)
        except ValueError:
            raise BlastEnvError(f"kind of sites is {kind!r}: {side!r} is no side in m") from None
        of_side = _SIZED[family]
        return lambda seed: of_side(seed, side_m)
    sized = (f"{name}/SIDE" for name in _SIZED)
    raise BlastEnvError(
        f"kind of sites is {kind!r}, must be one of {', '.join((*SITE_KINDS, *sized))}"
    )


def _close_site(seed: int, side_m: float) -> Scenario:
    return generate_site(seed, close_ranges(side_m))


def _large_site(seed: int, side_m: float) -> Scenario:
    return generate_site(seed, large_ranges(side_m))


def _front_site(seed: int, side_m: float) -> Scenario:
    """Return a close site on which only walls count that face the charge; of odd seeds, one."""
    site = _close_site(seed, side_m)
    (threat,) = draw_threats(site, [0])
    place_m = np.array(threat.charge_against(site, ()).position_m)
    structures = []
    for structure in site.structures:
        left, bottom, right, top = structure.rectangle_m
        way_m = place_m - np.clip(place_m, (left, bottom), (right, top))
        seen_m = {face: float(way_m @ OUTWARDS[face]) for face in structure.faces}
        most_m = max(seen_m.values())
        least_m = most_m if seed % 2 == 1 else min(most_m, _LEAST_SEEN_M)
        faces = tuple(face for face, far_m in seen_m.items() if far_m >= least_m)
        structures.append(structure.model_copy(update={"faces": faces}))
    return site.model_copy(update={"structures": tuple(structures)})


_SIZED: Final[Mapping[str, Callable[[int, float], Scenario]]] = MappingProxyType(
    {CLOSE_SITES: _close_site, FRONT_SITES: _front_site, LARGE_SITES: _large_site}
)
