"""The simulations of a league, as independent jobs for worker processes."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import call
from time import perf_counter, process_time

import numpy as np

from blast_agents.league.entries import NO_BARRIER, LeagueEntry
from blast_agents.league.standings import Result, Standings
from blast_agents.league.store import ResultStore, evaluation_key, search_key
from blast_agents.league.tracks import Track, practice_of
from blast_env.design.search import LayoutProblem, Proposal, SearchResult, timed_proposal
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.evaluation import BlastEvaluator, BlastMeter, BudgetError, Case, Objective
from blast_env.evaluation.engines import Engine, find_engine
from blast_env.geometry import Layout
from blast_env.layout import check_layout
from blast_env.runner import as_completed, check_workers


@dataclass(frozen=True, eq=False)
class SearchJob:
    """The proposal of an entry for a case.

    Attributes:
        case: The case.
        entry: The entry.
        engine: Name of the engine, or the engine.
    """

    case: Case
    entry: LeagueEntry
    engine: str | Engine

    def __call__(self) -> Proposal:
        """Return the proposal of a search, which shares no blasts with others.

        Its blasts are counted by the problem, not by the method.

        Raises:
            BlastEnvError: If the method runs more blasts than its budget, or its layout is
                illegal.
            KeyboardInterrupt: If the search was interrupted: its layout so far is not a result.
        """
        practice = practice_of(self.case)
        engine = self.entry.first_engine or self.engine
        # The first blast of a process loads code, which must not count in the search's time.
        for each in {engine, self.engine}:
            BlastEvaluator(practice.scenario, each).loads((), practice.threats[0])
        began_s, began_cpu_s = perf_counter(), process_time()
        problem = self._problem(engine, BlastMeter(self.entry.budget))
        result = self._result(problem)
        layout, blasts, other_blasts = result.layout, problem.blasts_run, 0
        if self.entry.first_engine is not None:
            layout, blasts, other_blasts = *self._judged(result), problem.blasts_run
        seconds, cpu_s = perf_counter() - began_s, process_time() - began_cpu_s
        found = Proposal(tuple(sorted(layout)), seconds, blasts, other_blasts, cpu_s)
        return self._checked(found)

    def at_once(self) -> Proposal:
        """Return the proposal of an entry without blasts, with its time.

        Raises:
            BlastEnvError: If a blast is run, or the layout is illegal.
        """
        problem = self._problem(self.engine, BlastMeter(0))
        found = timed_proposal(lambda: self._result(problem).layout)
        return self._checked(replace(found, layout=tuple(sorted(found.layout))))

    def _checked(self, proposal: Proposal) -> Proposal:
        try:
            check_layout(self.case.scenario, proposal.layout)
        except LayoutError as error:
            raise BlastEnvError(f"{self.entry.name}, case {self.case.name!r}: {error}") from None
        return proposal

    def _problem(self, engine: str | Engine, meter: BlastMeter) -> LayoutProblem:
        practice = practice_of(self.case)
        # The cache holds all blasts of the budget, so that each is simulated once.
        most = meter.budget + len(practice.threats)
        evaluator = BlastEvaluator(practice.scenario, engine, cache_size=most)
        return LayoutProblem(evaluator, practice, meter=meter)

    def _result(self, problem: LayoutProblem) -> SearchResult:
        """Return the result of the method.

        Raises:
            BlastEnvError: If it exceeds the budget, also past the meter, or its layout is illegal.
            KeyboardInterrupt: If it was interrupted.
        """
        entry, case = self.entry, self.case
        try:
            result = entry.proposer.propose(problem, entry.budget, case.seed)
        except (BudgetError, LayoutError) as error:
            raise BlastEnvError(f"{entry.name}, case {case.name!r}: {error}") from None
        if result.interrupted:
            raise KeyboardInterrupt
        if problem.blasts_run > entry.budget:
            raise BudgetError(
                f"{entry.name}, case {case.name!r}: {problem.blasts_run:,} blasts were run, the "
                f"budget is {entry.budget:,}"
            )
        return result

    def _judged(self, result: SearchResult) -> tuple[Layout, int]:
        """Return the judge's best of the last layouts of a search's history, and its blasts."""
        latest = [each.layout for each in reversed(result.history)] or [result.layout]
        finalists = list(dict.fromkeys(latest))[: self.entry.finalists]
        meter = BlastMeter(len(finalists) * len(practice_of(self.case).threats))
        best = min(finalists, key=self._problem(self.engine, meter).load)
        return best, meter.blasts


@dataclass(frozen=True, eq=False)
class EvaluationJob:
    """The simulation of a layout under the held-out threats of a case.

    Attributes:
        case: The case.
        layout: The layout.
        engine: Name of the engine, or the engine.
    """

    case: Case
    layout: Layout
    engine: str | Engine

    def __call__(self) -> tuple[float, ...]:
        """Return the loads, one per held-out threat, in the unit of the objective."""
        evaluator = BlastEvaluator(self.case.scenario, self.engine)
        return Objective(evaluator, self.case).counted_loads(self.layout)


@dataclass(frozen=True)
class Outlook:
    """The remaining simulations of a contest.

    Attributes:
        search_blasts: Upper bound on the blasts of the searches.
        held_out_blasts: Upper bound on the blasts under held-out threats.
        searches: Number of searches.
        kept_searches: Number of searches with a stored result.
    """

    search_blasts: int
    held_out_blasts: int
    searches: int
    kept_searches: int

    @property
    def blasts(self) -> int:
        """Upper bound on all blasts."""
        return self.search_blasts + self.held_out_blasts


@dataclass(frozen=True, eq=False)
class Contest:
    """Entries on a track.

    Proposals without blasts run first, in this process, where nothing disturbs their times; then
    the searches; then the simulations of all layouts under the held-out threats. Results of
    searches and loads are stored immediately and not repeated.

    Attributes:
        track: The cases.
        entries: Entries with distinct names, including `NO_BARRIER`.
        store: Stores the results.
        engine: Name of the engine, or the engine.

    Raises:
        BlastEnvError: If two entries have the same name, or `NO_BARRIER` is missing.
    """

    track: Track
    entries: tuple[LeagueEntry, ...]
    store: ResultStore
    engine: str | Engine = "event"

    def __post_init__(self) -> None:
        names = [entry.name for entry in self.entries]
        for name in names:
            if names.count(name) > 1:
                raise BlastEnvError(f"entry {name!r} appears twice, must be unique")
        if NO_BARRIER not in self.entries:
            raise BlastEnvError("no barrier is not among the entries: the others refer to it")

    @cached_property
    def _instant(self) -> Mapping[str, tuple[Proposal, ...]]:
        """The proposals of the entries without blasts, by name, one per case.

        A preceding proposal is not timed, because it loads code.
        """
        proposals = {}
        for entry in self.entries:
            if not entry.budget:
                jobs = [SearchJob(case, entry, self.engine) for case in self.track.cases]
                jobs[0].at_once()
                proposals[entry.name] = tuple(job.at_once() for job in jobs)
        return proposals

    def outlook(self) -> Outlook:
        """Return the remaining simulations.

        Raises:
            CalibrationError: If a scenario has no calibration for the engine.
            UnknownNameError: If the engine is unknown.
        """
        searches = [entry for entry in self.entries if entry.budget]
        missing = self._missing_searches()
        held_out = sum(len(job.case.threats) for job in missing)
        return Outlook(
            search_blasts=sum(job.entry.budget for job in missing),
            held_out_blasts=held_out
            + sum(len(job.case.threats) for job in self._missing_evaluations()),
            searches=len(searches) * len(self.track.cases),
            kept_searches=len(searches) * len(self.track.cases) - len(missing),
        )

    def play(
        self, processes: int = 1, progress: Callable[[float], None] = lambda _: None
    ) -> Standings:
        """Run all missing simulations and return the results.

        Args:
            processes: Worker processes; only the times depend on their number.
            progress: Called with the share of the blasts that is done.

        Raises:
            BlastEnvError: If `processes` is below 1, or nothing arrives at the protected
                structures of a case even without a barrier.
        """
        check_workers("processes", processes)
        whole, done = max(self.outlook().blasts, 1), 0
        searches = self._missing_searches()
        for index, proposal in as_completed(call, searches, processes):
            job = searches[index]
            self.store.keep_proposal(search_key(job.case, job.entry, self.engine), proposal)
            done += job.entry.budget
            progress(min(done / whole, 1.0))
        evaluations = self._missing_evaluations()
        for index, loads in as_completed(call, evaluations, processes):
            asked = evaluations[index]
            key = evaluation_key(asked.case, asked.layout, self.engine)
            self.store.keep_loads(key, loads)
            done += len(loads)
            progress(min(done / whole, 1.0))
        results = tuple(self._results())
        bare = results[self.entries.index(NO_BARRIER)]
        return Standings(self.track, results, bare.loads, find_engine(self.engine).words)

    def _missing_searches(self) -> list[SearchJob]:
        """Return the searches without a stored result, those with the largest budget first."""
        jobs = [
            SearchJob(case, entry, self.engine)
            for entry in self.entries
            if entry.budget
            for case in self.track.cases
            if self._found(case, entry) is None
        ]
        return sorted(jobs, key=lambda job: -job.entry.budget)

    def _missing_evaluations(self) -> list[EvaluationJob]:
        """Return the distinct layouts proposed so far without stored loads."""
        asked = dict.fromkeys(
            (index, proposal.layout)
            for entry in self.entries
            for index, proposal in enumerate(self._proposals(entry))
            if proposal is not None
        )
        cases = self.track.cases
        return [
            EvaluationJob(cases[index], layout, self.engine)
            for index, layout in asked
            if self._loads(cases[index], layout) is None
        ]

    def _proposals(self, entry: LeagueEntry) -> Sequence[Proposal | None]:
        """Return the proposals of an entry, one per case; `None` for a missing search."""
        if not entry.budget:
            return self._instant[entry.name]
        return [self._found(case, entry) for case in self.track.cases]

    def _found(self, case: Case, entry: LeagueEntry) -> Proposal | None:
        return self.store.proposal(search_key(case, entry, self.engine), case.scenario)

    def _loads(self, case: Case, layout: Layout) -> tuple[float, ...] | None:
        return self.store.loads(evaluation_key(case, layout, self.engine), len(case.threats))

    def _results(self) -> Iterator[Result]:
        for entry in self.entries:
            proposals = tuple(each for each in self._proposals(entry) if each is not None)
            loads = [
                self._loads(case, proposal.layout)
                for case, proposal in zip(self.track.cases, proposals, strict=True)
            ]
            yield Result(entry, proposals, np.array(loads, dtype=np.float64))
