"""`blast-env assess`: the damage of buildings by charges; stand-offs, and largest charges."""

from pathlib import Path
from typing import Final

import typer

from blast_env.cli.assessment import draw, print_assessment, write_table
from blast_env.cli.capacity import print_capacity
from blast_env.cli.command import writes
from blast_env.cli.options import (
    CacheOption,
    ChargeOption,
    DrawsOption,
    FinalCellOption,
    FinalCellsOption,
    GivenCharge,
    LayoutOption,
    MassErrorOption,
    RequireOption,
    ScenarioArgument,
    TargetOption,
    TntOption,
    refuse_given,
    resume_words,
    wanted_level,
)
from blast_env.cli.output import resumable
from blast_env.cli.screening import print_screening
from blast_env.cli.targets import PICTURES
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import JUDGE
from blast_env.evaluation.grid_error import final_engine
from blast_env.evaluation.probability import Uncertainty
from blast_env.evaluation.screening import facades_for
from blast_env.geometry import Layout, layout_counts
from blast_env.layout import load_layout
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import load_scenario
from blast_env.site.presets import CHARGE_PRESETS, TNT_EQUIVALENTS

_SCREEN: Final = "With --screen"
_MASS_HELP: Final = (
    f"Charge at every place of the site's charges: {', '.join(CHARGE_PRESETS)}, or "
    f"NAME=KG[,EXPLOSIVE] with {', '.join(TNT_EQUIVALENTS)}; else the site's own. May be repeated."
)
_OF_SCREENING: Final = ("mass", "gas")
_OF_DRAWN_CHARGES: Final = ("target", "charges", "mass_error", "charge", "tnt_kg", "cache")
_OF_ASSESSMENT: Final = ("without_fallen", "view", "diagram", "table")


def assess(
    context: typer.Context,
    scenario: ScenarioArgument,
    layout: LayoutOption = None,
    screen: bool = typer.Option(
        False,
        "--screen",
        help="Print only level of protection and stand-offs by the curves in the open, in "
        "seconds, without a blast.",
    ),
    capacity: bool = typer.Option(
        False,
        "--capacity",
        help="Print only the largest charge at each place, and the least stand-off, that keep "
        "each level.",
    ),
    target: TargetOption = None,
    charges: DrawsOption = 16,
    cell_m: FinalCellOption = None,
    cells: FinalCellsOption = None,
    mass_error: MassErrorOption = 0.1,
    without_fallen: bool = typer.Option(
        False,
        "--without-fallen",
        help="Remove pieces that overturn before the blast is over, and run it again.",
    ),
    require: RequireOption = None,
    glazing: str | None = typer.Option(
        None, help="Windows of protected structures that have no facade, a component."
    ),
    wall: str | None = typer.Option(
        None, help="Walls of protected structures that have no facade, a component."
    ),
    picture: Path | None = writes(
        "Picture of the facades under the worst charge; of the stand-offs as rings (--screen); of "
        "the probability over the mass (--capacity)",
        *PICTURES,
    ),
    view: Path | None = writes(
        "Picture of the site in three dimensions, bays by their damage", *PICTURES
    ),
    diagram: Path | None = writes("Pressure-impulse diagram with every bay on it", *PICTURES),
    table: Path | None = writes("Table of every bay under every charge", ".csv", ".xlsx"),
    charge: ChargeOption = None,
    tnt_kg: TntOption = None,
    cache: CacheOption = None,
    mass: list[str] = typer.Option(
        [],
        help=_MASS_HELP,
        rich_help_panel=_SCREEN,
    ),
    gas: bool = typer.Option(
        False,
        "--gas",
        help="Gas dynamics of each worst place, for comparison.",
        rich_help_panel=_SCREEN,
    ),
) -> None:
    """Assess the damage of buildings by charges: panes, panels, level of protection.

    Gas dynamics runs one blast per charge, with and without the layout; the barrier is judged as
    well. A structure needs a facade in the scenario file; one without is judged as an ordinary
    house. The effect of better glass needs no further blast, and is printed as well. The worst
    charge runs on cells twice as large as well: the difference gives the error of the cells.

    --screen takes Kingery and Bulmash's loads in the open, by angle of incidence and sight.
    --capacity runs a few blasts at each place, with other masses and stand-offs.
    """
    if screen and capacity:
        raise BlastEnvError("--screen and --capacity exclude each other")
    site = facades_for(load_scenario(scenario), glazing, wall)
    required = [Requirement.parsed(each) for each in require or ()]
    layouts: dict[str, Layout] = {"no barrier": ()}
    if layout is not None:
        elements = tuple(load_layout(layout, site))
        layouts[layout_counts(elements, "barrier")] = elements
    if screen:
        refuse_given(context, _OF_DRAWN_CHARGES + _OF_ASSESSMENT, "does not apply to --screen")
        *_, last = layouts.values()
        engine = final_engine(JUDGE, [site], cell_m, cells=cells) if gas else None
        print_screening(site, last, mass, required, engine, picture)
        return
    refuse_given(context, _OF_SCREENING, "is for --screen")
    engine = final_engine(JUDGE, [site], cell_m, cells=cells)
    drawn = GivenCharge.of(charge, tnt_kg).fixed_charges(site, charges)
    level = wanted_level(target, site, LevelOfProtection.LOW)
    if capacity:
        refuse_given(context, (*_OF_ASSESSMENT, "require"), "does not apply to --capacity")
        uncertainty = Uncertainty(mass=mass_error)
        with resumable(resume_words(cache)):
            print_capacity(site, layouts, drawn, engine, level, uncertainty, picture, cache)
        return
    with resumable(resume_words(cache)):
        assessed = print_assessment(
            site,
            layouts,
            drawn,
            engine,
            level,
            required,
            mass_error,
            without_fallen=without_fallen,
            cache=cache,
        )
    if table is not None:
        write_table(assessed, table, engine)
    draw(assessed, picture, view, diagram)
