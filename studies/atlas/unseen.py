"""Screening with and without the atlas on generated sites that no law has met, beside gas dynamics.

Sites along kerbs and streets, with courts and with short fronts take turns with no layout, a wall
before the building, what the packaged agent proposes, and random pieces.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from blast_agents import packaged_agent

from blast_env.arrays import FloatArray
from blast_env.atlas import packaged_laws
from blast_env.errors import BlastEnvError
from blast_env.evaluation.questions.screening import BayScreening, screen
from blast_env.gas.settings import CHECKED_SCALED_DISTANCE
from blast_env.geometry import Layout
from blast_env.layout import charge_against, check_layout
from blast_env.layout.build_site import draw_charge
from blast_env.rules import random_layout, wall_near_building
from blast_env.site import AnyCharge, Scenario
from blast_env.sites import court_site, kerb_site, square_site, street_site
from studies.atlas.sites import bays_by_gas, under_charge

KINDS: Final[Mapping[str, Callable[[int], Scenario]]] = MappingProxyType(
    {"kerb": kerb_site, "street": street_site, "court": court_site, "square": square_site}
)
FIRST_SEED: Final = 7_000_000
"""No site of the published blasts has a seed from here on."""

TOO_LOW: Final = 1.15
"""Ratio of gas dynamics to screening from which a load counts as too low."""

_WIDEST_M: Final = 45.0
_GROUPS: Final = ("walls that face away", "behind rows", "other bays")


@dataclass(frozen=True)
class UnseenBay:
    """A bay of an unseen site.

    Attributes:
        group: What stands around it, one of three kinds.
        without: Impulse and peak of gas dynamics over those of screening without the atlas.
        atlas: The same with it.
    """

    group: str
    without: tuple[float, float]
    atlas: tuple[float, float]


def unseen_bays(seed: int, folder: Path) -> Iterator[UnseenBay]:
    """Yield the bays of one site of each kind; blasts are kept in a folder.

    A site that is refused or wide, or a layout that is illegal with the charge, is left out.
    """
    for kind, make in KINDS.items():
        try:
            site = make(FIRST_SEED + seed)
            site = site if site.bays else site.with_facades("window_annealed_6", None)
            charge = draw_charge(site, seed)
            name, layout = _layout(site, charge, seed)
            at = charge_against(site, layout, charge)
            own = under_charge(site, at)
            check_layout(own, layout)
        except BlastEnvError:
            continue
        if max(site.site.width_m, site.site.height_m) > _WIDEST_M:
            continue
        by_gas = bays_by_gas(own, layout, folder / f"{kind}_{seed}_{name}.json")
        before, after = (
            screen(own, layout, (), laws).threats[0].bays for laws in (None, packaged_laws())
        )
        least_m = CHECKED_SCALED_DISTANCE[0] * float(np.cbrt(at.tnt_kg))
        for bay, without in zip(after, before, strict=True):
            if bay.filled.bay.name in by_gas and bay.distance_m >= least_m:
                loads = by_gas[bay.filled.bay.name]
                yield UnseenBay(_group(bay), _over(loads, without), _over(loads, bay))


def _layout(site: Scenario, charge: AnyCharge, seed: int) -> tuple[str, Layout]:
    """Return one of four layouts in turn, and its name.

    Raises:
        BlastEnvError: If a proposal is not legal with the charge.
    """
    names = ("none", "wall building", "agent", "random")
    chosen = names[seed // 2 % len(names)]
    layouts: dict[str, Callable[[], Layout]] = {
        "none": tuple,
        "wall building": lambda: wall_near_building(site, charge),
        "agent": lambda: packaged_agent().propose(site, charge),
        "random": lambda: random_layout(site, np.random.default_rng(seed)),
    }
    return chosen, tuple(layouts[chosen]())


def _group(bay: BayScreening) -> str:
    if not bay.faces_charge:
        return _GROUPS[0]
    return _GROUPS[1] if bay.is_behind else _GROUPS[2]


def _over(loads: tuple[float, float], bay: BayScreening) -> tuple[float, float]:
    impulse_pa_s, peak_pa = loads
    return impulse_pa_s / bay.impulse_pa_s, peak_pa / bay.peak_pa


def rows(bays: Sequence[UnseenBay]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each group of bays, and one of all."""
    for group in (*_GROUPS, "all"):
        own = [bay for bay in bays if group in (bay.group, "all")]
        if own:
            without = np.array([bay.without for bay in own])
            atlas = np.array([bay.atlas for bay in own])
            yield (
                group,
                str(len(own)),
                *(_change(_too_low(without[:, k]), _too_low(atlas[:, k])) for k in range(2)),
                *(
                    _change(f"{without[:, k].max():.2f}", f"{atlas[:, k].max():.2f}")
                    for k in range(2)
                ),
            )


def _too_low(ratios: FloatArray) -> str:
    return f"{np.mean(ratios > TOO_LOW):.0%}"


def _change(before: str, after: str) -> str:
    return f"{before} -> {after}"
