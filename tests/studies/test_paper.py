"""The studies of the particle model: the paper's tables, the two engines against each other."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer import Typer
from typer.testing import CliRunner, Result

from blast_env import load_scenario
from blast_env.calibration import PAPER_UFC_LABEL
from blast_env.particles import LINEAR, POWER, PROPORTIONAL, comparison_table
from studies import engines, paper
from studies.engines import HEADERS, Agreement, agreements, relative_difference


def run(*arguments: str) -> Result:
    app = Typer()
    app.command()(paper.main)
    return CliRunner().invoke(app, arguments)


def test_the_paper_s_tables_are_printed_and_written(tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    result = run("--out", str(out))
    assert result.exit_code == 0
    names = ["figure_5.png", "table_1.csv", "table_2.csv", "table_3.csv", "table_4.csv"]
    assert sorted(path.name for path in out.iterdir()) == names
    for words in ("Table 1", "Table 4", "k = 4.343e-05", "k = 4.2707e-05", "0.95097", "32.30"):
        assert words in " ".join(result.output.split())  # wherever lines end
    assert result.output.count("within the paper's rounding") == 4
    assert "BEYOND" not in result.output
    written = pd.read_csv(out / "table_2.csv")
    assert written["e_percent"].to_numpy() == pytest.approx(
        comparison_table(LINEAR)["e_percent"].to_numpy()
    )
    assert (out / "figure_5.png").read_bytes().startswith(b"\x89PNG")


def test_figure_5_has_the_column_and_the_three_laws() -> None:
    impulse, deviation, in_pa = paper.figure_5().axes
    legend = impulse.get_legend()
    assert legend is not None
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels[0] == PAPER_UFC_LABEL
    assert [label.partition(",")[0] for label in labels[1:]] == [
        "proportional",
        "linear",
        "power law",
    ]
    curves = [np.asarray(line.get_ydata(), dtype=float) for line in impulse.lines]
    assert curves[1] == pytest.approx(comparison_table(PROPORTIONAL)["i_scaled_psi_s"].to_numpy())
    errors = [np.asarray(line.get_ydata(), dtype=float) for line in deviation.lines[1:]]
    for law, error in zip((PROPORTIONAL, LINEAR, POWER), errors, strict=True):
        assert np.abs(error) == pytest.approx(comparison_table(law)["e_percent"].to_numpy())
    scales = np.array(in_pa.get_ylim()) / np.array([1.0, impulse.get_ylim()[1]])
    assert scales == pytest.approx([0.0, 6894.757293168])


def test_a_folder_that_cannot_be_made_is_the_user_s_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = run("--out", str(tmp_path / "file" / "folder"))
    assert result.exit_code == 2
    assert "cannot be a folder" in result.output


# --- The two particle engines against each other, and the study of it.


FACADE = (
    load_scenario("free_field")
    .at_stand_off(8.0)
    .with_simulation(overrides={"explosive": {"ball_count": 60}, "air": {"spacing_units": 0.0}})
)
"""Balls that meet nothing but the facade, on which the engines agree almost exactly."""


def test_the_engines_agree_where_balls_only_meet_a_facade() -> None:
    for agreement in agreements({"facade": FACADE}, 10, 1, (0.5, 0.25)):
        assert agreement.is_close
        assert abs(agreement.transferred.value) < 0.01
        assert len(agreement.cells()) == len(HEADERS)


def test_a_difference_by_hand() -> None:
    found = relative_difference(np.array([11.0, 12.0, 13.0]), np.array([10.0, 10.0, 10.0]))
    assert found.value == pytest.approx(0.2)
    half_width = 4.3026527 * 0.1 / 3.0**0.5  # Student's t with two degrees of freedom
    assert found.high - found.value == pytest.approx(half_width)
    near = relative_difference(np.array([10.3, 10.3, 10.3]), np.full(3, 10.0))
    assert Agreement("scene", 0.5, near, near).is_close
    assert not Agreement("scene", 0.5, near, found).is_close


def test_an_unknown_scene_is_named() -> None:
    app = Typer()
    app.command()(engines.main)
    result = CliRunner().invoke(app, ["--scene", "moon"])
    assert result.exit_code == 2
    assert "--scene is 'moon', must be one of free_field, 15 m" in " ".join(result.output.split())
