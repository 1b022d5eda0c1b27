"""Properties of generated sites, and a check by blasts of the criterion that selects them.

The criterion uses lines of sight. Here every site is measured with blasts: by particles, or by gas
dynamics for sites with heights and catalogues. With rejected sites included, all sites that a seed
draws are measured, so that wrong rejections show.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import ceil, inf
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from blast_env.answers.terminal import print_line
from blast_env.arrays import FloatArray
from blast_env.cli.options import ClusterAddress, running_on
from blast_env.cli.output import progress_bar, user_errors
from blast_env.design.search import DesignProblem, layouts_by_rule
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import BlastEvaluator, LoadCaseSet, draw_threats
from blast_env.evaluation.engines.contract import Engine, find_engine
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.plots.figures import save_figure
from blast_env.plots.plan import INK, STANDING, Feature, Kinds, site_features, without
from blast_env.plots.site_plan import draw_plan, legend_of, write_legend
from blast_env.plots.style import unit_interval
from blast_env.rules import random_layout
from blast_env.runner import run_all
from blast_env.site import Scenario, ScenarioError
from blast_env.sites import (
    FAMILIES,
    SITES,
    SiteCriterion,
    SiteMeasures,
    Visibility,
    VisibilityCriterion,
    draw_site,
    visibility_layout,
)
from blast_env.sites.criterion import cut_share_of
from blast_env.sites.ranges import Ranges
from blast_env.values import count_of

LEAST_REDUCTION: Final = 0.15


MOST_REDUCTION: Final = 0.85


LEAST_ADVANTAGE: Final = 0.1
"""By blasts, a site is worth solving if the visibility layout or a rule lowers the load by the
share `LEAST_REDUCTION`, no layout exceeds `MOST_REDUCTION`, and random layouts fall short of the
former by `LEAST_ADVANTAGE` on average."""


QUANTILES: Final = (0.0, 0.1, 0.5, 0.9, 1.0)


@dataclass(frozen=True)
class SiteMeasurement:
    """Results of blasts on a site.

    Attributes:
        accepted: Whether the criterion accepts the site.
        shares: Measures by lines of sight.
        unprotected_pa_s: Impulse on the building without a barrier, Pa*s.
        cut: Share of the lines of sight that each layout cuts: the visibility layout, then the
            random ones (1 + random,).
        reduction: Reduction of the load by each of them, a share (1 + random,).
        rules: Reduction by the layout of each rule, a share, by name.
    """

    accepted: bool
    shares: SiteMeasures
    unprotected_pa_s: float
    cut: FloatArray
    reduction: FloatArray
    rules: Mapping[str, float] = field(default_factory=dict)

    @property
    def made(self) -> float:
        """Largest reduction by a planned layout: the visibility layout, or a rule's."""
        return max(float(self.reduction[0]), *self.rules.values(), -inf)

    @property
    def advantage(self) -> float:
        """Lead of `made` over the mean reduction by random layouts."""
        return float(self.made - self.reduction[1:].mean())

    @property
    def fault(self) -> str:
        """Reason why the site is not worth solving, by blasts; empty if it is."""
        if self.made < LEAST_REDUCTION:
            return "too little to gain"
        if max(self.reduction.max(), self.made) > MOST_REDUCTION:
            return "everything can be gained"
        return "the place does not matter" if self.advantage < LEAST_ADVANTAGE else ""


def measured(
    site: Scenario,
    random_layouts: int,
    threats: int,
    engine: str | Engine,
    criterion: SiteCriterion | None = None,
) -> SiteMeasurement:
    """Measure a site with blasts of charges drawn from its threat.

    Args:
        site: The site.
        random_layouts: Number of random layouts.
        threats: Number of charges, or seeds for particles, per layout.
        engine: Runs the blasts.
        criterion: Accepts or rejects the site; `VisibilityCriterion` by default.
    """
    rng = np.random.default_rng(0)
    lines = Visibility.of(site)
    layouts = [visibility_layout(site, lines)]
    layouts += [random_layout(site, rng) for _ in range(random_layouts)]
    ruled = rule_layouts(site)
    drawn = draw_threats(site, range(threats))
    problem = DesignProblem(BlastEvaluator(site, engine), LoadCaseSet(site, drawn))
    unprotected = problem.load(())
    reduction = {
        layout: 1.0 - problem.load(layout) / unprotected for layout in (*layouts, *ruled.values())
    }
    return SiteMeasurement(
        accepted=(criterion or VisibilityCriterion()).objection(site) is None,
        shares=SiteMeasures.of(site),
        unprotected_pa_s=problem.evaluator.loads((), drawn[0]).protected_impulse_pa_s,
        cut=np.array([cut_share_of(lines, LayoutState(site, layout)) for layout in layouts]),
        reduction=np.array([reduction[layout] for layout in layouts]),
        rules={name: reduction[layout] for name, layout in ruled.items()},
    )


def rule_layouts(site: Scenario) -> dict[str, Layout]:
    """Return the layouts of the rules on a site with a catalogue, by name; else none.

    Rules that place nothing are left out.
    """
    if not site.zone.items:
        return {}
    return {name: layout for name, layout in layouts_by_rule(site).items() if layout}


def drawn_sites(seed: int, ranges: Ranges) -> Iterator[Scenario]:
    """Yield the sites that `generate_site` draws for a seed; it returns the last one."""
    rng = np.random.default_rng(seed)
    while True:
        try:
            site = draw_site(rng, ranges, f"site_{seed}")
        except ScenarioError:  # the parts drawn do not fit together
            continue
        yield site
        if ranges.criterion.objection(site) is None:
            return


def main(
    sites: Annotated[int, typer.Option(min=2, help="Seeds, from 0 on.")] = 40,
    random_layouts: Annotated[int, typer.Option(min=2)] = 50,
    threats: Annotated[int, typer.Option(min=1, help="Charges and seeds a layout.")] = 4,
    processes: int = 2,
    cluster: ClusterAddress = None,
    family: Annotated[str, typer.Option(help="sites, item_sites or large_sites.")] = SITES,
    engine: Annotated[str | None, typer.Option(show_default="event, or gas with items")] = None,
    rejected: Annotated[
        bool, typer.Option(help="Measure what the criterion rejected on the way, too.")
    ] = True,
    preset: str = FAMILIES[SITES].preset,
    calibration: str = FAMILIES[SITES].calibration,
    picture: Annotated[Path | None, typer.Option(help="Where to draw the first twelve.")] = None,
) -> None:
    """Print tables about generated sites, and draw some."""
    with user_errors(), running_on(cluster):
        if family not in FAMILIES:
            raise UnknownNameError("family", family, FAMILIES)
        ranges = FAMILIES[family].changed(preset=preset, calibration=calibration)
        run_by = find_engine(engine or ("event" if family == SITES else "gas"))
        of_seeds = [list(drawn_sites(seed, ranges)) for seed in range(sites)]
        if picture is not None:
            first = [seed[-1] for seed in of_seeds[:12]]
            print_line(f"wrote {save_figure(contact_sheet(first), picture)}")
        asked = of_seeds if rejected else [seed[-1:] for seed in of_seeds]
        drawn = [site for of_seed in asked for site in of_seed]
        measure = partial(
            measured,
            random_layouts=random_layouts,
            threats=threats,
            engine=run_by,
            criterion=ranges.criterion,
        )
        with progress_bar("blasts") as progress:
            results = run_all(measure, drawn, processes, progress=progress)
        print_measured([result for result in results if result.accepted])
        print_agreement(results)


def print_measured(results: Sequence[SiteMeasurement]) -> None:
    """Print the results of blasts on the sites that the criterion accepts."""
    reduction = np.array([result.reduction for result in results])
    columns = {
        "unprotected impulse (Pa s)": np.array([result.unprotected_pa_s for result in results]),
        "reduction by random layouts, mean (%)": 100.0 * reduction[:, 1:].mean(axis=1),
        f"by the best of {reduction.shape[1] - 1} (%)": 100.0 * reduction[:, 1:].max(axis=1),
        "by the visibility layout (%)": 100.0 * reduction[:, 0],
        "by the best of these and of the rules (%)": 100.0
        * np.array([max(x.made, float(x.reduction.max())) for x in results]),
        "advantage of visibility or best rule over random layouts (%)": np.array(
            [100.0 * x.advantage for x in results]
        ),
    }
    print_row("measured with blasts", "least", "10 %", "median", "90 %", "largest")
    print_line("|---" * 6 + "|")
    for name, values in columns.items():
        print_row(name, *(f"{value:.0f}" for value in np.quantile(values, QUANTILES)))


def print_agreement(results: Sequence[SiteMeasurement]) -> None:
    """Print the agreement between lines of sight and blasts."""
    faults = ("", *dict.fromkeys(result.fault for result in results if result.fault))
    print_row("by lines of sight", *(fault or "worth solving by blasts" for fault in faults))
    print_line("|---" * (1 + len(faults)) + "|")
    for label, accepted in (("accepted", True), ("rejected", False)):
        found = [result.fault for result in results if result.accepted is accepted]
        print_row(label, *(str(found.count(fault)) for fault in faults))


def print_row(*cells: str) -> None:
    """Print a row of a Markdown table."""
    print_line(f"| {' | '.join(cells)} |")


_COLUMNS: Final = 4
_PANEL_IN: Final = 3.0
_TITLE_IN: Final = 0.5
_LEGEND_IN: Final = 0.8
_FONT: Final = 12.5
_SCALE_M: Final = 10.0


def contact_sheet(sites: Sequence[Scenario]) -> Figure:
    """Return a picture of sites with the properties in which they differ, four per row.

    Args:
        sites: The sites, at least one.

    Raises:
        BlastEnvError: If there is no site.
    """
    if not sites:
        raise BlastEnvError("sites: there are none, must be at least one")
    rows = ceil(len(sites) / _COLUMNS)
    height_in = rows * (_PANEL_IN + _TITLE_IN) + _LEGEND_IN
    figure = Figure(figsize=(_COLUMNS * _PANEL_IN, height_in))
    figure.set_layout_engine("constrained", h_pad=0.08)
    panels = list(figure.subplots(rows, _COLUMNS, squeeze=False).flat)
    shown: list[Feature] = []
    for axes, site in zip(panels, sites, strict=False):
        features = site_features(site)
        shown += without(features, Kinds.SITE)
        _draw_panel(axes, site, features)
    for axes in panels[len(sites) :]:
        axes.set_visible(False)
    scale = Line2D([], [], color=unit_interval(INK), linewidth=3.0, label=f"{_SCALE_M:g} m")
    write_legend(figure, [*legend_of(shown), scale])
    return figure


def _draw_panel(axes: Axes, site: Scenario, features: Sequence[Feature]) -> None:
    draw_plan(axes, features)
    axes.axis("off")
    axes.set_title(_panel_title(site), fontsize=_FONT, color=unit_interval(INK))
    for feature in features:
        height_m = feature.properties.get("height_m")
        if feature.kind in STANDING and height_m is not None:
            _write(axes, feature, f"{height_m:g} m")
        elif feature.kind is Kinds.ACCESS_WAY and site.zone.access_way is not None:
            _write(axes, feature, f"{site.zone.access_way.width_m:g} m")
    left, bottom = site.site.rectangle_m.grown(-1.0)[:2]
    scale = Line2D([left, left + _SCALE_M], [bottom, bottom], color=unit_interval(INK))
    scale.set_linewidth(3.0)
    axes.add_line(scale)


def _write(axes: Axes, feature: Feature, words: str) -> None:
    text = axes.text(*feature.bounds_m.centre, words, ha="center", va="center", zorder=6)
    text.set(fontsize=_FONT - 2.5, color=unit_interval(feature.kind.look.line or INK))
    text.set_path_effects([patheffects.withStroke(linewidth=2.5, foreground="white")])


def _panel_title(site: Scenario) -> str:
    """Return the properties that cannot be drawn, in two lines."""
    charge = " or ".join(f"{source.tnt_kg:g}" for source in site.charge) + " kg TNT"
    zone = site.build_zone
    if zone is None:
        return f"{site.name}\n{charge}"
    budget = "" if zone.budget is None else f", budget {zone.budget:g}"
    if zone.items:
        return (
            f"{site.name}: {count_of('item', len(zone.items))}{budget}\n"
            f"{charge}, clearance {zone.clearance_m:g} m"
        )
    return (
        f"{site.name}: {count_of('module', zone.stock)}, {charge}\n"
        f"clearance {zone.clearance_m:g} m{budget}"
    )


if __name__ == "__main__":
    typer.run(main)
