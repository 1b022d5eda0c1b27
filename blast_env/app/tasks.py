"""The tasks of the page: searches, answers, reports; blasts are in `blasts`.

Each is called in a process, see `jobs`, and reports its progress through a `StatusWriter`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from blast_env.answers.document import AnyPart, Document, Number
from blast_env.app import placing
from blast_env.app.kept import write_kept
from blast_env.app.work import ANSWER, Answer, Question, StatusWriter, TaskWithBlasts
from blast_env.design.search import DesignProblem, Need, Progress, ProposerKind, find_proposer
from blast_env.design.search.registry import proposer_row
from blast_env.evaluation import BlastEvaluator, LoadCaseSet
from blast_env.evaluation.blasts import NO_BARRIER
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.geometry import Layout
from blast_env.response.levels import LevelOfProtection
from blast_env.site import Scenario
from blast_env.site.sources import source_of

if TYPE_CHECKING:
    from blast_env.evaluation.study import StudyOptions

_WRITING_S: Final = 300.0  # of a report with its pictures, on a busy computer


@dataclass(frozen=True, kw_only=True)
class SearchTask(TaskWithBlasts):
    """A search for a layout, or a proposal without a blast.

    Attributes:
        budget: Most blasts; 0 for a proposer that runs none.
    """

    method: str
    budget: int

    @property
    def problem(self) -> DesignProblem:
        """The problem of the proposer."""
        row, site = proposer_row(self.method), self.site
        if row.kind is ProposerKind.RULE and Need.VEHICLE not in row.needs:
            # One against vehicles plans for all of the site.
            sources = tuple(source_of(threat.charge) for threat in self.threats)
            site = site.model_copy(update={"charge": sources})
        engine = GasEngine.with_cells(self.cells)
        evaluator = BlastEvaluator(site, engine.coarser or engine, cache=self.cache)
        return DesignProblem(evaluator, LoadCaseSet(site, self.threats))

    def __call__(self, writer: StatusWriter) -> None:
        """Search; an interrupted search ends with its best layout so far.

        Raises:
            BlastEnvError: If it cannot be done; the message is for the user.
            KeyboardInterrupt: If it was stopped before it had any layout.
        """
        problem = self.problem
        if self.budget:
            writer.write(text="blasts without a barrier")
            problem.unprotected  # noqa: B018  # refuses a case in which nothing arrives

        def report(progress: Progress) -> None:
            if progress.best is None:
                writer.share(progress.share)
                return
            best = placing.plain(progress.best.layout)
            gone = Number.share(progress.best.reduction(problem)).text()
            text = f"{progress.blasts} of {progress.budget} blasts, best reduction {gone}"
            if best != writer.status.layout:
                writer.write(share=progress.share, text=text, layout=best)
            elif writer.is_due:
                writer.write(share=progress.share, text=text)

        result = find_proposer(self.method).propose(problem, self.budget, 0, report)
        if result.load is None and result.interrupted:
            raise KeyboardInterrupt
        if result.load is None:
            words = (result.expectation or result.by) if result.layout else result.by
            text = f"{placing.counted(self.site, result.layout)}, proposed by "
            text += f"{proposer_row(self.method).title}{words and f', {words}'}"
        else:
            gone = Number.share(result.history[-1].reduction(problem)).text()
            text = (
                f"reduction {gone} on the blasts of the search, after {result.blasts} of"
                f" {result.budget} ({problem.evaluator.engine.words}); blast the layout to confirm"
                " it"
            )
        state = "stopped" if result.interrupted else "done"
        writer.write(state=state, share=1.0, text=text, layout=placing.plain(result.layout))


@dataclass(frozen=True, kw_only=True)
class AnswerTask(TaskWithBlasts):
    """A question on a layout.

    Attributes:
        subject: Digest of the site, the layout and the threats.
        target: Required level of protection.
        mass_error: Uncertainty of the masses; see `Uncertainty`.
        budget: Most blasts of a search of advice.
    """

    layout: Layout
    name: str
    question: Question
    subject: str
    target: LevelOfProtection
    mass_error: float
    budget: int

    def __call__(self, writer: StatusWriter) -> None:
        """Answer the question, and keep the answer in a file."""
        changes: dict[str, object] = {}
        if self.question is Question.ADVISE:
            layout, parts = self._advice(writer)
            changes["layout"] = placing.plain(layout) or None
        else:
            parts = [*self._judgement(writer)]
        document = Document.of(parts)
        answer = Answer(question=self.question, subject=self.subject, document=document)
        write_kept(answer, writer.folder / ANSWER)
        writer.write(state="done", share=1.0, text=document.first, **changes)

    def _judgement(self, writer: StatusWriter) -> Iterator[AnyPart]:
        # Here, as below, because they take long to import, and a blast needs none of them.
        from blast_env.answers.assess import assessment, capacity_answer, governing
        from blast_env.evaluation.questions.capacity import capacity
        from blast_env.evaluation.questions.verdict import consequences_by_layout

        engine = GasEngine.with_cells(self.cells)
        layouts: dict[str, Layout] = {NO_BARRIER: ()}
        if self.layout:
            layouts[f"layout {self.name}"] = self.layout
        if self.question is Question.ASSESS:
            campaign = Campaign.on(
                self.site, layouts, self.threats, engine, engine.coarser, self.cache
            )
            blasts = campaign.run(writer.share, worst=governing)
            found = consequences_by_layout(blasts)
            return assessment(blasts, found, self.target, self.mass_error)
        evaluator, charges = (
            BlastEvaluator(self.site, engine, cache=self.cache),
            [threat.charge for threat in self.threats],
        )
        return capacity_answer(self.site, capacity(evaluator, layouts, charges, writer.share))

    def _advice(self, writer: StatusWriter) -> tuple[Layout, list[AnyPart]]:
        from blast_env.answers.advise import advice_answer
        from blast_env.design.search.advised import AdviceJudge, advised, site_with_target

        engine, site = GasEngine.with_cells(self.cells), site_with_target(self.site, self.target)
        coarse = BlastEvaluator(site, engine.coarser or engine, cache=self.cache)
        judge = AdviceJudge(
            DesignProblem(coarse, LoadCaseSet(site, self.threats)),
            BlastEvaluator(site, engine, cache=self.cache),
            self.mass_error,
        )
        advice = advised(judge, self.budget, progress=writer.share)
        return advice.best.layout, [*advice_answer(advice)]


@dataclass(frozen=True)
class ReportTask:
    """A report on one layout.

    Attributes:
        options: Its threats and contents.
        page: The page to write, .html.
        pdf: The same as PDF; `None` for none.
    """

    site: Scenario
    layout: Layout
    options: "StudyOptions"
    page: Path
    pdf: Path | None = None

    def __call__(self, writer: StatusWriter) -> None:
        """Write the report; a stopped one has the finished parts.

        Raises:
            BlastEnvError: If it cannot be written; the message is for the user.
            KeyboardInterrupt: If it was stopped before it had any part.
        """
        # Reports need an extra, and most work is no report.
        from blast_env.answers import report as reports

        cost = reports.StudyPlan(self.site, self.layout, self.options).cost()
        writer.write(grace_s=_WRITING_S)

        def tell(what: str, part: float) -> None:
            share = cost.share(what, part)
            if writer.is_due or share is None:
                writer.write(text=what, share=writer.status.share if share is None else share)

        found = reports.run_report(self.site, self.layout, self.options, tell)
        written = reports.write_report(found, self.page, self.pdf)
        words = f"wrote {' and '.join(path.name for path in written)}"
        if stopped := found.study.stopped:
            words = f"stopped before: {stopped}; {words} with the finished parts"
        state = "stopped" if stopped else "done"
        writer.write(state=state, share=1.0, text=words, file=str(written[-1]))
