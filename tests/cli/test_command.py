"""All commands: numbers that are refused, alone and with commas; notes; progress in log files."""

import warnings
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from blast_env.cli import app, output
from blast_env.cli.command import ShellCommand
from blast_env.cli.options import numbers
from blast_env.errors import BlastEnvError
from blast_env.store import Store


@pytest.mark.parametrize(
    "words",
    [
        *(("--tnt-kg", "1_000"), ("--tnt-kg", "nan"), ("--tnt-kg", "1,5"), ("--seed", "1_0")),
        *(("--cell", "inf"), ("--tnt-kg", "\uff11")),
    ],
)
def test_a_number_that_python_reads_and_nobody_means_is_refused(words: tuple[str, ...]) -> None:
    result = CliRunner().invoke(app, ["simulate", "courtyard", *words])
    assert result.exit_code == 2
    assert "is no number such as 1000 or 0.5" in result.output


def test_numbers_with_commas_are_as_many_as_their_form_has() -> None:
    assert numbers("--charge", "1,2.5", "X,Y[,KG]") == (1.0, 2.5)
    assert numbers("--charge", "-3,4,60", "X,Y[,KG]") == (-3.0, 4.0, 60.0)


@pytest.mark.parametrize("text", ["1", "1,2,3", "a,b", "1_0,2", ""])
def test_numbers_in_another_form_are_refused(text: str) -> None:
    with pytest.raises(BlastEnvError) as caught:
        numbers("--at", text, "X,Y")
    assert str(caught.value) == f"--at is {text!r}, must be two numbers as X,Y"


def test_a_note_of_a_store_is_one_plain_line(tmp_path: Path) -> None:
    path = tmp_path / "a.sqlite"
    path.write_bytes(b"")

    def work() -> None:
        assert Store(path).get("key") is None

    command = typer.Typer()
    command.command(cls=ShellCommand)(work)
    before = warnings.showwarning
    with warnings.catch_warnings(action="default"):
        result = CliRunner().invoke(command)
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr.startswith(f"note: {path}: has lost its content")
    assert result.stderr.count("\n") == 1
    assert warnings.showwarning is before


def test_a_log_file_gets_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    passed_s = 0.0
    monkeypatch.setattr(output, "perf_counter", lambda: passed_s)
    with output.progress_bar("training runs/a") as progress:
        for step in range(1, 101):
            passed_s += 1.0
            progress(step / 100)
            if step == 30:
                printed = capsys.readouterr().err
    assert printed == "training runs/a: 30% after 30 s\n"
    assert capsys.readouterr().err == (
        "training runs/a: 60% after 60 s\ntraining runs/a: 90% after 90 s\n"
    )
