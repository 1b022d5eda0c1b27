"""The tasks of a worker: searches, answers, reports; blasts are in `blasts`.

Long work reports its progress through a `Teller`, and may be interrupted anywhere by
`KeyboardInterrupt`.
"""

from pathlib import Path
from time import monotonic, time
from typing import Final

from blast_env.app import placing
from blast_env.app.blasts import run_blasts, warm_engine
from blast_env.app.cost import ReportCost
from blast_env.app.records import write_kept
from blast_env.app.work import (
    ANSWER,
    Answer,
    AnswerTask,
    BlastTask,
    Question,
    ReportTask,
    SearchTask,
    Status,
    read_status,
    read_task,
    write_status,
)
from blast_env.design.search import DesignProblem, Need, Progress, ProposerKind, find_proposer
from blast_env.design.search.registry import proposer_row
from blast_env.evaluation import BlastEvaluator, LoadCaseSet
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.geometry import Layout
from blast_env.site.vehicles import source_of

_LEAST_PAUSE_S: Final = 0.1
_WRITING_S: Final = 300.0  # of a report with its pictures, on a busy computer


class Teller:
    """Writes the progress of work into its status, at most every 0.1 s.

    Args:
        folder: The folder of the work.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        changes = {"state": "running", "began_s": time()}
        self._status = read_status(folder).model_copy(update=changes)
        self._told_s = 0.0
        self.tell()

    def tell(self, **changes: object) -> None:
        """Write changes of the status at once; the keys are the fields of `Status`."""
        self._status = self._status.model_copy(update=changes)
        self._told_s = monotonic()
        write_status(self._status, self.folder)

    def share(self, share: float) -> None:
        """Write the completed share, 0 to 1, if an update is due."""
        if self.is_due:
            self.tell(share=min(max(share, 0.0), 1.0))

    @property
    def is_due(self) -> bool:
        """Whether the last update is long enough ago."""
        return monotonic() - self._told_s >= _LEAST_PAUSE_S

    @property
    def status(self) -> Status:
        """The status written last."""
        return self._status


def warm_up() -> None:
    """Import modules and load compiled code in advance, so that the first task is not slow."""
    warm_engine()


def run_task(folder: Path) -> None:
    """Run the task of a folder.

    Raises:
        BlastEnvError: If it cannot be done; the message is for the user.
        KeyboardInterrupt: If it was stopped before it had any result.
    """
    task, teller = read_task(folder), Teller(folder)
    if isinstance(task, BlastTask):
        run_blasts(task, teller.share)
        teller.tell(state="done", share=1.0, text="done")
    elif isinstance(task, SearchTask):
        _search(task, teller)
    elif isinstance(task, ReportTask):
        _report(task, teller)
    else:
        _answer(task, teller)


def _search(task: SearchTask, teller: Teller) -> None:
    row, scenario = proposer_row(task.method), task.site
    if row.kind is ProposerKind.RULE and Need.VEHICLE not in row.needs:
        # One against vehicles plans for all of the site.
        sources = tuple(source_of(each.charge) for each in task.threats)
        scenario = scenario.model_copy(update={"charge": sources})
    engine = GasEngine.with_cells(task.cells)
    evaluator = BlastEvaluator(scenario, engine.coarser or engine, cache=task.cache)
    problem = DesignProblem(evaluator, LoadCaseSet(scenario, task.threats))
    if task.budget:
        teller.tell(text="blasts without a barrier")
        problem.unprotected  # noqa: B018  # refuses a case in which nothing arrives

    def report(progress: Progress) -> None:
        if progress.best is None:
            teller.share(progress.share)
            return
        best = placing.plain(progress.best.layout)
        reduction = 100.0 * progress.best.reduction(problem)
        text = f"{progress.blasts} of {progress.budget} blasts, best reduction {reduction:.1f} %"
        if best != teller.status.layout:
            teller.tell(share=progress.share, text=text, layout=best)
        elif teller.is_due:
            teller.tell(share=progress.share, text=text)

    result = find_proposer(task.method).propose(problem, task.budget, 0, report)
    if result.load is None and result.interrupted:
        raise KeyboardInterrupt
    if result.load is None:
        words = result.expectation if result.layout else result.by
        text = f"{placing.counted(scenario, result.layout)}, proposed by {row.title}"
        text += words and f", {words}"
    else:
        reduction = 100.0 * result.history[-1].reduction(problem)
        text = (
            f"reduction {reduction:.1f} % on the blasts of the search, after {result.blasts} of"
            f" {result.budget} ({evaluator.engine.words}); blast the layout to confirm it"
        )
    state = "stopped" if result.interrupted else "done"
    teller.tell(state=state, share=1.0, text=text, layout=placing.plain(result.layout))


def _answer(task: AnswerTask, teller: Teller) -> None:
    # Here, because they take long to import, and a blast needs none of them.
    from blast_env.design.search.advised import AdviceJudge, advised, asked_site
    from blast_env.evaluation.assessment import assess
    from blast_env.evaluation.capacity import capacity

    scenario, engine = task.site, GasEngine.with_cells(task.cells)
    charges = [each.charge for each in task.threats]
    layouts: dict[str, Layout] = {"no barrier": ()}
    if task.layout:
        layouts[f"layout {task.name}"] = placing.layout_from(scenario, task.layout)
    changes: dict[str, object] = {}
    if task.question is Question.ASSESS:
        found = assess(scenario, layouts, charges, engine, teller.share, cache=Path(task.cache))
        parts = found.answer(task.level, task.mass_error)
    elif task.question is Question.CAPACITY:
        evaluator = BlastEvaluator(scenario, engine, cache=task.cache)
        parts = capacity(evaluator, layouts, charges, teller.share).answer()
    else:
        site = asked_site(scenario, task.level)
        coarse = BlastEvaluator(site, engine.coarser or engine, cache=task.cache)
        judge = AdviceJudge(
            DesignProblem(coarse, LoadCaseSet(site, task.threats)),
            BlastEvaluator(site, engine, cache=task.cache),
            task.mass_error,
        )
        advice = advised(judge, task.budget, progress=teller.share)
        parts = advice.answer()
        changes["layout"] = placing.plain(advice.best.layout) or None
    answer = Answer(question=task.question, subject=task.subject, parts=tuple(parts))
    write_kept(answer, teller.folder / ANSWER)
    first = next(each for each in answer.parts if isinstance(each, str))
    teller.tell(state="done", share=1.0, text=first, **changes)


def _report(task: ReportTask, teller: Teller) -> None:
    # Reports need an extra, and most work is no report.
    from blast_env.report import run_study, write_report

    scenario, page = task.site, Path(task.path)
    layout = placing.layout_from(scenario, task.layout)
    options = task.choice.options((each.charge for each in task.threats), Path(task.cache))
    cost = ReportCost.of(scenario, layout, options)
    teller.tell(grace_s=_WRITING_S)

    def tell(what: str, part: float) -> None:
        share = cost.share(what, part)
        if teller.is_due or share is None:
            teller.tell(text=what, share=teller.status.share if share is None else share)

    study = run_study(scenario, layout, options, tell)
    written = write_report(study, page, None if task.pdf is None else Path(task.pdf))
    words = f"wrote {' and '.join(path.name for path in written)}"
    if study.stopped:
        words = f"stopped before: {study.stopped}; {words} with the finished parts"
    state = "stopped" if study.stopped else "done"
    teller.tell(state=state, share=1.0, text=words, file=str(written[-1]))
