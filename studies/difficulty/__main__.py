"""The effect of the barrier's place on the load, for docs/studies/scenarios.md.

For every bundled scenario with a build zone: no barrier, random layouts, rule layouts and the best
layout of a search, on the same threats. Scenarios with modules use a particle engine and held-out
seeds, once with one layout for all threats and once with one layout per charge. Scenarios with a
catalogue use gas dynamics, with one layout for all places of the charge. Prints the tables and a
verdict, writes both into a file that the page includes, and draws a picture of each scenario with
the best layout.
"""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import Annotated, Final

import numpy as np
import typer

from blast_env import load_scenario
from blast_env.cli.options import ClusterAddress, running_on
from blast_env.cli.output import ResultTable, print_line, progress_bar, result_console, user_errors
from blast_env.evaluation import evaluate_against
from blast_env.files import make_folder, write_atomically
from blast_env.plots.figures import save_figure
from blast_env.site import Scenario, bundled_scenarios
from blast_env.tables import markdown_table
from studies.difficulty.figure import difficulty_figure, items_figure
from studies.difficulty.items import ItemEffort, ItemResult, ItemStudy, cost_of, pieces_text
from studies.difficulty.study import DifficultyStudy, Effort, TaskResult, WayOutcome
from studies.difficulty.verdict import (
    Criterion,
    difficulty_criteria,
    item_criteria,
    joint_criteria,
)

TABLES: Final = Path("docs/studies/tables")
PICTURES: Final = Path("docs/pictures")

_HEADERS: Final = (
    "layout",
    "modules",
    "impulse (Pa s)",
    "reduction (95 % interval)",
    "worst threat (Pa s)",
    "CVaR (Pa s)",
)
_ITEM_HEADERS: Final = (
    "layout",
    "pieces",
    "cost",
    "impulse (Pa s)",
    "reduction",
    "at the worst place",
)
_JOINT: Final = "all_with_items"
_PERCENT: Final = 100.0


def main(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Scenarios; all with a build zone unless given.", show_default=False),
    ] = None,
    layouts: Annotated[int, typer.Option(min=2, help="Random layouts to search.")] = 500,
    seeds: Annotated[int, typer.Option(min=2, help="Held-out threats, charge hidden.")] = 32,
    charges: Annotated[int, typer.Option(min=2, help="Charges, charge visible.")] = 6,
    realisations: Annotated[int, typer.Option(min=1, help="Held-out blasts of each.")] = 5,
    engine: Annotated[str, typer.Option(help="Of particles; items are for gas.")] = "event",
    random: Annotated[int, typer.Option(min=2, help="Items: random layouts.")] = 50,
    budget: Annotated[int, typer.Option(min=1, help="Items: blasts of the search.")] = 1000,
    place_budget: Annotated[
        int, typer.Option(min=1, help="Items: blasts of a search for one place of the charge.")
    ] = 100,
    blasts: Annotated[
        Path, typer.Option(help="Items: folder in which blasts are kept for the next run.")
    ] = Path("out/scenario_difficulty"),
    processes: Annotated[int, typer.Option(min=1, help="Worker processes.")] = 2,
    cluster: ClusterAddress = None,
    tables: Annotated[Path, typer.Option(help="Folder for the tables.")] = TABLES,
    pictures: Annotated[Path, typer.Option(help="Folder for the pictures.")] = PICTURES,
) -> None:
    """Run the study and update the tables and pictures."""
    effort = Effort(layouts=layouts, seeds=seeds, charges=charges, realisations=realisations)
    items = ItemEffort(layouts=random, budget=budget, place_budget=place_budget)
    with user_errors(), running_on(cluster):
        scenarios = [load_scenario(name) for name in names or studied_scenarios()]
        for folder in (tables, pictures):  # before the blasts, so that no result is lost
            make_folder(folder)
        results = []
        for scenario in scenarios:
            if scenario.zone.items:
                results.append(study_items(scenario, items, blasts, processes, tables, pictures))
            else:
                study_scenario(scenario, effort, engine, processes, tables, pictures)
        if {each.scenario.name for each in results} == set(with_items()):
            write_joint(results, tables)


def with_items() -> tuple[str, ...]:
    """Return the names of the bundled scenarios in which items of a catalogue are placed."""
    return tuple(name for name in studied_scenarios() if load_scenario(name).zone.items)


def studied_scenarios() -> tuple[str, ...]:
    """Return the names of the bundled scenarios with a build zone and a load as objective.

    `studies.response_sites` has those with a response objective.
    """
    loaded = {name: load_scenario(name) for name in bundled_scenarios()}
    return tuple(
        name
        for name, each in loaded.items()
        if each.build_zone is not None and not each.objective.is_response
    )


def study_scenario(
    scenario: Scenario, effort: Effort, engine: str, processes: int, tables: Path, pictures: Path
) -> None:
    """Study one scenario: print, write its tables, draw its picture."""
    start = perf_counter()
    print_line(f"{scenario.name}: at most {effort.blasts:,} blasts")
    with progress_bar(scenario.name) as progress:
        study = DifficultyStudy(scenario, effort, engine, processes, progress)
        hidden, visible = study.hidden(), study.visible()
    best = hidden.best
    evaluation = evaluate_against(study.evaluator, best.layouts[0], study.held_out)
    save_figure(difficulty_figure(evaluation, best.name), picture_path(pictures, scenario.name))
    tasks = ((hidden_title(effort), hidden), (visible_title(effort), visible))
    criteria = difficulty_criteria(hidden, visible)
    for title, result in tasks:
        print_result(f"{scenario.name}, {title}", result)
    print_verdict(criteria)
    parts = [origin(study), *(markdown(*task) for task in tasks), markdown_verdict(criteria)]
    written = write_tables(tables, scenario.name, "\n\n".join(parts))
    print_line(
        f"{study.evaluator.blasts:,} blasts, {perf_counter() - start:.0f} s; wrote {written} and "
        f"{picture_path(pictures, scenario.name)}\n"
    )


def study_items(
    scenario: Scenario,
    effort: ItemEffort,
    blasts: Path,
    processes: int,
    tables: Path,
    pictures: Path,
) -> ItemResult:
    """Study one scenario with a catalogue: print, write its tables, draw its picture."""
    start_s = process_time()
    print_line(f"{scenario.name}: at most {effort.blasts(scenario):,} blasts")
    with progress_bar(scenario.name) as progress:
        study = ItemStudy(scenario, effort, processes=processes, progress=progress, cache=blasts)
        result = study.result()
    picture = save_figure(items_figure(result), picture_path(pictures, scenario.name))
    title = f"One layout for {len(result.places)} places of the charge"
    rows, criteria = item_rows(result), item_criteria(result)
    print_table(f"{scenario.name}, {title.lower()}", _ITEM_HEADERS, rows)
    print_verdict(criteria)
    parts = [
        item_origin(study, result),
        markdown_table_with_title(title, _ITEM_HEADERS, rows),
        elsewhere_text(result),
        markdown_verdict(criteria),
    ]
    written = write_tables(tables, scenario.name, "\n\n".join(parts))
    print_line(
        f"{study.evaluator.blasts:,} blasts, {process_time() - start_s:.0f} s of this process; "
        f"wrote {written} and {picture}\n"
    )
    return result


def write_joint(results: Sequence[ItemResult], tables: Path) -> None:
    """Print and write the joint table and criteria of the scenarios with a catalogue."""
    rows = joint_rows(results)
    headers = ("rule, points behind the best found", *(each.scenario.name for each in results))
    print_table("all scenarios with a catalogue", headers, rows)
    criteria = joint_criteria(results)
    print_verdict(criteria)
    table = markdown_table(headers, rows)
    write_tables(tables, _JOINT, f"{table}\n\n{markdown_verdict(criteria)}")


def item_rows(result: ItemResult) -> list[tuple[str, ...]]:
    """Return the cells of the table of a scenario with a catalogue."""
    rows: list[tuple[str, ...]] = []
    for outcome in result.task.rows:
        places = 1.0 - outcome.impulse_pa_s.mean(axis=0) / outcome.unprotected_pa_s
        costs = [cost_of(result.scenario, layout) for layout in outcome.layouts]
        reduction = f"{_PERCENT * outcome.reduction.value:.1f} %"
        if len(outcome.layouts) > 1:
            low, high = (_PERCENT * each for each in result.random_percentiles)
            reduction += f" (10 to 90 %: {low:.1f} to {high:.1f} %)"
        rows.append(
            (
                outcome.name,
                f"{outcome.modules:.3g}",
                f"{np.mean(costs):.3g}",
                f"{outcome.mean_pa_s.value:,.0f}",
                reduction if any(outcome.layouts) else "-",
                f"{_PERCENT * places.min():.1f} %" if any(outcome.layouts) else "-",
            )
        )
    return rows


def item_origin(study: ItemStudy, result: ItemResult) -> str:
    """Return the origin of the figures; a changed hash shows that they are out of date."""
    scenario, engine = result.scenario, study.evaluator.engine
    layout, tried = result.best.layouts[0], min(result.effort.tried, len(result.places))
    return (
        f"Engine `{engine.version}`, scenario hash `{scenario.content_hash[:12]}`. "
        f"{result.searched_blasts:,} blasts of a search at {tried} of the places.\n"
        f"The best found is of {pieces_text(layout)}."
    )


def elsewhere_text(result: ItemResult) -> str:
    """Return the table of reductions at all places by the best layout for each place."""
    own = np.diag(result.elsewhere)
    cells = [
        (f"best for place {number}", *(f"{_PERCENT * value:.1f} %" for value in row))
        for number, row in enumerate(result.elsewhere, start=1)
    ]
    headers = ("layout", *(f"at place {number}" for number in range(1, len(own) + 1)))
    return (
        f"A layout for one place of the charge loses up to {_PERCENT * result.loss_elsewhere:.1f} "
        f"points at another one:\n\n{markdown_table(headers, cells)}"
    )


def joint_rows(results: Sequence[ItemResult]) -> list[tuple[str, ...]]:
    """Return the points by which each rule falls short of the best found in each scenario."""
    names = dict.fromkeys(rule.name for result in results for rule in result.task.rules)
    rows = []
    for name in names:
        losses = [result.rule_loss(name) for result in results]
        rows.append((name, *("-" if x is None else f"{_PERCENT * x:.1f}" for x in losses)))
    return rows


def hidden_title(effort: Effort) -> str:
    """Return the title of the hidden task."""
    return f"charge hidden: one layout for {effort.seeds} threats"


def visible_title(effort: Effort) -> str:
    """Return the title of the visible task."""
    return (
        f"charge visible: a layout for each of {effort.charges} charges, "
        f"{effort.realisations} blasts each"
    )


def picture_path(folder: Path, name: str) -> Path:
    """Return the path of a scenario's picture."""
    return folder / f"scenario_{name}.png"


def origin(study: DifficultyStudy) -> str:
    """Return the origin of the figures; a changed hash shows that they are out of date."""
    scenario, evaluator = study.evaluator.scenario, study.evaluator
    return (
        f"Preset `{scenario.simulation.preset}`, calibration `{evaluator.calibration_name}`, "
        f"engine `{evaluator.engine.name}`, scenario hash `{scenario.content_hash[:12]}`."
    )


def row(outcome: WayOutcome) -> tuple[str, ...]:
    """Return the cells of a row of the tables."""
    reduction = outcome.reduction
    value, low, high = (f"{_PERCENT * each:.0f}" for each in reduction)
    text = "-" if reduction.low == reduction.high == 0.0 else f"{value} % ({low} to {high})"
    if outcome.spread > 0.0:
        text += f", ± {_PERCENT * outcome.spread:.0f}"
    return (
        outcome.name,
        f"{outcome.modules:.3g}",
        f"{outcome.mean_pa_s.value:,.0f}",
        text,
        f"{outcome.worst_pa_s:,.0f}",
        f"{outcome.cvar_pa_s:,.0f}",
    )


def print_result(title: str, result: TaskResult) -> None:
    """Print the table of a task."""
    print_table(title, _HEADERS, [row(outcome) for outcome in result.rows])


def print_table(title: str, headers: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table."""
    table = ResultTable(title, headers)
    for cells in rows:
        table.add_row(*cells)
    result_console().print(table)


def print_verdict(criteria: Sequence[Criterion]) -> None:
    """Print each criterion with its finding, and the verdict."""
    for criterion in criteria:
        sign = "met    " if criterion.met else "NOT MET"
        print_line(f"{sign} {criterion.text}: {criterion.finding}")
    print_line(verdict(criteria), style="bold")


def verdict(criteria: Sequence[Criterion]) -> str:
    """Return in a sentence whether all criteria are met."""
    met = sum(criterion.met for criterion in criteria)
    if met == len(criteria):
        return "It matters where the barrier stands: all criteria are met."
    return f"{met} of {len(criteria)} criteria are met."


def markdown(title: str, result: TaskResult) -> str:
    """Return the table of a task for the page."""
    return markdown_table_with_title(
        title.capitalize(), _HEADERS, [row(outcome) for outcome in result.rows]
    )


def markdown_table_with_title(
    title: str, headers: Sequence[str], rows: Sequence[Sequence[str]]
) -> str:
    """Return a table for the page, under its title."""
    return f"**{title}.**\n\n{markdown_table(headers, rows)}"


def markdown_verdict(criteria: Sequence[Criterion]) -> str:
    """Return the verdict for the page, with the criteria that are not met."""
    missed = [
        f"- not met: {each.text}\n- found: {each.finding}" for each in criteria if not each.met
    ]
    return "\n".join([verdict(criteria), *([""] if missed else []), *missed])


def tables_path(folder: Path, name: str) -> Path:
    """Return the path of a scenario's tables."""
    return folder / f"scenario_{name}.txt"


def write_tables(folder: Path, name: str, text: str) -> Path:
    """Write the tables of a scenario for the page; return the path."""
    path = tables_path(folder, name)
    with write_atomically(path) as temporary:
        temporary.write_text(f"{text}\n", encoding="utf-8")
    return path


if __name__ == "__main__":
    typer.run(main)
