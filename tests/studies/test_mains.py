"""The studies' commands: those of the documentation are there, and quick ones work."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer import Typer
from typer.testing import CliRunner, Result

from blast_env.fitting.paper import LINEAR, comparison_table
from blast_env.scenario import Scenario, check_layout, load_scenario
from studies import engines, layouts, reproduce_paper, validity
from studies.particles.agreement import layouts as study


def run(app: Typer, *arguments: str) -> Result:
    return CliRunner().invoke(app, arguments)


@pytest.fixture
def paper() -> Typer:
    app = Typer()
    app.command()(reproduce_paper.main)
    return app


def test_the_paper_s_tables_are_printed_and_written(paper: Typer, tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    result = run(paper, "--out", str(out))
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


def test_a_folder_that_cannot_be_made_is_the_user_s_error(paper: Typer, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = run(paper, "--out", str(tmp_path / "file" / "folder"))
    assert result.exit_code == 2
    assert "cannot be a folder" in result.output


def test_layouts_of_all_sizes_are_ranked_by_both_engines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With loads that fall with the number of modules, and little noise."""

    def loads(scenario: Scenario, drawn: list, charges: list, *_: object) -> np.ndarray:
        for layout in drawn:
            check_layout(scenario, layout)
        modules = np.array([len(layout) for layout in drawn])[:, None]
        noise = np.random.default_rng(0).normal(size=(2, 2, len(drawn), len(charges)))
        return 100.0 - modules + noise

    monkeypatch.setattr(study, "measured_loads", loads)
    monkeypatch.setattr(study, "_RESAMPLES", 100)  # the intervals are not looked at
    out = tmp_path / "loads.csv"
    result = run(layouts.app, "engines", "--layouts=60", "--charges=2", f"--out={out}")
    assert result.exit_code == 0, result.output
    assert "| pymunk with itself, other seeds | 0.9" in result.output
    table = pd.read_csv(out)
    assert list(table) == ["layout", "modules", "pymunk_0", "pymunk_1", "event_0", "event_1"]
    zone = load_scenario("courtyard").build_zone
    assert zone is not None
    assert table.modules.min() <= 3
    assert table.modules.max() == zone.stock


def test_the_pressure_is_held_against_kingery_and_bulmash(tmp_path: Path) -> None:
    out = tmp_path / "pressure.png"
    result = run(
        validity.app, "pressure", "--distances=10", "--seeds=2", "--processes=1", f"--out={out}"
    )
    assert result.exit_code == 0, result.output
    simulated, reference = result.output.splitlines()[2:4]
    assert simulated.startswith("| 10 | simulated | ")
    assert reference.startswith("| 10 | Kingery-Bulmash | ")
    assert out.exists()


def test_costs_of_two_sizes_are_fitted(tmp_path: Path) -> None:
    out = tmp_path / "cost.png"
    sizes = ("--least-balls=2000", "--most-balls=5000")
    result = run(engines.app, "cost", "--repeats=1", *sizes, f"--out={out}")
    assert result.exit_code == 0, result.output
    assert re.search(r"ns an event = -?\d+ [+] -?[\d.]+ log2\(balls\)", result.output)
    assert run(engines.app, "cost", "--most-balls=2000", f"--out={out}").exit_code == 2


def test_the_event_engine_needs_all_seeds_that_pymunk_has() -> None:
    refused = run(engines.app, "compare", "--seeds=20", "--event-seeds=19")
    assert refused.exit_code == 2
    assert "--event-seeds is 19, must be at least --seeds, 20" in refused.output
