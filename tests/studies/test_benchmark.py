"""`python -m studies.benchmark`: what its tables say of the problems that come with the package."""

import pytest
from typer.testing import CliRunner

import studies.benchmark.__main__ as benchmark
from blast_env.problems import DEFINITIONS
from studies.benchmark.__main__ import app
from studies.benchmark.annealing import settings, sites_for


def test_no_best_layout_is_behind_a_rule_and_all_problems_are_counted() -> None:
    result = CliRunner().invoke(app, ["headroom"])
    assert result.exit_code == 0, result.output
    rows = [line.strip("| ").split(" | ") for line in result.stdout.splitlines()[2:]]
    families = [each.family for each in DEFINITIONS.values()]
    assert {row[0]: int(row[4].split(" of ")[1]) for row in rows} == {
        family: families.count(family) for family in dict.fromkeys(families)
    }
    assert all(float(row[1]) <= float(row[2]) for row in rows)
    assert all(int(row[4].split(" of ")[0]) > 0 for row in rows)


def test_annealing_is_tuned_and_its_best_checked_on_other_sites(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    packaged, other = settings()[0], settings()[5]
    assert packaged.is_packaged
    assert not other.is_packaged
    monkeypatch.setattr(benchmark, "settings", lambda: [packaged, other])
    options = ["annealing", "--sites", "2", "--seeds", "1", "--processes", "1"]
    result = CliRunner().invoke(app, options, catch_exceptions=False)
    rows = [line.strip("| ").split(" | ") for line in result.stdout.splitlines()[2:]]
    tuned, checked = rows[:2], rows[2:]
    best = max(tuned, key=lambda row: float(row[4]))
    assert {row[0] for row in checked} == {"checked on"}
    assert best[1:4] in [row[1:4] for row in checked]
    assert {each.name for each in sites_for("to tune", 2)}.isdisjoint(
        each.name for each in sites_for("to check", 2)
    )
