"""Special files, numbers out of bounds and foreign texts end in the documented error."""

import os
from contextlib import suppress
from pathlib import Path
from stat import S_IFSOCK
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from blast_agents.training.checkpoint import _check_optimizer
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.benchmark import Run, Submission, make
from blast_env.benchmark.methods import find_method
from blast_env.benchmark.standings import StandingsTable
from blast_env.cli.output import print_table
from blast_env.documents import DocumentError, parse_json, read_text
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.io.importing import ImportOptions, import_site
from blast_env.layout import LayoutFile
from blast_env.particles.parquet import checked_table
from blast_env.response.components import find_component
from blast_env.response.facade import respond
from blast_env.site import Scenario, ScenarioError
from blast_env.store import Store
from blast_env.tables import markdown_table
from blast_env.values import STEERING, markup_text
from tests.io.importing.maps import BLOCK
from tests.site.documents import Document, changed, key_paths, minimal_document, value_at

SPECIAL: Final = ("a pipe", "a device", "a socket", "a sparse file of 20 GB")

TEXTS: Final = (
    *("\x1b]0;title\x07", "\x1b[31mred", "a\0b", "\u202eright to left", "\u2066\u200f", "\x9b2J"),
    *("a\n\n# Heading", "<script>alert(1)</script>", "[here](javascript:alert(1))", "{raw}`x`"),
)

USED: Final = ("window_laminated_12", "concrete_200", "brick_215", "steel_stud")
COMPONENTS: Final[Document] = {
    name: find_component(name).model_dump(mode="json", exclude_none=True) for name in USED
}


def site_document() -> Document:
    """Return a small site with components of all kinds, and an objective with references."""
    document = minimal_document()
    parts = [{"walls": [w], "wall": c} for w, c in (("east", USED[2]), ("north", USED[3]))]
    facade = {"glazing": USED[0], "wall": USED[1], "parts": parts}
    document["structures"][0] |= {"height_m": 3.0, "weight": 3.0, "facade": facade}
    references = {"reference_impulse_pa_s": 500.0, "reference_peak_pa": 5e4}
    return document | {
        "components": COMPONENTS,
        "objective": {"quantity": "both", **references},
    }


DOCUMENT: Final = site_document()
NUMBERS: Final = [
    path
    for path in key_paths(DOCUMENT)
    if isinstance(value_at(DOCUMENT, path), float) and path[0] in ("components", "objective")
]


def special(path: Path, kind: str) -> Path:
    if kind == "a pipe":
        os.mkfifo(path)
    elif kind == "a device":
        path.symlink_to("/dev/full")
    elif kind == "a socket":
        os.mknod(path, S_IFSOCK | 0o600)
    else:
        with path.open("wb") as file:
            file.truncate(20_000_000_000)  # takes no room on the disk
    return path


@pytest.mark.parametrize("kind", SPECIAL)
def test_a_special_file_is_refused(kind: str, tmp_path: Path) -> None:
    path = special(tmp_path / "a.json", kind)
    with pytest.raises(DocumentError, match=r"not a regular file|bytes, must|cannot be read"):
        read_text(path)
    with pytest.raises(BlastEnvError, match=r"a\.json: (cannot be used|is damaged)"):
        Store(path)


def test_nothing_is_written_in_the_place_of_a_device(tmp_path: Path) -> None:
    path = special(tmp_path / "a.json", "a pipe")
    with pytest.raises(BlastEnvError, match="not a regular file"), write_atomically(path):
        pass
    assert path.is_fifo()


@pytest.mark.parametrize(
    ("column", "values", "words"),
    [
        ("structure", [1.0], "column 'structure' holds double, must hold texts"),
        ("time_s", ["a"], "column 'time_s' holds string, must hold numbers or truth values"),
        ("own", [[1.0]], "column 'own' holds list"),
        ("structure", ["a", None], "column 'structure' has 1 missing values"),
    ],
)
def test_a_table_has_the_kinds_of_its_columns(
    column: str, values: list[Any], words: str, tmp_path: Path
) -> None:
    pq.write_table(pa.table({column: values}), tmp_path / "a.parquet")
    with pytest.raises(BlastEnvError, match=f"a.parquet: {words}"):
        checked_table(tmp_path / "a.parquet")


def test_values_are_counted_before_they_are_read() -> None:
    with pytest.raises(DocumentError, match="3,200,002 commas and opening brackets, must have"):
        parse_json("[" + "[]," * 1_600_000 + "[]]")


@settings(deadline=None, derandomize=True)
@given(st.sampled_from(NUMBERS), st.sampled_from((5e-324, 1e-300, 1e38, 1e300, -1.0, True, "1.0")))
def test_any_number_of_a_site_is_refused_or_gives_finite_numbers(
    path: tuple[str | int, ...], value: Any
) -> None:
    with suppress(ScenarioError):
        scenario = Scenario.from_document(changed(DOCUMENT, path, value), "test")
        bays, house = scenario.bays, scenario.structures[0]
        time_s = np.linspace(0.0, 0.02, 41)
        pressure_pa = np.outer(np.ones(len(bays)), 3e4 * np.exp(-time_s / 0.004))
        load = scenario.objective.load(300.0, 3e4, house.weight, house.counted_peak_weight)
        panes = respond(bays, time_s, pressure_pa).broken_panes
        assert np.isfinite([panes, load, 1.0 / load]).all()


@pytest.mark.parametrize("text", TEXTS)
def test_foreign_texts_reach_neither_terminal_nor_page_as_they_are(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    submission = Submission(text, (Run("control_room-known-v2", 0, 0, 0, ()),), text)
    table = StandingsTable(submission.method, ("method",), ((text,),))
    print_table(table.title, table.headers, table.rows)
    assert STEERING.search(capsys.readouterr().out) is None
    page = markdown_table(("note",), [(markup_text(submission.note),)])
    marks = ("<script", "[here](javascript", "\n# Heading", "{raw}`", "\x1b", "\u202e")
    assert not any(mark in page for mark in marks)


def test_messages_quote_little_of_a_long_text() -> None:
    long = "x" * 500_000
    with pytest.raises(BlastEnvError) as layout:
        LayoutFile((), long, "0" * 64).layout_for("courtyard")
    with pytest.raises(BlastEnvError) as crs:
        import_site(BLOCK, ImportOptions(crs=long))
    for each in (layout, crs):
        assert "x" * 81 not in str(each.value)


@pytest.mark.parametrize("name", ["os:system", "builtins:pow", "math:pi", "nothing:at_all"])
def test_a_function_that_is_no_method_is_refused(name: str) -> None:
    with pytest.raises(BlastEnvError):
        find_method(name)(make("control_room-known-v2", 0), 0)


def stepped() -> torch.optim.Adam:
    layer = torch.nn.Linear(2, 1)
    optimizer = torch.optim.Adam(layer.parameters(), lr=1e-3)
    layer(torch.ones(1, 2)).sum().backward()
    optimizer.step()
    return optimizer


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("lr", "fast"),
        ("foreach", True),
        ("exp_avg", torch.zeros(7)),
        ("exp_avg", "x"),
        ("exp_avg_sq", torch.full((1, 2), -1.0)),
    ],
)
def test_the_state_of_a_forged_optimiser_is_refused(key: str, value: Any) -> None:
    optimizer = stepped()
    content = optimizer.state_dict()
    _check_optimizer(optimizer, content)
    (content["param_groups"][0] if key in ("lr", "foreach") else content["state"][0])[key] = value
    with pytest.raises((ValueError, KeyError)):
        _check_optimizer(stepped(), content)
