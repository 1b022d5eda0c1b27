"""The picture of many cases shows the layouts and numbers that it was given."""

from math import nan
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.text import Text

from blast_env import Charge, load_scenario
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Threat, ThreatOutcome
from blast_env.rendering.evaluation_figures import MOST_SHOWN, ProtectedCase, cases_figure
from blast_env.rendering.figures import save_figure
from blast_env.scenario import Scenario
from blast_env.sites import generate_site
from blast_env.statistics import Estimate
from blast_env.units import UNITS_PER_M

COURTYARD = load_scenario("courtyard")
MEAN = Estimate(0.772, 0.718, 0.823)


def case(
    number: int, reduction: float = 0.5, in_range: bool = True, scenario: Scenario = COURTYARD
) -> ProtectedCase:
    """Return a case with `number` + 1 modules, its charge on the road of the courtyard."""
    threat = Threat(Charge((5.0, 8.0 + number), 100.0), number)
    outcome = ThreatOutcome(threat, 0.1 * (1.0 - reduction), 0.1, in_range)
    layout = tuple((row, 0) for row in range(number + 1))
    return ProtectedCase(scenario, layout, outcome)


def panels(figure: Figure) -> list[Axes]:
    return [axes for axes in figure.axes if axes.get_visible()]


def words(figure: Figure) -> str:
    """Return everything that stands in a figure."""
    return "\n".join(text.get_text() for text in figure.findobj(Text) if isinstance(text, Text))


def test_every_panel_has_its_own_charge_modules_and_reduction() -> None:
    reductions = (0.851, 0.63, -0.04)
    cases = [case(number, share) for number, share in enumerate(reductions)]
    figure = cases_figure(cases, MEAN)
    drawn = panels(figure)
    assert [axes.get_title() for axes in drawn] == [
        "case 1: reduction 85 %",
        "case 2: reduction 63 %",
        "case 3: reduction -4 %",
    ]
    for number, (axes, each) in enumerate(zip(drawn, cases, strict=True)):
        (star,) = axes.lines
        assert tuple(np.ravel(star.get_xydata())) == (5.0, 8.0 + number)
        (modules,) = (c for c in axes.collections if isinstance(c, PatchCollection))
        corners = {
            tuple(np.asarray(path.vertices).min(axis=0).tolist()) for path in modules.get_paths()
        }
        barrier = each.scene().structures[-1].build()
        assert corners == {
            (part.rectangle.left / UNITS_PER_M, part.rectangle.bottom / UNITS_PER_M)
            for part in barrier.parts
        }
        noun = "module" if number == 0 else "modules"
        assert axes.texts[0].get_text() == (
            f"{number + 1} {noun}\n100 kg TNT at (5.0, {8.0 + number:.1f}) m"
        )


def test_the_heading_has_the_mean_with_its_interval() -> None:
    title = cases_figure([case(0), case(1)], MEAN).get_suptitle().strip()
    assert title == "courtyard: a layout for each case, mean reduction 77 % (95 %: 72 % to 82 %)"
    one = cases_figure([case(0)], Estimate(0.5, nan, nan)).get_suptitle().strip()
    assert one == "courtyard: reduction 50 %"


def test_it_says_how_many_of_the_cases_are_shown() -> None:
    """Whoever sees twelve of thirteen must not take them for all."""
    cases = [case(number) for number in range(MOST_SHOWN + 1)]
    figure = cases_figure(cases, MEAN)
    assert len(panels(figure)) == MOST_SHOWN == 12
    assert panels(figure)[-1].get_title().startswith("case 12:")
    assert "mean over all 13 cases, of which the first 12 are shown" in words(figure)
    all_shown = words(cases_figure(cases[:-1], MEAN))
    assert "; 12 cases" in all_shown
    assert "are shown" not in all_shown


def test_numbers_that_are_not_to_be_trusted_or_do_not_exist_say_so() -> None:
    figure = cases_figure([case(0, in_range=False), case(1)], MEAN)
    titles = [axes.get_title() for axes in panels(figure)]
    assert titles == ["case 1: reduction 50 % ~", "case 2: reduction 50 %"]
    assert "~ outside the calibration's range" in words(figure)
    assert "~" not in words(cases_figure([case(1)], MEAN))
    unloaded = ProtectedCase(COURTYARD, (), ThreatOutcome(case(0).outcome.threat, 0.0, 0.0, True))
    (panel,) = panels(cases_figure([unloaded], Estimate(nan, nan, nan)))
    assert panel.get_title() == "case 1: reduction -"


def test_the_legend_has_what_is_drawn_and_nothing_else() -> None:
    labels = [text.get_text() for text in cases_figure([case(0)], MEAN).legends[0].get_texts()]
    assert labels == [
        "charge",
        "protected structure",
        "barrier module",
        "build zone",
        "keep-out",
        "site border",
    ]


def test_different_sites_have_their_names_and_their_own_scales(tmp_path: Path) -> None:
    """A legend for all of them, and a site without a keep-out does not lose that of another."""
    small = load_scenario("free_field")
    sites = [generate_site(1), generate_site(2), COURTYARD]
    cases = [ProtectedCase(each, (), case(0).outcome) for each in (*sites, small)]
    figure = cases_figure(cases, MEAN)
    assert figure.get_suptitle().startswith("different sites: a layout for each case")
    for axes, each in zip(panels(figure), cases, strict=True):
        assert axes.texts[0].get_text().startswith(f"{each.scenario.name}, 0 modules\n")
        low, high = axes.get_xlim()
        assert low < 0.0 < each.scenario.site.width_m < high < 1.1 * each.scenario.site.width_m
    assert "keep-out" in words(figure)
    assert save_figure(figure, tmp_path / "cases.png").stat().st_size > 10_000


@pytest.mark.parametrize("count", [1, 2, 12])
def test_no_text_covers_another_or_leaves_the_page(count: int) -> None:
    """Long names and masses: what a panel says stays within its own column."""
    scenario = COURTYARD.model_copy(update={"name": "a_scenario_whose_name_is_forty_signs_lon"})
    cases = [case(number, scenario=scenario) for number in range(count)]
    cases[0] = ProtectedCase(COURTYARD, cases[0].layout, cases[0].outcome)
    figure = cases_figure(cases, MEAN)
    figure.draw_without_rendering()
    page = figure.bbox
    texts = [axes.title for axes in panels(figure)] + [a.texts[-1] for a in panels(figure)]
    boxes = [text.get_window_extent() for text in texts]
    for index, box in enumerate(boxes):
        assert box.x0 >= page.x0
        assert box.x1 <= page.x1
        assert box.y1 <= page.y1
        assert box.count_overlaps(boxes[:index]) == 0


def test_no_cases_are_an_error() -> None:
    with pytest.raises(BlastEnvError, match="cases: there are none, must be at least one"):
        cases_figure([], MEAN)
