"""`python -m studies.benchmark`: what its tables say of the problems that come with the package."""

from typer.testing import CliRunner

from blast_env.benchmark import DEFINITIONS
from studies.benchmark.__main__ import app


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
