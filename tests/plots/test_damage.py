"""Pictures of damage: unfolded facades, pressure-impulse diagrams."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle, Rectangle

from blast_env.calibration import kingery_bulmash
from blast_env.evaluation.engines.gas import GasBlast
from blast_env.evaluation.questions.verdict import BuildingResponse
from blast_env.plots import (
    LEVEL_COLOURS,
    facade_picture,
    ground_recorders,
    level_bounds,
    open_distance_m,
    pressure_impulse_diagram,
    threshold_map,
)
from blast_env.response import (
    FacadeResponse,
    Glazing,
    LevelOfProtection,
    catalogue,
    ground_thresholds,
    respond,
)
from blast_env.site import Charge, Scenario
from tests.catalogue_sites import WALL, yard_document

CHARGE = Charge((2.0, 6.0), 5.0)
WORST = LEVEL_COLOURS[LevelOfProtection.BELOW_STANDARDS]
BEST = LEVEL_COLOURS[LevelOfProtection.HIGH]


@pytest.fixture(scope="module")
def site() -> Scenario:
    document = yard_document()
    facade = {"storey_m": 2.5, "glazing": "window_annealed_4", "wall": "concrete_200"}
    document["structures"][0]["facade"] = facade
    return Scenario.from_document(document, "yard")


def response(site: Scenario, peak_pa: float) -> FacadeResponse:
    """Return what a triangle of 10 ms does to the western bay; the others are not loaded."""
    time_s = np.array([0.0, 0.01, 0.02])
    loads = [peak_pa if bay.bay.wall == "west" else 0.0 for bay in site.bays]
    return respond(site.bays, time_s, np.outer(loads, [1.0, 0.0, 0.0]))


def both(site: Scenario) -> list[tuple[str, BuildingResponse]]:
    return [
        (words, BuildingResponse("hut", CHARGE, response(site, peak_pa)))
        for words, peak_pa in (("no barrier", 4e4), ("walls", 100.0))
    ]


def test_panes_and_walls_have_the_colours_of_what_they_allow(site: Scenario) -> None:
    """Four walls of a bay with two panes each; in the west the panes fly, and the wall holds."""
    figure = facade_picture(both(site), "hut")
    unprotected, protected = (
        [patch for patch in plot.patches if isinstance(patch, Rectangle)] for plot in figure.axes
    )
    for patches, panes in ((unprotected, WORST), (protected, BEST)):
        colours = [tuple(patch.get_facecolor()[:3]) for patch in patches]
        assert len(colours) == 4 * 3
        assert colours.count(to_rgb(panes)) >= 2
    assert "level of protection below standards" in figure.axes[0].get_title("left")
    assert "level of protection high" in figure.axes[1].get_title("left")


def test_a_bay_with_better_glass_is_in_the_diagram_of_that_glass(site: Scenario) -> None:
    """Its point among the regions of the old glass would say that it fails."""
    better = catalogue()["window_laminated_12"]
    assert isinstance(better, Glazing)
    unprotected = response(site, 4e4)
    bays = [replace(bay, glazing=better) for bay in site.bays]
    hardened = respond(bays, unprotected.time_s, unprotected.pressure_pa)
    figure = pressure_impulse_diagram([("nothing", unprotected), ("laminated", hardened)], "hut")
    counts = {
        axes.get_title(): [
            len(np.asarray(line.get_xdata()))
            for line in axes.lines
            if line.get_linestyle() == "None"
        ]
        for axes in figure.axes
        if axes.get_visible()
    }
    assert counts == {
        "reinforced concrete wall, 200 mm": [4, 4],
        "window, 4 mm annealed": [4, 0],
        "window, laminated, 6 + 6 mm, 1.52 mm PVB": [0, 4],
    }


def test_worse_levels_begin_at_larger_impulses_and_thicker_glass_holds_more() -> None:
    peaks = np.array([2e3, 1e4, 1e5])
    thin, thick = (
        level_bounds((component, 0.0), peaks, (1.0, 1e4))
        for component in map(catalogue().get, ("window_annealed_4", "window_annealed_6"))
        if isinstance(component, Glazing)
    )
    ordered = np.array(list(thick.values()))
    assert (np.diff(ordered, axis=0) >= 0.0).all()
    assert (thick[LevelOfProtection.HIGH] >= thin[LevelOfProtection.HIGH]).all()


def test_thresholds_reach_as_far_in_the_open_as_the_curves_say() -> None:
    for threshold in ground_thresholds()[1:]:
        distance_m = open_distance_m(threshold.peak_pa, CHARGE)
        peak_pa = kingery_bulmash("incident_overpressure", distance_m, CHARGE.tnt_kg)
        assert peak_pa == pytest.approx(threshold.peak_pa, rel=0.01)
    assert np.isinf(open_distance_m(500.0, CHARGE))


def test_a_charge_just_above_the_ground_is_no_safer_than_one_on_it() -> None:
    lying, raised = (Charge((24.3, 22.0), 200.0, height_m) for height_m in (0.0, 0.5))
    for threshold in ground_thresholds():
        reach_m = open_distance_m(threshold.peak_pa, raised)
        assert reach_m == open_distance_m(threshold.peak_pa, lying)
    assert open_distance_m(43.2e3, raised) == pytest.approx(29.0, abs=0.5)


def test_a_burst_in_the_air_reaches_as_far_as_its_reflection_on_the_ground() -> None:
    lying, high = (Charge((0.0, 0.0), 8.0, height_m) for height_m in (0.0, 2.0))
    for peak_pa in (10e3, 43.2e3):
        reach_m = open_distance_m(peak_pa, high)
        assert reach_m >= open_distance_m(peak_pa, lying)
        slant_m = np.hypot(reach_m, 2.0)
        reflected = kingery_bulmash("reflected_overpressure", slant_m, 8.0, "spherical")
        assert reflected == pytest.approx(peak_pa, rel=0.01)


def test_a_map_of_risks_has_a_region_and_a_circle_a_threshold(site: Scenario) -> None:
    blasts = (GasBlast(site, layout, charge=CHARGE) for layout in ((), WALL))
    unprotected, protected = (blast.run(recorders=ground_recorders) for blast in blasts)
    figure = threshold_map(protected, beside=unprotected)
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert any(word.startswith("windows usually shattered: from 3.4 kPa, ") for word in words)
    for axes in figure.axes:
        circles = [patch for patch in axes.patches if isinstance(patch, Circle)]
        radii = [circle.get_radius() for circle in circles if circle.get_linestyle() != "-"]
        assert radii[-3:] == sorted(radii[-3:], reverse=True)
