"""Commands that cannot be done: one clear message before any blast, and nothing is written."""

from pathlib import Path
from shlex import split
from shutil import copy

import pytest
from typer.testing import CliRunner

from blast_env import load_scenario, save_scenario, write_layout
from blast_env.cli import app
from blast_env.gas import GasRun
from blast_env.particles.event import EventRun
from blast_env.particles.pymunk.engine import PymunkRun
from tests.design.search_cases import small_scenario
from tests.gas_sites import hut
from tests.io.importing.maps import BLOCK
from tests.report.sites import LAYOUT, small_hut
from tests.site.test_hardening import glazed_yard

ADVISE = "advise yard.toml"
CALIBRATE = "calibrate --name mine --seeds 2 --reference paper_ufc --out"
EVALUATE = "evaluate --engine event --out folder --layout modules.json"
GAS = "simulate hut.toml --engine gas"
REPORT = "report small.toml --layout wall.json --out a.html"
SEARCH = "search --engine event --budget 4"
SURROGATE = "search --method surrogate"

BAD: dict[str, str] = {
    "simulate cortyard": "did you mean 'courtyard'",
    "simulate courtyard --charge 29,15": "building",
    "simulate courtyard --stand-off 20": "needs one point charge",
    "simulate site.toml --charge 5,19,60 --tnt-kg 50": (
        "--charge has the mass 60 kg, and --tnt-kg is 50: give one of them"
    ),
    "simulate street_junction --layout courtyard.json": (
        "courtyard.json: the layout was saved for 'courtyard' (hash "
    ),
    f"{GAS} --preset ballistic": "--preset is for particles",
    f"{GAS} --gauge front": "--gauge is for --history: no history is to be drawn",
    f"{GAS} --impulse-map a.png --side-by-side": "--layout is missing",
    f"{GAS} --cell 0.2": "cell_m is 0.2, must be 0.5 m",
    "simulate hut.toml --engine event --impulse-map a.png": "--impulse-map is for gas dynamics",
    f"{CALIBRATE} . --distances 15,20": "no value at 20 m",
    f"{CALIBRATE} . --scenario courtyard": "one point charge",
    f"{EVALUATE} --layout courtyard.json": "--layout is given 2 times, must be given once",
    "evaluate --layout courtyard.json --scenario street_junction": "not for 'street_junction'",
    "assess hut.toml --charge 1,2 --charge 1,4": "--charge is given 2 times, must be given once",
    f"{EVALUATE} --cvar-level 1": "cvar_level is 1, must be at least 0 and below 1",
    f"{EVALUATE} --scenario free_field": "(9, 0) is not usable",
    "evaluate": "Missing option '--layout'",
    "judge --run . --scenario courtyard": "is no run folder",
    "judge --method random --cases 3": "--cases is for --scenario",
    "judge --method random --sites 3": "--sites is for --secret",
    "judge --budget 3": "--budget is for --method and --run",
    f"{SEARCH} --risk men": "did you mean 'mean'",
    f"{SEARCH} --start-from nowhere.json": "nowhere.json",
    f"{SEARCH} --threats 4": "--threats is for a hidden threat",
    f"{SEARCH} --threat hidden --charge 5,9": "a hidden one is drawn",
    f"{SEARCH} --surrogate own.json": "--surrogate is for --method surrogate, not genetic",
    f"{SURROGATE} --surrogate own.json": "own.json: there is no such file",
    f"{SURROGATE} --scenario hut.toml --start-from empty.json": "surrogate begins with no layouts",
    "train --run run --algo maskable_pp": "did you mean 'maskable_ppo'",
    "train --run run --set ent_coeff=1": "did you mean 'ent_coef'",
    "train --run run --scenario free_field": "no build zone",
    "train --run run --engine event --cell 0.25": "engine 'event' has no cells",
    "train --steps 5": "--run is missing",
    "train --resume nowhere": "is no run folder",
    "train --resume run --seed 5": "--seed cannot be changed with --resume",
    f"{REPORT} --limit hut": "--limit is 'hut', must be NAME=IMPULSE,PEAK",
    f"{REPORT} --limit shed=1": "no building 'shed'; known: hut",
    f"{REPORT} --charge 7,4": "must keep clear of it",
    f"{REPORT} --cells 0.25 0.5": "the coarser one first",
    f"{REPORT} --cells rough fine": "--cells is 'rough', must be a length in m, or coarse, fine",
    f"{REPORT} --threats 9": "threats is 9, must be 1 to 6",
    f"{ADVISE} --target good": "no level of protection 'good'",
    f"{ADVISE} --budget-cost -3": "build_zone.budget: is -3.0: Input should be greater than 0",
    f"{ADVISE} --cells huge": "cells is 'huge', must be one of 'uniform'",
    "advise visitor_entrance --budget 3": "no protected structure has a facade",
    "assess yard.toml --target meduim": "did you mean 'medium'",
    "assess --screen clinic_front --mass lory": "did you mean 'lorry'",
    "import map.geojson --out a.toml --charge-at 7.5": "is '7.5', must be two numbers as X,Y",
    "app --folder designs --allow-host http://desk/": "is 'http://desk/', must be a name",
    # Where a command writes.
    "simulate site.toml --film a.avi": "--film a.avi: suffix is '.avi', must be one of",
    "simulate site.toml --heat-map no/a.png": "--heat-map no/a.png: there is no folder",
    "simulate site.toml --history folder.png": "folder.png: is a folder",
    "simulate site.toml --history a.png --heat-map a.png": "are the same file",
    f"{EVALUATE} --out empty.json/a": "--out empty.json/a: cannot be a folder",
    f"{EVALUATE} --cache empty.json": "--cache empty.json: cannot be a folder",
    f"{EVALUATE} --export no/a.dxf": "there is no folder",
    f"{CALIBRATE} empty.json": "--out empty.json: cannot be a folder",
    # Folders that were made for it are taken away again.
    f"{SEARCH} --start-from nowhere.json --cache folder.png/c --out folder.png/a/b": "nowhere.json",
}
"""Commands in the folder below, and what each is told."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("work")
    sites = {"hut": hut(), "site": small_scenario(), "small": small_hut()}
    for name, scenario in {**sites, "yard": glazed_yard(charges="mean")}.items():
        save_scenario(scenario, folder / f"{name}.toml")
    write_layout(folder / "wall.json", small_hut(), LAYOUT, {})
    write_layout(folder / "courtyard.json", load_scenario("courtyard"), ((9, 0),))
    copy(BLOCK, folder / "map.geojson")
    (folder / "modules.json").write_text("[[9, 0], [10, 0], [11, 0]]")
    (folder / "empty.json").write_text("[]")
    (folder / "folder.png").mkdir()
    return folder


@pytest.mark.parametrize("line", BAD)
def test_bad_input_is_one_clear_message(
    line: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_work(*_: object) -> None:
        raise AssertionError("the work has begun")

    for engine in (EventRun, GasRun, PymunkRun):
        monkeypatch.setattr(engine, "advance", no_work)
    monkeypatch.chdir(folder)
    before = sorted(folder.rglob("*"))
    result = CliRunner().invoke(app, split(line), env={"COLUMNS": "300"})
    assert result.exit_code == 2, result.output
    assert BAD[line] in " ".join(result.output.split())
    assert "Traceback" not in result.output
    assert sorted(folder.rglob("*")) == before
