"""The figure of a shielding study says what its numbers say."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure

from blast_env.rendering.figures import save_figure
from blast_env.studies.shielding.figure import gauge_rectangles, shielding_figure
from blast_env.studies.shielding.report import BlockGeometry, ShieldingReport, ShieldingStudy
from tests.studies.shielding_cases import DENSE

GEOMETRY = BlockGeometry(side_modules=9, stand_off_m=3.0, margin_m=8.0)
PLAN, _COLOUR_BAR, LOADS, RATIOS = range(4)


@pytest.fixture(scope="module")
def report() -> ShieldingReport:
    """Loads in dense air, for there are few in sparse air; by the name of a preset."""
    measured = ShieldingStudy(DENSE, seeds=(0, 1, 2, 3), geometry=GEOMETRY).run()
    named = ShieldingStudy("ballistic", seeds=(0, 1, 2, 3), geometry=GEOMETRY)
    return ShieldingReport(named, measured.block, measured.wall)


@pytest.fixture(scope="module")
def figure(report: ShieldingReport) -> Figure:
    return shielding_figure(report, exponent=1.25)


def test_both_gauges_of_a_pair_have_the_colour_of_their_ratio(
    figure: Figure, report: ShieldingReport
) -> None:
    (gauges,) = (
        each for each in figure.axes[PLAN].collections if isinstance(each, PatchCollection)
    )
    drawn = np.asarray(gauges.get_array())
    assert drawn.tolist() == [*report.gauges.ratio, *report.gauges.ratio]
    assert len(gauges.get_paths()) == len(drawn)


def test_gauges_lie_before_their_faces_where_their_modules_are() -> None:
    rectangles = gauge_rectangles(GEOMETRY)
    upper, lower = rectangles[:14], rectangles[14:]
    half_m, far_m = GEOMETRY.side_m / 2.0, GEOMETRY.stand_off_m + GEOMETRY.side_m
    for index, rectangle in enumerate(upper[:9]):
        assert rectangle.bottom == half_m
        assert rectangle.centre[0] - GEOMETRY.stand_off_m == GEOMETRY.from_edge_m[index]
    for index, rectangle in enumerate(upper[9:]):
        assert rectangle.left == far_m
        assert half_m - rectangle.centre[1] == GEOMETRY.from_edge_m[index]
    assert upper[-1].centre[1] == 0.0
    assert [r.centre for r in lower] == [(x, -y) for x, y in (r.centre for r in upper)]
    for rectangle in upper[:-1]:  # the gauge in the middle is its own mirror image
        assert not any(rectangle.overlaps(other) for other in rectangles if other != rectangle)


def test_ratios_are_drawn_over_path_length_with_bands_and_scaled_lines(
    figure: Figure, report: ShieldingReport
) -> None:
    axes = figure.axes[RATIOS]
    drawn = np.concatenate([np.asarray(line.get_xydata()) for line in axes.lines[:2]])
    expected = report.gauges[["path_m", "ratio"]].to_numpy()
    assert drawn == pytest.approx(expected)
    legend = axes.get_legend()
    assert legend is not None
    texts = [text.get_text() for text in legend.get_texts()]
    assert len(texts) == 6
    value, low, high = report.two_corners
    assert f"back, two corners away: {value:.2f} ({low:.2f} to {high:.2f})" in texts
    assert f"scaled, ratio$^{{1.25}}$: {value**1.25:.2f}" in texts[4]
    assert {"experiments: 0.57 ± 0.10", "experiments: 0.49 ± 0.12"} < set(texts)
    assert "path length" in axes.get_xlabel()
    assert axes.get_ylim()[0] == 0.0


def test_loads_show_the_curve_and_both_faces(figure: Figure, report: ShieldingReport) -> None:
    axes = figure.axes[LOADS]
    assert axes.get_yscale() == "log"
    curve = report.free_field[report.free_field.fitted]
    drawn = [np.asarray(line.get_xydata()) for line in axes.lines]
    expected = curve[["path_m", "transferred_impulse_curve"]].to_numpy()
    assert any(each.shape == expected.shape and np.allclose(each, expected) for each in drawn)
    assert "(simulation units)" in axes.get_ylabel()


def test_the_heading_says_how_much_and_from_what(figure: Figure, report: ShieldingReport) -> None:
    title = figure.get_suptitle()
    assert f"{report.one_corner.value:.2f} of the free field one corner away" in title
    subtitle = figure.axes[0].texts[-1].get_text()
    assert "preset ballistic, engine event, 4 seeds, 100 kg TNT" in subtitle


def test_a_single_seed_and_no_exponent_can_be_drawn(
    tmp_path: Path, report: ShieldingReport
) -> None:
    study = ShieldingStudy(DENSE, seeds=(3,), geometry=GEOMETRY)
    single = ShieldingReport(study, report.block[3:], report.wall[3:])
    figure = shielding_figure(single)
    legend = figure.axes[RATIOS].get_legend()
    assert legend is not None
    texts = [text.get_text() for text in legend.get_texts()]
    assert len(texts) == 4
    assert not any("to" in text.split(":")[1] for text in texts)
    assert "own parameters" in figure.axes[0].texts[-1].get_text()
    path = save_figure(figure, tmp_path / "shielding.png")
    assert path.stat().st_size > 10_000


def test_gauges_above_the_axis_are_counted(report: ShieldingReport) -> None:
    higher = ShieldingReport(report.study, 100.0 * report.block, report.wall)
    axes = shielding_figure(higher).axes[RATIOS]
    top = axes.get_ylim()[1]
    above = int((higher.gauges.ratio > top).sum())
    assert above > 0
    assert f"gauges above the axis: {above}" in [text.get_text() for text in axes.texts]
