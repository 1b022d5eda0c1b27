"""`python -m studies.benchmark`: its table of the problems that come with the package."""

from typer.testing import CliRunner

from blast_env.benchmark import DEFINITIONS
from studies.benchmark.__main__ import app


def test_no_best_layout_is_behind_a_rule_and_every_problem_is_there() -> None:
    result = CliRunner().invoke(app, ["headroom"])
    assert result.exit_code == 0, result.output
    rows = [line.strip("| ").split(" | ") for line in result.stdout.splitlines()[2:]]
    assert {row[0].strip("`") for row in rows} == {*DEFINITIONS}
    assert all(float(row[4]) >= 0.0 for row in rows)
