"""Annealing from the rules' layouts, tuned for 50 blasts, with the surrogate for gas dynamics."""

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
    """A search with its settings.

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
        """Whether these are the settings of the package."""
        return self.search in _PACKAGED


def settings() -> list[Setting]:
    """Return the settings to try, for one walker and for several; the packaged ones are first."""
    tried = [Setting(each) for each in _PACKAGED]
    for each, share, (hot, cold) in product(_PACKAGED, _STARTING_SHARES, _TEMPERATURES):
        setting = Setting(replace(each, starting_share=share, hot=hot, cold=cold))
        if setting not in tried:
            tried.append(setting)
    return tried


def sites_for(purpose: str, count: int) -> tuple[Definition, ...]:
    """Return generated sites; different purposes get different sites."""
    return secret_sites(f"annealing, {purpose}", count)


def taken_off_percent(setting: Setting, seeds: int, site: Definition) -> float:
    """Return the reduction by a search from the rules on a site, the mean over seeds, in %."""
    propose, found = method_of(FromRulesSearch(setting.search)), []
    for seed in range(seeds):
        layout = propose(make(site, _BUDGET, engine="surrogate"), seed)
        found.append(1.0 - make(site, _BUDGET, engine="surrogate").evaluate(layout))
    return 100.0 * float(np.mean(found))


def on_sites(
    setting: Setting, sites: tuple[Definition, ...], seeds: int, workers: int
) -> FloatArray:
    """Return the reduction by a search on each site, in % (sites,)."""
    return np.array(run_all(partial(taken_off_percent, setting, seeds), sites, workers))
