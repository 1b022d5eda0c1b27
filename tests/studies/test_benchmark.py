"""`python -m studies.benchmark`: what its tables say of the problems that come with the package."""

from collections.abc import Sequence

import numpy as np
import pytest
from typer.testing import CliRunner

import studies.benchmark.__main__ as benchmark
from blast_env.arrays import FloatArray
from blast_env.problems import DEFINITIONS, Definition
from studies.benchmark.__main__ import app
from studies.benchmark.annealing import Setting, settings, sites_for, taken_off_percent


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
    """A setting that is better on the sites to tune on is played on others, and held against."""
    packaged, better, worse = settings()[0], *settings()[2:4]
    assert packaged.is_packaged
    played: list[tuple[str, ...]] = []

    def on_sites(setting: Setting, sites: Sequence[Definition], *_: int) -> FloatArray:
        played.append(tuple(each.name for each in sites))
        return np.full(len(sites), 5.0) + {better: 1.5, worse: -2.0}.get(setting, 0.0)

    monkeypatch.setattr(benchmark, "settings", lambda: [packaged, worse, better])
    monkeypatch.setattr(benchmark, "on_sites", on_sites)
    result = CliRunner().invoke(app, ["annealing", "--sites", "2"], catch_exceptions=False)
    rows = [line.strip("| ").split(" | ") for line in result.stdout.splitlines()[2:]]
    assert [row[0] for row in rows] == ["tuned on"] * 3 + ["checked on"] * 2
    assert [row[4] for row in rows] == ["5.0", "3.0", "6.5", "5.0", "6.5"]
    assert rows[-1][5] == "+1.5 (1.5 to 1.5)"
    assert len({*played[0], *played[-1]}) == 4


def test_a_setting_takes_something_off_from_the_rules_on() -> None:
    (site,) = sites_for("to tune", 1)
    found = taken_off_percent(settings()[0], 1, site)
    assert 0.0 < found < 90.0
    assert found == taken_off_percent(settings()[0], 1, site)
