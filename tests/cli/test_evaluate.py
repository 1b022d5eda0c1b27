"""`blast-env evaluate`, run in this process."""

import json
import signal
from functools import partial
from pathlib import Path

import pandas as pd
import pytest

from blast_env import save_scenario
from blast_env.evaluation import evaluate_layout
from blast_env.io.export import SUFFIXES
from blast_env.layout import LayoutFile, write_layout
from blast_env.particles.event import EventRun
from blast_env.site import PointSource, Scenario
from tests.cli.running import run
from tests.envs.small import small_scenario
from tests.evaluation.cases import WALL
from tests.gas_sites import hut
from tests.scenarios import BALLISTIC_COURTYARD

CELLS = WALL  # in the way of most threats: in sparse air, few modules hardly show

Given = tuple[str | Path, ...]


@pytest.fixture
def given(tmp_path: Path) -> Given:
    """Name a layout, and the courtyard in sparse air, where a blast takes a tenth of the time."""
    layout, site = tmp_path / "layout.json", tmp_path / "sparse.toml"
    layout.write_text(json.dumps(CELLS))
    save_scenario(BALLISTIC_COURTYARD, site)
    return ("--layout", layout, "--scenario", site)


evaluate = partial(run, "evaluate", "--engine", "event")
"""With blasts of milliseconds, unless the arguments name another engine."""


def test_it_prints_the_evaluation_and_writes_all_files(given: Given, tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    options = ("--seeds", "3", "--first-seed", "7", "--processes", "2", "--out", out)
    result = evaluate(*given, *options)
    assert result.exit_code == 0, result.output
    expected = evaluate_layout(BALLISTIC_COURTYARD, CELLS, (7, 8, 9), engine="event")
    content = json.loads((out / "evaluation.json").read_text())
    assert {name: content[name] for name in expected.to_dict()} == expected.to_dict()
    half = 100.0 * (expected.mean_reduction - expected.ci95[0])
    interval = f"+- {half:.1f} (95 %, threats)"
    assert f"mean reduction {100.0 * expected.mean_reduction:.1f} % {interval}" in result.stdout
    assert f"mean of the worst 20 % {expected.cvar:,.0f} Pa s" in result.stdout
    assert f"seed {expected.worst.threat.seed}: {expected.worst.impulse_pa_s:,.0f}" in result.stdout
    assert "means over 3 threats (seeds 7 to 9)" in result.stdout
    tables = [f"{name}.csv" for name in ("structures", "buildings", "modules", "threats")]
    for name in ("evaluation.json", *tables):
        assert f"wrote {out / name}" in result.stdout
    for name, table in (("structures", expected.table), ("threats", expected.threat_table)):
        written = pd.read_csv(out / f"{name}.csv")
        pd.testing.assert_frame_equal(written, table, check_dtype=False, rtol=1e-9)
    assert (out / "evaluation.png").stat().st_size > 1000


def test_it_prints_json_and_says_when_one_threat_has_no_interval(given: Given) -> None:
    result = evaluate(*given, "--seeds", "1", "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)
    assert content["layout"] == [list(cell) for cell in CELLS]
    assert content["result"]["reduction"]["ci95_low"] is None
    assert content["files"] == []
    assert content["cache"] == {"blasts": 2, "hits": 0, "hit_rate": 0.0}
    table = evaluate(*given, "--seeds", "1")
    share = 100.0 * content["result"]["reduction"]["value"]
    assert f"mean reduction {share:.1f} %\n" in table.stdout
    assert "(cells)" not in table.stdout


def test_a_layout_file_may_go_while_blasts_run(
    given: Given, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of it is read before the first blast, so that no result is lost."""
    advance, layout = EventRun.advance, tmp_path / "layout.json"

    def gone(run: EventRun, until_s: float) -> None:
        layout.unlink(missing_ok=True)
        advance(run, until_s)

    monkeypatch.setattr(EventRun, "advance", gone)
    result = evaluate(*given, "--seeds", "1")
    assert result.exit_code == 0, result.output
    assert not layout.exists()


def test_the_next_run_finds_the_blasts_that_the_first_one_kept(
    given: Given, tmp_path: Path
) -> None:
    options = ("--engine", "event", "--cache", tmp_path / "blasts")
    first = evaluate(*given, "--seeds", "2", *options)
    assert first.exit_code == 0, first.output
    assert "4 blasts run, 0 known already (cache hit rate 0.0 %)" in first.stdout
    second = evaluate(*given, "--seeds", "3", "--json", *options)
    content = json.loads(second.stdout)
    assert content["cache"] == {"blasts": 2, "hits": 4, "hit_rate": pytest.approx(2 / 3)}
    fresh = evaluate(*given, "--seeds", "3", "--json", "--engine", "event")
    assert json.loads(fresh.stdout)["result"] == content["result"]


def test_sigterm_ends_a_command_as_an_interruption_with_its_blasts_kept(
    given: Given, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    advance, runs = EventRun.advance, [0]

    def terminated(self: EventRun, until_s: float) -> None:
        runs[0] += 1
        if runs[0] == 4:
            signal.raise_signal(signal.SIGTERM)
        advance(self, until_s)

    options = (*given, "--seeds", "2", "--out", tmp_path / "out")
    cache = tmp_path / "cache"
    monkeypatch.setattr(EventRun, "advance", terminated)
    result = evaluate(*options, "--cache", cache)
    assert result.exit_code == 128 + signal.SIGTERM
    assert f"resumes with the blasts kept in {cache}" in " ".join(result.stderr.split())
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    assert not (tmp_path / "out").exists()
    before = runs[0]
    assert evaluate(*options, "--cache", cache).exit_code == 0
    again = runs[0] - before
    evaluate(*options)
    assert again < runs[0] - before - again


def test_fixed_charges_count_once_each_and_are_named(tmp_path: Path) -> None:
    places = ((2.0, 5.0), (2.0, 7.0), (2.0, 9.0))
    points = tuple(PointSource(kind="point", position_m=place, tnt_kg=100.0) for place in places)
    save_scenario(small_scenario().model_copy(update={"charge": points}), tmp_path / "points.toml")
    (tmp_path / "layout.json").write_text("[]")
    site = ("--scenario", tmp_path / "points.toml", "--layout", tmp_path / "layout.json")
    result = evaluate(*site, "--seeds", 3, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    met = pd.read_csv(tmp_path / "out" / "threats.csv")[["charge_x_m", "charge_y_m"]]
    assert {*met.itertuples(index=False, name=None)} == {*places}
    assert "note: the site has 3 fixed charges, which all count here; the" in result.stdout


def test_fixed_charges_that_do_not_count_by_their_weights_or_at_all_are_named(
    tmp_path: Path,
) -> None:
    places = ((2.0, 5.0), (2.0, 9.0))
    points = [PointSource(kind="point", position_m=place, tnt_kg=100.0) for place in places]
    points[0] = points[0].model_copy(update={"weight": 9.0})
    site = small_scenario().model_copy(update={"charge": tuple(points)})
    save_scenario(site, tmp_path / "points.toml")
    (tmp_path / "layout.json").write_text("[]")
    options = ("--scenario", tmp_path / "points.toml", "--layout", tmp_path / "layout.json")
    both, one = (evaluate(*options, "--seeds", seeds).stdout for seeds in (2, 1))
    assert "2 fixed charges, which all count here alike, whatever their weights" in both
    assert "note: not among these: 1 of the 2 fixed charges of the site" in one


def test_every_mass_of_a_site_counts_at_a_given_place(tmp_path: Path) -> None:
    """Draws had missed that of a source which hardly ever comes, without a word."""
    document = hut().model_dump(mode="json", exclude_none=True)
    way = {"kind": "segment", "start_m": [1.0, 4.0], "end_m": [2.0, 4.0]}
    document["charge"] = [way | {"tnt_kg": 1.0}, way | {"tnt_kg": 2.0, "weight": 1e-6}]
    save_scenario(Scenario.from_document(document, "rare"), tmp_path / "rare.toml")
    (tmp_path / "layout.json").write_text("[]")
    site = ("--scenario", tmp_path / "rare.toml", "--layout", tmp_path / "layout.json")
    options = (*site, "--engine", "gas", "--cell", "0.5", "--seeds", 2, "--out", tmp_path / "out")
    alone = evaluate(*options).stdout
    assert "note: not among these: any charge of 1 of the 2 sources of charges" in alone
    placed = evaluate(*options, "--charge", "2,4").stdout
    assert "note: all masses count here alike, whatever the weights" in placed
    assert "not among these" not in placed
    assert pd.read_csv(tmp_path / "out" / "threats.csv")["tnt_kg"].tolist() == [1.0, 2.0]


def test_a_layout_is_exported_with_its_provenance(tmp_path: Path) -> None:
    site, path = small_scenario(), tmp_path / "layout.json"
    save_scenario(site, tmp_path / "small.toml")
    write_layout(path, site, CELLS[:0], {"method": "by hand"})
    given = ("--layout", path, "--scenario", tmp_path / "small.toml", "--seeds", 1)
    for export, files in (
        (tmp_path / "copy.json", [tmp_path / "copy.json"]),
        (
            tmp_path / "all",
            [tmp_path / "all" / f"layout{suffix}" for suffix in SUFFIXES if suffix != ".ifc"],
        ),
    ):
        result = evaluate(*given, "--export", export)
        assert result.exit_code == 0, result.output
        assert all(f"wrote {file}" in result.stdout and file.exists() for file in files)
    for copy in (tmp_path / "copy.json", tmp_path / "all" / "layout.json"):
        assert LayoutFile.load(copy) == LayoutFile.load(path)
