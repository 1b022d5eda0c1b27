"""The table and the figure of the blast front; the fronts are in tests/physics."""

import numpy as np
import pytest

from studies.particles.blast_front import HEADERS, STUDIES, FrontTrace, front_figure, front_rows


def power_law(exponent: float, factor: float = 1.0) -> FrontTrace:
    time_s = np.geomspace(0.1, 10.0, 20)
    law = 60.0 * time_s**exponent
    return FrontTrace(time_s, factor * law, law, np.full(20, 2.0))


def test_a_trace_knows_its_power_and_its_distance_from_the_law() -> None:
    trace = power_law(0.5, factor=1.1)
    assert trace.exponent == pytest.approx(0.5)
    assert trace.ratio == pytest.approx(1.1)
    late = trace.from_radius(70.0)
    assert 0 < len(late.time_s) < 20
    assert late.law.min() >= 70.0


def test_the_table_has_a_row_a_law() -> None:
    rows = front_rows([[power_law(0.5), power_law(0.5, 1.02)], [power_law(1 / 3)]])
    assert rows[0][3:6] == ("0.500 ± 0.000", "1/2", "1.010 ± 0.010")
    assert rows[1][3:6] == ("0.333 ± 0.000", "1/3", "1.000 ± 0.000")
    assert {len(row) for row in rows} == {len(HEADERS)}


def test_the_figure_has_radii_and_ratios_of_each_law() -> None:
    traces = [power_law(0.5), power_law(0.5, 1.02)]
    short = tuple(slice(None, len(study.radii_spacings)) for study in STUDIES)
    found = [
        [FrontTrace(t.time_s[s], t.radius[s], t.law[s], t.compression[s]) for t in traces]
        for s in short
    ]
    figure = front_figure(found)
    assert len(figure.axes) == 4
    assert "0.500" in figure.axes[0].get_title()
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()][1] == "simulated, 2 seeds"
