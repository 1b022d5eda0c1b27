"""Pictures of the sites with a response objective: `python -m studies.response_sites`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Final

import typer

from blast_env.cli.output import print_line, user_errors
from blast_env.design.search.registry import layouts_by_rule
from blast_env.evaluation import BlastEvaluator, LoadCase, draw_threats
from blast_env.evaluation.cases import one_of_each_charge
from blast_env.files import make_folder
from blast_env.geometry import layout_words
from blast_env.layout import LayoutState, load_layout
from blast_env.layout.build_scene import charge_against
from blast_env.plots.facade import LEVEL_COLOURS
from blast_env.plots.figures import save_figure
from blast_env.plots.plan import INK, PROTECTED, charge_feature, site_features, vehicle_features
from blast_env.plots.site_plan import (
    draw_plan,
    legend_of,
    write_heading,
    write_legend,
    write_names,
)
from blast_env.plots.style import render_extra, unit_interval
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.damage import fails_from, worst
from blast_env.site import Scenario, load_scenario

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SITES: Final = ("clinic_front", "guard_post", "school_wing", "ministry_kerb")
PICTURES: Final = Path("docs/pictures")
FOUND: Final = Path(__file__).parent.parent / "docs" / "data" / "best_found"

_DRAWS: Final = 16

_WIDTH_IN: Final = 13.5
_PLAN_SHARE: Final = 0.55
_ROW_IN: Final = 0.36

SomeSites = Annotated[list[str] | None, typer.Argument(help="All of them unless given.")]


def main(
    sites: SomeSites = None,
    folder: Annotated[Path, typer.Option(help="Folder for the pictures.")] = PICTURES,
) -> None:
    """Draw the layout found for each site, and the damage with it, with rules and with none."""
    with user_errors():
        make_folder(folder)
        for name in sites or SITES:
            picture = folder / f"scenario_{name}.png"
            print_line(f"wrote {save_figure(damage_figure(load_scenario(name)), picture)}")


def damage_figure(scenario: Scenario) -> Figure:
    """Return the plan of the layout found, beside a chart of the damage with each layout.

    The damage is the worst one on cells of 0.5 m, with sharpened peaks, as in searches.
    """
    found = load_layout(FOUND / f"{scenario.name}.json", scenario)
    layouts = {"no layout": (), **layouts_by_rule(scenario), "found": found}
    threats, evaluator = _threats(scenario), BlastEvaluator(scenario, "gas")
    damages = {
        f"{name}, cost {LayoutState(scenario, layout).cost:g}": worst(
            load.worst_damage or 0.0
            for threat in threats
            for load in evaluator.loads(layout, threat).protected
        )
        for name, layout in layouts.items()
    }
    site = scenario.site
    plan_in = _PLAN_SHARE * _WIDTH_IN * site.height_m / site.width_m
    height_in = max(plan_in, _ROW_IN * len(damages) + 0.8) + 1.9
    figure = Figure(figsize=(_WIDTH_IN, height_in), layout="constrained")
    plan, chart = figure.subplots(1, 2, width_ratios=(_PLAN_SHARE, 1.0 - _PLAN_SHARE))
    charges = [charge_against(scenario, found, threat.charge) for threat in threats]
    features = (
        *site_features(scenario, found),
        *vehicle_features(scenario, found),
        *(charge_feature(each, "charge") for each in charges),
    )
    draw_plan(plan, features)
    _draw_damages(chart, damages, _target(scenario))
    write_legend(figure, legend_of(features))
    cost, budget = LayoutState(scenario, found).cost, scenario.zone.budget
    write_heading(
        figure,
        f"{scenario.name}: {_target(scenario).label} costs {cost:g} of {budget:g}",
        layout_words(found),
    )
    write_names(plan, features)
    return figure


def _draw_damages(axes: Axes, damages: Mapping[str, float], target: LevelOfProtection) -> None:
    """Draw one row per layout over one band per level; the target's limit is dashed."""
    for level in LevelOfProtection:
        begin = float(LevelOfProtection.HIGH - level)
        axes.axvspan(begin, begin + 1.0, color=LEVEL_COLOURS[level], alpha=0.45, lw=0.0, zorder=0)
        axes.text(begin + 0.5, len(damages) - 0.35, level.label, ha="center", fontsize=7.5)
    axes.axvline(fails_from(target), color="black", linestyle="--", linewidth=1.2)
    rows = range(len(damages))
    *others, found = damages.values()
    axes.plot(others, rows[:-1], "o", color=unit_interval(INK), markersize=8)
    axes.plot(found, rows[-1], "D", color=unit_interval(PROTECTED), markersize=9)
    axes.set_yticks(rows, list(damages))
    axes.set_ylim(-0.6, len(damages) - 0.05)
    axes.set_xlim(0.0, fails_from(LevelOfProtection.BELOW_STANDARDS))
    axes.set_xlabel(f"worst damage, cells of 0.5 m; {target.label} is left of the dashed line")
    axes.spines[["top", "right"]].set_visible(False)


def _threats(scenario: Scenario) -> tuple[LoadCase, ...]:
    return one_of_each_charge(draw_threats(scenario, range(_DRAWS)))


def _target(scenario: Scenario) -> LevelOfProtection:
    target = scenario.objective.level
    assert target is not None
    return target


if __name__ == "__main__":
    typer.run(main)
