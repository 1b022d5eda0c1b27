"""Special files, numbers out of bounds and foreign texts end in the usual errors, or are shown."""

import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from blast_agents.training.checkpoint import _check_optimizer

from blast_env.benchmark import Run, Submission
from blast_env.benchmark.standings import StandingsTable
from blast_env.design.surrogate.network import load_surrogate
from blast_env.documents import DocumentError, parse_json, read_text
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import simulate
from blast_env.evaluation.engines.gas import GasResult
from blast_env.files import write_atomically
from blast_env.io.importing import ImportOptions, import_site
from blast_env.layout import LayoutFile
from blast_env.particles.parquet import checked_table
from blast_env.site import Scenario, ScenarioError
from blast_env.store import Store
from tests.attack import hostile

DOCUMENT = hostile.site_document()


@pytest.mark.parametrize("kind", hostile.SPECIAL)
def test_a_special_file_is_refused(kind: str, tmp_path: Path) -> None:
    hostile.special(tmp_path / "a.json", kind)
    with pytest.raises(DocumentError, match=r"not a regular file|bytes, must|cannot be read"):
        read_text(tmp_path / "a.json")
    with pytest.raises(BlastEnvError, match=r"a\.json: (cannot be used|is damaged)"):
        Store(tmp_path / "a.json")


def test_nothing_is_written_in_the_place_of_a_device(tmp_path: Path) -> None:
    hostile.special(tmp_path / "a.json", "a pipe")
    with (
        pytest.raises(BlastEnvError, match=r"a\.json: is not a regular file"),
        write_atomically(tmp_path / "a.json"),
    ):
        pass
    assert (tmp_path / "a.json").is_fifo()


@pytest.mark.parametrize(
    ("column", "values", "words"),
    [
        ("structure", [1.0], "column 'structure' holds double, must hold texts"),
        ("time_s", ["a"], "column 'time_s' holds string, must hold numbers or truth values"),
        ("time_s", [b"a"], "column 'time_s' holds binary"),
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


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (("components", "brick", "section", "thickness_m"), 1e-300, "equal to 0.01"),
        (("components", "brick", "section", "thickness_m"), "0.2", "should be a valid number"),
        (("components", "window", "outer_thickness_mm"), 1e-300, "must be 0 or at least 1"),
        (("components", "concrete", "section", "steel_pa"), 3e9, "must be at most 0.0085"),
        (("components", "window", "title"), "\x1b[2J", "must not have the character"),
    ],
)
def test_numbers_of_a_site_are_numbers_within_bounds(
    place: hostile.Place, value: Any, words: str
) -> None:
    document = hostile.replaced(DOCUMENT, place, value)
    if value == 3e9:
        document["components"]["concrete"]["section"]["steel_share"] = 0.03
    with pytest.raises(ScenarioError, match=words):
        Scenario.from_document(document, "test")


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("members", 0, 0, 0), 1e38),
        (("scale", 0), 1e-300),
        (("mean", 0), "1.0"),
        (("mean", 0), True),
    ],
)
def test_numbers_of_a_surrogate_are_numbers_within_bounds(
    place: hostile.Place, value: Any, tmp_path: Path
) -> None:
    make, _, _ = hostile.DOCUMENTS["surrogate.json"]
    (tmp_path / "a.json").write_text(json.dumps(hostile.replaced(make(), place, value)))
    with pytest.raises(
        BlastEnvError, match=rf"a.json: is no surrogate, .*{place[0]}.*Input should"
    ):
        load_surrogate(tmp_path / "a.json")


@pytest.mark.parametrize("text", hostile.TEXTS[:-2])
def test_foreign_texts_reach_neither_terminal_nor_page_as_they_are(text: str) -> None:
    run = Run("control_room-known-v2", 0, 0, 0, ())
    assert hostile.shown([StandingsTable(text, ("method",), ((text,),))], "") == ""
    assert hostile._use_submission(Submission(text, (run,), text)) == ""


def test_messages_quote_little_of_a_long_text(tmp_path: Path) -> None:
    long = "x" * 500_000
    with pytest.raises(BlastEnvError) as layout:
        LayoutFile((), long, "0" * 64).layout_for("courtyard")
    (tmp_path / "a.geojson").write_text(json.dumps(hostile.map_document()))
    with pytest.raises(BlastEnvError) as crs:
        import_site(tmp_path / "a.geojson", ImportOptions(crs=long))
    for each in (layout, crs):
        assert hostile.message_problem(str(each.value)) == ""


def test_a_gauge_that_is_moved_out_of_a_solid_is_said_to_be() -> None:
    site = hostile.gauge_site((22.0, 10.0, 0.3))
    result = simulate(site, engine="gas", cell_m=0.5, until=0.001)
    assert isinstance(result, GasResult)
    (note,) = result.moved_gauges
    assert "gauge gauge: lies inside a solid" in note
    assert note in result.gauge_notes
    assert hostile.gauge_outcome((15.0, 10.0, 1.0)) == ""


@pytest.mark.parametrize("name", ["os:system", "builtins:pow", "math:pi", "nothing:at_all"])
def test_what_is_no_method_is_refused(name: str) -> None:
    assert hostile.method_outcome(name) == ""


def _stepped() -> torch.optim.Adam:
    layer = torch.nn.Linear(2, 1)
    optimizer = torch.optim.Adam(layer.parameters(), lr=1e-3)
    layer(torch.ones(1, 2)).sum().backward()
    optimizer.step()
    return optimizer


def _forge(content: Any, change: str) -> None:
    if change == "rate":
        content["param_groups"][0]["lr"] = "fast"
    elif change == "setting":
        content["param_groups"][0]["foreach"] = True
    elif change == "shape":
        content["state"][0]["exp_avg"] = torch.zeros(7)
    elif change == "text":
        content["state"][0]["exp_avg"] = "x"
    elif change == "index":
        content["state"][9] = content["state"].pop(0)
    else:
        content["state"][0]["exp_avg_sq"] = torch.full((1, 2), -1.0)


def test_the_state_of_an_optimiser_fits_itself() -> None:
    optimizer = _stepped()
    _check_optimizer(optimizer, optimizer.state_dict())


@pytest.mark.parametrize("change", ["rate", "setting", "shape", "text", "index", "negative"])
def test_the_state_of_a_forged_optimiser_is_refused(change: str) -> None:
    optimizer = _stepped()
    content = optimizer.state_dict()
    _forge(content, change)
    with pytest.raises((ValueError, KeyError)):
        _check_optimizer(_stepped(), content)
