"""`blast-env report`: the report of an engineer to a client."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from blast_env.cli.command import writes
from blast_env.cli.options import (
    CHARGE,
    CacheOption,
    MassErrorOption,
    ProcessesOption,
    ScenarioArgument,
    TargetOption,
    numbers,
    resume_words,
)
from blast_env.cli.output import InterruptedCommandError, blasts_running, print_written, resumable
from blast_env.errors import BlastEnvError, value_text
from blast_env.gas.settings import CELLS, UNIFORM, Cells
from blast_env.layout import check_layout, load_layout
from blast_env.response.levels import LevelOfProtection
from blast_env.site import Scenario, load_scenario
from blast_env.site.blast_site import Charge
from blast_env.values import plain_number

if TYPE_CHECKING:
    from blast_env.answers.report import StudyOptions

_CellsOption = Annotated[
    tuple[str, str] | None,
    typer.Option(
        help="Sides of the cells of gas dynamics, m, or coarse fine, which grow; the same twice is "
        "one size, without a grid error.",
        metavar="COARSE FINE",
        show_default="0.5 0.25; coarse fine on sites wider than 40 m",
    ),
]
_DetailsOption = Annotated[
    Path | None,
    typer.Option(help="TOML file with project, client, author, checker, revision and marking."),
]


def report(
    context: typer.Context,
    scenario: ScenarioArgument,
    layout: Path = typer.Option(help="JSON file of the layout."),
    out: Path = writes("The page to write", ".html", ".htm", default=...),
    pdf: Path | None = writes("The same as PDF", ".pdf"),
    charges: list[str] = typer.Option(
        [],
        "--charge",
        help="A threat, site metres and kg TNT; may be given again.",
        metavar=CHARGE,
        show_default="of each charge source the worst of its places with the layout",
    ),
    most_threats: int = typer.Option(2, "--threats", help="How many of those, 1 to 6."),
    cells: _CellsOption = None,
    limits: list[str] = typer.Option(
        [],
        "--limit",
        help="Largest permissible load of a building, in Pa s and kPa; one may be left out.",
        metavar="NAME=IMPULSE,PEAK",
    ),
    target: TargetOption = None,
    places: int = typer.Option(5, help="Other places of each charge source."),
    items: bool = typer.Option(True, help="Rank the contribution of each module or piece."),
    mass_error: MassErrorOption = 0.1,
    details: _DetailsOption = None,
    processes: ProcessesOption = 1,
    cache: CacheOption = None,
) -> None:
    """Report on a layout by gas dynamics, as one self-contained HTML page and as PDF.

    The verdict comes first, then the assumptions: site and threats, bill of quantities, loads with
    two sizes of cells, damage, the worth of each item, other places, checks by hand, and everything
    to repeat it. If it is stopped (Ctrl-C) after the loads with the coarser cells, the command
    writes the parts finished so far.
    """
    site = load_scenario(scenario)
    elements = load_layout(layout, site)
    # Here, because reports need extras, and Numba half a second.
    from blast_env.answers import report as reports

    reports.check_targets(out, pdf)
    options = _study_options(site, context.params)
    given = reports.ReportDetails.read(details)
    check_layout(site, elements)
    cost = reports.StudyPlan(site, tuple(elements), options).cost()
    resume = resume_words(cache)
    if cache is not None:
        resume = f"{resume}, and draws the threats again"
    coarse, fine = options.engines
    label, words = f"report on {site.name}", f"{coarse.describe()} and {fine.cell_words}"
    running = blasts_running(label, words, cost.blasts, drawn=cost.drawn)
    with resumable(resume), running as progress:

        def tell(label: str, part: float) -> None:
            share = cost.share(label, part)
            if share is not None:
                progress(share)

        found = reports.run_report(site, elements, options, tell)
    print_written(reports.write_report(found, out, pdf, given))
    if stopped := found.study.stopped:
        raise InterruptedCommandError(f"{out} has the parts finished before: {stopped}", resume)


def _study_options(scenario: Scenario, values: Mapping[str, Any]) -> "StudyOptions":
    """Return the options of the study from the values of the command line, by their names."""
    from blast_env.answers.report import Limit, StudyOptions, final_cells

    given = {own.name: values[own.name] for own in fields(StudyOptions)}
    given |= {
        "charges": tuple(_charge(text, scenario) for text in values["charges"]),
        "limits": tuple(Limit.parsed(text) for text in values["limits"]),
        "cells": final_cells(scenario),
    }
    if values["cells"]:
        given["cells"] = tuple(_cells(text) for text in values["cells"])
    if values["target"] is not None:
        given["target"] = LevelOfProtection.named(values["target"])
    return StudyOptions(**given)


def _charge(given: str, scenario: Scenario) -> Charge:
    """Return the charge of an option, as high as the scenario's sources of that mass, or all.

    Without a mass, it is the one of the scenario's sources.
    """
    x_m, y_m, *own_kg = numbers("--charge", given, CHARGE)
    masses_kg = {source.tnt_kg for source in scenario.charge}
    if not own_kg and len(masses_kg) > 1:
        raise BlastEnvError(
            f"--charge is {x_m:g},{y_m:g} without a mass, but the scenario has charges of "
            f"{_listed(masses_kg)} kg: say X,Y,KG"
        )
    mass_kg = own_kg[0] if own_kg else min(masses_kg)
    alike = [source for source in scenario.charge if source.tnt_kg == mass_kg]
    heights_m = {source.height_m for source in alike or scenario.charge}
    if len(heights_m) > 1:
        raise BlastEnvError(
            f"--charge is {given}, but the scenario has charges {_listed(heights_m)} m high: leave "
            "those of one height in a file of their own"
        )
    return Charge((x_m, y_m), mass_kg, min(heights_m))


def _listed(values: Iterable[float]) -> str:
    return ", ".join(f"{value:g}" for value in sorted(values))


def _cells(text: str) -> Cells:
    """Return the cells of a text: a side, m, or the name of growing cells."""
    with suppress(BlastEnvError):
        return plain_number("--cells", text)
    growing = [name for name in CELLS if name != UNIFORM]
    if text not in growing:
        known = ", ".join(growing)
        raise BlastEnvError(f"--cells is {value_text(text)}, must be a length in m, or {known}")
    return text
