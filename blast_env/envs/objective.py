"""What a layout is worth in one episode: its impulses under the episode's threats."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from blast_env.evaluation.cases import Threat
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.evaluation.store import BlastCache, find_cache
from blast_env.geometry import Cell
from blast_env.physics.engine import Engine
from blast_env.scenario import Scenario
from blast_env.statistics import Risk
from blast_env.units import PA_PER_PSI

_MOST_EVALUATORS: Final = 4
_LOADS_PER_EVALUATOR: Final = 1024


@dataclass(frozen=True)
class Assessment:
    """The impulse on the protected structures with one layout.

    Each is the mean over the realisations of a threat, then by the risk measure over the threats.

    Attributes:
        impulse_psi_s: Calibrated impulses per area of the protected structures, by weight, added
            up, psi*s.
        impulse_sim: The same in simulation units.
        in_range: Whether the calibration was made for every one of the blasts.
        threat_impulses_psi_s: Of each threat, psi*s (threats,).
    """

    impulse_psi_s: float
    impulse_sim: float
    in_range: bool
    threat_impulses_psi_s: tuple[float, ...]

    @property
    def impulse_pa_s(self) -> float:
        """The calibrated impulse, Pa*s."""
        return self.impulse_psi_s * PA_PER_PSI

    def reduction_from(self, unprotected: "Assessment") -> float:
        """Return by which share the impulse is below that without a barrier; 0 if that is 0."""
        if unprotected.impulse_psi_s == 0.0:
            return 0.0
        return 1.0 - self.impulse_psi_s / unprotected.impulse_psi_s


@dataclass(frozen=True, eq=False)
class Objective:
    """The blasts that every layout of one episode has to stand.

    All layouts meet the same charges, fans and air (common random numbers).

    Attributes:
        evaluator: Runs the blasts and remembers them.
        threats: The realisations of each threat: the same charge with different seeds.
        risk: How the threats become one number.
    """

    evaluator: BlastEvaluator
    threats: tuple[tuple[Threat, ...], ...]
    risk: Risk
    _assessed: dict[tuple[Cell, ...], Assessment] = field(default_factory=dict, init=False)

    def assess(self, layout: Sequence[Cell]) -> Assessment:
        """Return what a layout is worth; a blast for each threat and realisation, unless known.

        Args:
            layout: (row, column) of the cells that hold a module, in any order.

        Raises:
            LayoutError: If the layout does not fit the build zone.
        """
        key = tuple(sorted(layout))
        if key not in self._assessed:
            self._assessed[key] = self._assess(layout)
        return self._assessed[key]

    def _assess(self, layout: Sequence[Cell]) -> Assessment:
        pairs = [(layout, threat) for realisations in self.threats for threat in realisations]
        loads = self.evaluator.loads_of_many(pairs)
        shape = (len(self.threats), -1)
        psi_s = np.array([each.protected_impulse_psi_s for each in loads]).reshape(shape)
        sim = np.array([each.protected_impulse_sim for each in loads]).reshape(shape)
        of_threats_psi_s = psi_s.mean(axis=1)
        return Assessment(
            impulse_psi_s=self.risk(of_threats_psi_s),
            impulse_sim=self.risk(sim.mean(axis=1)),
            in_range=all(each.in_range for each in loads),
            threat_impulses_psi_s=tuple(of_threats_psi_s.tolist()),
        )


class Evaluators:
    """The evaluators of the scenarios that were met last.

    A fresh site at every reset must not fill the memory: only few are kept, and the counts of
    those that go stay.

    Args:
        engine: Name of an engine, or an engine.
        cache: Folder or cache that all of them share; see `BlastEvaluator`.

    Raises:
        BlastEnvError: If the cache is of no use.
    """

    def __init__(self, engine: str | Engine, cache: str | Path | BlastCache | None = None) -> None:
        self._engine = engine
        self._cache = find_cache(cache)
        self._kept: OrderedDict[str, BlastEvaluator] = OrderedDict()
        self._gone_blasts = 0
        self._gone_cache_hits = 0

    @property
    def blasts(self) -> int:
        """Number of blasts that were really simulated so far."""
        return self._gone_blasts + sum(each.blasts for each in self._kept.values())

    @property
    def cache_hits(self) -> int:
        """Number of loads that were asked for so far and needed no blast."""
        return self._gone_cache_hits + sum(each.cache_hits for each in self._kept.values())

    @property
    def cache_hit_rate(self) -> float:
        """Share of the loads asked for so far that needed no blast; 0 if none were."""
        asked = self.blasts + self.cache_hits
        return self.cache_hits / asked if asked else 0.0

    def of(self, scenario: Scenario) -> BlastEvaluator:
        """Return the evaluator of a scenario.

        Raises:
            CalibrationError: If the scenario names no calibration, or one that was made with other
                parameters or another engine.
            UnknownNameError: If there is no such engine or calibration.
        """
        newest = next(reversed(self._kept.values()), None)
        if newest is not None and newest.scenario is scenario:
            return newest  # the usual case, without the time that a content hash takes
        key = scenario.content_hash
        if key not in self._kept:
            self._kept[key] = BlastEvaluator(
                scenario, self._engine, _LOADS_PER_EVALUATOR, self._cache
            )
        self._kept.move_to_end(key)
        if len(self._kept) > _MOST_EVALUATORS:
            _, gone = self._kept.popitem(last=False)
            self._gone_blasts += gone.blasts
            self._gone_cache_hits += gone.cache_hits
        return self._kept[key]
