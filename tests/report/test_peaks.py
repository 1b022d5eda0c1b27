"""Peaks that limits are held against: no cell keeps a limit by clipping."""

import pandas as pd
import pytest

from blast_env.answers.report import Limit, Report
from blast_env.calibration import kingery_bulmash
from blast_env.evaluation.engines.walls import PeakSource, PeakWeight, counted_peak
from blast_env.geometry import Layout
from blast_env.layout import build_site
from blast_env.response import peak_factor
from tests.gas_sites import WALL, hut
from tests.report.sites import page_text


def counted(peak_pa: float, layout: Layout, outward_x: float = -1.0) -> PeakWeight:
    """Return the peak that counts of a face of a cell 4 m from 5 kg."""
    normal = {"outward_x": outward_x, "outward_y": 0.0}
    row = {**normal, "x_m": 6.0, "y_m": 4.0, "z_m": 0.0, "peak_pa": peak_pa}
    return counted_peak(build_site(hut(), layout), 0.5, pd.DataFrame([row]))


def test_in_sight_the_larger_of_gas_and_the_curve_counts() -> None:
    curve_pa = kingery_bulmash("reflected_overpressure", 4.0, 5.0)
    clipped = counted(0.4 * curve_pa, ())
    assert clipped.source is PeakSource.CURVE
    assert clipped.pa == pytest.approx(curve_pa)
    assert counted(1.2 * curve_pa, ()) == PeakWeight(1.2 * curve_pa, PeakSource.GAS)


@pytest.mark.parametrize(("layout", "outward_x"), [(WALL, -1.0), ((), 1.0)])
def test_out_of_sight_the_peak_is_extrapolated_from_the_cells(
    layout: Layout, outward_x: float
) -> None:
    curve_pa, factor = kingery_bulmash("reflected_overpressure", 4.0, 5.0), peak_factor(0.5, 5.0)
    found = counted(1e4, layout, outward_x)
    assert found == PeakWeight(factor * 1e4, PeakSource.EXTRAPOLATED)
    assert counted(0.9 * curve_pa, layout, outward_x).pa == pytest.approx(curve_pa)
    # Between walls more may come than in the open: then the curve is no bound.
    assert counted(1.1 * curve_pa, layout, outward_x).pa == pytest.approx(factor * 1.1 * curve_pa)


def test_a_report_fails_a_limit_between_the_clipped_peak_and_the_counted_one(
    report: Report,
) -> None:
    (own,) = report.study.verdicts[0].limited
    assert own.load.counted_by == PeakSource.CURVE
    limit = Limit("hut", peak_pa=0.5 * (own.load.peak_pa + own.load.counted_pa))
    assert own.load.peak_pa < limit.peak_pa < own.load.counted_pa
    assert not limit.is_kept(own.load)
    words = f"(Kingery-Bulmash reflected; gas {own.load.peak_pa / 1e3:.0f})"
    assert words in page_text(report)
