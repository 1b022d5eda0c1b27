"""`make demo`: MaskablePPO learns a layout in minutes, and is compared with every rule and filmed.

The MaskablePPO of sb3-contrib trains on the surrogate's guesses of a bundled site on which rules
are not enough. After each round a few blasts by gas dynamics correct the guesses. The best layout
of the policy by these blasts is judged by gas dynamics under charges that it has not met.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import exp, isnan, log
from pathlib import Path
from time import perf_counter
from typing import Annotated, Final

import numpy as np
import torch
import typer
from blast_agents import packaged_agent
from matplotlib.figure import Figure
from sb3_contrib import MaskablePPO

from blast_env.answers.document import interval, percent
from blast_env.answers.terminal import print_line, print_table
from blast_env.cli.output import progress_bar, user_errors
from blast_env.design.search import layouts_by_rule
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.strategies import Transition
from blast_env.evaluation import (
    Assessment,
    Evaluation,
    Evaluators,
    LoadCaseSet,
    SeedRange,
    compare,
    draw_threats,
)
from blast_env.evaluation.cases import one_per_charge
from blast_env.evaluation.engines import JUDGE
from blast_env.evaluation.engines.gas import GasBlast
from blast_env.files import make_folder
from blast_env.geometry import Layout
from blast_env.io.export import LayoutPlan, export_to
from blast_env.layout import LayoutState
from blast_env.plots.figures import save_figure
from blast_env.plots.film import write_film
from blast_env.plots.gas import facades
from blast_env.plots.site_picture import site_picture
from blast_env.rules import random_layout
from blast_env.site import Scenario, load_scenario
from blast_env.surrogate import SurrogateEngine, SurrogateSite, site_of
from blast_env.surrogate.correction import Correction
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
AGENT: Final = "MaskablePPO"
PACKAGED: Final = "packaged agent"
"""The agent that comes with the package, which was not trained on the site."""


@dataclass(frozen=True)
class DemoSettings:
    """Settings of the demonstration.

    Attributes:
        out: Folder for all output.
        scenario: Scenario file, or a bundled name.
        seed: Seed of the training.
        rounds: Rounds of training.
        steps: Steps of the environment per round.
        draws: Layouts drawn from the policy after each round.
        blasted: Layouts per round that are blasted: the proposal, then the best draws by guess.
        masses_kg: Charges of the judgement. The training has that of the scenario alone.
        processes: Worker processes of blasts.
        film_width_px: Width of the film.
        frames_per_s: Frames per second of the film.
    """

    out: Path = Path("out/demo")
    scenario: str = "hotel_forecourt"
    seed: int = 0
    rounds: int = 8
    steps: int = 1024
    draws: int = 16
    blasted: int = 4
    masses_kg: tuple[float, ...] = (50.0, 75.0, 125.0, 150.0, 200.0)
    processes: int = 2
    film_width_px: int = 1600
    frames_per_s: float = 25.0


@dataclass(eq=False)
class RewardCorrection:
    """The guessed reduction, corrected by blasts of similar layouts, at the end; a `Reward`.

    Attributes:
        site: The site.
        reduction: Reduction by gas dynamics of each blasted layout.
    """

    site: SurrogateSite
    reduction: dict[Layout, float] = field(default_factory=dict)
    _errors: dict[Layout, float] = field(default_factory=dict)
    _correction: Correction | None = None

    def terms(self, scenario: Scenario) -> tuple[str, ...]:  # noqa: ARG002
        """Return `reduction`."""
        return ("reduction",)

    def layouts(self, transition: Transition) -> Sequence[Layout]:  # noqa: ARG002
        """Return none: those at the end are enough."""
        return ()

    def __call__(
        self, transition: Transition, loads: Mapping[Layout, Assessment]
    ) -> Mapping[str, float]:
        """Return the term `reduction`, 0 before the end."""
        if not transition.ended:
            return {"reduction": 0.0}
        guessed = float(np.nan_to_num(loads[transition.after].reduction_from(loads[()])))
        return {"reduction": self.corrected(transition.after, guessed)}

    def corrected(self, layout: Layout, guessed: float) -> float:
        """Return a guessed reduction with the expected error of the layout."""
        if self._correction is None:
            return guessed
        error, _ = self._correction.expected([self.site.barrier(layout)])
        return 1.0 - (1.0 - guessed) * exp(error.item())

    def learn(self, layout: Layout, guessed: float, reduction: float) -> None:
        """Take in the blasts of a layout."""
        self.reduction[layout] = reduction
        self._errors[layout] = log((1.0 - reduction) / (1.0 - guessed))
        barriers = [self.site.barrier(error) for error in self._errors]
        self._correction = Correction.of(barriers, np.array([*self._errors.values()]))


@dataclass(eq=False)
class DemoTraining:
    """The training of an agent, round by round.

    Attributes:
        settings: The settings.
        scenario: The site.
        curve: Steps so far, reduction of the proposal by gas dynamics, and the one promised by the
            corrected guess before that blast, by round. The first row has the means of draws of the
            untrained policy, which are random layouts.
    """

    settings: DemoSettings
    scenario: Scenario
    curve: list[tuple[int, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        threats = one_per_charge(draw_threats(self.scenario, range(16)))
        self._case, self._judge = LoadCaseSet(self.scenario, threats), Evaluators(JUDGE)
        self.reward = RewardCorrection(site_of(self.scenario))
        engine = SurrogateEngine()
        in_training, self._env = (
            BlastBarrierEnv(
                self.scenario,
                reward=self.reward,
                observation="features",
                action="row",
                threat="hidden",
                threats=len(threats),
                engine=engine,
            )
            for _ in range(2)
        )
        self.model = MaskablePPO(
            "MlpPolicy",
            in_training,
            learning_rate=1e-3,
            n_steps=min(self.settings.steps, 512),
            batch_size=min(self.settings.steps, 64),
            gamma=1.0,
            ent_coef=0.01,
            seed=self.settings.seed,
            device="cpu",
        )
        drawn = [self._layout(deterministic=False) for _ in range(self.settings.blasted)]
        self._blast(drawn, len(drawn))

    @property
    def blasts(self) -> int:
        """Number of blasts so far."""
        return self._judge.counts.blasts

    @property
    def best(self) -> Layout:
        """The best layout of the policy by the blasts so far."""
        return max(self.reward.reduction, key=lambda item: self.reward.reduction[item])

    def do_round(self) -> None:
        """Train on corrected guesses, then blast the proposal and the best draws."""
        self.model.learn(self.settings.steps, reset_num_timesteps=False)
        proposal = self._layout(deterministic=True)
        drawn = dict(self._layout(deterministic=False) for _ in range(self.settings.draws))
        known = {*self.reward.reduction, proposal[0]}
        new = [draw for draw in drawn.items() if draw[0] not in known]
        new.sort(key=lambda draw: -self.reward.corrected(*draw))
        self._blast([proposal, *new[: self.settings.blasted - 1]], 1)

    def _layout(self, *, deterministic: bool) -> tuple[Layout, float]:
        """Return a layout of the policy and its guessed reduction."""
        observation, _ = self._env.reset(seed=self.settings.seed)
        ended = False
        while not ended:
            action, _ = self.model.predict(
                observation, deterministic=deterministic, action_masks=self._env.action_masks()
            )
            observation, _, ended, _, info = self._env.step(np.int64(action))
        return tuple(sorted(self._env.placement.layout)), info["reduction"]

    def _blast(self, layouts: Sequence[tuple[Layout, float]], shown: int) -> None:
        """Blast layouts, each with its guess; the curve gets the means of the first ones."""
        promised = np.mean([self.reward.corrected(*layout) for layout in layouts[:shown]]).item()
        for layout, guessed in layouts:
            judged = compare(self._judge, [self._case], [layout], self.settings.processes)
            self.reward.learn(layout, guessed, judged.reduction.value)
        by_gas = np.mean([self.reward.reduction[name] for name, _ in layouts[:shown]]).item()
        self.curve.append((self.model.num_timesteps, by_gas, promised))


def train_agent(settings: DemoSettings) -> DemoTraining:
    """Train an agent, and print the learning curve as it grows."""
    torch.set_num_threads(1)  # further threads only wait for these small products
    training = DemoTraining(settings, load_scenario(settings.scenario))
    print_line(f"{AGENT} on guesses that gas dynamics corrects; reductions of its proposals:")
    with progress_bar("training") as progress:
        for number in range(settings.rounds + 1):
            if number:
                training.do_round()
            steps, by_gas, promised = training.curve[-1]
            print_line(
                f"  after {steps:>5,} steps, {training.blasts:>3} blasts: {percent(by_gas):>6} by "
                f"gas dynamics, {percent(promised):>6} promised{'' if number else ' (random)'}"
            )
            progress(number / settings.rounds)
    return training


def learning_curve(training: DemoTraining) -> Figure:
    """Return the figure of the learning curve."""
    steps, by_gas, promised = zip(*training.curve, strict=True)
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.add_subplot(xlabel="steps of training", ylabel="reduction of the proposal (%)")
    axes.plot(steps, 100.0 * np.array(by_gas), marker="o", label="by gas dynamics")
    axes.plot(steps, 100.0 * np.array(promised), ls="--", label="promised by corrected guesses")
    axes.set_title(f"{AGENT} on {training.scenario.name}; first point: random layouts", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend()
    return figure


@dataclass(frozen=True, eq=False)
class AgentComparison:
    """The trained agent against the other methods, on the same charges.

    Attributes:
        results: Evaluation of each method's layouts with no barrier, by name.
        rules: Names of the rules among them.
        engine: Name of the judging engine, with its cells.
    """

    results: Mapping[str, Evaluation]
    rules: tuple[str, ...]
    engine: str

    @property
    def agent(self) -> Evaluation:
        """The layouts of the trained agent."""
        return self.results[AGENT]

    @property
    def best_rule(self) -> str:
        """Name of the rule with the largest mean reduction."""
        return max(self.rules, key=lambda name: self.results[name].reduction.value)

    @property
    def best_rules(self) -> Evaluation:
        """The best rule for each charge, which only blasts with all rules can determine."""
        rules = [self.results[name] for name in self.rules]
        chosen = np.argmin([rule.loads.mean(axis=1) for rule in rules], axis=0).tolist()
        return replace(
            rules[0],
            every=tuple(rules[number].every[case] for case, number in enumerate(chosen)),
        )

    @property
    def is_ahead(self) -> bool:
        """Whether the agent is ahead of the best rule for each case, with its interval above 0."""
        return bool(self.agent.difference(self.best_rules).low > 0.0)

    @property
    def verdict(self) -> str:
        """The reduction and cost of the layout, and its lead over rules and random layouts."""
        others = self.results[RANDOM], self.results[self.best_rule], self.best_rules
        leads = [self.agent.difference(other).scaled(100.0) for other in others]
        if isnan(leads[0].low):
            return "No verdict: one charge gives no interval."
        random, rule, every_rule = (
            f"{lead.value:+.1f} points ({lead.low:+.1f} to {lead.high:+.1f})" for lead in leads
        )
        scenario, reduction = self.agent.cases[0].scenario, self.agent.reduction
        cost = LayoutState(scenario, self.agent.layouts[0]).cost
        budget = "" if scenario.zone.budget is None else f" of {scenario.zone.budget:g}"
        ahead = "is ahead" if self.is_ahead else "is not shown to be ahead"
        return (
            f"The layout takes off {percent(reduction.value)} of the load ({interval(reduction)}) "
            f"and costs {cost:g}{budget}. It {ahead} of the rules: {rule} beside the best one, "
            f"{self.best_rule!r}, {every_rule} beside the best for each charge, {random} beside "
            "random layouts (95 % intervals of paired differences)."
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Return the printed table, one row per method; see `HEADERS`."""
        others = {name: result for name, result in self.results.items() if name != AGENT}
        others |= {"best rule for each case": self.best_rules, AGENT: self.agent}
        return [self._row(name, other) for name, other in others.items()]

    def _row(self, name: str, result: Evaluation) -> tuple[str, ...]:
        ahead = self.agent.difference(result)
        return (
            name,
            f"{result.loads.mean():,.0f}",
            percent(result.reduction.value),
            interval(result.reduction),
            *(("-", "-") if name == AGENT else (percent(ahead.value), interval(ahead))),
        )


def unseen_charges(settings: DemoSettings, scenario: Scenario) -> list[LoadCaseSet]:
    """Return a case for each mass of the judgement, with one threat for each place."""
    count, cases = len(one_per_charge(draw_threats(scenario, range(16)))), []
    for index, tnt_kg in enumerate(settings.masses_kg):
        charge = tuple(source.model_copy(update={"tnt_kg": tnt_kg}) for source in scenario.charge)
        site = scenario.model_copy(update={"charge": charge})
        threats = draw_threats(site, SeedRange.TEST.seeds(count * index, count))
        cases.append(LoadCaseSet(site, threats, name=f"{tnt_kg:g} kg", seed=index))
    return cases


def compare_methods(settings: DemoSettings, training: DemoTraining) -> AgentComparison:
    """Compare the best layout of the training with all rules under unseen charges."""
    cases = unseen_charges(settings, training.scenario)
    rules = [layouts_by_rule(case.scenario) for case in cases]
    layouts: dict[str, list[Layout]] = {
        NOTHING: [()] * len(cases),
        RANDOM: [random_layout(case.scenario, generator(case.seed)) for case in cases],
        **{name: [rule[name] for rule in rules] for name in rules[0]},
        PACKAGED: [packaged_agent().ranked(case.scenario)[0] for case in cases],
        AGENT: [training.best] * len(cases),
    }
    evaluators, results = Evaluators(JUDGE, most=len(cases)), {}
    with progress_bar(f"{len(cases)} unseen charges") as progress:
        for name, own in layouts.items():
            results[name] = compare(evaluators, cases, own, settings.processes)
            progress(len(results) / len(layouts))
    return AgentComparison(results, tuple(rules[0]), evaluators.engine.words)


def main(
    seed: Annotated[int, typer.Option(help="Seed of the training.")] = 0,
    scenario: Annotated[str, typer.Option(help="Bundled name or file.")] = DemoSettings.scenario,
    only_train: Annotated[bool, typer.Option(help="Print the learning curve only.")] = False,
) -> None:
    """Train MaskablePPO on a site, and compare its layout with every rule."""
    settings = DemoSettings(seed=seed, scenario=scenario)
    with user_errors():
        if only_train:
            train_agent(settings)
        else:
            demonstrate(settings)


def demonstrate(settings: DemoSettings) -> AgentComparison:
    """Train, compare, film; print a table and the paths.

    Returns:
        The comparison behind the verdict.

    Raises:
        BlastEnvError: If a setting is invalid, or a file cannot be written.
    """
    began = perf_counter()
    make_folder(settings.out)
    training = train_agent(settings)
    comparison = compare_methods(settings, training)
    print_comparison(comparison)
    written = [save_figure(learning_curve(training), settings.out / "learning_curve.png")]
    written += write_pictures(settings, comparison)
    training.model.save(settings.out / "agent.zip")
    print_line(f"\n{comparison.verdict}\n", style="bold")
    for path in (*written, settings.out / "agent.zip"):
        print_line(f"wrote {path}")
    print_line(f"{perf_counter() - began:.0f} s in all")
    return comparison


def print_comparison(comparison: AgentComparison) -> None:
    """Print one row per method: mean load, reduction, lead of the agent."""
    cases = comparison.agent.cases
    title = (
        f"{cases[0].scenario.name}: charges of {', '.join(case.name for case in cases)}, which the "
        f"training has not met; judged by the engine {comparison.engine}"
    )
    print_table(title, HEADERS, comparison.rows())
    print_line("Pa s: mean load on the protected structures; ahead: percentage points, paired")


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
    blasts = [
        GasBlast(scenario, layout_tried, threat.seed, charge=threat.charge)
        for layout_tried in ((), layout)
    ]
    film = out / "side_by_side.mp4"
    with progress_bar("film") as progress:
        unprotected, protected = write_film(
            blasts[1],
            film,
            beside=blasts[0],
            frames_per_s=settings.frames_per_s,
            width_px=settings.film_width_px,
            progress=progress,
        )
    charge = threat.charge_against(scenario, layout)
    plan = LayoutPlan(scenario, layout, charge, {"agent": AGENT, "seed": str(settings.seed)})
    return [
        film,
        save_figure(facades(protected, beside=unprotected), out / "facade.png"),
        save_figure(site_picture(scenario, layout), out / "site.png"),
        protected.to_excel(out / "loads.xlsx"),
        *export_to(plan, out),
    ]


if __name__ == "__main__":
    typer.run(main)
