"""Campaigns: blasts of layouts under threats, run once each, and kept in a store."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, islice
from pathlib import Path
from typing import Final

from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.cases import LoadCase, LoadCaseSet, check_distinct, one_per_charge
from blast_env.evaluation.engines.contract import BlastDrawing, Engine
from blast_env.evaluation.evaluator import BlastEvaluator, BlastStore
from blast_env.evaluation.record import BlastRecord
from blast_env.gas.cost import CostGuess
from blast_env.geometry import Layout
from blast_env.layout.placement import load_relevant
from blast_env.runner import ProgressCallback, share_of
from blast_env.site import AnyScenario, Scenario, find_scenario

_COARSER: Final = 10  # per cent of the work: coarser cells take little time


@dataclass(frozen=True, eq=False)
class Campaign:
    """The blasts of some layouts under the threats of a case.

    Attributes:
        case: The site and the threats.
        layouts: The layouts by name, no barrier first, the one in question last.
        evaluator: Runs the blasts, and keeps them in its store.
        coarser: The same on coarser cells, for the threat that governs; `None` without.
        processes: Worker processes; they change only the time.
        without_fallen: Whether pieces that overturn before a blast is over are taken away, and the
            blast is run again until no other piece falls.
    """

    case: LoadCaseSet
    layouts: Mapping[str, Layout]
    evaluator: BlastEvaluator
    coarser: BlastEvaluator | None = None
    processes: int = 1
    without_fallen: bool = False

    @classmethod
    def on(
        cls,
        site: AnyScenario,
        layouts: Mapping[str, Layout],
        threats: Sequence[LoadCase],
        engine: Engine,
        coarser: Engine | None = None,
        cache: str | Path | BlastStore | None = None,
    ) -> "Campaign":
        """Return the campaign of a site, with a store of its own or in a folder."""
        found, store = find_scenario(site), BlastStore.of(cache)
        evaluators = (
            None if engine_used is None else BlastEvaluator(found, engine_used, cache=store)
            for engine_used in (engine, coarser)
        )
        fine, other = evaluators
        assert fine is not None
        return cls(LoadCaseSet(found, tuple(threats)), layouts, fine, other)

    @property
    def scenario(self) -> Scenario:
        """The site."""
        return self.case.scenario

    def cost(self) -> tuple[CostGuess, ...]:
        """Return the estimated cost of each blast, of engines that can tell; nothing is run."""
        engine, threats = self.evaluator.engine, self.case.threats
        charges = [own.charge for own in (threats if engine.has_noise else one_per_charge(threats))]
        asked = [(engine, charge) for charge in charges]
        if self.coarser is not None:
            asked.append((self.coarser.engine, self.case.threats[0].charge))
        known = {pair: pair[0].cost(self.scenario, pair[1]) for pair in dict.fromkeys(asked)}
        costs = [known[pair] for pair in asked for _ in self.layouts]
        return tuple(cost for cost in costs if cost is not None)

    def run(
        self,
        progress: ProgressCallback | None = None,
        drawing: BlastDrawing | None = None,
        worst: Callable[[Blasts], int] = Blasts.worst,
    ) -> Blasts:
        """Run the blasts that the store lacks, and return all.

        Args:
            progress: Called with the finished share of the blasts.
            drawing: Draws each blast; all are run for it.
            worst: Returns the number of the threat that governs, which runs on coarser cells too.
        """
        # Coarser cells cost an eighth of the cells and half of the steps: their share of the
        # progress.
        whole = 100 if self.coarser is None else 100 - _COARSER
        (found,) = blasts_of([self], share_of(progress, 0, 100, whole), drawing)
        return self.with_coarse(found, worst(found), share_of(progress, whole, 100, 100 - whole))

    def with_coarse(
        self, found: Blasts, number: int, progress: ProgressCallback | None = None
    ) -> Blasts:
        """Return blasts with those on coarser cells under one threat, by its number."""
        if self.coarser is None:
            return found
        case = LoadCaseSet(self.scenario, (self.case.threats[number],))
        coarse = replace(self, case=case, evaluator=self.coarser, coarser=None)
        return replace(found, coarse=coarse.run(progress))

    def stored(self) -> Blasts | None:
        """Return the stored blasts, under the threats that have all; `None` without any.

        Nothing is run.
        """
        # A threat counts if all layouts are known under it: comparisons are of pairs.
        known: dict[str, list[BlastRecord]] = {name: [] for name in self.layouts}
        threats = []
        for threat in self.case.threats:
            found = [self.evaluator.known(layout, threat) for layout in self.layouts.values()]
            records = [item for item in found if item is not None]
            if len(records) == len(found):
                threats.append(threat)
                for own, record in zip(known.values(), records, strict=True):
                    own.append(record)
        if not threats:
            return None
        coarse = None
        if self.coarser is not None:
            coarse = replace(self, evaluator=self.coarser, coarser=None).stored()
        return Blasts(
            LoadCaseSet(self.scenario, tuple(threats)),
            self.layouts,
            {name: tuple(own) for name, own in known.items()},
            self.evaluator.engine,
            coarse,
        )

    def _after_falls(self, layout: Layout, threat: LoadCase, record: BlastRecord) -> BlastRecord:
        """Return the record of a blast without the pieces that fall before it is over."""
        fallen: Layout = ()
        there = LoadCase(threat.charge_against(self.scenario, layout), threat.seed)
        while falling := _falling(self.scenario, layout, record):
            fallen += falling
            layout = tuple(element for element in layout if element not in fallen)
            (record,) = self.evaluator.records_of_many([(layout, there)])
        return replace(record, taken_away=fallen)


def _falling(scenario: Scenario, layout: Layout, record: BlastRecord) -> Layout:
    """Return the pieces of a layout that overturn before the end of a blast."""
    if record.pieces is None or not len(record.pieces):
        return ()
    zone = scenario.zone
    # A blast has its pieces in order, whatever the order in the layout.
    ordered = sorted(load_relevant(layout))
    bodies = [element for element in ordered if zone.catalogue.variant(element).height_m]
    falls = record.pieces["falls_in_blast"].tolist()
    return tuple(body for body, is_falling in zip(bodies, falls, strict=True) if is_falling)


def blasts_of(
    campaigns: Sequence[Campaign],
    progress: ProgressCallback | None = None,
    drawing: BlastDrawing | None = None,
) -> list[Blasts]:
    """Run campaigns, without coarser cells; consecutive ones on one scenario run together."""
    return list(_blasts_of(campaigns, progress, drawing))


def _blasts_of(
    campaigns: Sequence[Campaign],
    progress: ProgressCallback | None,
    drawing: BlastDrawing | None,
) -> Iterator[Blasts]:
    done = 0
    for _, group in groupby(
        campaigns, lambda request: (id(request.scenario), id(request.evaluator.engine))
    ):
        together = list(group)
        for request in together:
            check_distinct(request.case.threats)
        pairs = [
            (layout, threat)
            for request in together
            for threat in request.case.threats
            for layout in request.layouts.values()
        ]
        # One batch for all campaigns on a scenario, so that no process waits at the end of each.
        part = share_of(progress, done, len(campaigns), len(together))
        first = together[0]
        records = iter(first.evaluator.records_of_many(pairs, first.processes, part, drawing))
        # Records come in the order of the pairs: threats outside, layouts inside.
        for request in together:
            own: dict[str, list[BlastRecord]] = {name: [] for name in request.layouts}
            for threat in request.case.threats:
                for (name, layout), record in zip(
                    request.layouts.items(), islice(records, len(request.layouts)), strict=True
                ):
                    last = (
                        request._after_falls(layout, threat, record)
                        if request.without_fallen
                        else record
                    )
                    own[name].append(last)
            yield Blasts(
                request.case,
                request.layouts,
                {name: tuple(found) for name, found in own.items()},
                request.evaluator.engine,
            )
        done += len(together)
