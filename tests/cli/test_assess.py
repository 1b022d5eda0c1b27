"""`blast-env assess`: the verdict, what better glass brings, screening, and capacity."""

from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

import blast_env
from blast_env.cli import app
from blast_env.cli.options import wanted_level
from blast_env.evaluation import LoadCaseSet
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.questions import capacity
from blast_env.evaluation.questions.probability import scaled_to
from blast_env.evaluation.questions.verdict import Consequences, consequences_of
from blast_env.layout import write_layout
from blast_env.response import LevelOfProtection
from blast_env.site import Charge, Scenario
from tests.gas_sites import WALL, glazed_hut


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    document = blast_env.load_scenario("control_room").model_dump(mode="json")
    document["structures"][0]["facade"] = {"glazing": "window_annealed_6", "wall": "concrete_200"}
    document["charge"] = document["charge"][:1]
    document["name"] = "glazed_room"
    path = tmp_path_factory.mktemp("assess") / "glazed.toml"
    blast_env.save_scenario(Scenario.from_document(document, "test"), path)
    return path


def run(*words: str | Path) -> str:
    done = CliRunner().invoke(app, ["assess", *map(str, words)])
    assert done.exit_code in (0, 2), done.output
    return done.output


@pytest.mark.slow
def test_the_verdict_comes_first_and_better_glass_may_turn_it(site: Path, tmp_path: Path) -> None:
    """1 kg at 8.5 m: annealed glass flies 3 m, laminated glass stays in its frame."""
    picture, diagram, table = (
        tmp_path / name for name in ("facade.png", "diagram.png", "bays.csv")
    )
    files = ("--picture", picture, "--diagram", diagram, "--table", table)
    output = run(site, "--tnt-kg", "1", "--target", "medium", "--cell", "0.5", *files)
    # On a slow machine lines of progress come between the cost and the verdict.
    engine, cost, *rest = output.splitlines()
    assert cost.startswith("up to a blast of gas")
    assert engine.startswith("engine gas ")
    verdict = next(line for line in rest if line.startswith("glazed_room"))
    assert verdict.startswith(
        "glazed_room, no barrier: DOES NOT COMPLY: level of protection below M"
    )
    rows = {line.split()[0]: line for line in output.splitlines() if line.startswith("window")}
    assert rows["window_annealed_6"].endswith("does not comply")
    assert rows["window_laminated_6"].endswith("complies (flagged)")
    assert all(case.stat().st_size > 1000 for case in (picture, diagram))
    bays = pd.read_csv(table).astype(str)
    assert "control_room/west/1/1" in bays.to_numpy()


@pytest.mark.slow
def test_no_verdict_passes_without_the_flags_of_its_loads(site: Path) -> None:
    """1 kg on cells of 0.5 m: 2 cells per m/kg^(1/3), where 9.2 are wanted."""
    lines = run(site, "--tnt-kg", "1", "--target", "very low", "--cell", "0.5").splitlines()
    verdict = next(k for k, line in enumerate(lines) if "glazed_room, no barrier" in line)
    assert "COMPLIES (flagged): level of protection at least Very low" in lines[verdict]
    assert any(line.startswith("flag: control_room: 1 of 1 charges are outside") for line in lines)
    assert not any(line.endswith("complies") for line in lines)


def test_notes_on_gauges_are_printed_once(tmp_path: Path) -> None:
    """As in the report and on the page; what a flag says is not said again."""
    document = glazed_hut().model_dump(mode="json", exclude_none=True)
    inside_m = [document["structures"][0]["corner_m"][k] + s for k, s in enumerate((0.4, 1.0))]
    document["gauges"] = [{"name": "buried", "position_m": [*inside_m, 1.0]}]
    path = tmp_path / "hut.toml"
    blast_env.save_scenario(Scenario.from_document(document, "hut"), path)
    lines = run(path, "--cells", "coarse", "--charges", "2").splitlines()
    (note,) = (line for line in lines if "buried" in line)
    assert note.startswith("note: gauge buried: lies inside a solid; its load is that of the near")
    assert not any("validated range" in line for line in lines if line.startswith("note: "))
    assert sum("cells per m/kg" in line for line in lines if line.startswith("flag: ")) == 1


def test_a_site_without_facades() -> None:
    output = run("control_room")
    assert "no structure has a facade with bays" in output


@pytest.mark.parametrize(
    ("asked", "site_name", "level"),
    [
        ("high", "clinic_front", LevelOfProtection.HIGH),
        (None, "clinic_front", LevelOfProtection.MEDIUM),
        (None, "control_room", LevelOfProtection.LOW),
    ],
)
def test_a_site_s_own_target_counts_unless_another_one_is_asked_for(
    asked: str | None, site_name: str, level: LevelOfProtection
) -> None:
    scenario = blast_env.load_scenario(site_name)
    assert wanted_level(asked, scenario, LevelOfProtection.LOW) is level


def test_the_worst_charge_gives_the_error_of_the_cells(tmp_path: Path) -> None:
    """Beside impulses, reduction and panes; not with the largest cells, which have no coarser."""
    site = tmp_path / "glazed.toml"
    blast_env.save_scenario(glazed_hut(), site)
    layout = blast_env.write_layout(tmp_path / "wall.json", glazed_hut(), WALL)
    output = run(site, "--layout", layout)
    line = next(line for line in output.splitlines() if line.startswith("impulse on the protected"))
    assert line.count(" +- ") == 3
    likely = [line for line in output.splitlines() if line.startswith("probability, ")]
    assert [line.split(",")[1][:5] for line in likely] == [" 6 ba", " no b"]
    assert all("'low' with " in line for line in likely)
    panes = [line for line in output.splitlines() if line.startswith(("no barrier", "6 barrier"))]
    assert all(" +- " in pane for pane in panes)
    assert len(panes) == 2


def test_an_error_of_the_cells_that_is_not_known_is_named(tmp_path: Path) -> None:
    """It dropped out without a word, and counted as none in the probability."""
    path, layout = tmp_path / "hut.toml", tmp_path / "layout.json"
    blast_env.save_scenario(glazed_hut(), path)
    write_layout(layout, glazed_hut(), WALL, {})
    words = (
        "(cells): the grid error is not known: cells twice as large as those of 0.5 m do not fit"
        " into a module"
    )
    said = run(path, "--layout", layout, "--cell", "0.5").splitlines()
    assert f"{words}; probabilities leave it out" in said
    asked = ("evaluate", "--scenario", path, "--layout", layout, "--cell", "0.5")
    done = CliRunner().invoke(app, [*map(str, asked)])
    assert words in done.output.splitlines()


def test_a_verdict_names_how_many_fixed_charges_it_leaves_out(tmp_path: Path) -> None:
    document = glazed_hut().model_dump(mode="json", exclude_none=True)
    (first,) = document["charge"]
    document["charge"] = [first, first | {"tnt_kg": 1.0}]
    site = tmp_path / "two.toml"
    blast_env.save_scenario(Scenario.from_document(document, "two"), site)
    asked = (("--charges", "1"), ("--charges", "2"), ("--tnt-kg", "3"))
    outputs = [run(site, "--cells", "coarse", *options) for options in asked]
    said = "flag: not among these: 1 of the 2 fixed charges of the site"
    assert [said in output for output in outputs] == [True, False, False]


def test_a_verdict_names_a_source_of_which_no_charge_was_drawn(tmp_path: Path) -> None:
    """A lorry that hardly ever comes was left out without a word, and so was its mass."""
    document = glazed_hut().model_dump(mode="json", exclude_none=True)
    x_m, y_m = document["charge"][0]["position_m"]
    way = {"kind": "segment", "start_m": [x_m, y_m], "end_m": [x_m, y_m + 0.5]}
    document["charge"] = [way | {"tnt_kg": 0.1}, way | {"tnt_kg": 1.0, "weight": 1e-6}]
    site = tmp_path / "rare.toml"
    blast_env.save_scenario(Scenario.from_document(document, "rare"), site)
    drawn, placed = (
        run(site, "--cells", "coarse", *options)
        for options in (("--charges", "2"), ("--charge", f"{x_m},{y_m}"))
    )
    assert "flag: not among these: any charge of 1 of the 2 sources of charges" in drawn
    assert "(1 kg)" in drawn
    assert "not among these" not in placed
    assert "under 2 charges" in placed


def test_a_verdict_names_the_protected_buildings_that_it_does_not_cover(tmp_path: Path) -> None:
    document = glazed_hut().model_dump(mode="json", exclude_none=True)
    shed = document["structures"][0] | {"name": "shed", "corner_m": [8.0, 0.5], "rows": 2}
    del shed["facade"]
    site = tmp_path / "two.toml"
    said = {}
    for is_protected in (True, False):
        document["structures"][1:] = [shed | {"protected": is_protected}]
        blast_env.save_scenario(Scenario.from_document(document, "two"), site)
        for options in (("--cell", "0.5", "--charges", "1"), ("--screen",)):
            output = " ".join(run(site, *options).split())
            said[is_protected, options[0]] = "shed: protected, but without a facade" in output
    assert said == {key: key[0] for key in said}
    assert len(said) == 4


# --- Screening: tables, the verdict by the requirement, and the picture.


def test_threats_stand_offs_and_rings(tmp_path: Path) -> None:
    site, picture = tmp_path / "glazed.toml", tmp_path / "rings.png"
    blast_env.save_scenario(glazed_hut(), site)
    masses = ("--mass", "vest", "--mass", "bag=2,c4")
    output = run("--screen", site, *masses, "--require", "iso D", "--picture", picture)
    assert "required: ISO 16933 rating D" in output
    assert output.count("glass: small_window *") == 2
    assert "left out: surroundings outside the range of the atlas" in output
    assert "left out: shielding" in run("--screen", site, *masses, "--no-shielding")
    assert picture.stat().st_size > 1000


@pytest.mark.slow
def test_gas_stands_beside_the_curves(tmp_path: Path) -> None:
    site = tmp_path / "glazed.toml"
    blast_env.save_scenario(glazed_hut(), site)
    assert run("--screen", site, "--mass", "bag=2", "--gas", "--cell", "0.5").count("by gas") == 1


# --- Capacity.


def test_a_row_for_each_layout_and_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the hut; all blasts but the first are scaled from it."""
    site = tmp_path / "glazed.toml"
    blast_env.save_scenario(glazed_hut(), site)
    layout = blast_env.write_layout(tmp_path / "wall.json", glazed_hut(), WALL)
    first: list[Blasts] = []
    own = Campaign.run

    def once(campaign: Campaign) -> LoadCaseSet:
        first[:] = first or [own(campaign)]
        return campaign.case

    def scaled(case: LoadCaseSet) -> Consequences:
        (charge,) = case.charges
        assert isinstance(charge, Charge)
        return scaled_to(consequences_of(first[0]), charge)

    monkeypatch.setattr(Campaign, "run", once)
    monkeypatch.setattr(capacity, "consequences_of", scaled)
    output = run("--capacity", site, "--tnt-kg", "0.1", "--cell", "0.5", "--layout", layout)
    rows = [line.split() for line in output.splitlines() if "2.0, 4.0" in line]
    assert len(rows) == 4
    assert "largest charge (kg TNT) that keeps each level of protection" in output
    (flag,) = (line for line in output.splitlines() if line.startswith("flag: hut: "))
    assert "cells per m/kg^(1/3), checked from 9.2" in flag  # 0.1 kg on cells of 0.5 m
