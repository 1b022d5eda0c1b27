"""The printed verdict of `blast-env assess`, its table and its pictures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from blast_env.cli.output import (
    print_answer,
    print_cost,
    print_line,
    print_written,
    progress_bar,
    save_figures,
)
from blast_env.evaluation.answers import charge_text, counted
from blast_env.evaluation.assessment import Assessed, assess
from blast_env.evaluation.consequences import (
    BAY_CASE_COLUMNS,
    CASE_COLUMNS,
    BuildingResponse,
    bay_table,
    piece_table,
)
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.engines.pieces import PIECE_COLUMNS
from blast_env.evaluation.governing import governing
from blast_env.geometry import Layout
from blast_env.provenance import versions
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import AnyCharge, Scenario
from blast_env.tables import write_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def print_assessment(
    scenario: Scenario,
    layouts: Mapping[str, Layout],
    charges: Sequence[AnyCharge],
    engine: Engine,
    target: LevelOfProtection,
    required: Sequence[Requirement],
    mass_error: float,
    *,
    without_fallen: bool,
    cache: Path | None,
) -> Assessed:
    """Run the blasts, print the verdict, and write the files that are asked for."""
    print_line(engine.describe([scenario]))
    asked = [(engine, each) for each in charges] + [(engine.coarser, charges[0])]
    print_cost((each, scenario, charge) for each, charge in asked for _ in layouts)
    with progress_bar(counted(len(charges))) as progress:
        assessed = assess(
            *(scenario, layouts, charges, engine, progress),
            without_fallen=without_fallen,
            cache=cache,
        )
    print_answer(assessed.answer(target, mass_error, required))
    return assessed


def write_table(assessed: Assessed, path: Path, engine: Engine) -> None:
    """Write the table of the bays; a workbook also holds the barrier's pieces."""
    bays, pieces = bay_table(assessed.found), piece_table(assessed.found)
    if path.suffix.lower() == ".csv":
        print_written([write_csv(bays, path)])
        return
    from blast_env.particles.workbook import SheetTable, write_tables

    tables = [SheetTable("Bays", bays, BAY_CASE_COLUMNS)]
    if len(pieces):
        tables.append(SheetTable("Pieces", pieces, (*CASE_COLUMNS, *PIECE_COLUMNS)))
    record: dict[str, str | int | float] = {
        "scenario": assessed.scenario.name,
        "scenario hash": assessed.scenario.content_hash,
        "engine": engine.words,
        "engine version": engine.version,
        "blast-env version": versions(engine.version)["blast_env"],
    }
    print_written([write_tables(record, tables, path, f"Bays of {assessed.scenario.name}")])


def draw(assessed: Assessed, picture: Path | None, view: Path | None, diagram: Path | None) -> None:
    """Draw the facades, the site, and the pressure-impulse diagram under the worst charge."""
    rows = _worst_rows(assessed) if picture or view or diagram else []

    def title() -> str:
        building = rows[0][1].building
        return (
            f"{assessed.scenario.title_of(building)}: {charge_text(rows[0][1].charge)}, the worst"
        )

    def facades() -> "Figure":
        from blast_env.plots.facade import facade_picture

        return facade_picture(rows, title())

    def pressure_impulse() -> "Figure":
        from blast_env.plots.pressure_impulse import pressure_impulse_diagram

        return pressure_impulse_diagram([(name, each.facade) for name, each in rows], title())

    def site() -> "Figure":
        from blast_env.plots.facade import damage_view

        worst = rows[0][1]
        number = assessed.found[rows[0][0]].of(worst.building).index(worst)
        views = [
            (name, assessed.layouts[name], [each.of(b)[number] for b in each.buildings])
            for name, each in assessed.found.items()
        ]
        words = f"{assessed.scenario.name}: {charge_text(worst.charge)}, the worst"
        return damage_view(assessed.scenario, views, words)

    print_written(save_figures((picture, facades), (diagram, pressure_impulse), (view, site)))


def _worst_rows(assessed: Assessed) -> list[tuple[str, BuildingResponse]]:
    """Return the governing building and charge of the judged layout, one row per layout."""
    responses = assessed.judged.responses
    number = responses.index(governing(responses, lambda each: each.severity))
    return [(name, each.responses[number]) for name, each in assessed.found.items()]
