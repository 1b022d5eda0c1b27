"""`blast-env evaluate --run` and `--export`, run in this process."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from blast_agents.training import load_agent, train
from ezdxf.filemanagement import readfile

from blast_env import load_scenario
from blast_env.evaluation import SeedRange, draw_threats, evaluate_layout
from blast_env.io.export import SUFFIXES
from blast_env.layout import LayoutFile, load_layout, write_layout
from tests.agents.training_runs import hyperparameters, scenario_file, settings
from tests.cli.running import run

CELLS = ((1, 0), (2, 0))


def make_run(folder: Path, **changes: Any) -> Path:
    train(settings(scenario_file(folder), steps=16, **changes), hyperparameters(), folder / "run")
    return folder / "run"


@pytest.fixture(scope="module")
def visible(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("visible"))


@pytest.fixture(scope="module")
def hidden(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("hidden"), threat="hidden")


evaluate = partial(run, "evaluate", "--engine", "event")
"""With blasts of milliseconds, whatever the command would take."""


def test_a_visible_threat_gets_a_layout_for_each_charge(visible: Path, tmp_path: Path) -> None:
    """What is evaluated and written is what the agent proposes for just that charge."""
    out, export = tmp_path / "out", tmp_path / "layouts"
    result = evaluate("--run", visible, "--seeds", 3, "--out", out, "--export", export)
    assert result.exit_code == 0, result.output
    scenario, agent = load_scenario(visible / "scenario.toml"), load_agent(visible)
    threats = draw_threats(scenario, SeedRange.TEST.seeds(0, 3))
    table = pd.read_csv(out / "cases.csv")
    for number, threat in enumerate(threats, start=1):
        path = export / f"layout_{number}.json"
        layout = load_layout(path, scenario)
        assert layout == agent.propose(scenario, threat.charge)
        expected = evaluate_layout(scenario, layout, engine="event", threats=[threat])
        assert table["load"][number - 1] == pytest.approx(expected.load)
        provenance = LayoutFile.load(path).provenance
        assert provenance["charge"]["position_m"] == list(
            threat.charge_against(scenario, layout).position_m
        )
        assert (provenance["run"], provenance["seed"]) == (str(visible), threat.seed)
    assert f"mean reduction {100.0 * table['reduction'].mean():.1f} %" in result.stdout
    assert "maskable_ppo of" in result.stdout
    assert "note:" not in result.stdout
    assert {path.name for path in out.iterdir()} == {
        "evaluation.json",
        "cases.csv",
        "evaluation.png",
    }
    assert all(f"wrote {path}" in result.stdout for path in out.iterdir())
    assert (out / "evaluation.png").stat().st_size > 1000
    kinds = {path.name.removeprefix(path.name.split(".")[0]) for path in export.iterdir()}
    assert kinds == set(SUFFIXES)
    assert len(list(export.iterdir())) == 3 * len(SUFFIXES)


def test_a_hidden_threat_gets_one_layout(hidden: Path, tmp_path: Path) -> None:
    export = tmp_path / "layout.dxf"
    result = evaluate("--run", hidden, "--seeds", 3, "--export", export, "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)
    scenario = load_scenario(hidden / "scenario.toml")
    layout = load_agent(hidden).propose(scenario, None)
    assert sorted(map(tuple, content["layout"])) == sorted(layout)
    seeds = SeedRange.TEST.seeds(0, 3)
    assert (
        content["result"]
        == evaluate_layout(scenario, layout, seeds, engine="event").to_dict()["result"]
    )
    assert content["provenance"]["threat"] == "hidden"
    assert content["files"] == [str(export)]
    space = readfile(export).modelspace()
    assert len(space.query('LWPOLYLINE[layer=="BARRIER"]')) == len(layout)
    assert len(space.query('*[layer=="CHARGE"]')) == 0


def test_json_is_all_that_is_printed_and_the_file_has_every_case(
    visible: Path, tmp_path: Path
) -> None:
    given = ("--seeds", 2, "--first-seed", 1_000_000, "--out", tmp_path, "--json")
    content = json.loads(evaluate("--run", visible, *given).stdout)
    cases = json.loads((tmp_path / "evaluation.json").read_text())["cases"]
    assert [case["seed"] for case in cases] == [1_000_000, 1_000_001]
    assert content["cache"] == {"blasts": 4, "hits": 0, "hit_rate": 0.0}
    assert content["result"]["reduction"]["ci95_low"] is not None


def test_it_says_when_the_weights_were_chosen_by_the_threats(visible: Path) -> None:
    result = evaluate(
        "--run", visible, "--seeds", 3, "--first-seed", SeedRange.VALIDATION.value.start - 1
    )
    assert "note: the best weights were chosen by 2 of these threats" in result.stdout


def test_more_layouts_than_a_file_holds_are_refused_before_any_blast(
    visible: Path, tmp_path: Path
) -> None:
    path = tmp_path / "layout.geojson"
    result = evaluate("--run", visible, "--seeds", 2, "--export", path)
    assert result.exit_code == 2
    assert "is one file, but there are 2 layouts: name a folder" in " ".join(result.stderr.split())
    assert evaluate("--run", visible, "--seeds", 1, "--export", path).exit_code == 0
    kinds = {each["properties"]["kind"] for each in json.loads(path.read_text())["features"]}
    assert {"charge", "charge_place", "protected_structure", "barrier"} <= kinds


def test_a_layout_s_file_is_exported_with_where_it_came_from(tmp_path: Path) -> None:
    site = scenario_file(tmp_path)
    path, export = tmp_path / "layout.json", tmp_path / "copy.json"
    write_layout(path, load_scenario(site), CELLS, {"method": "by hand"})
    result = evaluate("--layout", path, "--scenario", site, "--seeds", 1, "--export", export)
    assert result.exit_code == 0, result.output
    assert f"wrote {export}" in result.stdout
    assert LayoutFile.load(export) == LayoutFile.load(path)


def test_generated_sites_get_a_layout_and_a_scenario_each(tmp_path: Path) -> None:
    run = tmp_path / "run"
    train(settings(Path("sites"), steps=16, evaluation_cases=2), hyperparameters(), run)
    export = tmp_path / "layouts"
    result = evaluate("--run", run, "--seeds", 2, "--export", export)
    assert result.exit_code == 0, result.output
    hashes = set()
    for number in (1, 2):
        site = load_scenario(export / f"layout_{number}_site.toml")
        hashes.add(site.content_hash)
        assert load_layout(export / f"layout_{number}.json", site)
        assert site.name in result.stdout
    assert len(hashes) == 2
