"""Wrong types, special files, numbers out of bounds, foreign texts end in the documented error."""

import os
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from stat import S_IFSOCK
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

import blast_env
from blast_env import Charge, load_scenario, simulate
from blast_env.answers import Table
from blast_env.answers.terminal import print_parts
from blast_env.benchmark import Run, Submission, make
from blast_env.benchmark.methods import find_method
from blast_env.calibration import fit_power_law, kingery_bulmash, load_calibration
from blast_env.cli import app
from blast_env.documents import DocumentError, parse_json, read_text
from blast_env.errors import BlastEnvError
from blast_env.evaluation import evaluate_layout
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.files import write_atomically
from blast_env.io.importing import ImportOptions, import_site
from blast_env.layout import LayoutFile
from blast_env.parquet import checked_table, write_table
from blast_env.particles import COLLISION_COLUMNS
from blast_env.response import catalogue, respond
from blast_env.site import Scenario, ScenarioError, save_scenario
from blast_env.store import Store
from blast_env.tables import markdown_table
from blast_env.values import STEERING, markup_text
from tests.io.importing.maps import BLOCK
from tests.scenarios import BALLISTIC_COURTYARD
from tests.site.documents import Document, changed, key_paths, minimal_document, value_at

ENORMOUS = 10**400
LONG = "x" * 100_000
FIVE: Any = 5
SOON: Any = "soon"
COURTYARD, FAR = load_scenario("courtyard"), Charge((ENORMOUS, 1), 1.0)
"""Arguments of types that the checker of types would refuse."""


def blast(**changes: Any) -> Callable[[], Any]:
    arguments = {"scenario": "courtyard", "engine": "event"} | changes
    return lambda: simulate(**arguments)


def evaluation(**changes: Any) -> Callable[[], Any]:
    arguments = {"scenario": "courtyard", "layout": (), "seeds": (0, 1), "engine": "event"}
    return lambda: evaluate_layout(**arguments | changes)


def kb(**changes: Any) -> Callable[[], Any]:
    arguments: dict[str, Any] = {"quantity": "reflected_impulse", "distance_m": 10.0}
    return lambda: kingery_bulmash(**{"charge_kg": 1.0} | arguments | changes)


WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "seed 1.5": (blast(seed=1.5), r"^seed is 1.5, must be an integer from 0 to 922337203"),
    "seed none": (blast(seed=None), "^seed is nothing"),
    "seed 2**63": (blast(seed=2**63), "^seed is 9223372036854775808, must be an integer from 0"),
    "seed enormous": (blast(seed=ENORMOUS), "^seed is an integer of about 400 digits"),
    "engine 5": (blast(engine=5), "^engine is 5, must be a name or an engine"),
    "engine long": (blast(engine=LONG), "^no engine 'xxx"),
    "engine escape": (blast(engine="\x1b[31m"), r"^no engine '\\x1b\[31m'"),
    "layout 5": (blast(layout=5), "^layout is 5, must be a list"),
    "layout floats": (blast(layout=[(1.0, 2)]), "layout"),
    "layout enormous": (blast(layout=[(ENORMOUS, 0)]), "an integer of about 400 digits"),
    "scenario 5": (blast(scenario=5), "^scenario is 5, must be a name"),
    "scenario keys": (blast(scenario={1: 2}), "has the key 1: Keys should be strings"),
    "scenario null": (blast(scenario="\0"), r"null characters"),
    "scenario long": (blast(scenario=f"{LONG}.toml"), r"path is .* of 100005 characters"),
    "cells tiny": (blast(engine="gas", cell_m=1e-9), "^cell_m is 1e-09, .* at least 0.001 m"),
    "settled text": (lambda: GasEngine(settled_s=SOON), "^settled_s is 'soon', must be a number"),
    "settled nan": (lambda: GasEngine(settled_s=float("nan")), "^settled_s is nan, must be a fini"),
    "settled 0": (lambda: GasEngine(settled_s=0.0), "^settled_s is 0, must be above 0"),
    "cells enormous": (blast(engine="gas", cell_m=ENORMOUS), "^cell_m is an integer of about 400"),
    "cells of balls": (blast(cell_m="a"), "'event' has no cells"),
    "seeds 5": (evaluation(seeds=5), "^seeds is 5, must be integers"),
    "seeds 2**63": (evaluation(seeds=[0, 2**63]), r"^seeds\[1\] is 9223372036854775808, must be"),
    "processes a": (evaluation(processes="a"), "^processes is 'a'"),
    "cache 5": (evaluation(cache=5), "^cache is 5"),
    "calibration 5": (lambda: load_calibration(FIVE), "^path is 5, must be a path"),
    "quantity 5": (kb(quantity=5), "5"),
    "distance": (kb(distance_m=ENORMOUS), "must be made of numbers"),
    "fit": (lambda: fit_power_law([1, 2], [ENORMOUS, 1]), "must be made of numbers"),
    "charge 5": (lambda: COURTYARD.with_charge(FIVE), "^charge is 5, must be a Charge"),
    "charge enormous": (lambda: COURTYARD.with_charge(FAR), "an integer of about 400 digits"),
    "file 5": (lambda: save_scenario("courtyard", FIVE), "^path is 5, must be a path"),
    "file null": (lambda: save_scenario("courtyard", "a\0.toml"), "null characters"),
    "layout file 5": (lambda: blast_env.load_layout(FIVE), "^path is 5, must be a path"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named_with_its_value(name: str) -> None:
    call, words = WRONG[name]
    with pytest.raises(BlastEnvError, match=words) as caught:
        call()
    assert len(str(caught.value)) < 1000


def test_a_path_that_is_none_is_refused_by_every_writer() -> None:
    result = simulate(BALLISTIC_COURTYARD, engine="event")
    for write in (
        result.to_excel,
        partial(write_table, result.collisions, COLLISION_COLUMNS, result.run_record),
        lambda path: write_atomically(path).__enter__(),
    ):
        with pytest.raises(BlastEnvError, match=r"^path is 5, must be a path"):
            write(FIVE)
    with pytest.raises(BlastEnvError, match=r"^calibration is 5, must be a Calibration"):
        result.impulse("building", FIVE)
    with pytest.raises(BlastEnvError, match=r"^no structure 5; known: building"):
        result.impulse(FIVE)


@pytest.mark.parametrize("text", ["\x1b[31mred", "a\0b", "a\u202eb", "a\x85b", "a\ud800b"])
def test_texts_of_a_scenario_do_not_steer_what_shows_them(text: str) -> None:
    document = BALLISTIC_COURTYARD.model_dump(mode="json", exclude_none=True)
    keep_out = {"corner_m": [20.0, 20.0], "size_m": [1.0, 1.0], "reason": text}
    document["build_zone"]["keep_outs"] = [keep_out]
    with pytest.raises(ScenarioError, match=r"keep_outs\[0\].reason: is '?a?") as caught:
        Scenario.from_document(document, "mine")
    assert str(caught.value).isprintable()


def invoke(*arguments: str | Path) -> tuple[int, str]:
    result = CliRunner().invoke(app, list(map(str, arguments)), catch_exceptions=False)
    return result.exit_code, result.output


def test_what_looks_like_markup_is_shown_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    save_scenario(BALLISTIC_COURTYARD, "[red]a.toml")
    assert invoke("draw", "[/x]") == (1, "[/x]: must be a .toml file\n")
    code, output = invoke(
        "simulate", "[red]a.toml", "--engine", "event", "--excel", "[b]:smile:.xlsx"
    )
    assert code == 0
    assert "[b]:smile:.xlsx" in output
    assert (tmp_path / "[b]:smile:.xlsx").exists()
    for command in (("simulate", "[/x].toml"), ("train", "--resume", "[/x]")):
        code, output = invoke(*command)
        assert code == 2
        assert output.strip().startswith("error: [/x]")


def test_nothing_on_a_command_line_steers_the_terminal() -> None:
    code, output = invoke("simulate", "\x1b[31m\x9b\u202e.toml")
    assert code == 2
    assert output == "error: \\x1b[31m\\x9b\\u202e.toml: there is no such file\n"


# --- Special files, numbers out of bounds and foreign texts end in the documented error.


SPECIAL: Final = ("a pipe", "a device", "a socket", "a sparse file of 20 GB")

TEXTS: Final = (
    *("\x1b]0;title\x07", "\x1b[31mred", "a\0b", "\u202eright to left", "\u2066\u200f", "\x9b2J"),
    *("a\n\n# Heading", "<script>alert(1)</script>", "[here](javascript:alert(1))", "{raw}`x`"),
)

USED: Final = ("window_laminated_12", "concrete_200", "brick_215", "steel_stud")
COMPONENTS: Final[Document] = {
    name: catalogue()[name].model_dump(mode="json", exclude_none=True) for name in USED
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
        checked_table(
            tmp_path / "a.parquet",
            [
                collision_column
                for collision_column in COLLISION_COLUMNS
                if collision_column.name == column
            ],
        )


def test_values_are_counted_before_they_are_read() -> None:
    with pytest.raises(DocumentError, match="3,200,002 commas and opening brackets, must have"):
        parse_json("[" + "[]," * 1_600_000 + "[]]")


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
    table = Table(submission.method, ("method",), ((text,),))
    print_parts([table])
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
    for case in (layout, crs):
        assert "x" * 81 not in str(case.value)


@pytest.mark.parametrize("name", ["os:system", "builtins:pow", "math:pi", "nothing:at_all"])
def test_a_function_that_is_no_method_is_refused(name: str) -> None:
    with pytest.raises(BlastEnvError):
        find_method(name)(make("control_room-known-v2", 0), 0)
