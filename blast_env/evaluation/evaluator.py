"""Loads of layouts under threats: each blast is simulated once, and kept in a store."""

import dataclasses
import json
import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import repeat
from math import isnan, nan
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Final, Self, TypeVar

from blast_env.errors import BlastEnvError, BlastEnvWarning, value_text
from blast_env.evaluation.cases import LoadCase, LoadCaseSet
from blast_env.evaluation.engines import JUDGE, Engine, find_engine
from blast_env.evaluation.engines.contract import BlastDrawing, EngineBlast
from blast_env.evaluation.record import KEY, BlastKey, BlastLoads, BlastRecord, parts_digest
from blast_env.geometry import Element
from blast_env.layout import check_layout
from blast_env.layout.placement import LegalLayout, load_relevant
from blast_env.provenance import code_version
from blast_env.response.levels import LevelOfProtection
from blast_env.runner import ProgressCallback, as_completed, check_workers, share_of
from blast_env.site import AnyScenario, Scenario, find_scenario
from blast_env.site.blast_site import Charge
from blast_env.site.objective import ObjectiveSection
from blast_env.units import PA_PER_PSI

if TYPE_CHECKING:
    from blast_env.store import Store


MOST_BYTES: Final = 256_000_000
"""Default maximum size of the file of a store; a blast in the courtyard takes 2 kB."""

_FILE: Final = "blasts.sqlite"
_MOST_COMPLETE: Final = 256  # in memory, without a file; one with histories takes up to a megabyte


class BlastStore:
    """The records of blasts: the most recently used in memory and, with a folder, all in a file.

    The file serves other processes and later runs; see `Store`. If it becomes unusable, a warning
    is issued and the work continues without it. A store can be pickled, with what is in memory.
    With a file, loads alone stay in memory.

    Args:
        folder: Folder of the file; created if necessary. Without one, records are only in memory.
        size: Maximum number of loads in memory; 0 for none. Each takes 8 bytes per module plus
            about a kilobyte.
        most_bytes: Maximum total size of the records in the file.

    Raises:
        BlastEnvError: If a bound is negative, or the file is damaged or cannot be made.
    """

    def __init__(
        self, folder: str | Path | None = None, size: int = 4096, most_bytes: int = MOST_BYTES
    ) -> None:
        if size < 0:
            raise BlastEnvError(f"cache_size is {size}, must be at least 0")
        self.size = size
        self._loads: OrderedDict[BlastKey, BlastLoads] = OrderedDict()
        self._complete: OrderedDict[BlastKey, BlastRecord] = OrderedDict()
        self._file = None if folder is None else _opened(Path(folder) / _FILE, most_bytes)

    @classmethod
    def of(cls, value: "str | Path | BlastStore | None", size: int = 4096) -> "BlastStore":
        """Return the store for an argument `cache`: a folder, a store, or `None`."""
        if isinstance(value, BlastStore):
            return value
        if value is not None and not isinstance(value, str | Path):
            raise BlastEnvError(f"cache is {value_text(value)}, must be a folder or a BlastStore")
        return cls(value, size)

    @property
    def damaged(self) -> int:
        """Number of damaged blasts found in the file by this object."""
        return 0 if self._file is None else self._file.damaged

    def get(self, key: BlastKey, scenario: AnyScenario | None = None) -> BlastLoads | None:
        """Return the loads of a blast, or `None` if they are missing or damaged.

        Loads in the file that cannot be those of `scenario` count as missing: anybody may write to
        it.
        """
        # 1. In memory; 2. in the file; 3. what was found there stays in memory.
        loads = self._loads.get(key)
        if loads is not None:
            with suppress(KeyError):  # another thread has displaced it
                self._loads.move_to_end(key)
            return loads
        found = self._read(key, scenario)
        if found is None:
            return None
        self.remember(key, found.loads)
        return found.loads

    def record(self, key: BlastKey, scenario: AnyScenario | None = None) -> BlastRecord | None:
        """Return the complete record of a blast; `None` if it is missing, damaged, or loads alone.

        As for `get`, it must be able to be that of `scenario`.
        """
        found = self._complete.get(key) or self._read(key, scenario)
        return None if found is None or found.details is None else found

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Keep the loads of a blast, which may displace others."""
        if self._file is None:
            self.remember(key, loads)
        else:
            self.keep(key, BlastRecord(loads))

    def keep(self, key: BlastKey, record: BlastRecord) -> None:
        """Keep the record of a blast, which may displace others."""
        self.remember(key, record.loads)
        if self._file is None:
            if record.details is not None and self.size:
                self._complete[key] = record
                if len(self._complete) > _MOST_COMPLETE:
                    self._complete.popitem(last=False)
            return
        try:
            self._file.put(key.text, record.encoded())
        except BlastEnvError as error:
            warnings.warn(f"a blast is not kept: {error}", BlastEnvWarning, stacklevel=3)

    def remember(self, key: BlastKey, loads: BlastLoads) -> None:
        """Keep the loads of a blast in memory only."""
        for on_modules in (loads.module_impulse_n_s, loads.module_impulse_sim):
            on_modules.flags.writeable = False  # shared by several callers
        self._loads.pop(key, None)
        self._loads[key] = loads
        with suppress(KeyError):  # another thread has displaced it
            if len(self._loads) > self.size:
                self._loads.popitem(last=False)

    def _read(self, key: BlastKey, scenario: AnyScenario | None) -> BlastRecord | None:
        """Return a record of the file."""
        if self._file is None:
            return None
        try:
            found = self._file.read(key.text, BlastRecord.decoded)
        except BlastEnvError as error:
            warnings.warn(f"a blast counts as missing: {error}", BlastEnvWarning, stacklevel=3)
            return None
        # A file can hold anything: loads must have the structures and modules of the site.
        is_known = found is not None and (
            scenario is None or found.loads.are_for(find_scenario(scenario))
        )
        return found if is_known else None

    def items(self) -> Iterator[tuple[BlastKey, BlastLoads]]:
        """Yield the loads of all undamaged blasts of the file, always in the same order.

        Without a file, those in memory.

        Raises:
            BlastEnvError: If the file cannot be read.
        """
        if self._file is None:
            yield from self._loads.items()
            return
        for text, content in self._file.items():
            with suppress(ValueError):
                yield KEY.validate_python(json.loads(text)), BlastRecord.decoded(content).loads

    def __len__(self) -> int:
        return len(self._loads) if self._file is None else len(self._file)


def _opened(path: Path, most_bytes: int) -> "Store":
    from blast_env.store import Store  # only where blasts go to a file

    return Store(path, most_bytes)


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
        calibration_name: Its name; `"none"` without one.
        store: Where the loads are.

    Raises:
        BlastEnvError: If the engine cannot compute the loads that the objective needs, its
            calibration is missing or was made with others, or an argument is not usable.
    """

    def __init__(
        self,
        scenario: AnyScenario,
        engine: str | Engine = JUDGE,
        cache_size: int = 4096,
        cache: str | Path | BlastStore | None = None,
        counts: BlastCounts | None = None,
    ) -> None:
        self.scenario = find_scenario(scenario)
        self.engine = find_engine(engine)
        self.engine.check(self.scenario)
        law = self.calibration = self.engine.calibration(self.scenario)
        self.calibration_name = "none" if law is None else law.name
        self.counts = BlastCounts() if counts is None else counts
        self.store = BlastStore.of(cache, cache_size)
        self._key_of_nothing = BlastKey(
            scenario_hash=self.scenario.without_budget.content_hash,
            layout=(),
            charge=Charge((0.0, 0.0), 0.0),
            seed=0,
            engine=engine_text(self.engine),
            calibration="" if law is None else law.digest,
            code=code_version(),
            parts=parts_digest(self.scenario, self.engine.response_s(self.scenario)),
        )

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
        progress: ProgressCallback | None = None,
    ) -> list[BlastLoads]:
        """Return the loads of many blasts, in the order of the pairs.

        Repeated pairs and cached blasts cost nothing. The number of processes changes only the
        time. Blasts that ended before an interruption stay cached.

        Raises:
            LayoutError: If a layout does not fit the build zone; nothing is simulated then.
            ScenarioError: If a charge is not clear of a structure or the border.
        """
        asked = [(self, layout, threat) for layout, threat in pairs]
        return loads_together(asked, processes, progress)

    def records_of_many(
        self,
        pairs: Iterable[tuple[Sequence[Element], LoadCase]],
        processes: int = 1,
        progress: ProgressCallback | None = None,
        drawing: BlastDrawing | None = None,
    ) -> list[BlastRecord]:
        """Return the records of many blasts, complete of an engine whose records are.

        Others are as for `loads_of_many`, also the errors. With `drawing`, which draws each blast,
        all of them are run in this process, whether or not they are known.
        """
        if not self.engine.is_complete:
            return list(map(BlastRecord, self.loads_of_many(pairs, processes, progress)))
        check_workers("processes", processes)
        asked = [(self, layout, threat) for layout, threat in pairs]
        # A drawing needs the blast itself, so then all of them run.
        find = BlastStore.record if drawing is None else None
        run = partial(_records, processes=processes, progress=progress, drawing=drawing)
        found = _together(asked, find, run, BlastStore.keep, progress)
        # Measures need no blast: one record answers for its layout with any of them.
        return [
            replace(record, loads=self.responding(record.loads, layout))
            for record, (_, layout, _) in zip(found, asked, strict=True)
        ]

    def responding(self, loads: BlastLoads, layout: Sequence[Element]) -> BlastLoads:
        """Return loads with the response of the facades, where the objective counts that."""
        objective = self.scenario.objective
        if objective.kind != "response":
            return loads
        return loads.with_facades(
            self.scenario.named_bays(check_layout(self.scenario, layout)), objective
        )

    def known(self, layout: Sequence[Element], threat: LoadCase) -> BlastRecord | None:
        """Return the complete record of a blast if it is stored."""
        found = self.store.record(self.key(layout, threat), self.scenario)
        if found is None:
            return None
        return replace(found, loads=self.responding(found.loads, tuple(layout)))

    def keep(self, layout: Sequence[Element], threat: LoadCase, loads: BlastLoads) -> None:
        """Cache and count the loads of a blast that ran elsewhere, with the same engine.

        Raises:
            LayoutError: If the layout does not fit the build zone.
        """
        self.counts.blasts += 1
        self.store.keep(self.key(layout, threat), BlastRecord(loads))

    def key(self, layout: Sequence[Element], threat: LoadCase) -> BlastKey:
        """Return the key of a blast, with all inputs of its loads."""
        legal = check_layout(self.scenario, layout)
        cells = tuple(sorted(load_relevant(legal)))
        # Without noise the seed has no effect: a charge has one realisation.
        seed = threat.seed if self.engine.has_noise else 0
        charge = threat.charge_against(self.scenario, legal)
        site, *_, engine, calibration, code, parts = self._key_of_nothing
        return BlastKey(site, cells, charge, seed, engine, calibration, code, parts)


BlastRequest = tuple[BlastEvaluator, Sequence[Element], LoadCase]
"""The evaluator, the layout and the threat of a blast."""

Kept = TypeVar("Kept", BlastLoads, BlastRecord)


def loads_together(
    asked: Sequence[BlastRequest], processes: int = 1, progress: ProgressCallback | None = None
) -> list[BlastLoads]:
    """Return the loads of blasts on several sites by one engine, run in one batch.

    Arguments and errors are those of `BlastEvaluator.loads_of_many`.
    """
    check_workers("processes", processes)
    run = partial(_loads, processes=processes)
    found = _together(asked, BlastStore.get, run, BlastStore.add, progress)
    return [
        evaluator.responding(loads, layout)
        for loads, (evaluator, layout, _) in zip(found, asked, strict=True)
    ]


def _together(
    asked: Sequence[BlastRequest],
    find: Callable[[BlastStore, BlastKey, AnyScenario], Kept | None] | None,
    run: Callable[[Engine, Sequence[EngineBlast]], Iterator[tuple[int, Kept]]],
    keep: Callable[[BlastStore, BlastKey, Kept], None],
    progress: ProgressCallback | None,
) -> list[Kept]:
    """Return what is kept of blasts, in the order asked for; each is found, or runs once.

    Args:
        asked: The blasts, all by one engine.
        find: Returns what a store has of a blast; `None` if all must run.
        run: Runs blasts, and yields (index, what is kept) when one is done.
        keep: Stores that.
        progress: Called after each blast, with the share of those that run.
    """
    # 1. A number per blast, equal for equal blasts, and what the store has.
    distinct: dict[BlastKey, int] = {}  # a hash of a key takes as long as a step of a layout
    numbers: list[int] = []
    found: dict[int, Kept] = {}
    missing: dict[int, tuple[BlastEvaluator, BlastKey]] = {}
    blasts: list[EngineBlast] = []  # those missing
    for evaluator, layout, threat in asked:
        key = evaluator.key(layout, threat)
        number = distinct.setdefault(key, len(distinct))
        numbers.append(number)
        if number in found or number in missing:
            continue
        known = None if find is None else find(evaluator.store, key, evaluator.scenario)
        if known is None:
            # The charge, or the vehicle that carries it to the place in the key.
            cells = key.layout
            if isinstance(layout, LegalLayout) and layout.worst:
                cells = layout.in_order(cells)
            missing[number] = evaluator, key
            blasts.append(EngineBlast(evaluator.scenario, cells, threat.charge, key.seed))
        else:
            found[number] = known
    if not asked:
        return []
    # 2. The others run. Each is kept when done: an interruption loses only those under way.
    first, places = asked[0][0], list(missing)
    for done, (index, kept) in enumerate(run(first.engine, blasts), start=1):
        evaluator, key = missing[places[index]]
        evaluator.counts.blasts += 1
        keep(evaluator.store, key, kept)
        found[places[index]] = kept
        if progress is not None:
            progress(done / len(missing))
    first.counts.cache_hits += len(numbers) - len(missing)
    # 3. Back in the order asked for.
    return list(map(found.__getitem__, numbers))


def _loads(
    engine: Engine, blasts: Sequence[EngineBlast], processes: int
) -> Iterator[tuple[int, BlastLoads]]:
    """Run blasts; yield (index, loads) when done."""
    # Lots as large as the engine takes less time for than for their parts.
    firsts = range(0, len(blasts), engine.at_once)
    lots = [blasts[first : first + engine.at_once] for first in firsts]
    for lot, of_lot in as_completed(engine.loads_at_once, lots, processes):
        yield from enumerate(of_lot, start=firsts[lot])


def _records(
    engine: Engine,
    blasts: Sequence[EngineBlast],
    processes: int,
    progress: ProgressCallback | None,
    drawing: BlastDrawing | None,
) -> Iterator[tuple[int, BlastRecord]]:
    """Run blasts; yield (index, record) when done."""
    if processes > 1 and drawing is None:
        return as_completed(engine.record, blasts, processes)
    # A drawing stays in this process, because it collects pictures here.
    parts = [share_of(progress, index, len(blasts)) for index in range(len(blasts))]
    return enumerate(map(engine.record, blasts, parts, repeat(drawing)))


def engine_text(engine: Engine) -> str:
    """Return the text of an engine in a key: class, name, version and any dataclass fields.

    Engines of one class, name and version that are not dataclasses count as equal.
    """
    kind = f"{type(engine).__module__}.{type(engine).__qualname__}"
    fields = repr(engine) if dataclasses.is_dataclass(engine) else ""
    return f"{kind} {engine.name} {engine.version} {fields}".rstrip()


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
        self._kept: OrderedDict[tuple[str, str], BlastEvaluator] = OrderedDict()
        self.counts = BlastCounts() if counts is None else counts

    def coarser(self) -> "Evaluators | None":
        """Return evaluators with `Engine.coarser` and the same store, if there is one."""
        engine = self.engine.coarser
        return None if engine is None else Evaluators(engine, self._store, self.most, self.counts)

    def of(self, scenario: AnyScenario) -> BlastEvaluator:
        """Return the evaluator of a scenario; see `BlastEvaluator` for errors."""
        # By identity first: a content hash takes longer than a guess of the surrogate.
        newest = next(reversed(self._kept.values()), None)
        if newest is not None and newest.scenario is scenario:
            return newest  # the usual case, without the time for a content hash
        found = find_scenario(scenario)
        known = (key for key, own in self._kept.items() if own.scenario is found)
        key = next(known, None) or self._key(found)
        if key not in self._kept:
            self._kept[key] = BlastEvaluator(
                found, self.engine, cache=self._store, counts=self.counts
            )
        self._kept.move_to_end(key)
        if len(self._kept) > self.most:
            self._kept.popitem(last=False)
        return self._kept[key]

    def _key(self, scenario: Scenario) -> tuple[str, str]:
        """Return what a scenario and its records depend on, as those of a `BlastKey`."""
        return scenario.content_hash, parts_digest(scenario, self.engine.response_s(scenario))


@dataclass(frozen=True)
class Assessment:
    """The loads on the protected structures with one layout.

    Each load is the mean over the realisations of a charge, combined over the charges by the risk
    measure.

    Attributes:
        impulse_pa_s: Weighted sum of the impulses per area of the protected buildings, Pa*s.
        impulse_sim: Weighted sum of the impulses of the protected structures, simulation units;
            `None` of an engine without particles.
        peak_pa: The largest overpressure on the walls of these structures, Pa; NaN for particles.
        load: The objective value: Pa s for impulses, Pa for peaks, dimensionless for both, for a
            response and with a target.
        in_range: Whether all the blasts are in the range of the calibration.
        level: The lowest level of protection under any threat; `None` unless the objective is a
            response.
    """

    impulse_pa_s: float
    impulse_sim: float | None
    peak_pa: float
    load: float
    in_range: bool
    level: LevelOfProtection | None = None

    @classmethod
    def of(cls, case: LoadCaseSet, layout: Sequence[Element], loads: Sequence[BlastLoads]) -> Self:
        """Return the assessment of a layout from its loads, one per threat of the case."""
        # Impulse, peak and objective, each combined over the threats by itself.
        combined, counts = case.combined, case.scenario.objective
        if len(loads) == 1 and case.takes_one_as_it_is:  # the usual case of an episode
            return cls._of_one(loads[0], counts)
        sums = [s for load in loads if (s := load.protected_impulse_sim) is not None]
        return cls(
            combined([load.protected_impulse_pa_s for load in loads]),
            combined(sums) if len(sums) == len(loads) else None,
            combined([load.protected_peak_pa for load in loads]),
            case.objective_value([load.load(counts) for load in loads], layout),
            all(map(attrgetter("in_range"), loads)),
            min([load.level for load in loads]) if counts.kind == "response" else None,
        )

    @classmethod
    def _of_one(cls, loads: BlastLoads, counts: ObjectiveSection) -> Self:
        """Return the same of the only threat, whose loads are the combined ones."""
        sim = loads.protected_impulse_sim
        return cls(
            float(loads.protected_impulse_pa_s),
            None if sim is None else float(sim),
            float(loads.protected_peak_pa),
            float(loads.load(counts)),
            loads.in_range,
            loads.level if counts.kind == "response" else None,
        )

    @property
    def impulse_psi_s(self) -> float:
        """The impulse in the paper's unit, psi*s."""
        return self.impulse_pa_s / PA_PER_PSI

    def reduction_from(self, unprotected: "Assessment") -> float:
        """Return the relative reduction of `load` from no barrier; NaN if that load is 0.

        It is 0 where pieces hide a building, whose load is then not known.
        """
        if not unprotected.load > 0.0:
            return nan
        return 0.0 if isnan(self.load) else 1.0 - self.load / unprotected.load
