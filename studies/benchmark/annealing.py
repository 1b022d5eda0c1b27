"""Annealing from the rules' layouts, tuned for 50 blasts; the surrogate stands for gas dynamics."""

from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Final

import numpy as np
from blast_agents.benchmark import method_of
from blast_agents.search import AnnealingSearch, FromRulesSearch, WinnersSearch

from blast_env.arrays import FloatArray
from blast_env.problems import Definition, make, secret_sites
from blast_env.runner import run_all

_PACKAGED: Final[tuple[AnnealingSearch | WinnersSearch, ...]] = (
    AnnealingSearch(),
    WinnersSearch(),
)
_BUDGET: Final = 50
_STARTING_SHARES: Final = (0.08, 0.15, 0.25, 0.4, 0.6)
_TEMPERATURES: Final = ((0.002, 0.0005), (0.005, 0.001), (0.02, 0.001), (0.06, 0.001))


@dataclass(frozen=True)
class Setting:
    """A search with settings of its own.

    Attributes:
        search: The search.
    """

    search: AnnealingSearch | WinnersSearch

    @property
    def kind(self) -> str:
        """Name of the search."""
        return self.search.name

    @property
    def is_packaged(self) -> bool:
        """Whether the package's own settings are these."""
        return self.search in _PACKAGED


def settings() -> list[Setting]:
    """Return what is tried, of one walker and of several; the packaged ones are the first two."""
    tried = [Setting(each) for each in _PACKAGED]
    for each, share, (hot, cold) in product(_PACKAGED, _STARTING_SHARES, _TEMPERATURES):
        setting = Setting(replace(each, starting_share=share, hot=hot, cold=cold))
        if setting not in tried:
            tried.append(setting)
    return tried


def sites_for(purpose: str, count: int) -> tuple[Definition, ...]:
    """Return generated sites; those for another purpose are others."""
    return secret_sites(f"annealing, {purpose}", count)


def taken_off_percent(setting: Setting, seeds: int, site: Definition) -> float:
    """Return what a search from the rules takes off on a site, the mean over its seeds."""
    propose, found = method_of(FromRulesSearch(setting.search)), []
    for seed in range(seeds):
        layout = propose(make(site, _BUDGET, engine="surrogate"), seed)
        found.append(1.0 - make(site, _BUDGET, engine="surrogate").evaluate(layout))
    return 100.0 * float(np.mean(found))


def on_sites(
    setting: Setting, sites: tuple[Definition, ...], seeds: int, workers: int
) -> FloatArray:
    """Return what a search takes off on each site, in per cent (sites,)."""
    return np.array(run_all(partial(taken_off_percent, setting, seeds), sites, workers))
