"""The picture of the probability of a level over the mass."""

import numpy as np

from blast_env.plots.capacity import capacity_figure


def test_each_layout_is_a_curve_beside_the_charge_of_the_scenario() -> None:
    curves = {"no barrier": [(10.0, 1.0), (20.0, 0.4)], "6 walls": [(10.0, 1.0), (40.0, 0.2)]}
    (axes,) = capacity_figure(curves, "medium", 31.0, "yard").axes
    *drawn, mark = axes.lines
    assert [each.get_label() for each in drawn] == list(curves)
    for line, points in zip(drawn, curves.values(), strict=True):
        np.testing.assert_array_equal(np.asarray(line.get_xydata()), points)
    np.testing.assert_array_equal(mark.get_xdata(), [31.0, 31.0])
    assert axes.get_ylabel() == "probability of level 'medium'"
