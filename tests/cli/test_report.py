"""`blast-env report`: what is wrong is said before the first blast."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from blast_env.cli import app
from blast_env.layout import write_layout
from blast_env.site import save_scenario
from tests.report.sites import LAYOUT, small_hut


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, ...]:
    save_scenario(small_hut(), tmp_path / "hut.toml")
    write_layout(tmp_path / "wall.json", small_hut(), LAYOUT, {})
    return str(tmp_path / "hut.toml"), "--layout", str(tmp_path / "wall.json")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--units", "bar"), "no units 'bar'; known: psi, si"),
        (("--limit", "hut"), "--limit is 'hut', must be NAME=IMPULSE,PEAK"),
        (("--limit", "shed=1"), "no building 'shed'; known: hut"),
        (("--charge", "1"), "--charge is '1', must be two or three numbers as X,Y[,KG]"),
        (("--charge", "7,4"), "must keep clear of it"),
        (("--charge", "7,4,5"), "must keep clear of it"),
        (("--charge", "4.25,4,5"), "closer than the charge's radius"),
        (("--cells", "0.25", "0.5"), "the coarser one first"),
        (("--cells", "fine", "coarse"), "the coarser one first"),
        (
            ("--cells", "rough", "fine"),
            "--cells is 'rough', must be a length in m, or coarse, fine",
        ),
        (("--threats", "9"), "threats is 9, must be 1 to 6"),
        (("--pdf", "a.doc"), "a.doc: suffix is '.doc', must be .pdf"),
        (("--front", "no.csv"), "no.csv: is not the front.csv of a search"),
    ],
)
def test_bad_options(
    files: tuple[str, ...], options: tuple[str, ...], words: str, tmp_path: Path
) -> None:
    out = tmp_path / "a.html"
    done = CliRunner().invoke(app, ["report", *files, "--out", str(out), *options])
    assert done.exit_code == 2, done.stdout
    assert words in " ".join(done.stderr.split())
    assert not out.exists()
