"""`blast-env search`, run in this process."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from blast_agents import packaged_agent
from blast_agents.packaged import search_from_agent
from typer.testing import CliRunner, Result

from blast_env import load_scenario, save_scenario
from blast_env.answers import Number
from blast_env.cli import app
from blast_env.design.search import DesignProblem, find_proposer
from blast_env.evaluation import BlastEvaluator, SeedRange, draw_threats
from blast_env.evaluation.cases import search_set
from blast_env.layout import LayoutFile, load_layout
from blast_env.particles.event import EventRun
from blast_env.site import Charge, SegmentSource
from blast_env.surrogate import packaged_surrogate
from tests.catalogue_sites import wide_yard
from tests.design.search_cases import small_scenario
from tests.gas_sites import hut

CHARGE = Charge((5.0, 20.5), 100.0)


def search_without_blasts(*arguments: str | Path) -> Result:
    """Run the command for a proposal by guesses."""
    return CliRunner().invoke(app, ["search", "--method", "package", *map(str, arguments)])


@pytest.fixture
def site(tmp_path: Path) -> Path:
    path = tmp_path / "site.toml"
    save_scenario(small_scenario(), path)
    return path


def search(*arguments: str | Path | float) -> Result:
    """Run the command, by particles unless an engine is named."""
    engine = () if "--engine" in arguments else ("--engine", "event")
    return CliRunner().invoke(app, ["search", *map(str, (*arguments, *engine))])


def test_it_finds_what_the_library_finds_and_writes_all_files(site: Path, tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    options = ("--budget", 20, "--seed", 3, "--held-out", 4, "--out", out)
    result = search("--method", "nsga2", "--scenario", site, *options)
    assert result.exit_code == 0, result.output
    evaluator = BlastEvaluator(load_scenario(site), "event")
    problem = DesignProblem(evaluator, search_set(evaluator.scenario, CHARGE, 2, 3))
    expected = find_proposer("nsga2").propose(problem, 20, 3)
    assert load_layout(out / "layout.json", evaluator.scenario) == expected.layout
    assert f"{expected.blasts} of 20 blasts spent" in result.stdout
    assert f"{problem.load(expected.layout):,.0f}" in result.stdout
    content = LayoutFile.load(out / "layout.json")
    assert content.site_hash == load_scenario(site).site_hash
    assert content.provenance["options"]["method"] == "nsga2"
    assert content.provenance["result"]["blasts"] == expected.blasts
    assert "blast_env" in content.provenance["versions"]
    for name, table in (("history", expected.history_table()), ("front", expected.front_table())):
        written = pd.read_csv(out / f"{name}.csv").fillna("")  # the empty layout is an empty field
        pd.testing.assert_frame_equal(written, table, check_dtype=False, rtol=1e-9)
    for name in ("layout.json", "layout.png", "history.csv", "front.csv", "search.png"):
        assert f"wrote {out / name}" in result.stdout
    assert (out / "search.png").stat().st_size > 1000


def test_a_hidden_threat_is_searched_for_wherever_it_may_be(tmp_path: Path) -> None:
    road = SegmentSource(kind="segment", start_m=(5.0, 15.0), end_m=(5.0, 25.0), tnt_kg=100.0)
    scenario = small_scenario().model_copy(update={"charge": (road,)})
    out, site = tmp_path / "out", tmp_path / "site.toml"
    save_scenario(scenario, site)
    options = ("--threat", "hidden", "--threats", 3, "--budget", 12, "--held-out", 2, "--out", out)
    result = search("--scenario", site, "--method", "random", "--risk", "cvar", *options)
    assert result.exit_code == 0, result.output
    assert "mean of the worst 20 %" in result.stdout
    threats = search_set(scenario, None, 1, 0, charges=3).threats
    listed = json.loads((out / "layout.json").read_text())["provenance"]["threats"]
    assert [name["seed"] for name in listed] == [threat.seed for threat in threats]
    assert len({tuple(name["charge_position_m"]) for name in listed}) == 3


def test_held_out_threats_are_combined_as_those_of_the_search(tmp_path: Path) -> None:
    """The row had been of the mean, under the title of the largest."""
    road = SegmentSource(kind="segment", start_m=(2.0, 1.0), end_m=(2.0, 7.0), tnt_kg=5.0)
    scenario = hut().model_copy(update={"charge": (road,)})
    save_scenario(scenario, tmp_path / "site.toml")
    options = ("--threat", "hidden", "--threats", 2, "--budget", 2, "--held-out", 3, "--cell", 0.5)
    site = ("--scenario", tmp_path / "site.toml", "--method", "random", "--engine", "gas")
    result = search(*site, "--risk", "worst", *options)
    assert result.exit_code == 0, result.output
    assert "largest impulse of the protected structures" in result.stdout
    threats = draw_threats(scenario, SeedRange.TEST.seeds(0, 3))
    loads = BlastEvaluator(scenario).loads_of_many(((), threat) for threat in threats)
    largest = max(load.protected_impulse_pa_s for load in loads)
    (row,) = (line for line in result.stdout.splitlines() if line.startswith("held out"))
    assert row.split()[3] == Number(largest).text()


def test_files_of_an_earlier_search_beside_another_layout_are_named(tmp_path: Path) -> None:
    save_scenario(hut(), tmp_path / "hut.toml")
    out = tmp_path / "out"
    options = ("--scenario", tmp_path / "hut.toml", "--engine", "gas", "--cell", 0.5, "--out", out)
    first = search("--method", "nsga2", *options, "--budget", 2)
    assert "is of an earlier search" not in first.stdout
    again = search("--method", "random", *options, "--budget", 2)
    assert f"note: {out / 'front.csv'} is of an earlier search" in again.stdout
    assert again.stdout.count("is of an earlier search") == 1
    proposed = search_without_blasts("--scenario", tmp_path / "hut.toml", "--out", out)
    assert proposed.stdout.count("is of an earlier search") == 3


def test_the_surrogate_says_what_gets_a_blast(tmp_path: Path) -> None:
    """That of the package; the only blast goes to what the packaged agent proposes."""
    scenario, out = wide_yard(tnt_kg=1.0), tmp_path / "out"
    save_scenario(scenario, tmp_path / "yard.toml")
    options = ("--engine", "gas", "--cell", 0.5, "--budget", 1, "--held-out", 1, "--out", out)
    result = search("--method", "surrogate", "--scenario", tmp_path / "yard.toml", *options)
    assert result.exit_code == 0, result.output
    assert "1 of 1 blasts spent" in result.stdout
    assert "no threat is held out: with this engine a charge is one blast" in result.stdout
    assert "the charge of the search: 1 kg at (" in result.stdout
    assert "held out " not in result.stdout.replace("is held out", "")
    found, provenance = packaged_surrogate(), LayoutFile.load(out / "layout.json").provenance
    assert provenance["options"]["surrogate"] == found.digest
    assert provenance["options"]["agent"] == packaged_agent().digest
    assert provenance["result"]["held_out_threats"] == 0
    assert provenance["result"]["held_out_reduction"] is None
    case = search_set(scenario, scenario.sample_charge(np.random.default_rng(0)), 1, 0)
    problem = DesignProblem(BlastEvaluator(scenario, "gas"), case)
    expected = search_from_agent(found).propose(problem, 1, 0)
    assert load_layout(out / "layout.json", scenario) == expected.layout != ()


def test_a_rule_spends_nothing(tmp_path: Path) -> None:
    out, site = tmp_path / "out", tmp_path / "hut.toml"
    save_scenario(hut(), site)
    options = ("--scenario", site, "--engine", "gas", "--cell", 0.5, "--out", out)
    result = search("--method", "wall_near_charge", *options)
    assert result.exit_code == 0, result.output
    assert "0 of 200 blasts spent" in result.stdout
    assert "blasts of gas" not in result.stdout  # no estimate of a cost that there is not
    assert sorted(path.name for path in out.iterdir()) == ["layout.json", "layout.png"]


def test_it_begins_with_given_layouts_and_keeps_blasts(site: Path, tmp_path: Path) -> None:
    """The second run asks the folder for all of its blasts, and spends and finds the same."""
    start = tmp_path / "start.json"
    start.write_text("[[0, 0], [1, 0], [3, 2]]")
    options = ("--start-from", start, "--budget", 20, "--held-out", 2, "--cache", tmp_path / "kept")
    first, second = (search("--scenario", site, *options) for _ in range(2))
    assert first.exit_code == second.exit_code == 0, first.output
    assert "20 of 20 blasts spent, 0 of the loads asked for known already" in first.stdout
    assert "20 of 20 blasts spent, 20 of the loads asked for known already" in second.stdout
    assert first.stdout.split("modules;")[0] == second.stdout.split("modules;")[0]


def test_an_interruption_keeps_the_best_so_far(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C after some thirty blasts: the layout is written, and checked on other threats."""
    left, advance = [30], EventRun.advance

    def interrupted(self: EventRun, until_s: float) -> None:
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt
        advance(self, until_s)

    monkeypatch.setattr(EventRun, "advance", interrupted)
    out = tmp_path / "out"
    result = search("--scenario", site, "--budget", 100, "--held-out", 2, "--out", out)
    assert result.exit_code == 130
    assert "interrupted: the best layout so far was kept" in result.stderr
    content = json.loads((out / "layout.json").read_text())
    assert content["provenance"]["result"]["interrupted"] is True
    assert 0 < content["provenance"]["result"]["blasts"] < 30
    assert 0 < len(content["cells"]) <= 3
    assert (out / "search.png").exists()
