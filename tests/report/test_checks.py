"""The checks by hand of a report add up."""

import re
from dataclasses import replace

import pytest

from blast_env.answers import Line
from blast_env.answers.report import Report, Study, StudyOptions, report_document, run_report
from blast_env.curves import kingery_bulmash
from blast_env.evaluation.record import BlastRecord
from blast_env.site import Charge, Scenario
from tests.gas_sites import WALL, site_document
from tests.report.test_report import changed


def check_sum(impulse: list[str]) -> None:
    """Repeat the sum of an impulse, and compare it with the table of bays."""
    means, step, total = re.match(  # type: ignore[union-attr]
        r"\((.*)\) kPa x (.*) ms = (.*) Pa s", impulse[1]
    ).groups()
    assert float(step) > 0.0
    assert sum(map(float, means.split(" + "))) * float(step) == pytest.approx(
        float(total), rel=0.01
    )
    assert impulse[2].endswith(f"{total} Pa s")


def test_a_reviewer_who_repeats_the_checks_finds_the_same(report: Report) -> None:
    document = report_document(report)
    (section,) = (own for own in document.sections if own.title == "Checks by hand")
    checks: dict[str, list[str]] = {}
    for line in section.parts:
        assert isinstance(line, Line)
        if line.kind == "head":
            checks[line.text()] = []
        else:
            checks[[*checks][-1]].append(line.text())
    stand_off, impulse, pane, cost = checks.values()
    away_m = 4.0  # from (2, 4) to the hut at x = 6
    assert f"{away_m:.2f} m" in stand_off[0]
    expected = kingery_bulmash("reflected_impulse", away_m, 5.0)
    assert f"{expected:,.0f} Pa s" in stand_off[2]
    check_sum(impulse)
    assert "factor 4" in pane[1]
    assert cost[-1] == "sum 4; cost of the layout 4"


def test_the_sum_of_an_impulse_ends_at_its_largest_value_before_a_long_suction(
    study: Study,
) -> None:
    """The running integral is below 0 at the end, so that its values do not rise."""

    def sucked(_: str, __: float, record: BlastRecord) -> BlastRecord:
        pressure = record.pressure_pa.copy()
        count = pressure.shape[1]
        pressure[:, count // 3 :] = -pressure.max()
        return replace(record, pressure_pa=pressure)

    document = report_document(Report(changed(study, sucked)))
    texts = [part.text() for part in document.parts if isinstance(part, Line)]
    begin = next(k for k, text in enumerate(texts) if text.startswith("Impulse of a bay"))
    check_sum(texts[begin + 1 : begin + 4])


def test_the_stand_off_is_that_of_a_building_with_a_load() -> None:
    """The shed is nearer, but no air touches the only wall of it that counts."""
    document = site_document()
    hut = document["structures"][0]
    shed = {"name": "shed", "corner_m": [8.0, 3.0], "columns": 2, "faces": ["west"]}
    document["structures"].append(hut | shed)
    charges = (Charge((9.5, 6.0), 1.0),)
    options = StudyOptions(cells=(0.5, 0.5), items=False, places=1, charges=charges)
    scenario = Scenario.from_document(document, "two")
    document_of = report_document(run_report(scenario, WALL[:2], options))
    lines = [part.text() for part in document_of.parts if isinstance(part, Line)]
    (words,) = (line for line in lines if " from the outline of " in line)
    assert words.endswith("1.80 m from the outline of hut")
