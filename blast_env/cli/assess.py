"""`blast-env assess`: the damage of buildings by charges; stand-offs, and largest charges."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from blast_env.answers.assess import (
    assessment,
    capacity_answer,
    facade_figure,
    governing,
    pressure_impulse_figure,
)
from blast_env.answers.screening import screening_answer
from blast_env.answers.terminal import print_line, print_parts
from blast_env.atlas import Laws, packaged_laws
from blast_env.cli.command import PICTURES, writes
from blast_env.cli.options import (
    CacheOption,
    ChargeInput,
    ChargeOption,
    DrawsOption,
    FinalCellOption,
    FinalCellsOption,
    GlazingOption,
    LayoutOption,
    MassErrorOption,
    RequireOption,
    ScenarioArgument,
    TargetOption,
    TntOption,
    WallOption,
    refuse_given,
    resume_words,
    wanted_level,
)
from blast_env.cli.output import blasts_running, print_written, resumable, save_figures
from blast_env.errors import BlastEnvError
from blast_env.evaluation import LoadCase
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines import JUDGE, Engine, final_engine
from blast_env.evaluation.questions.capacity import MOST_BLASTS
from blast_env.evaluation.questions.capacity import capacity as capacity_of
from blast_env.evaluation.questions.screening import Screening
from blast_env.evaluation.questions.screening import screen as screen_site
from blast_env.evaluation.questions.verdict import (
    Consequences,
    bay_table,
    check_facades,
    consequences_by_layout,
    consequences_of,
)
from blast_env.geometry import Layout, layout_counts
from blast_env.layout import load_layout
from blast_env.response.levels import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import Scenario, load_scenario
from blast_env.site.sources import (
    CHARGE_PRESETS,
    EQUIVALENTS_SOURCE,
    PRESETS_SOURCE,
    TNT_EQUIVALENTS,
    MassPreset,
)
from blast_env.tables import write_csv
from blast_env.values import count_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SCREEN: Final = "With --screen"
_MASS_HELP: Final = (
    f"Charge at every place of the site's charges: {', '.join(CHARGE_PRESETS)}, or "
    f"NAME=KG[,EXPLOSIVE] with {', '.join(TNT_EQUIVALENTS)}; else the site's own. May be repeated."
)
_OF_SCREENING: Final = ("mass", "gas", "shielding")
_OF_DRAWN_CHARGES: Final = ("target", "charges", "mass_error", "charge", "tnt_kg", "cache")
_OF_ASSESSMENT: Final = ("without_fallen", "diagram", "table")
_NOT_OF_CAPACITY: Final = (*_OF_ASSESSMENT, "require", "target", "mass_error", "picture")

_ScreenOption = Annotated[
    bool,
    typer.Option(
        "--screen",
        help="Print only level of protection and stand-offs by the curves in the open, in "
        "seconds, without a blast.",
    ),
]
_CapacityOption = Annotated[
    bool,
    typer.Option(
        "--capacity",
        help="Print only the largest charge at each place, and the least stand-off, that keep "
        "each level.",
    ),
]
_WithoutFallenOption = Annotated[
    bool,
    typer.Option(
        "--without-fallen",
        help="Remove pieces that overturn before the blast is over, and run it again.",
    ),
]
_GasOption = Annotated[
    bool,
    typer.Option(
        "--gas", help="Gas dynamics of each worst place, for comparison.", rich_help_panel=_SCREEN
    ),
]
_ShieldingOption = Annotated[
    bool,
    typer.Option(
        "--shielding/--no-shielding",
        help="Change loads by what stands around, by the atlas of shielding.",
        rich_help_panel=_SCREEN,
    ),
]


def assess(
    context: typer.Context,
    scenario: ScenarioArgument,
    layout: LayoutOption = None,
    screen: _ScreenOption = False,
    capacity: _CapacityOption = False,
    target: TargetOption = None,
    charges: DrawsOption = 16,
    cell_m: FinalCellOption = None,
    cells: FinalCellsOption = None,
    mass_error: MassErrorOption = 0.1,
    without_fallen: _WithoutFallenOption = False,
    require: RequireOption = None,
    glazing: GlazingOption = None,
    wall: WallOption = None,
    picture: Path | None = writes(
        "Picture of the facades under the worst charge; of the stand-offs as rings (--screen)",
        *PICTURES,
    ),
    diagram: Path | None = writes("Pressure-impulse diagram with every bay on it", *PICTURES),
    table: Path | None = writes("Table of every bay under every charge", ".csv"),
    charge: ChargeOption = None,
    tnt_kg: TntOption = None,
    cache: CacheOption = None,
    mass: list[str] = typer.Option(
        [],
        help=_MASS_HELP,
        rich_help_panel=_SCREEN,
    ),
    gas: _GasOption = False,
    shielding: _ShieldingOption = True,
) -> None:
    """Assess the damage of buildings by charges: panes, panels, level of protection.

    Gas dynamics runs one blast per charge, with and without the layout; the barrier is judged as
    well. A structure needs a facade in the scenario file; one without is judged as an ordinary
    house. The effect of better glass needs no further blast, and is printed as well. The worst
    charge runs on cells twice as large as well: the difference gives the grid error.

    --screen takes Kingery and Bulmash's loads in the open by angle of incidence, and the atlas of
    shielding for walls, rows, streets, courts and shadows.
    --capacity runs a few blasts at each place, with other masses and stand-offs.
    """
    if screen and capacity:
        raise BlastEnvError("--screen and --capacity exclude each other")
    site = load_scenario(scenario).with_facades(glazing, wall)
    required = [Requirement.parsed(own) for own in require or ()]
    elements = () if layout is None else tuple(load_layout(layout, site))
    engine = final_engine(JUDGE, [site], cell_m, cells=cells)
    if screen:
        refuse_given(context, _OF_DRAWN_CHARGES + _OF_ASSESSMENT, "does not apply to --screen")
        atlas = packaged_laws() if shielding else None
        _screen(site, elements, mass, required, engine if gas else None, picture, atlas)
        return
    refuse_given(context, _OF_SCREENING, "is for --screen")
    layouts: dict[str, Layout] = {"no barrier": ()}
    if layout is not None:
        layouts[layout_counts(elements, "barrier")] = elements
    threats = ChargeInput.of(charge, tnt_kg).threats(site, charges)
    campaign = Campaign.on(site, layouts, threats, engine, engine.coarser, cache)
    level = wanted_level(target, site, LevelOfProtection.LOW)
    if capacity:
        refuse_given(context, _NOT_OF_CAPACITY, "does not apply to --capacity")
    with resumable(resume_words(cache)):
        if capacity:
            _capacity(campaign)
            return
        check_facades(site, engine)
        found = _damage(replace(campaign, without_fallen=without_fallen))
        print_parts(assessment(*found, level, mass_error, required))
    _write(site, found[1], picture, diagram, table)


def _damage(campaign: Campaign) -> tuple[Blasts, dict[str, Consequences]]:
    """Return the blasts of a campaign, and the consequences of each layout."""
    label = count_of("charge", len(campaign.case.threats))
    words = campaign.evaluator.engine.describe([campaign.scenario])
    with blasts_running(label, words, campaign.cost()) as progress:
        blasts = campaign.run(progress, worst=governing)
    return blasts, consequences_by_layout(blasts)


def _write(
    site: Scenario,
    consequences: dict[str, Consequences],
    picture: Path | None,
    diagram: Path | None,
    table: Path | None,
) -> None:
    """Write the table and the pictures of the command line."""
    written = [] if table is None else [write_csv(bay_table(consequences), table)]
    drawings = (picture, facade_figure), (diagram, pressure_impulse_figure)
    figures = ((path, partial(draw, site, consequences)) for path, draw in drawings)
    print_written([*written, *save_figures(*figures)])


def _capacity(campaign: Campaign) -> None:
    """Print the largest charges and the least stand-offs that keep each level."""
    site, evaluator = campaign.scenario, campaign.evaluator
    charges = [threat.charge for threat in campaign.case.threats]
    costs = replace(campaign, coarser=None).cost() * MOST_BLASTS
    label = f"{site.name}: masses and stand-offs"
    with blasts_running(label, evaluator.engine.describe([site]), costs) as progress:
        found = capacity_of(evaluator, campaign.layouts, charges, progress)
    print_parts(capacity_answer(site, found))


def _screen(
    scenario: Scenario,
    layout: Layout,
    masses: Sequence[str],
    required: Sequence[Requirement],
    engine: Engine | None,
    picture: Path | None,
    atlas: Laws | None,
) -> None:
    """Print the level of protection of each facade, and the stand-off that each level needs."""
    level = scenario.objective.level or LevelOfProtection.LOW
    required = required or [Requirement.of_level(level)]
    named = [MassPreset.parsed(mass) for mass in masses]
    found = screen_site(scenario, layout, named, atlas)
    beside = {} if engine is None else _by_gas(scenario, layout, found, engine)
    print_parts(screening_answer(scenario, layout, found, required, beside))
    if named:
        print_line(f"presets: {PRESETS_SOURCE}")
    if any("," in mass for mass in masses):
        print_line(f"TNT equivalents: {EQUIVALENTS_SOURCE}")
    if engine is None:
        print_line("--gas shows by how much that matters at each worst place")

    def rings() -> "Figure":
        from blast_env.plots.screening import screening_picture

        return screening_picture(scenario, layout, found)

    print_written(save_figures((picture, rings)))


def _by_gas(
    scenario: Scenario, layout: Layout, found: Screening, engine: Engine
) -> dict[str, Consequences]:
    """Return the consequences of each worst place by gas dynamics."""
    threats = [LoadCase(threat.charge, name=threat.name) for threat in found.threats]
    campaign = Campaign.on(scenario, {"": layout}, threats, engine)
    label = f"{len(threats)} blasts"
    with blasts_running(label, engine.describe([scenario]), campaign.cost()) as progress:
        blasts = campaign.run(progress)
    return {own.name: consequences_of(blasts.under([k])) for k, own in enumerate(threats)}
