"""Loads of layouts under threats, with each blast simulated once, and budgets of blasts."""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import LoadCase
from blast_env.evaluation.engines import BlastLoads, Engine, find_engine
from blast_env.evaluation.engines.contract import EngineBlast
from blast_env.evaluation.store import BlastKey, BlastStore, calibration_digest, engine_text
from blast_env.geometry import Element, Layout
from blast_env.layout import check_layout
from blast_env.layout.placement import load_relevant
from blast_env.particles.calibration.model import Calibration
from blast_env.provenance import code_version
from blast_env.runner import as_completed, check_workers
from blast_env.site import AnyCharge, AnyScenario, find_scenario
from blast_env.site.scene import Charge


@dataclass
class BlastCounts:
    """Counts of loads that were asked for.

    Attributes:
        blasts: Number of simulated blasts.
        cache_hits: Number of requested loads that needed no blast.
    """

    blasts: int = 0
    cache_hits: int = 0

    @property
    def cache_hit_rate(self) -> float:
        """Share of the requested loads that needed no blast; 0 without requests."""
        asked = self.blasts + self.cache_hits
        return self.cache_hits / asked if asked else 0.0


class BlastEvaluator:
    """Runs blasts of one scenario and caches their loads.

    It serves the reward, the search methods and `evaluate_layout`. Loads are a pure function of
    scenario, layout, threat and engine. They do not depend on the order of the cells in a layout,
    to the last bit, because cells are sorted before the blast.

    It can be pickled, with its cached loads.

    Args:
        scenario: The scenario; for the particle engines it must name a calibration.
        engine: Name of an engine, or an engine.
        cache_size: Maximum number of loads in memory, unless `cache` is a store.
        cache: Folder of a store, for other processes and later runs, or a store that several
            evaluators share; see `BlastStore`.
        counts: Counts that several evaluators share; its own unless given.

    Attributes:
        calibration: The scenario's calibration, checked against its parameters and the engine;
            `None` for engines without particles, which need none.
        store: Where the loads are.

    Raises:
        BlastEnvError: If the engine cannot compute the loads that the objective needs, its
            calibration is missing or was made with others, or an argument is not usable.
    """

    def __init__(
        self,
        scenario: AnyScenario,
        engine: str | Engine = "event",
        cache_size: int = 4096,
        cache: str | Path | BlastStore | None = None,
        counts: BlastCounts | None = None,
    ) -> None:
        self.scenario = find_scenario(scenario)
        self.engine = find_engine(engine)
        self.engine.check(self.scenario)
        self.calibration: Calibration | None = self.engine.calibration(self.scenario)
        self.counts = BlastCounts() if counts is None else counts
        self.store = BlastStore.of(cache, cache_size)
        self._key_of_nothing = BlastKey(
            scenario_hash=self.scenario.content_hash,
            layout=(),
            charge=Charge((0.0, 0.0), 0.0),
            seed=0,
            engine=engine_text(self.engine),
            calibration="" if self.calibration is None else calibration_digest(self.calibration),
            code=code_version(),
        )

    @property
    def scenario_hash(self) -> str:
        """Content hash of the scenario, computed once."""
        return self._key_of_nothing.scenario_hash

    @property
    def calibration_name(self) -> str:
        """Name of the calibration; `"none"` for engines without particles, which need none."""
        return "none" if self.calibration is None else self.calibration.name

    def coarser(self) -> "BlastEvaluator | None":
        """Return an evaluator with `Engine.coarser` and the same store, if there is one."""
        engine = self.engine.coarser
        if engine is None:
            return None
        return BlastEvaluator(self.scenario, engine, cache=self.store, counts=self.counts)

    def of(self, scenario: AnyScenario) -> "BlastEvaluator":  # noqa: ARG002
        """Return itself, as `Evaluators.of` of its scenario."""
        return self

    def loads(self, layout: Sequence[Element], threat: LoadCase) -> BlastLoads:
        """Return the loads of one blast; see `loads_of_many`."""
        return self.loads_of_many([(layout, threat)])[0]

    def loads_of_many(
        self,
        pairs: Iterable[tuple[Sequence[Element], LoadCase]],
        processes: int = 1,
        progress: Callable[[float], None] | None = None,
    ) -> list[BlastLoads]:
        """Return the loads of many blasts, in the order of the pairs.

        Repeated pairs and cached blasts cost nothing. The number of processes changes only the
        time. Blasts that ended before an interruption stay cached.

        Raises:
            LayoutError: If a layout does not fit the build zone; nothing is simulated then.
            ScenarioError: If a charge is not clear of a structure or the border.
        """
        check_workers("processes", processes)
        asked: dict[BlastKey, AnyCharge] = {}
        keys, layouts = [], []
        for layout, threat in pairs:
            layouts.append(tuple(check_layout(self.scenario, layout)))
            keys.append(self.key(layout, threat))
            asked.setdefault(keys[-1], threat.charge)
        stored = ((key, self.store.get(key, self.scenario)) for key in asked)
        found = {key: loads for key, loads in stored if loads is not None}
        missing = {key: (self, charge) for key, charge in asked.items() if key not in found}
        for done, (key, loads) in enumerate(_run(missing, processes), start=1):
            found[key] = loads
            if progress is not None:
                progress(1.0 - (len(missing) - done) / len(keys))
        self.counts.cache_hits += len(keys) - len(missing)
        objective, loads_of = self.scenario.objective, [found[key] for key in keys]
        if objective.kind != "response":
            return loads_of
        return [
            loads.with_facades(self.scenario.named_bays(layout), objective)
            for loads, layout in zip(loads_of, layouts, strict=True)
        ]

    def keep(self, layout: Sequence[Element], threat: LoadCase, loads: BlastLoads) -> None:
        """Cache and count the loads of a blast that ran elsewhere, with the same engine.

        Raises:
            LayoutError: If the layout does not fit the build zone.
        """
        self._keep(self.key(layout, threat), loads)

    def knows(self, layout: Sequence[Element], threat: LoadCase) -> bool:
        """Return whether the loads of a blast are stored."""
        return self.store.get(self.key(layout, threat), self.scenario) is not None

    def key(self, layout: Sequence[Element], threat: LoadCase) -> BlastKey:
        """Return the key of a blast, with all inputs of its loads."""
        cells = tuple(sorted(load_relevant(check_layout(self.scenario, layout))))
        # Without noise the seed has no effect: a charge has one realisation.
        seed = threat.seed if self.engine.has_noise else 0
        charge = threat.charge_against(self.scenario, cells)
        return self._key_of_nothing._replace(layout=cells, charge=charge, seed=seed)

    def _keep(self, key: BlastKey, loads: BlastLoads) -> None:
        """Count and store a blast."""
        self.counts.blasts += 1
        self.store.add(key, loads)


def _run(
    missing: Mapping[BlastKey, tuple[BlastEvaluator, AnyCharge]], processes: int
) -> Iterator[tuple[BlastKey, BlastLoads]]:
    """Run blasts, cache the loads in their evaluators, and yield them in order of completion.

    The charges are those of the keys, or the vehicles that carry them.
    """
    if not missing:
        return
    engine = next(iter(missing.values()))[0].engine
    keys, size = list(missing), engine.at_once
    lots = [keys[first : first + size] for first in range(0, len(keys), size)]
    work = [
        [EngineBlast(missing[k][0].scenario, k.layout, missing[k][1], k.seed) for k in lot]
        for lot in lots
    ]
    for index, of_lot in as_completed(engine.loads_at_once, work, processes):
        for key, loads in zip(lots[index], of_lot, strict=True):
            missing[key][0]._keep(key, loads)
            yield key, loads


def run_together(
    asked: Iterable[tuple[BlastEvaluator, Layout, LoadCase]], processes: int = 1
) -> None:
    """Run blasts of evaluators with one engine in one batch and cache their loads.

    Cached ones are not run. Errors are those of `BlastEvaluator.loads_of_many`.
    """
    missing: dict[BlastKey, tuple[BlastEvaluator, AnyCharge]] = {}
    for evaluator, layout, threat in asked:
        key = evaluator.key(layout, threat)
        if key not in missing and evaluator.store.get(key, evaluator.scenario) is None:
            missing[key] = evaluator, threat.charge
    for _ in _run(missing, processes):
        pass


_MOST_EVALUATORS: Final = 4


class Evaluators:
    """The evaluators of the most recent scenarios, with one engine and one store.

    Only few are kept, so that a new site at every reset does not fill the memory. Arguments and
    errors are those of `BlastEvaluator`.
    """

    def __init__(
        self,
        engine: str | Engine,
        cache: str | Path | BlastStore | None = None,
        most: int = _MOST_EVALUATORS,
        counts: BlastCounts | None = None,
    ) -> None:
        self.engine = find_engine(engine)
        self.most = most
        self._store = BlastStore.of(cache)
        self._kept: OrderedDict[str, BlastEvaluator] = OrderedDict()
        self.counts = BlastCounts() if counts is None else counts

    def coarser(self) -> "Evaluators | None":
        """Return evaluators with `Engine.coarser` and the same store, if there is one."""
        engine = self.engine.coarser
        return None if engine is None else Evaluators(engine, self._store, self.most, self.counts)

    def of(self, scenario: AnyScenario) -> BlastEvaluator:
        """Return the evaluator of a scenario; see `BlastEvaluator` for errors."""
        newest = next(reversed(self._kept.values()), None)
        if newest is not None and newest.scenario is scenario:
            return newest  # the usual case, without the time for a content hash
        found = find_scenario(scenario)
        key = found.content_hash
        if key not in self._kept:
            self._kept[key] = BlastEvaluator(
                found, self.engine, cache=self._store, counts=self.counts
            )
        self._kept.move_to_end(key)
        if len(self._kept) > self.most:
            self._kept.popitem(last=False)
        return self._kept[key]


class BudgetError(BlastEnvError):
    """A search requests more blasts than its budget allows."""
