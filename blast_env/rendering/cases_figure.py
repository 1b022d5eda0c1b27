"""Layouts for many cases, side by side: each on its site, with the charge that it met."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, isnan
from typing import Final

from blast_env.errors import BlastEnvError
from blast_env.evaluation import Estimate, ThreatOutcome
from blast_env.rendering.captions import write_heading
from blast_env.rendering.evaluation_plan import draw_layout, layout_legend
from blast_env.rendering.extra import render_extra
from blast_env.rendering.site_plan import draw_charge
from blast_env.rendering.style import INK, QUIET_INK, count_of, unit_interval
from blast_env.scenario import Cell, Scenario
from blast_env.scene import Scene, build_scene

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_SHOWN: Final = 12
"""How many cases a figure has at most: the first ones."""

_COLUMNS: Final = 4
_PANEL_IN: Final = 3.2
_LEAST_WIDTH_IN: Final = 9.6  # the heading has to fit
_PANEL_HEIGHTS_IN: Final = (2.0, 4.8)
_THREAT_PT: Final = 29.0  # of the lines between title and panel
_TITLE_IN: Final = 0.95  # of a panel, with the numbers along x
_NUMBERS_IN: Final = 0.4  # along y
_FRAME_IN: Final = 1.8  # heading and legend
_PERCENT: Final = 100.0
_OUT_OF_RANGE: Final = " ~"


@dataclass(frozen=True, eq=False)
class ProtectedCase:
    """A layout, and what it does against the threat of its case.

    Attributes:
        scenario: The site.
        layout: (row, column) of each module.
        outcome: With the layout and without a barrier.
    """

    scenario: Scenario
    layout: tuple[Cell, ...]
    outcome: ThreatOutcome

    def scene(self) -> Scene:
        """Return the site with the layout and the charge."""
        threat = self.outcome.threat
        return build_scene(self.scenario, self.layout, threat.seed, threat.charge)


def cases_figure(cases: Sequence[ProtectedCase], reduction: Estimate) -> Figure:
    """Return a picture of layouts and of how much each takes off, four in a row.

    Args:
        cases: At least one. The first `MOST_SHOWN` are drawn, numbered from 1; if there are more,
            the picture says so.
        reduction: Of the mean impulse on the protected structures over all cases.

    Raises:
        BlastEnvError: If there is no case.
    """
    if not cases:
        raise BlastEnvError("cases: there are none, must be at least one")
    shown = cases[:MOST_SHOWN]
    columns = min(len(shown), _COLUMNS)
    figure, panels = _empty_panels(shown, columns)
    is_one_site = len({case.scenario.content_hash for case in cases}) == 1
    scenes = [case.scene() for case in shown]
    for number, (axes, case, scene) in enumerate(zip(panels, shown, scenes, strict=True), start=1):
        _draw_case(axes, case, scene, f"case {number}")
        _write_threat(axes, case, "" if is_one_site else f"{case.scenario.name}, ")
        axes.set_xlabel("x (m)" if number > len(shown) - columns else "")
        axes.set_ylabel("y (m)" if number % columns == 1 or columns == 1 else "")
    zones = [case.scenario.build_zone for case in shown if case.scenario.build_zone is not None]
    richest = max(zones, key=lambda zone: len(zone.keep_outs), default=None)
    structures = [outline for scene in scenes for outline in scene.structures]
    handles = layout_legend(structures, richest)
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    place = cases[0].scenario.name if is_one_site else "different sites"
    write_heading(figure, f"{place}: {_headline(len(cases), reduction)}", _subtitle(cases))
    return figure


def _empty_panels(shown: Sequence[ProtectedCase], columns: int) -> tuple[Figure, list[Axes]]:
    """Return a figure with a panel a case, high enough for the highest site."""
    rows = ceil(len(shown) / columns)
    width_in = max(columns * _PANEL_IN, _LEAST_WIDTH_IN)
    sites = [case.scenario.site for case in shown]
    slenderness = max(site.height_m / site.width_m for site in sites)
    least_in, most_in = _PANEL_HEIGHTS_IN
    plan_in = slenderness * (width_in / columns - _NUMBERS_IN)
    panel_in = min(max(plan_in, least_in), most_in) + _TITLE_IN
    figure = Figure(figsize=(width_in, rows * panel_in + _FRAME_IN), layout="constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    return figure, panels[: len(shown)]


def _draw_case(axes: Axes, case: ProtectedCase, scene: Scene, name: str) -> None:
    draw_layout(axes, case.scenario.build_zone, scene)
    draw_charge(axes, case.outcome.threat.charge.position_m)
    axes.tick_params(labelsize=7.5)
    mark = "" if case.outcome.in_range else _OUT_OF_RANGE
    axes.set_title(
        f"{name}: reduction {_percent(case.outcome.reduction)}{mark}",
        fontsize=10.5,
        fontweight="bold",
        color=unit_interval(INK),
        pad=_THREAT_PT,
    )


def _write_threat(axes: Axes, case: ProtectedCase, site: str) -> None:
    """Write two quiet lines between title and panel."""
    (x_m, y_m), tnt_kg = case.outcome.threat.charge
    charge = f"{tnt_kg:g} kg TNT at ({x_m:.1f}, {y_m:.1f}) m"
    axes.annotate(
        f"{site}{count_of('module', len(case.layout))}\n{charge}",
        (0.5, 1.0),
        xycoords="axes fraction",
        xytext=(0.0, 2.0),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=9,
        color=unit_interval(QUIET_INK),
    )


def _headline(count: int, reduction: Estimate) -> str:
    if count == 1:
        return f"reduction {_percent(reduction.value)}"
    text = f"a layout for each case, mean reduction {_percent(reduction.value)}"
    if isnan(reduction.low):
        return text
    return f"{text} (95 %: {_percent(reduction.low)} to {_percent(reduction.high)})"


def _subtitle(cases: Sequence[ProtectedCase]) -> str:
    """Return what the numbers are, how many cases are shown, and which are to be distrusted."""
    parts = ["reduction of the impulse on the protected structures"]
    if len(cases) > MOST_SHOWN:
        parts.append(f"mean over all {len(cases)} cases, of which the first {MOST_SHOWN} are shown")
    else:
        parts.append(count_of("case", len(cases)))
    if not all(case.outcome.in_range for case in cases):
        parts.append("~ outside the calibration's range")
    return "; ".join(parts)


def _percent(share: float) -> str:
    return "-" if isnan(share) else f"{_PERCENT * share:.0f} %"
