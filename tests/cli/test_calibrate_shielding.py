"""`blast-env calibrate --shielding`, run in this process."""

import json
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from blast_env.calibration.model import load_calibration, save_calibration
from blast_env.cli import app
from blast_env.physics.event.engine import EventRun
from blast_env.studies.shielding.report import ShieldingStudy


def calibrate(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["calibrate", *(str(argument) for argument in arguments)])


def test_it_prints_the_ratios_beside_the_experiments_and_writes_all_files(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    options = ("--seeds", "3", "--first-seed", "7", "--exponent", "1.2")
    result = calibrate("--shielding", *options, "--out", out)
    assert result.exit_code == 0, result.output
    report = ShieldingStudy("ballistic", seeds=(7, 8, 9)).run()
    value, low, high = report.two_corners
    (row,) = (line for line in result.stdout.splitlines() if "back, two corners" in line)
    for words in (f"{value:.2f}", f"{low:.2f} to {high:.2f}", f"{value**1.2:.2f}", "0.49 +- 0.12"):
        assert words in row
    assert "too low" in row
    assert "0.57 +- 0.10" in result.stdout
    assert "scaled, B = 1.2" in result.stdout
    assert "Kingery-Bulmash" in result.stdout

    stem = out / "shielding.ballistic.event"
    record = json.loads(Path(f"{stem}.json").read_text())
    assert record["preset"] == "ballistic"
    assert record["exponent"] == 1.2
    assert record["result"] == json.loads(report.to_json(1.2))["result"]
    assert len(record["reflection"]) == len(record["arrivals"]) == 4
    pd.testing.assert_frame_equal(
        pd.read_csv(f"{stem}.csv"), report.gauges, check_dtype=False, rtol=1e-9
    )
    assert Path(f"{stem}.png").stat().st_size > 10_000
    for suffix in ("json", "csv", "png"):
        assert f"wrote {stem}.{suffix}" in result.stdout


def test_a_calibration_gives_the_exponent(tmp_path: Path) -> None:
    name = "ballistic_kb_100kg"
    result = calibrate("--shielding", "--calibration", name, "--seeds", "2", "--out", tmp_path)
    assert result.exit_code == 0, result.output
    exponent = load_calibration(name, "event").coefficients["B"]
    record = json.loads((tmp_path / "shielding.ballistic.event.json").read_text())
    assert record["exponent"] == exponent
    assert f"scaled, B = {exponent:.4g}" in result.stdout


def test_a_calibration_without_an_exponent_is_refused(tmp_path: Path) -> None:
    power = load_calibration("ballistic_kb_100kg", "event")
    coefficients = {"a": 0.0, "b": 1e-6}
    intervals = {name: (value, value) for name, value in coefficients.items()}
    linear = power.model_copy(
        update={
            "law": "linear",
            "coefficients": coefficients,
            "coefficient_intervals": intervals,
        }
    )
    save_calibration(linear, tmp_path / "linear.json")
    calibration = ("--calibration", tmp_path / "linear.json")
    result = calibrate("--shielding", *calibration, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert "has a linear law, must have a power law" in result.stderr


def test_a_calibration_of_other_blasts_is_refused(tmp_path: Path) -> None:
    save_calibration(load_calibration("ballistic_ufc", "pymunk"), tmp_path / "other.json")
    calibration = ("--calibration", tmp_path / "other.json")
    result = calibrate("--shielding", *calibration, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert "was made with engine 'pymunk'" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--preset", "balistic"), "did you mean 'ballistic'"),
        (("--engine", "evnt"), "did you mean 'event'"),
        (("--exponent", "0"), "exponent is 0, must be above 0"),
        (("--exponent", "1", "--calibration", "ballistic_kb_100kg"), "one of them, not both"),
        (("--calibration", "ballistic_kb_100"), "did you mean 'ballistic_kb_100kg'"),
        (("--seeds", "1"), "greater than or equal to 2"),
        (("--name", "mine"), "--name does not go with --shielding"),
        (("--distances", "8,12"), "--distances does not go with --shielding"),
        (("--out", "file"), "file: cannot be a folder"),
    ],
)
def test_bad_input_is_one_clear_message(
    arguments: tuple[str, ...], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    result = calibrate("--shielding", "--out", "folder", *arguments)
    assert result.exit_code == 2
    assert words in result.stderr.replace("\n", " ")
    assert "Traceback" not in result.output
    assert not (tmp_path / "folder").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "--name is missing"),
        (("--name", "mine"), "--reference is missing"),
        (
            ("--name", "mine", "--reference", "paper_ufc", "--exponent", "1.1"),
            "--exponent goes with --shielding only",
        ),
    ],
)
def test_without_shielding_its_options_are_refused_and_the_others_needed(
    arguments: tuple[str, ...], words: str, tmp_path: Path
) -> None:
    result = calibrate(*arguments, "--out", tmp_path)
    assert result.exit_code == 2
    assert words in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_leaves_nothing_half_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(self: EventRun, until_s: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(EventRun, "advance", interrupted)
    result = calibrate("--shielding", "--seeds", "2", "--out", tmp_path)
    assert result.exit_code == 130
    assert list(tmp_path.iterdir()) == []
