"""`blast-env advise`: the protection for a budget by kind of measure, and the cost to pass."""

from dataclasses import dataclass, replace
from itertools import cycle, islice
from pathlib import Path
from typing import Final

from blast_env.cli.command import argument, option
from blast_env.cli.evaluation_report import impulse_text
from blast_env.cli.options import (
    CELL_HELP,
    CELLS_HELP,
    FINAL_CELLS,
    MASS_ERROR_HELP,
    SCENARIO_HELP,
    TARGET_HELP,
    ChargeOptions,
    wanted_level,
)
from blast_env.cli.output import ResultTable, print_cost, print_line, progress_bar, result_console
from blast_env.cli.targets import PICTURES
from blast_env.design.search import DesignProblem
from blast_env.design.search.advice import (
    MARGIN,
    Advice,
    MeasureKind,
    advise_until,
    best_of,
    kinds_for,
)
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, Case, draw_threats
from blast_env.evaluation.cases import one_of_each_charge
from blast_env.evaluation.consequences import Consequences, Verdict, consequences
from blast_env.evaluation.engines.contract import JUDGE, Engine, find_engine
from blast_env.evaluation.grid_error import GridError, final_engine, grid_error
from blast_env.evaluation.probability import (
    DRAWS,
    Uncertainty,
    level_probability,
    probability_text,
)
from blast_env.geometry import Layout, layout_words
from blast_env.layout import Placement, write_layout
from blast_env.layout.placement import met_by_blasts
from blast_env.provenance import versions
from blast_env.response.buildings import LevelOfProtection
from blast_env.site import Scenario, load_scenario
from blast_env.site.models import SCHEMA_VERSION

_BARELY: Final = Verdict.PASSES_BARELY
_PROBABLE_MARGIN: Final = 0.3
"""Margin in damage levels after a layout failed before a judge who wants a probability."""

_HEADERS: Final = (
    "kind",
    "layout",
    "cost",
    "blasts",
    "level",
    "passes",
    "judged",
    "sharp peaks",
    "probability",
)


@dataclass(frozen=True, kw_only=True)
class AdviseCommand(ChargeOptions):
    """Compare the protection for a budget: stand-off, shielding, hardening, and all combined.

    For each kind the command searches for the cheapest layout that reaches the target, by gas
    dynamics, or for the one with the least shortfall if none does. The layouts found are judged
    again with finer cells, and with peaks as sharp as Kingery and Bulmash's: cells clip peaks, and
    those of 0.5 m halve them. If a layout fails there, the search is repeated with a margin to the
    target. Hardening needs no further blasts.
    """

    scenario: str = argument(SCENARIO_HELP)
    budget_cost: float | None = option(None, "Most that may be spent; else the zone's budget.")
    target: str | None = option(None, TARGET_HELP.format("medium"))
    target_probability: float | None = option(
        None, "Least probability of the level; else the scenario's, else none.", min=0.5, max=0.999
    )
    mass_error: float = option(0.1, MASS_ERROR_HELP, min=0.0, max=0.3)
    charges: int = option(16, "Draws of the charge; each place counts once.", min=1)
    budget: int = option(60, "Most blasts of a search.", min=1)
    rounds: int = option(3, "Most searches for each kind.", min=1)
    seed: int = option(0, "Seed of the draws.", min=0)
    processes: int = option(1, "Worker processes.", min=1)
    cell_m: float | None = option(None, CELL_HELP)
    cells: str | None = option(None, CELLS_HELP, show_default="uniform")
    judge_cell_m: float | None = option(
        None, "Side of the cells for judging the layouts found, m; else 0.25."
    )
    judge_cells: str | None = option(
        None, "The same as --cells, for judging the layouts found.", show_default=FINAL_CELLS
    )
    out: Path | None = option(
        None, "Layout file of the best layout of all: .json.", writes=(".json",)
    )
    picture: Path | None = option(
        None, "Picture of cost against level of protection: .png, .svg, .pdf.", writes=PICTURES
    )

    def __call__(self) -> None:
        """Search for each kind, judge, and print the verdict."""
        scenario = self._asked(load_scenario(self.scenario))
        target = scenario.objective.level
        assert target is not None
        drawn = draw_threats(scenario, range(self.charges))
        fixed = [replace(each, charge=self.fixed(scenario, each.charge)) for each in drawn]
        threats = one_of_each_charge(fixed)
        engine = find_engine(JUDGE, self.cell_m, cells=self.cells)
        judge = final_engine(JUDGE, [scenario], self.judge_cell_m, cells=self.judge_cells)
        problem = DesignProblem(
            BlastEvaluator(scenario, engine), Case(scenario, threats), self.processes
        )
        if self.budget < len(threats):
            raise BlastEnvError(
                f"budget is {self.budget} blasts, must be at least {len(threats)}: one per charge"
            )
        kinds = kinds_for(scenario)
        searched = islice(cycle(threats), len(kinds) * self.rounds * self.budget)
        asked = [(engine, each.charge) for each in searched]
        asked += [(judge, each.charge) for each in threats] * (len(kinds) * self.rounds)
        print_line(
            f"{len(kinds)} kinds, at most {self.rounds} searches of {self.budget} blasts each, "
            f"{engine.words}; each result is judged with {len(threats)}, {judge.words}"
        )
        print_cost((each, scenario, charge) for each, charge in asked)
        charges = [threat.charge for threat in threats]
        judged: dict[Layout, Consequences] = {}
        shares: dict[Layout, float] = {}
        wanted = scenario.objective.target_probability

        def verdict(layout: Layout) -> Verdict:
            if layout not in judged:
                judged[layout] = consequences(scenario, layout, charges, judge)
                likely = level_probability(judged[layout], Uncertainty(mass=self.mass_error))
                shares[layout] = likely.of(target)
            found = judged[layout].verdict(target)
            return found if shares[layout] >= (wanted or 0.0) else min(found, _BARELY)

        found: list[Advice] = []
        for kind in kinds:
            first = tuple(each.layout for each in found) if kind is MeasureKind.TOGETHER else ()
            arguments = (verdict, problem, kind, self.budget, self.seed, first)
            with progress_bar(f"{kind}") as progress:
                margin = MARGIN if wanted is None else _PROBABLE_MARGIN
                rounds = self.rounds
                found.append(advise_until(*arguments, progress, rounds=rounds, margin=margin))
        best = best_of(found, verdict)
        error = _error(problem, best.layout, judged, judge)
        passes = verdict(best.layout) is Verdict.PASSES
        print_line(_answer(scenario, target, best, found, judged, shares[best.layout], passes))
        self._print(scenario, target, best, found, judged, shares, judge, error)
        if self.out is not None:
            made = {"method": "advise", "seed": self.seed, "versions": versions(engine.version)}
            print_line(f"wrote {write_layout(self.out, scenario, best.layout, made)}")
        if self.picture is not None:
            self._draw(self.picture, scenario, target, found, judged, engine, judge)

    def _draw(
        self,
        path: Path,
        scenario: Scenario,
        target: LevelOfProtection,
        found: list[Advice],
        judged: dict[Layout, Consequences],
        engine: Engine,
        judge: Engine,
    ) -> None:
        # Here, because pictures need the extra `render`.
        from blast_env.plots.cost_level import PricedDamage, cost_level_figure
        from blast_env.plots.figures import save_figure

        tried = {
            str(each.kind): [PricedDamage(x.cost, x.damage) for x in each.tried] for each in found
        }
        searched = {x.layout: PricedDamage(x.cost, x.damage) for each in found for x in each.tried}
        pairs = [
            (point, point._replace(damage=seen.worst_damage(scenario)))
            for layout, seen in judged.items()
            for point in [searched[layout]]
        ]
        charges = len(next(iter(judged.values())).barriers)
        title = f"{scenario.name}: cost of each higher level, worst of {charges} charges"
        figure = cost_level_figure(tried, pairs, target, title, (engine.words, judge.words))
        print_line(f"wrote {save_figure(figure, path)}")

    def _asked(self, scenario: Scenario) -> Scenario:
        """Return the scenario with the requested target and budget."""
        target = wanted_level(self.target, scenario, LevelOfProtection.MEDIUM).label
        kept = scenario.objective.model_dump(
            include={"charges", "cvar_level", "measure", "target_probability"}, exclude_none=True
        )
        if self.target_probability is not None:
            kept["target_probability"] = self.target_probability
        document = scenario.model_dump() | {
            "schema_version": SCHEMA_VERSION,
            "objective": {**kept, "kind": "response", "target": target},
        }
        if self.budget_cost is not None:
            document["build_zone"] = {**scenario.zone.model_dump(), "budget": self.budget_cost}
        return Scenario.from_document(document, scenario.name)

    def _print(
        self,
        scenario: Scenario,
        target: LevelOfProtection,
        best: Advice,
        found: list[Advice],
        judged: dict[Layout, Consequences],
        shares: dict[Layout, float],
        judge: Engine,
        error: GridError | None,
    ) -> None:
        for note in judged[best.layout].notes:
            print_line(f"flag: {note}")
        if error is not None:
            print_line(impulse_text(error))
            print_line(error.words)
        title = f"{scenario.name}: budget {scenario.zone.budget:g}, required level {target.label!r}"
        table = ResultTable(title, _HEADERS, text_columns=2)
        for each in found:
            seen = judged[each.layout]
            levels = [seen.level(building) for building in seen.buildings]
            table.add_row(
                each.kind,
                layout_words(each.layout),
                f"{Placement(scenario, each.layout).cost:g}",
                str(each.blasts),
                min(levels).label,
                "yes" if each.passes else "no",
                Verdict.of(seen.passes_on_cells(target)).word(seen.is_flagged).lower(),
                seen.verdict_word(target).lower(),
                probability_text(shares[each.layout], DRAWS),
            )
        result_console().print(table)
        print_line(
            f"passes: by the search; judged: {judge.words}; level, sharp peaks: the same impulses "
            "with peaks that cells do not clip as well; probability: of the required level."
        )


def _error(
    problem: DesignProblem, layout: Layout, judged: dict[Layout, Consequences], judge: Engine
) -> GridError | None:
    """Return the error of the cells for a judged layout; the search's blasts serve it if they can.

    They do if the cells of the search are twice those of the judge.
    """
    fine, bare = judged[layout], judged[()]
    threat = problem.threats[fine.worst_number]
    of_both = fine.loads[fine.worst_number], bare.loads[fine.worst_number]
    coarser: BlastEvaluator | None = problem.evaluator
    if judge.coarser != problem.evaluator.engine:
        coarser = BlastEvaluator(problem.scenario, judge).coarser()
    return grid_error(coarser, problem.case, met_by_blasts(layout), threat, of_both)


def _answer(
    scenario: Scenario,
    target: LevelOfProtection,
    best: Advice,
    found: list[Advice],
    judged: dict[Layout, Consequences],
    share: float,
    passes: bool,
) -> str:
    """Return the answer in a line or two: the cost to pass, and whether walls help."""
    by_kind = {each.kind: each for each in found}
    cost = Placement(scenario, best.layout).cost
    flagged = " (flagged)" if judged[best.layout].is_flagged else ""
    wanted, likely = scenario.objective.target_probability, probability_text(share, DRAWS)
    if not passes:
        least = (
            "" if wanted is None else f" with a probability of {wanted:g}; the best has {likely}"
        )
        answer = f"{scenario.name}: nothing that was tried reaches {target.label!r}{least}."
    elif not best.layout:
        answer = f"{scenario.name}: the empty site reaches {target.label!r} with {likely}{flagged}."
    else:
        words = layout_words(best.layout)
        level = f"{target.label!r} with {likely}"
        answer = f"{scenario.name}: {level} costs {scenario.zone.priced(cost)}{flagged}: {words}."
    shield, nothing = by_kind.get(MeasureKind.SHIELD), by_kind[MeasureKind.NOTHING]
    if shield is None or judged[shield.layout].passes(target):
        return answer
    barrier = set(met_by_blasts(best.layout))
    gain = 1.0 - (shield.worth - 1.0) / (nothing.worth - 1.0) if nothing.worth > 1.0 else 0.0
    if best.passes and not barrier:
        return f"Walls are worth nothing here: better components alone are cheaper. {answer}"
    if gain < 0.01:
        return (
            f"Walls alone are worth nothing here: they change the shortfall by {gain:.1%}. {answer}"
        )
    return answer
