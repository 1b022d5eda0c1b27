"""What a league has to simulate, in pieces that any process can do."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import TypeVar

import joblib

from agents.league.entries import Instant, Search
from agents.league.tracks import TrackCase
from agents.proposal import Layout, Proposal, timed_proposal
from agents.search import LayoutProblem
from blast_env.evaluation import BlastEvaluator

Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class SearchJob:
    """Lets a search find its layout for a case.

    Attributes:
        case: The case.
        search: The search.
        engine: Name of the engine.
    """

    case: TrackCase
    search: Search
    engine: str

    @property
    def blasts(self) -> int:
        """Most blasts that it takes."""
        return self.search.budget

    def __call__(self) -> Proposal:
        """Return what the search proposes; it shares no blast with any other.

        Raises:
            KeyboardInterrupt: If the search was interrupted: what it has by then is not its
                answer.
        """
        # What the first blast of a process has to load is no part of the search's time.
        BlastEvaluator(self.case.scenario, self.engine).loads((), self.case.search_threats[0])
        began_s = perf_counter()
        problem = LayoutProblem(
            BlastEvaluator(self.case.scenario, self.engine), self.case.search_threats
        )
        result = self.search.method.search(problem, self.search.budget, self.case.seed)
        seconds = perf_counter() - began_s
        if result.interrupted:
            raise KeyboardInterrupt
        return Proposal(tuple(sorted(result.layout)), seconds, result.blasts)


@dataclass(frozen=True, eq=False)
class EvaluationJob:
    """Lets a layout meet the held-out threats of a case.

    Attributes:
        case: The case.
        layout: The layout.
        engine: Name of the engine.
    """

    case: TrackCase
    layout: Layout
    engine: str

    @property
    def blasts(self) -> int:
        """Blasts that it takes."""
        return len(self.case.held_out)

    def __call__(self) -> tuple[float, ...]:
        """Return the impulses on the protected structures, Pa*s, one a held-out threat."""
        evaluator = BlastEvaluator(self.case.scenario, self.engine)
        loads = evaluator.loads_of_many([(self.layout, threat) for threat in self.case.held_out])
        return tuple(load.protected_impulse_pa_s for load in loads)


def run_jobs(jobs: Sequence[Callable[[], Found]], processes: int) -> Iterator[tuple[int, Found]]:
    """Run jobs; each result comes with the job's index, as soon as it is there.

    Args:
        jobs: They can be pickled.
        processes: Worker processes.
    """
    if processes == 1 or len(jobs) < 2:
        yield from (_numbered(index, job) for index, job in enumerate(jobs))
        return
    calls = (joblib.delayed(_numbered)(index, job) for index, job in enumerate(jobs))
    workers = joblib.Parallel(min(processes, len(jobs)), return_as="generator_unordered")
    yield from workers(calls)


def propose_at_once(entry: Instant, cases: Sequence[TrackCase]) -> tuple[Proposal, ...]:
    """Return an entry's proposals, none of which takes a blast.

    The time of one more proposal before these is not counted: it loads what has to be loaded.
    """
    entry.propose(cases[0])
    proposals = [timed_proposal(partial(entry.propose, case)) for case in cases]
    return tuple(replace(each, layout=tuple(sorted(each.layout))) for each in proposals)


def _numbered(index: int, job: Callable[[], Found]) -> tuple[int, Found]:
    return index, job()
