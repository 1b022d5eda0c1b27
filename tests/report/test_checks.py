"""The checks by hand of a report add up."""

import re

import pytest

from blast_env.curves import kingery_bulmash
from blast_env.report import Study
from blast_env.report.checks import checks_of
from blast_env.report.page import report_html


def test_a_reviewer_who_repeats_the_checks_finds_the_same(study: Study) -> None:
    stand_off, impulse, pane, cost = checks_of(study)
    away_m = 4.0  # from (2, 4) to the hut at x = 6
    assert f"{away_m:.2f} m" in stand_off.lines[0]
    expected = kingery_bulmash("reflected_impulse", away_m, 5.0)
    assert f"{expected:,.0f} Pa s" in stand_off.lines[2]
    means, step, total = re.match(  # type: ignore[union-attr]
        r"\((.*)\) kPa x (.*) ms = (.*) Pa s", impulse.lines[1]
    ).groups()
    assert sum(map(float, means.split(" + "))) * float(step) == pytest.approx(
        float(total), rel=0.01
    )
    assert impulse.lines[2].endswith(f"{total} Pa s")
    assert "factor 4" in pane.lines[1]
    assert cost.lines[-1] == f"sum {study.cost:g}; cost of the layout {study.cost:g}"
    page = report_html(study, [])
    assert page.count("Pa s</li>") >= 2
    assert "Checks by hand" in page
