"""`make demo`: train an agent for a few minutes by gas dynamics, and compare its layouts.

Trains an agent by self-labelling: it begins with the best layout by rule for each of some charges,
then learns from the best layouts it finds. Compares its layouts with no barrier, random layouts and
all rules, on charges that the training has not seen, and films one blast with and without its
layout.
"""

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from math import isnan
from pathlib import Path
from time import perf_counter
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from blast_agents.training import TrainingSettings, load_agent, load_hyperparameters, train
from blast_agents.training.environments import environment_id
from blast_agents.training.hyperparameters import SELF_LABELLING
from blast_agents.training.run_folder import EvaluationRow, RunFolder, read_rows
from blast_agents.training.train import TrainingResult

from blast_env.benchmark import Method, make, site_problems
from blast_env.benchmark.methods import find_method, method_of
from blast_env.cli.evaluation_report import interval
from blast_env.cli.output import (
    ResultTable,
    percent,
    print_line,
    progress_bar,
    result_console,
    user_errors,
)
from blast_env.design.rules import random_layout
from blast_env.design.search import ProposerKind, proposers
from blast_env.design.surrogate import LearntSearch
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Comparison, Evaluators, compare
from blast_env.evaluation.engines import JUDGE
from blast_env.evaluation.engines.gas import GasBlast
from blast_env.io.export import LayoutPlan, export_layouts
from blast_env.plots.figures import save_figure
from blast_env.plots.gas import facades
from blast_env.plots.pressure_film import write_pressure_film
from blast_env.plots.site_picture import site_picture
from blast_env.values import generator

HEADERS: Final = (
    "layouts",
    "Pa s",
    "reduction",
    "95 % interval",
    "agent ahead by",
    "95 % interval",
)
"""Columns of the printed table."""


NOTHING: Final = "no barrier"
RANDOM: Final = "random layout"
AGENT: Final = "trained agent"


@dataclass(frozen=True, eq=False)
class AgentComparison:
    """The trained agent against the other methods, on the same charges.

    Attributes:
        results: Comparison of each method's layouts with no barrier, by name.
        rules: Names of the rules among them.
        engine: Name of the judging engine, with its cells.
    """

    results: Mapping[str, Comparison]
    rules: tuple[str, ...]
    engine: str

    @property
    def agent(self) -> Comparison:
        """The layouts of the trained agent."""
        return self.results[AGENT]

    @property
    def best_rule(self) -> str:
        """Name of the rule with the largest mean reduction."""
        return max(self.rules, key=lambda name: self.results[name].reduction.value)

    @property
    def best_rule_each(self) -> Comparison:
        """The best rule for each charge, which only blasts with all rules can determine."""
        rules = [self.results[name] for name in self.rules]
        chosen = np.argmin([rule.loads.mean(axis=1) for rule in rules], axis=0).tolist()
        return replace(
            rules[0],
            layouts=tuple(rules[each].layouts[case] for case, each in enumerate(chosen)),
            loads=np.array([rules[each].loads[case] for case, each in enumerate(chosen)]),
        )

    @property
    def has_learnt(self) -> bool:
        """Whether the agent beats random layouts by more than both confidence intervals."""
        return bool(self.agent.reduction.low > self.results[RANDOM].reduction.high)

    @property
    def verdict(self) -> str:
        """Whether the agent has learnt anything, and its lead over the best rule, in words."""
        gain = self.agent.difference(self.results[RANDOM])
        if isnan(gain.low):
            return "No verdict: one threat gives no interval."
        value, low, high = gain.scaled(100.0)
        outcome = (
            "The agent has learnt: its layouts beat random ones by more than the 95 % intervals, "
            "which do not overlap"
            if self.has_learnt
            else "Not shown that the agent has learnt: its 95 % interval reaches that of random "
            "layouts"
        )
        ahead = self.agent.difference(self.results[self.best_rule]).scaled(100.0)
        return (
            f"{outcome}. It takes off {value:.1f} percentage points more than random layouts do "
            f"(95 % interval of the paired difference {low:.1f} to {high:.1f}), and "
            f"{ahead.value:+.1f} points beside the best rule, {self.best_rule!r} "
            f"({ahead.low:+.1f} to {ahead.high:+.1f})."
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Return the printed table, one row per method; see `HEADERS`."""
        others = {name: each for name, each in self.results.items() if name != AGENT}
        others |= {"best rule for each case": self.best_rule_each, AGENT: self.agent}
        return [self._row(name, each) for name, each in others.items()]

    def _row(self, name: str, result: Comparison) -> tuple[str, ...]:
        ahead = self.agent.difference(result)
        return (
            name,
            f"{result.loads.mean():,.0f}",
            percent(result.reduction.value),
            interval(result.reduction),
            *(("-", "-") if name == AGENT else (percent(ahead.value), interval(ahead))),
        )


_CHANGES: Final[Mapping[str, Any]] = MappingProxyType(
    {
        "cases": 16,
        "cases_per_round": 8,
        "samples": 3,
        "neighbours": 5,
        "first_updates": 300,
        "updates": 100,
    }
)
"""Hyperparameters for charges on one line and a few minutes of training."""


@dataclass(frozen=True)
class DemoSettings:
    """Settings of the demonstration.

    Attributes:
        out: Folder for all output.
        scenario: Scenario file, or a bundled name.
        steps: Steps of training: layouts simulated against a charge.
        seed: Seed of the training.
        changes: Hyperparameters that replace those of the package.
        evaluation_interval: Rounds between points of the learning curve.
        evaluation_cases: Held-out threats of each point.
        threats: Unseen threats of the comparison.
        processes: Worker processes of training and comparison.
        film_width_px: Width of the film.
        frames_per_s: Frames per second of the film.
    """

    out: Path = Path("out/demo")
    scenario: str = str(Path(__file__).with_name("demo_site.toml"))
    steps: int = 240
    seed: int = 0
    changes: Mapping[str, Any] = field(default_factory=lambda: dict(_CHANGES))
    evaluation_interval: int = 1
    evaluation_cases: int = 8
    threats: int = 8
    processes: int = 2
    film_width_px: int = 1600
    frames_per_s: float = 25.0

    @property
    def run(self) -> Path:
        """The run folder."""
        return self.out / "run"


def main() -> None:
    """Run the demonstration."""
    with user_errors():
        demonstrate(DemoSettings())


def demonstrate(settings: DemoSettings) -> AgentComparison:
    """Train, compare, film; print a table and the paths.

    Returns:
        The comparison behind the verdict.

    Raises:
        BlastEnvError: If a setting is invalid, or a file cannot be written.
    """
    began = perf_counter()
    trained = train_agent(settings)
    comparison = compare_methods(settings, trained)
    print_comparison(comparison)
    written = [trained.folder.learning_curve]
    written += write_pictures(settings, comparison)
    print_line(f"\n{comparison.verdict}\n", style="bold")
    for path in written:
        print_line(f"wrote {path}")
    print_line(f"the run folder is {settings.run}; try: blast-env evaluate --run {settings.run}")
    print_line(f"{perf_counter() - began:.0f} s in all")
    return comparison


def train_agent(settings: DemoSettings) -> TrainingResult:
    """Train an agent in a fresh run folder, and print the learning curve as it grows."""
    hyperparameters = load_hyperparameters(
        SELF_LABELLING, environment_id(settings.scenario), settings.changes, settings.processes
    )
    training = TrainingSettings(
        algorithm=SELF_LABELLING,
        scenario=settings.scenario,
        steps=settings.steps,
        seed=settings.seed,
        engine=JUDGE,
        evaluation_interval=settings.evaluation_interval,
        evaluation_cases=settings.evaluation_cases,
    )
    clear(settings.run)
    print_line("training by gas dynamics, beginning with the best layouts by rule")
    with _learning_curve(RunFolder(settings.run)) as progress:
        result = train(training, hyperparameters, settings.run, progress)
    counters = result.progress.counters
    print_line(
        f"{counters.episodes:,} layouts tried with {counters.blasts:,} blasts of the engine "
        f"{JUDGE} in {counters.seconds:.0f} s\n"
    )
    return result


@contextmanager
def _learning_curve(folder: RunFolder) -> Iterator[Callable[[float], None]]:
    """Show a progress bar, and print each evaluation as soon as it is available."""
    printed = 0

    def print_new() -> None:
        nonlocal printed
        rows = _evaluations(folder)
        for row in rows[printed:]:
            print_line(
                f"  after {row.episodes:>5,} layouts, {row.seconds:>4.0f} s: reduction "
                f"{percent(row.reduction):>6} (95 % interval {percent(row.low)} to "
                f"{percent(row.high)})"
            )
        printed = len(rows)

    with progress_bar("training") as show:

        def progress(share: float) -> None:
            show(share)
            print_new()

        yield progress
    print_new()


def _evaluations(folder: RunFolder) -> list[EvaluationRow]:
    if not folder.evaluations.exists():
        return []
    return read_rows(folder.evaluations, EvaluationRow)


def clear(run: Path) -> None:
    """Remove the run of an earlier demonstration; leave any other folder alone."""
    if (run / "config.json").exists():
        try:
            shutil.rmtree(run)
        except OSError as error:
            raise BlastEnvError(f"{run}: cannot be removed: {error.strerror or error}") from error


def compare_methods(settings: DemoSettings, trained: TrainingResult) -> AgentComparison:
    """Compare the best weights of the training with the other methods on unseen threats."""
    engine = trained.configuration.settings.engine
    problems = [
        make(each, 0, engine=engine) for each in site_problems(settings.scenario, settings.threats)
    ]
    scenario = problems[0].scenario
    rules = {
        row.title: find_method(name)
        for name, row in proposers(ProposerKind.RULE, suiting=[scenario]).items()
    }
    methods: dict[str, Method] = {
        NOTHING: lambda *_: (),
        RANDOM: lambda problem, seed: random_layout(problem.scenario, generator(seed)),
        **rules,
        AGENT: method_of(LearntSearch(agent=load_agent(settings.run))),
    }
    layouts = {
        name: [method(each, seed) for seed, each in enumerate(problems)]
        for name, method in methods.items()
    }
    evaluators, cases = Evaluators(engine), [each.definition.case for each in problems]
    with progress_bar(f"{len(cases)} unseen threats") as progress:
        results = {}
        for name, own in layouts.items():
            results[name] = compare(evaluators, cases, own, settings.processes)
            progress(len(results) / len(layouts))
    return AgentComparison(results, tuple(rules), evaluators.engine.words)


def print_comparison(comparison: AgentComparison) -> None:
    """Print one row per method: mean impulse, reduction, time to propose a layout."""
    cases = comparison.agent.cases
    table = ResultTable(
        f"{cases[0].scenario.name}: {len(cases)} threats that the training has not met, the same "
        f"for all; judged by the engine {comparison.engine}\n(Pa s: mean impulse on the "
        "protected structures; ahead: in percentage points, paired)",
        HEADERS,
    )
    for row in comparison.rows():
        table.add_row(*row)
    result_console().print(table)


def write_pictures(settings: DemoSettings, comparison: AgentComparison) -> list[Path]:
    """Film a blast without barrier and with the agent's layout; write the layout and the loads.

    Args:
        settings: The settings.
        comparison: The comparison; its first threat is filmed.

    Returns:
        The files.
    """
    case, layout = comparison.agent.cases[0], comparison.agent.layouts[0]
    scenario, threat, out = case.scenario, case.threats[0], settings.out
    blasts = [GasBlast(scenario, each, threat.seed, charge=threat.charge) for each in ((), layout)]
    film = out / "side_by_side.mp4"
    with progress_bar("film") as progress:
        bare, protected = write_pressure_film(
            blasts[1],
            film,
            beside=blasts[0],
            frames_per_s=settings.frames_per_s,
            width_px=settings.film_width_px,
            progress=progress,
        )
    charge = threat.charge_against(scenario, layout)
    plan = LayoutPlan(scenario, layout, charge, {"run": str(settings.run)})
    return [
        film,
        save_figure(facades(protected, beside=bare), out / "facade.png"),
        save_figure(site_picture(scenario, layout), out / "site.png"),
        protected.to_excel(out / "loads.xlsx"),
        *export_layouts({"layout": plan}, out),
    ]


if __name__ == "__main__":
    main()
