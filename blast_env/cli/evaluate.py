"""`blast-env evaluate`: a layout, or the agent of a run, against no barrier."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from blast_env.cli.command import option
from blast_env.cli.evaluation_report import EvaluateOptions, report_layout
from blast_env.cli.options import running_on
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.grid_error import final_engine
from blast_env.io.export import LayoutPlan
from blast_env.layout import LayoutFile, load_layout
from blast_env.site import load_scenario
from blast_env.statistics import check_cvar_level

_SCENARIO: Final = "courtyard"


@dataclass(frozen=True, kw_only=True)
class EvaluateCommand(EvaluateOptions):
    """Compare layouts with no barrier, both exposed to the same threats.

    Each seed draws a charge from the scenario; for particles, also the fan and the air. With --run,
    an agent trained on visible charges proposes one layout per charge, any other agent one layout
    for all.

    Gas dynamics runs on cells of 0.25 m. The worst charge runs on cells twice as large as well: the
    difference gives the error of the cells beside each number.
    """

    layout: Path | None = option(None, "JSON file of the (row, column) cells.")
    run: Path | None = option(None, "Folder of a training run, whose agent proposes the layouts.")
    scenario: str | None = option(
        None, "Bundled name, or a scenario file, for --layout.", show_default=_SCENARIO
    )

    def __call__(self) -> None:
        """Run the blasts; print and write the results."""
        check_cvar_level(self.cvar_level)
        with running_on(self.cluster):
            if self.run is not None:
                self._evaluate_run(self.run)
            elif self.layout is not None:
                self._evaluate_file(self.layout)
            else:
                raise BlastEnvError("--layout or --run is missing: give the layouts to evaluate")

    def _evaluate_file(self, path: Path) -> None:
        scenario = load_scenario(self.scenario or _SCENARIO)
        layout = load_layout(path, scenario)
        plan = LayoutPlan(scenario, layout, provenance=LayoutFile.load(path).provenance)
        engine = final_engine(self.engine, [scenario], self.cell_m, self.until, self.cells)
        report_layout(plan, BlastEvaluator(scenario, engine, cache=self.cache), self)

    def _evaluate_run(self, run: Path) -> None:
        """Evaluate the agent of a run; refuse options that the run folder already fixes."""
        if self.layout is not None:
            raise BlastEnvError(
                "--layout and --run exclude each other: a run's agent proposes the layouts"
            )
        if self.scenario is not None:
            raise BlastEnvError("--scenario cannot be used with --run: the run folder contains it")
        # Here, because runs need the extras.
        with import_extra("agents,render", "--run"):
            from blast_env.cli.agent_runs import evaluate_run
        evaluate_run(run, self)
