"""The picture of many cases shows the layouts and numbers that it was given."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from blast_env import Charge, load_scenario
from blast_env.evaluation import Evaluation, LoadCase, LoadCaseSet
from blast_env.evaluation.engines import find_engine
from blast_env.plots.evaluation_figures import MOST_SHOWN, comparison_figure
from blast_env.plots.figures import save_figure
from blast_env.plots.plan import Kinds
from blast_env.site import Scenario
from blast_env.sites import generate_site
from blast_env.units import MODULE_SIDE_M
from tests.evaluation.cases import loads_of

COURTYARD = load_scenario("courtyard")


def comparison(
    *reductions: float, scenarios: Sequence[Scenario] = (COURTYARD,), in_range: Sequence[bool] = ()
) -> Evaluation:
    """Return a comparison: case k has k + 1 modules, its charge on the road of the courtyard."""
    cases = []
    for number in range(len(reductions)):
        threat = LoadCase(Charge((5.0, 8.0 + number), 100.0), number)
        cases.append(LoadCaseSet(scenarios[number % len(scenarios)], (threat,)))
    return Evaluation(
        cases=tuple(cases),
        layouts=tuple(tuple((row, 0) for row in range(index + 1)) for index in range(len(cases))),
        blasts=tuple(
            (loads_of(case.scenario, 600.0 * (1.0 - share), in_range=within),)
            for case, share, within in zip(
                cases, reductions, in_range or [True] * len(cases), strict=True
            )
        ),
        unprotected_blasts=tuple((loads_of(case.scenario, 600.0),) for case in cases),
        engine=find_engine("event"),
    )


def panels(figure: Figure) -> list[Axes]:
    return [axes for axes in figure.axes if axes.get_visible()]


def words(figure: Figure) -> str:
    """Return everything that stands in a figure."""
    return "\n".join(text.get_text() for text in figure.findobj(Text) if isinstance(text, Text))


def test_every_panel_has_its_own_charge_modules_and_reduction() -> None:
    reductions = (0.851, 0.63, -0.04)
    figure = comparison_figure(comparison(*reductions))
    drawn = panels(figure)
    assert [axes.get_title() for axes in drawn] == [
        "case 1: reduction 85 %",
        "case 2: reduction 63 %",
        "case 3: reduction -4 %",
    ]
    zone = COURTYARD.build_zone
    assert zone is not None
    for number, axes in enumerate(drawn):
        (star,) = axes.lines
        assert tuple(np.ravel(star.get_xydata())) == (5.0, 8.0 + number)
        (modules,) = (each for each in axes.patches if each.get_zorder() == Kinds.BARRIER.level)
        squares = np.asarray(modules.get_path().vertices).reshape(-1, 5, 2)
        corners = {tuple(square.min(axis=0).tolist()) for square in squares}
        left_m, low_m = zone.corner_m
        assert corners == {(left_m, low_m + row * MODULE_SIDE_M) for row in range(number + 1)}
        noun = "module" if number == 0 else "modules"
        assert axes.texts[0].get_text() == (
            f"{number + 1} {noun}\n100 kg TNT at (5.0, {8.0 + number:.1f}) m"
        )


def test_the_heading_has_the_mean_with_its_interval() -> None:
    both = comparison(0.7, 0.8, 0.8)
    _, low, high = both.reduction.scaled(100.0)
    title = comparison_figure(both).get_suptitle().strip()
    assert title == (
        "courtyard: a layout for each case, mean reduction 77 % "
        f"(95 %: {low:.0f} % to {high:.0f} %)"
    )
    one = comparison_figure(comparison(0.5)).get_suptitle().strip()
    assert one == "courtyard: reduction 50 %"


def test_it_says_how_many_of_the_cases_are_shown() -> None:
    """Whoever sees twelve of thirteen must not take them for all."""
    figure = comparison_figure(comparison(*[0.5] * (MOST_SHOWN + 1)))
    assert len(panels(figure)) == MOST_SHOWN == 12
    assert panels(figure)[-1].get_title().startswith("case 12:")
    assert "mean over all 13 cases, of which the first 12 are shown" in words(figure)
    all_shown = words(comparison_figure(comparison(*[0.5] * MOST_SHOWN)))
    assert "; 12 cases" in all_shown
    assert "are shown" not in all_shown


def test_numbers_that_are_not_to_be_trusted_say_so() -> None:
    figure = comparison_figure(comparison(0.5, 0.5, in_range=(False, True)))
    titles = [axes.get_title() for axes in panels(figure)]
    assert titles == ["case 1: reduction 50 % ~", "case 2: reduction 50 %"]
    assert "~ outside the validated range" in words(figure)
    assert "~" not in words(comparison_figure(comparison(0.5)))


def test_different_sites_have_their_names_and_their_own_scales(tmp_path: Path) -> None:
    """A legend for all of them, and a site without a no-build area keeps that of another."""
    sites = [generate_site(1), generate_site(2), COURTYARD]
    figure = comparison_figure(comparison(0.5, 0.5, 0.5, scenarios=sites))
    assert figure.get_suptitle().startswith("different sites: a layout for each case")
    for axes, site in zip(panels(figure), sites, strict=True):
        assert axes.texts[0].get_text().startswith(f"{site.name}, ")
        low, high = axes.get_xlim()
        assert low < 0.0 < site.site.width_m < high < 1.1 * site.site.width_m
    assert "no-build area" in words(figure)
    assert save_figure(figure, tmp_path / "cases.png").stat().st_size > 10_000


@pytest.mark.usefixtures("laid_out")
@pytest.mark.parametrize("count", [2, 12])
def test_no_text_covers_another_or_leaves_the_page(count: int) -> None:
    """Long names and masses: what a panel says stays within its own column."""
    scenario = COURTYARD.model_copy(update={"name": "a_scenario_whose_name_is_forty_signs_lon"})
    figure = comparison_figure(comparison(*[0.5] * count, scenarios=(COURTYARD, scenario)))
    figure.draw_without_rendering()
    page = figure.bbox
    texts = [axes.title for axes in panels(figure)] + [a.texts[-1] for a in panels(figure)]
    boxes = [text.get_window_extent() for text in texts]
    for index, box in enumerate(boxes):
        assert box.x0 >= page.x0
        assert box.x1 <= page.x1
        assert box.y1 <= page.y1
        assert box.count_overlaps(boxes[:index]) == 0
