"""`blast-env advise`: the protection for a budget by kind of measure, and the cost to pass."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import cycle, islice
from pathlib import Path
from typing import TYPE_CHECKING, Final

import typer

from blast_env.cli.command import writes
from blast_env.cli.evaluation_report import impulse_text
from blast_env.cli.options import (
    FINAL_CELLS,
    TARGET_HELP,
    CellOption,
    CellsOption,
    ChargeOption,
    DrawsOption,
    GivenCharge,
    MassErrorOption,
    ProcessesOption,
    ScenarioArgument,
    TntOption,
    wanted_level,
)
from blast_env.cli.output import (
    print_cost,
    print_line,
    print_table,
    print_written,
    progress_bar,
    save_figures,
)
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
from blast_env.evaluation import BlastEvaluator, LoadCaseSet, draw_threats
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
from blast_env.layout import LayoutState, write_layout
from blast_env.layout.placement import load_relevant
from blast_env.provenance import versions
from blast_env.response.buildings import LevelOfProtection
from blast_env.site import Scenario, load_scenario
from blast_env.site.models import SCHEMA_VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PROBABLE_MARGIN: Final = 0.3
"""Margin in damage levels after a layout failed before a judge who wants a probability."""

_HEADERS: Final = (
    *("kind", "layout", "cost", "blasts", "level", "passes", "judged", "sharp peaks"),
    "probability",
)


def advise(
    scenario: ScenarioArgument,
    budget_cost: float | None = typer.Option(
        None, help="Most that may be spent; else the zone's budget."
    ),
    target: str | None = typer.Option(None, help=TARGET_HELP.format("medium")),
    target_probability: float | None = typer.Option(
        None,
        help="Least probability of the level; else the scenario's, else none.",
        min=0.5,
        max=0.999,
    ),
    mass_error: MassErrorOption = 0.1,
    charges: DrawsOption = 16,
    budget: int = typer.Option(60, help="Most blasts of a search.", min=1),
    rounds: int = typer.Option(3, help="Most searches for each kind.", min=1),
    seed: int = typer.Option(0, help="Seed of the draws.", min=0),
    cell_m: CellOption = None,
    cells: CellsOption = None,
    judge_cell_m: float | None = typer.Option(
        None, "--judge-cell", help="Side of the cells for judging the layouts found, m; else 0.25."
    ),
    judge_cells: str | None = typer.Option(
        None,
        help="The same as --cells, for judging the layouts found.",
        show_default=FINAL_CELLS,
    ),
    out: Path | None = writes("Layout file of the best layout of all", ".json"),
    picture: Path | None = writes("Picture of cost against level of protection", *PICTURES),
    charge: ChargeOption = None,
    tnt_kg: TntOption = None,
    processes: ProcessesOption = 1,
) -> None:
    """Compare the protection for a budget: stand-off, shielding, hardening, and all combined.

    For each kind the command searches for the cheapest layout that reaches the target, by gas
    dynamics, or for the one with the least shortfall if none does. The layouts found are judged
    again with finer cells, and with peaks as sharp as Kingery and Bulmash's: cells clip peaks, and
    those of 0.5 m halve them. If a layout fails there, the search is repeated with a margin to the
    target. Hardening needs no further blasts.
    """
    site = _asked(load_scenario(scenario), target, target_probability, budget_cost)
    given = GivenCharge.of(charge, tnt_kg)
    drawn = draw_threats(site, range(charges))
    threats = one_of_each_charge(
        [replace(each, charge=given.fixed(site, each.charge)) for each in drawn]
    )
    if budget < len(threats):
        raise BlastEnvError(
            f"budget is {budget} blasts, must be at least {len(threats)}: one per charge"
        )
    engine = find_engine(JUDGE, cell_m, cells=cells)
    judge = final_engine(JUDGE, [site], judge_cell_m, cells=judge_cells)
    problem = DesignProblem(BlastEvaluator(site, engine), LoadCaseSet(site, threats), processes)
    kinds = kinds_for(site)
    asked = [(engine, each.charge) for each in islice(cycle(threats), len(kinds) * rounds * budget)]
    asked += [(judge, each.charge) for each in threats] * (len(kinds) * rounds)
    print_line(
        f"{len(kinds)} kinds, at most {rounds} searches of {budget} blasts each, {engine.words}; "
        f"each result is judged with {len(threats)}, {judge.words}"
    )
    print_cost((each, site, charge) for each, charge in asked)
    judged = _Judge(problem, judge, mass_error)
    found: list[Advice] = []
    for kind in kinds:
        first = tuple(each.layout for each in found) if kind is MeasureKind.TOGETHER else ()
        margin = MARGIN if site.objective.target_probability is None else _PROBABLE_MARGIN
        with progress_bar(f"{kind}") as progress:
            found.append(
                advise_until(
                    *(judged.verdict, problem, kind, budget, seed, first, progress),
                    rounds=rounds,
                    margin=margin,
                )
            )
    best = best_of(found, judged.verdict)
    print_line(_answer(judged, best, found))
    _print(judged, best, found)
    if out is not None:
        made = {"method": "advise", "seed": seed, "versions": versions(engine.version)}
        print_written([write_layout(out, site, best.layout, made)])
    print_written(save_figures((picture, partial(_draw, judged, found))))


def _asked(
    scenario: Scenario,
    target: str | None,
    target_probability: float | None,
    budget_cost: float | None,
) -> Scenario:
    """Return the scenario with the requested target and budget."""
    kept = scenario.objective.model_dump(
        include={"charges", "cvar_level", "measure", "target_probability"}, exclude_none=True
    )
    if target_probability is not None:
        kept["target_probability"] = target_probability
    level = wanted_level(target, scenario, LevelOfProtection.MEDIUM)
    document = scenario.model_dump() | {
        "schema_version": SCHEMA_VERSION,
        "objective": {**kept, "kind": "response", "target": level.label},
    }
    if budget_cost is not None:
        document["build_zone"] = {**scenario.zone.model_dump(), "budget": budget_cost}
    return Scenario.from_document(document, scenario.name)


class _Judge:
    """The verdicts on layouts by finer cells.

    Args:
        problem: The problem of the search.
        engine: Gas dynamics with the finer cells.
        mass_error: Uncertainty of the masses; see `Uncertainty`.

    Attributes:
        judged: The consequences with each layout that was judged.
        shares: The probability of the required level with each of them.
    """

    def __init__(self, problem: DesignProblem, engine: Engine, mass_error: float) -> None:
        self.problem, self.engine, self._mass_error = problem, engine, mass_error
        self.scenario = problem.scenario
        self.judged: dict[Layout, Consequences] = {}
        self.shares: dict[Layout, float] = {}

    @property
    def target(self) -> LevelOfProtection:
        """The required level."""
        target = self.scenario.objective.level
        assert target is not None
        return target

    def verdict(self, layout: Layout) -> Verdict:
        """Return the verdict on a layout; it takes a blast per charge, once."""
        if layout not in self.judged:
            charges = [each.charge for each in self.problem.threats]
            self.judged[layout] = consequences(self.scenario, layout, charges, self.engine)
            likely = level_probability(self.judged[layout], Uncertainty(mass=self._mass_error))
            self.shares[layout] = likely.of(self.target)
        found = self.judged[layout].verdict(self.target)
        wanted = self.scenario.objective.target_probability or 0.0
        return found if self.shares[layout] >= wanted else min(found, Verdict.PASSES_BARELY)

    def error(self, layout: Layout) -> GridError | None:
        """Return the error of the cells for a judged layout.

        The search's blasts serve it if their cells are twice as large as the judge's.
        """
        fine, unprotected = self.judged[layout], self.judged[()]
        threat = self.problem.threats[fine.worst_number]
        of_both = fine.loads[fine.worst_number], unprotected.loads[fine.worst_number]
        coarser: BlastEvaluator | None = self.problem.evaluator
        if self.engine.coarser != self.problem.evaluator.engine:
            coarser = BlastEvaluator(self.scenario, self.engine).coarser()
        return grid_error(coarser, self.problem.case, load_relevant(layout), threat, of_both)


def _draw(judge: _Judge, found: Sequence[Advice]) -> "Figure":
    # Here, because pictures need the extra `render`.
    from blast_env.plots.cost_level import PricedDamage, cost_level_figure

    scenario = judge.scenario
    tried = {str(each.kind): [PricedDamage(x.cost, x.damage) for x in each.tried] for each in found}
    searched = {x.layout: PricedDamage(x.cost, x.damage) for each in found for x in each.tried}
    pairs = [
        (searched[layout], searched[layout]._replace(damage=seen.worst_damage(scenario)))
        for layout, seen in judge.judged.items()
    ]
    count = len(judge.problem.threats)
    title = f"{scenario.name}: cost of each higher level, worst of {count} charges"
    engines = judge.problem.evaluator.engine.words, judge.engine.words
    return cost_level_figure(tried, pairs, judge.target, title, engines)


def _print(judge: _Judge, best: Advice, found: Sequence[Advice]) -> None:
    scenario, target = judge.scenario, judge.target
    for note in judge.judged[best.layout].notes:
        print_line(f"flag: {note}")
    error = judge.error(best.layout)
    if error is not None:
        print_line(impulse_text(error))
        print_line(error.words)
    rows = []
    for each in found:
        seen = judge.judged[each.layout]
        rows.append(
            (
                each.kind,
                layout_words(each.layout),
                f"{LayoutState(scenario, each.layout).cost:g}",
                str(each.blasts),
                min(seen.level(building) for building in seen.buildings).label,
                "yes" if each.passes else "no",
                Verdict.of(seen.passes_on_cells(target)).word(seen.is_flagged).lower(),
                seen.verdict_word(target).lower(),
                probability_text(judge.shares[each.layout], DRAWS),
            )
        )
    title = f"{scenario.name}: budget {scenario.zone.budget:g}, required level {target.label!r}"
    print_table(title, _HEADERS, rows, text_columns=2)
    print_line(
        f"passes: by the search; judged: {judge.engine.words}; level, sharp peaks: the same "
        "impulses with peaks that cells do not clip as well; probability: of the required level."
    )


def _answer(judge: _Judge, best: Advice, found: Sequence[Advice]) -> str:
    """Return the answer in a line or two: the cost to pass, and whether walls help."""
    scenario, target = judge.scenario, judge.target
    by_kind = {each.kind: each for each in found}
    cost = LayoutState(scenario, best.layout).cost
    flagged = " (flagged)" if judge.judged[best.layout].is_flagged else ""
    wanted = scenario.objective.target_probability
    likely = probability_text(judge.shares[best.layout], DRAWS)
    if judge.verdict(best.layout) is not Verdict.PASSES:
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
    if shield is None or judge.judged[shield.layout].passes(target):
        return answer
    barrier = set(load_relevant(best.layout))
    gain = 1.0 - (shield.worth - 1.0) / (nothing.worth - 1.0) if nothing.worth > 1.0 else 0.0
    if best.passes and not barrier:
        return f"Walls are worth nothing here: better components alone are cheaper. {answer}"
    if gain < 0.01:
        return (
            f"Walls alone are worth nothing here: they change the shortfall by {gain:.1%}. {answer}"
        )
    return answer
