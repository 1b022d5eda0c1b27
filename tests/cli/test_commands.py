"""The command line, run in this process."""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import Result

import blast_env
from blast_env import load_scenario, save_scenario, simulate, write_layout
from blast_env.particles.calibration import load_calibration
from blast_env.particles.pymunk.engine import PymunkRun
from blast_env.plots import film
from blast_env.store import Store
from tests.cli.running import run
from tests.scenarios import BALLISTIC_COURTYARD


@pytest.fixture(scope="module")
def sparse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a scenario of which pymunk runs a blast in no time."""
    path = tmp_path_factory.mktemp("scenarios") / "sparse.toml"
    save_scenario(BALLISTIC_COURTYARD, path)
    return path


def test_the_version_is_that_of_the_package() -> None:
    assert run("--version").output == f"blast-env {blast_env.__version__}\n"


def test_the_module_is_the_command_and_completes_its_words() -> None:
    """As a shell asks for it, so that what `--install-completion` installs works."""
    words = {"COMP_WORDS": "blast-env sim", "COMP_CWORD": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "blast_env"],
        env=os.environ | words | {"_BLAST_ENV_COMPLETE": "complete_bash"},
        capture_output=True,
        text=True,
    )
    assert done.stdout.split() == ["simulate"]


def test_simulate_prints_loads_with_units_and_writes_all_files(
    sparse: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(film, "write_film", partial(film.write_film, frames_per_s=0.5))
    names = ("film.mp4", "table.xlsx", "map.png")
    options = ("--film", "--excel", "--heat-map")
    written = [tmp_path / name for name in names]
    layout = tmp_path / "layout.json"
    layout.write_text("[[4, 0], [5, 0]]")
    pairs = [text for pair in zip(options, written, strict=True) for text in pair]
    result = run(
        *("simulate", sparse, "--engine", "pymunk", "--seed", "3", "--layout", layout), *pairs
    )
    assert result.exit_code == 0, result.output
    blast = simulate(BALLISTIC_COURTYARD, [(4, 0), (5, 0)], seed=3, engine="pymunk")
    assert f"{blast.impulse_sim('building'):,.0f}" in result.stdout
    assert "impulse m|v| (sim)" in result.stdout
    assert blast.digest in result.stdout
    for path in written:
        assert path.stat().st_size > 1000
        assert str(path) in result.stdout.replace("\n", "")


def test_a_layout_is_for_its_site_also_with_another_preset(tmp_path: Path) -> None:
    """What `simulate` itself changes of a scenario does not make it another site."""
    layout = write_layout(tmp_path / "layout.json", load_scenario("courtyard"), [(9, 0)])
    for preset in ("ballistic", "collisional"):
        options = ("--preset", preset, "--engine", "event")
        result = run("simulate", "courtyard", "--layout", layout, *options)
        assert result.exit_code == 0, result.output
        assert "1 barrier module" in result.stdout


def test_an_interruption_leaves_nothing_half_written(
    sparse: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    advance = PymunkRun.advance

    def interrupted(self: PymunkRun, until_s: float) -> None:
        advance(self, until_s)
        if self.time_s > 0.02:
            raise KeyboardInterrupt

    monkeypatch.setattr(PymunkRun, "advance", interrupted)
    result = run("simulate", sparse, "--engine", "pymunk", "--film", tmp_path / "film.mp4")
    assert result.exit_code == 130
    assert "interrupted" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_draw_reports_all_problems_of_all_files(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "scenarios" / "courtyard.toml").read_text()
    bad = tmp_path / "bad.toml"
    bad.write_text(text.replace("width_m", "widht_m").replace("stock = 16", "stock = -1"))
    result = run("draw", "courtyard", bad)
    assert result.exit_code == 1
    assert "courtyard: good for simulate" in result.stdout
    output = result.stdout.replace("\n", " ")
    assert "site.widht_m: unknown key, did you mean 'width_m'?" in output
    assert "build_zone.stock: is -1: Input should be greater than or equal to 1" in output
    assert "wrote" not in output
    assert run("draw", "--check-only", "courtyard").exit_code == 0
    result = run("draw", "courtyard", bad, "--out", tmp_path / "site.png")
    assert result.exit_code == 2
    assert "--out is for one scenario: there are 2" in result.stderr


def calibrate(*arguments: str, out: Path) -> Result:
    fixed = ("calibrate", "--name", "mine", "--seeds", "2", "--out", out)
    return run(*fixed, *arguments)


def test_calibrate_writes_a_calibration_its_table_and_its_figure(tmp_path: Path) -> None:
    wanted = ("--reference", "reflected_impulse", "--distances", "8,11,15,20")
    arguments = (*wanted, "--engine", "event")
    result = calibrate(*arguments, out=tmp_path)
    assert result.exit_code == 0, result.output
    stored = load_calibration(tmp_path / "mine.event.json")
    assert stored.distances_m == (8.0, 11.0, 15.0, 20.0)
    assert stored.seeds == (1000, 1001)
    assert stored.reference.charge_kg == 100.0
    table = pd.read_csv(tmp_path / "mine.event.csv")
    assert table.i_sim.tolist() == pytest.approx(list(stored.i_sim))
    assert (tmp_path / "mine.event.png").stat().st_size > 1000
    assert "leave-one-distance-out" in result.stdout
    finished = list(Store(tmp_path / "mine.event.runs.sqlite").items())
    assert len(finished) == 8
    again = calibrate(*arguments, out=tmp_path)
    assert again.exit_code == 0
    assert list(Store(tmp_path / "mine.event.runs.sqlite").items()) == finished
