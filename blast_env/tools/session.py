"""A session of the tools: one problem, a budget of blasts, and one score at its end."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as WaitedTooLong
from functools import cached_property, partial
from pathlib import Path
from threading import RLock
from time import monotonic
from typing import Any, Final

from blast_env.benchmark import (
    JUDGE_CELL_M,
    Definition,
    Run,
    RunJudgement,
    ScoreReference,
    Submission,
    judge,
    make,
)
from blast_env.benchmark.methods import reference_of
from blast_env.benchmark.references import cell_key
from blast_env.design.search import find_proposer
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, BlastStore, BudgetError
from blast_env.evaluation.engines import JUDGE, Engine
from blast_env.evaluation.validation import worst_validation
from blast_env.geometry import Element, Layout
from blast_env.layout import check_layout
from blast_env.layout.placement import load_relevant
from blast_env.rules import random_layout
from blast_env.sections import digest_of
from blast_env.surrogate import Surrogate, SurrogateSite, packaged_surrogate, site_of
from blast_env.tables import number_or_none
from blast_env.tools.guesses import guessed_shares
from blast_env.tools.records import (
    BUDGET,
    BuildingLoad,
    Legality,
    Look,
    Outcome,
    PlacedPiece,
    Proposals,
    Score,
    ShareByBlast,
    ShareByGuess,
)
from blast_env.tools.sight import element_in, legality_of, look_at, proposals_for
from blast_env.values import MOST_SEED, generator, whole_number

WAIT_S: Final = 25.0
"""Longest time for which a tool keeps a client waiting, s: some clients give up after 30."""

_SAME: Final = 1e-9
"""Tolerance within which shares are equal."""

_DIGITS: Final = 16
_PREPARED: Final = "guess"
_FREE_CELL_M: Final = 0.5
"""Side of the cells on which the rules are compared where no reference is stored, m."""


class Session:
    """An agent's work on one problem: looks, guesses, blasts, and one submission.

    Every tool is a method whose result is a record. A blast is charged when it has succeeded, once
    for each layout. The score is 0 with nothing placed and 1 for the best known layout; the judge
    blasts the submitted layout anew, on finer cells. It is given once; then the session has ended,
    and all tools refuse. Layouts may be those of the rest of the package, too.

    Sessions share nothing. A session may be used from several threads; its blasts run one after the
    other, in a thread of its own.

    Args:
        problem: Name of a problem of the benchmark, or its definition.
        seed: Seed of the random layout among the proposals.
        budget: Most blasts.
        engine: Another engine than gas dynamics, for blasts and judge.
        judge_cell_m: Side of the judge's cells, m; `None` for those of the engine.
        reference: The best known layout; the stored one or, without one, the best of the rules and
            the package's proposal unless given.
        cache: Folder or store in which blasts are kept for other sessions.
        wait_s: Longest time for which a tool waits before it gives a ticket, s; `None` for as long
            as it takes.

    Raises:
        UnknownNameError: If there is no such problem.
        BlastEnvError: If the seed or the budget is out of bounds, or as `benchmark.make`.
    """

    def __init__(
        self,
        problem: str | Definition,
        seed: int = 0,
        budget: int = BUDGET,
        *,
        engine: str | Engine = JUDGE,
        judge_cell_m: float | None = JUDGE_CELL_M,
        reference: ScoreReference | None = None,
        cache: str | Path | BlastStore | None = None,
        wait_s: float | None = WAIT_S,
    ) -> None:
        self.seed = whole_number("seed", seed, 0, MOST_SEED)
        self._problem = make(problem, budget, engine=engine, cache=cache)
        self._engine, self._cache = engine, cache
        self._judge_cell_m, self._wait_s = judge_cell_m, wait_s
        self._reference = self._problem.reference if reference is None else reference
        self._lock, self._began_s = RLock(), monotonic()
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="blast-env-tools")
        self._jobs: dict[str, Future[Any]] = {}
        self._costs: dict[str, int] = {}
        self._paid: set[Layout] = set()
        self._submitted = ""
        self._score: float | None = None

    @property
    def problem_name(self) -> str:
        """Name of the problem."""
        return self._problem.name

    @property
    def score(self) -> float | None:
        """The score; `None` before it was given."""
        return self._score

    def close(self) -> None:
        """End the session; what runs is not waited for."""
        self._worker.shutdown(wait=False, cancel_futures=True)

    def look(self, picture: bool = False) -> Look:
        """Return the site in words and numbers, and the task.

        Args:
            picture: Whether to add a picture of the plan.

        Raises:
            BlastEnvError: If the session has ended, or a picture needs an extra.
        """
        self._check_open()
        by = "the best of the rules and of the package's proposal"
        return look_at(
            self._problem,
            picture,
            seed=self.seed,
            score_0="nothing placed",
            score_1="the best known layout, found by "
            + (by if self._reference is None else self._reference.best.method),
            **self._common("the site as it is blasted; nothing here is a load"),
        )

    def rules(self) -> Proposals:
        """Return what each rule of thumb proposes and costs, and a random layout.

        Raises:
            BlastEnvError: If the session has ended.
        """
        self._check_open()
        words = "legal layouts, none of which was blasted"
        return Proposals(proposals=proposals_for(self._problem, self.seed), **self._common(words))

    def check(self, layout: Sequence[PlacedPiece | Element]) -> Legality:
        """Return whether a layout is legal, or why not.

        Raises:
            BlastEnvError: If the session has ended, or a piece has another form.
        """
        self._check_open()
        found = legality_of(self._problem, layout)
        return Legality(**found, **self._common("exact"))

    def guess(self, layout: Sequence[PlacedPiece | Element]) -> ShareByGuess:
        """Return a prediction of the share of the load that a layout leaves.

        It is free, and no score depends on it.

        Raises:
            BlastEnvError: If the session has ended, the layout is illegal, or the load without a
                barrier is not known yet. Then it is free to ask again.
        """
        self._check_open()
        checked = self._checked(layout)
        if not self._is_done(self._begun(_PREPARED, self._prepared)):
            raise BlastEnvError(
                "the load without a barrier is still being blasted, and the surrogate compiled, "
                "which is free: call `guess` again in some seconds"
            )
        share, low, high = guessed_shares(self._problem, *self._surrogate, checked)
        return ShareByGuess(share=share, low=low, high=high, **self._common(self._guess_words))

    def blast(self, layout: Sequence[PlacedPiece | Element]) -> Outcome:
        """Return the share of the load that a layout leaves, by a blast.

        A layout that was blasted before is free, and its result is the same.

        Raises:
            BlastEnvError: If the session has ended, the layout is illegal, the budget is used up,
                or the blast fails; nothing is charged then.
        """
        self._check_open()
        checked = self._checked(layout)
        ticket = f"blast-{_digest(checked)}"
        with self._lock:
            if ticket not in self._jobs:
                self._charge(ticket, checked)
            self._begun(ticket, partial(self._blasted, ticket, checked))
        return self._outcome(ticket)

    def poll(self, ticket: str) -> Outcome:
        """Return what a ticket stands for, once it is done.

        Raises:
            BlastEnvError: If the session has ended, there is no such ticket, or the work failed.
        """
        if self._score is not None or ticket != self._submitted:
            self._check_open()
        if ticket not in self._jobs or ticket == _PREPARED:
            raise BlastEnvError(
                f"there is no ticket {ticket!r}: `blast` and `submit` give them, and work that "
                "failed has none; call `blast` or `submit` again"
            )
        return self._outcome(ticket)

    def submit(self, layout: Sequence[PlacedPiece | Element]) -> Outcome:
        """Submit a layout, which ends the session, and return its score.

        Raises:
            BlastEnvError: If the session has ended or another layout was submitted, the layout is
                illegal, or the judge fails; the session goes on then.
        """
        with self._lock:
            if not self._submitted:
                self._check_open()
            checked = self._checked(layout)
            ticket = f"submit-{_digest(checked)}"
            if ticket != self._submitted or self._score is not None:
                self._check_open()
            for name in [name for name, job in self._jobs.items() if job.cancel()]:
                self._forget(name)
            self._submitted = ticket
            self._begun(ticket, partial(self._judged, checked))
        return self._outcome(ticket)

    def _check_open(self) -> None:
        if self._score is not None:
            raise BlastEnvError(
                f"this session has ended with the score {self._score:.4f}, which counts once: "
                "begin another session"
            )
        if self._submitted:
            raise BlastEnvError(
                "a layout was submitted and is being judged: call `poll` with the ticket "
                f"{self._submitted!r}"
            )

    def _checked(self, layout: Sequence[PlacedPiece | Element]) -> Layout:
        """Return a legal layout, sorted."""
        try:
            elements = [element_in(self._problem, piece) for piece in layout]
            return tuple(sorted(check_layout(self._problem.scenario, elements)))
        except BlastEnvError as error:
            raise BlastEnvError(
                f"the layout is illegal, and nothing was charged: {error}; `check` has all reasons"
            ) from error

    def _charge(self, ticket: str, layout: Layout) -> None:
        """Reserve the blasts of a layout.

        Raises:
            BlastEnvError: If too few are left.
        """
        relevant = tuple(load_relevant(layout))
        cost = len(self._problem.threats) if relevant and relevant not in self._paid else 0
        reserved = sum(self._costs.values())
        if cost > self._problem.blasts_left - reserved:
            running = f", {reserved} of them for blasts that are running" if reserved else ""
            raise BlastEnvError(
                f"this blast costs {cost} of the budget, of which {self._problem.blasts_left} are "
                f"left{running}: `guess` is free, and `submit` needs none"
            )
        self._costs[ticket] = cost

    def _begun(self, ticket: str, work: Callable[[], Any]) -> str:
        with self._lock:
            if ticket not in self._jobs:
                self._jobs[ticket] = self._worker.submit(work)
        return ticket

    def _is_done(self, ticket: str) -> bool:
        """Wait for work, and return whether it is done.

        Raises:
            BlastEnvError: If it failed; it can be asked for again.
        """
        job = self._jobs[ticket]
        try:
            job.result(self._wait_s)
        except WaitedTooLong:
            return False
        except Exception as error:
            with self._lock:
                if self._jobs.get(ticket) is job:
                    self._forget(ticket)
            raise BlastEnvError(
                f"{ticket.partition('-')[0]} failed, and nothing was charged: {error}; try again, "
                "or with another layout"
            ) from error
        return True

    def _forget(self, ticket: str) -> None:
        self._jobs.pop(ticket, None)
        self._costs.pop(ticket, None)
        if ticket == self._submitted:
            self._submitted = ""

    def _outcome(self, ticket: str) -> Outcome:
        if not self._is_done(ticket):
            words = "no number yet"
            return Outcome(ticket=ticket, running=True, **self._common(words))
        if ticket != self._submitted:
            found: tuple[ShareByBlast, str] = self._jobs[ticket].result()
            return Outcome(ticket=ticket, running=False, blast=found[0], **self._common(found[1]))
        with self._lock:
            if self._score is not None:  # another call was given it
                self._check_open()
            score: Score = self._jobs[ticket].result()
            self._score = score.score
        cells = "" if self._judge_cell_m is None else f" on cells of {self._judge_cell_m:g} m"
        words = f"blasted anew by the judge{cells}"
        return Outcome(ticket=ticket, running=False, score=score, **self._common(words))

    def _prepared(self) -> None:
        """Blast without a barrier, and guess once, which may compile the surrogate."""
        drawn = random_layout(self._problem.scenario, generator(self.seed))
        guessed_shares(self._problem, *self._surrogate, drawn)

    def _blasted(self, ticket: str, layout: Layout) -> tuple[ShareByBlast, str]:
        """Return the result of a blast, which is charged once it has succeeded."""
        problem = self._problem
        pairs = [(layout, threat) for threat in problem.threats]
        assert problem.unprotected
        loads = problem.evaluator.loads_of_many(pairs)
        before = problem.blasts
        try:
            share = problem.evaluate(layout)
        except BudgetError as error:
            raise BlastEnvError(f"{error}: blast a layout that stops more") from error
        with self._lock:
            self._costs.pop(ticket, None)
            self._paid.add(tuple(load_relevant(layout)))
        rows = tuple(
            BuildingLoad(
                threat=number,
                building=load.name,
                impulse_pa_s=number_or_none(load.impulse_pa_s),
                peak_pa=None if load.peak_pa is None else number_or_none(load.peak_pa),
                validity=load.validation.words,
            )
            for number, of_threat in enumerate(loads)
            for load in of_threat.protected
        )
        worst = worst_validation(load.validation for own in loads for load in own.protected)
        words = f"{problem.evaluator.engine.describe([problem.scenario])}: {worst.words}"
        return ShareByBlast(share=share, charged=problem.blasts - before, loads=rows), words

    def _judged(self, layout: Layout) -> Score:
        """Return the score of a layout, by the judge of the benchmark."""
        definition, problem = self._problem.definition, self._problem
        run = Run(problem.name, problem.most_blasts, 0, problem.blasts, layout)
        found = judge(
            Submission("session", (run,)),
            self._judge_cell_m,
            cache=self._cache,
            engine=self._engine,
            definitions={problem.name: definition},
            references={problem.name: self._known_reference},
        )
        return score_of(found.runs[0])

    @cached_property
    def _known_reference(self) -> ScoreReference:
        """The stored reference, or one of the rules and the package's proposal."""
        if self._reference is not None:
            return self._reference
        definition = self._problem.definition
        proposed = find_proposer("package").propose(self._problem, 0)
        evaluator = BlastEvaluator(definition.scenario, self._engine, cache=self._cache)
        more = {"the package's proposal": tuple(sorted(proposed.layout))}
        return reference_of(definition, evaluator, more, cell_key(_FREE_CELL_M))

    @cached_property
    def _surrogate(self) -> tuple[Surrogate, SurrogateSite]:
        return packaged_surrogate(), site_of(self._problem.scenario)

    @property
    def _guess_words(self) -> str:
        fit = self._surrogate[0].fit
        _, _, version = fit.engine.split(" (")[0].split(maxsplit=2)  # after the class and the name
        words = (
            f"a prediction from {fit.blasts:,} loads by {version}, with "
            "the 95 % interval of loads on new sites; never scored"
        )
        if self._problem.scenario.objective.is_response:
            words += "; the interval is of loads, not of the response to them"
        return words

    def _common(self, validity: str) -> dict[str, Any]:
        """Return what all results have in common."""
        return {
            "blasts_left": self._problem.blasts_left,
            "seconds": round(monotonic() - self._began_s, 3),
            "validity": validity,
        }


def score_of(run: RunJudgement) -> Score:
    """Return the score of a judged layout: 0 with nothing placed, 1 for the best known layout.

    Where that takes nothing off, 1 is for all that does.
    """
    most, taken_off = 1.0 - run.best, 1.0 - run.share
    score = float(taken_off > _SAME) if most < _SAME else min(max(taken_off / most, 0.0), 1.0)
    return Score(score=score, share=run.share, best_share=run.best)


def _digest(layout: Layout) -> str:
    return digest_of({"layout": [list(element) for element in layout]})[:_DIGITS]
