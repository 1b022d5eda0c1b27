"""Whether it matters where the barrier stands, for docs/studies/scenarios.md.

For every bundled scenario with a build zone: no barrier, random layouts, a hand-made wall at three
distances and the best of many random layouts, on held-out seeds; once with one layout for all
threats, once with a layout for each charge. Prints the tables and a verdict, writes both between
the markers of the page, and draws a picture of each scenario with the best layout for all threats.
"""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Annotated, Final

import typer

from blast_env import load_scenario
from blast_env.cli.cluster import ClusterAddress, running_on
from blast_env.cli.output import make_table, print_line, progress_bar, result_console, user_errors
from blast_env.errors import BlastEnvError
from blast_env.evaluation import evaluate_against
from blast_env.files import write_atomically
from blast_env.rendering.figures import save_figure
from blast_env.scenario import Scenario, bundled_scenarios
from scripts.difficulty_figure import difficulty_figure
from scripts.difficulty_outcomes import Outcome, TaskResult
from scripts.difficulty_study import Effort, Study
from scripts.difficulty_verdict import Criterion, difficulty_criteria

PAGE: Final = Path("docs/studies/scenarios.md")
PICTURES: Final = Path("docs/pictures")

_HEADERS: Final = (
    "layout",
    "modules",
    "impulse (Pa s)",
    "reduction (95 % interval)",
    "worst threat (Pa s)",
    "CVaR (Pa s)",
)
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
    engine: str = "event",
    processes: Annotated[int, typer.Option(min=1, help="Worker processes.")] = 2,
    cluster: ClusterAddress = None,
    page: Annotated[Path, typer.Option(help="The page with the markers.")] = PAGE,
    pictures: Annotated[Path, typer.Option(help="Folder for the pictures.")] = PICTURES,
) -> None:
    """Run the study and bring page and pictures up to date."""
    effort = Effort(layouts=layouts, seeds=seeds, charges=charges, realisations=realisations)
    with user_errors(), running_on(cluster):
        scenarios = [load_scenario(name) for name in names or studied_scenarios()]
        for scenario in scenarios:  # before the blasts, so that no result is lost
            with_section(read_page(page), scenario.name, "")
        pictures.mkdir(parents=True, exist_ok=True)
        print_line(f"{len(scenarios)} scenarios, at most {effort.blasts:,} blasts each")
        for scenario in scenarios:
            study_scenario(scenario, effort, engine, processes, page, pictures)


def studied_scenarios() -> tuple[str, ...]:
    """Return the names of the bundled scenarios in which something can be placed."""
    return tuple(name for name in bundled_scenarios() if load_scenario(name).build_zone is not None)


def study_scenario(
    scenario: Scenario, effort: Effort, engine: str, processes: int, page: Path, pictures: Path
) -> None:
    """Study one scenario: print, write its section of the page, draw its picture."""
    start = perf_counter()
    with progress_bar(scenario.name) as progress:
        study = Study(scenario, effort, engine, processes, progress)
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
    text = with_section(read_page(page), scenario.name, "\n\n".join(parts))
    with write_atomically(page) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print_line(
        f"{study.evaluator.blasts:,} blasts, {perf_counter() - start:.0f} s; wrote {page} and "
        f"{picture_path(pictures, scenario.name)}\n"
    )


def hidden_title(effort: Effort) -> str:
    """Return what the hidden task is."""
    return f"charge hidden: one layout for {effort.seeds} threats"


def visible_title(effort: Effort) -> str:
    """Return what the visible task is."""
    return (
        f"charge visible: a layout for each of {effort.charges} charges, "
        f"{effort.realisations} blasts each"
    )


def picture_path(folder: Path, name: str) -> Path:
    """Return where the picture of a scenario is."""
    return folder / f"scenario_{name}.png"


def origin(study: Study) -> str:
    """Return what the figures were made with; the hash tells when they are out of date."""
    scenario, evaluator = study.evaluator.scenario, study.evaluator
    return (
        f"Preset `{scenario.simulation.preset}`, calibration `{evaluator.calibration_name}`, "
        f"engine `{evaluator.engine.name}`, scenario hash `{scenario.content_hash[:12]}`."
    )


def row(outcome: Outcome) -> tuple[str, ...]:
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
    table = make_table(title, _HEADERS)
    for outcome in result.rows:
        table.add_row(*row(outcome))
    result_console().print(table)


def print_verdict(criteria: Sequence[Criterion]) -> None:
    """Print what the scenario has of what it must have."""
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
    rows = [_HEADERS, ("---", *["---:"] * (len(_HEADERS) - 1)), *map(row, result.rows)]
    table = [f"| {' | '.join(cells)} |" for cells in rows]
    return "\n".join([f"**{title.capitalize()}.**", "", *table])


def markdown_verdict(criteria: Sequence[Criterion]) -> str:
    """Return the verdict for the page."""
    found = [
        f"- {'met' if each.met else '**not met**'}: {each.text}; found: {each.finding}"
        for each in criteria
    ]
    return "\n".join([verdict(criteria), "", *found])


def read_page(path: Path) -> str:
    """Return the text of the page.

    Raises:
        BlastEnvError: If there is none.
    """
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise BlastEnvError(f"{path}: cannot be read: {error.strerror or error}") from error


def with_section(page: str, name: str, text: str) -> str:
    """Return a page with other text between the markers of a scenario.

    Raises:
        BlastEnvError: If the page does not have them.
    """
    begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->"
    before, found, rest = page.partition(begin)
    _, found_end, after = rest.partition(end)
    if not (found and found_end):
        raise BlastEnvError(f"{name}: the page has no lines {begin.strip()!r} and {end!r}")
    return f"{before}{begin}{text}\n{end}{after}"


if __name__ == "__main__":
    typer.run(main)
