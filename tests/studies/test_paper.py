"""The paper's tables, from its columns."""

from pathlib import Path

import pandas as pd
import pytest
from typer import Typer
from typer.testing import CliRunner, Result

from blast_env.particles.paper import LINEAR, comparison_table
from studies import paper


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


def test_a_folder_that_cannot_be_made_is_the_user_s_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = run("--out", str(tmp_path / "file" / "folder"))
    assert result.exit_code == 2
    assert "cannot be a folder" in result.output
