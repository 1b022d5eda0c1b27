"""Weights that come with the package propose as their run does; nothing else is read."""

import re
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import torch
from blast_agents.training import load_agent, packaged, train
from blast_agents.training.packaged import LeagueResult, pack, packaged_agent, records
from scipy.stats import spearmanr
from typer.testing import CliRunner, Result

from blast_env.cli import app
from blast_env.design.surrogate import LearntSearch, packaged_surrogate, site_of
from blast_env.design.surrogate.fitting import elements
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator
from blast_env.layout import LayoutFile, Placement
from blast_env.site import Scenario, load_scenario, save_scenario
from blast_env.site.scene import Charge
from blast_env.sites import FAMILIES, generate_site
from tests.agents.test_self_labelling import own, run_settings, wide_yard
from tests.catalogue_sites import yard as yard_with_a_point

LEAGUE = LeagueResult(
    command="blast-env league",
    engine="gas",
    track="known_walled_yard",
    cases=2,
    reduction=0.4,
    low=0.3,
    high=0.5,
    best_rule="wall near the charge",
    best_rule_reduction=0.35,
)
CHARGE = Charge((1.7, 5.2), 5.0)
MODULES = {"corner_m": [4.0, 3.0], "rows": 12, "columns": 2, "stock": 6, "height_m": 2.0}
BLASTS = Path(__file__).parents[2] / "docs/data/gas_blasts.parquet"


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("site") / "yard.toml"
    save_scenario(wide_yard(), path)
    return path


@pytest.fixture(scope="module")
def run(yard: Path) -> Path:
    """A run on the yard that has hardly learnt anything."""
    small = own(cases=1, first_updates=2)
    train(run_settings(yard, engine="surrogate", steps=1), small, yard.parent / "run")
    return yard.parent / "run"


@pytest.fixture(scope="module")
def folder(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of weights, as the package's."""
    folder = tmp_path_factory.mktemp("weights")
    pack(run, "yard", LEAGUE, folder)
    return folder


def proposed(folder: Path, monkeypatch: pytest.MonkeyPatch, *arguments: Any) -> Result:
    monkeypatch.setattr(packaged, "WEIGHTS", folder)
    return CliRunner().invoke(app, ["propose", *map(str, arguments)])


def test_the_weights_propose_what_their_run_does(run: Path, folder: Path) -> None:
    found = packaged_agent(wide_yard(), "visible", folder)
    assert found is not None
    agent, record = found
    assert agent.propose(wide_yard(), CHARGE) == load_agent(run).propose(wide_yard(), CHARGE)
    assert (record.league, record.scenario) == (LEAGUE, "walled_yard")
    assert record.command == (run / "command.txt").read_text().strip()
    assert "/" not in record.command.partition(" ")[0]  # nor where the program is
    assert "platform" not in record.versions
    assert "torch" in record.versions
    assert packaged_agent(wide_yard(), "hidden", folder) is None
    assert packaged_agent(yard_with_a_point(), "visible", folder) is None  # of the same name


def test_the_weights_of_the_package_are_for_its_scenarios_as_they_are() -> None:
    for path, record in records():
        family = FAMILIES.get(record.scenario)
        if family is None:
            scenario = load_scenario(record.scenario)
            assert record.configuration.scenario_hash == scenario.content_hash, path.name
        else:
            scenario = generate_site(0, family)
        found = packaged_agent(scenario, record.configuration.settings.threat)
        assert found is not None
        assert record.league is not None
        assert path.stat().st_size < 500_000


def test_weights_for_generated_sites_are_for_each_site_of_their_family(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    chosen = {"engine": "surrogate", "evaluation_engine": "event", "evaluation_cases": 2}
    settings = run_settings(Path("item_sites"), threat="hidden", steps=1, **chosen)
    train(settings, own(cases=1, first_updates=2), run)
    pack(run, "sites", folder=tmp_path)

    site, other = (generate_site(seed, FAMILIES["item_sites"]) for seed in range(2))
    found = packaged_agent(site, "hidden", tmp_path)
    assert found is not None
    agent, record = found
    assert record.scenario == "item_sites"
    layouts = [agent.propose(each) for each in (site, other)]
    assert layouts == [load_agent(run).propose(each) for each in (site, other)]
    assert layouts[0] != layouts[1]
    for each, layout in zip((site, other), layouts, strict=True):
        assert Placement.of(each, layout).modules  # refuses what is not legal

    save_scenario(site, tmp_path / "site.toml")
    done = proposed(tmp_path, monkeypatch, tmp_path / "site.toml")
    assert "by the surrogate of gas dynamics" in done.output  # which are better there

    assert packaged_agent(site, "visible", tmp_path) is None
    assert packaged_agent(wide_yard(), "hidden", tmp_path) is None  # of another size
    document = site.model_dump() | {"objective": {"quantity": "peak"}}
    assert packaged_agent(Scenario.from_document(document, "p"), "hidden", tmp_path) is None
    text = (tmp_path / "sites.json").read_text()
    (tmp_path / "sites.json").write_text(text.replace(record.configuration.scenario_hash, "0" * 64))
    assert packaged_agent(site, "hidden", tmp_path) is None  # sites are drawn in another way now


def test_a_damaged_file_is_told(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "yard.json").write_bytes((folder / "yard.json").read_bytes())
    with pytest.raises(BlastEnvError, match=r"yard.pt: is damaged, or no weights"):
        packaged_agent(wide_yard(), "visible", tmp_path)
    torch.save({"cell": Path("code")}, tmp_path / "yard.pt")  # an object that is no weights
    with pytest.raises(BlastEnvError, match=r"yard.pt: is damaged, or no weights"):
        packaged_agent(wide_yard(), "visible", tmp_path)
    (tmp_path / "yard.json").write_text("{}")
    with pytest.raises(BlastEnvError, match=r"yard.json: is damaged"):
        packaged_agent(wide_yard(), "visible", tmp_path)


def test_a_proposal_is_verified_and_written(
    yard: Path, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "layout.json"
    charge = ("--charge", "{},{}".format(*CHARGE.position_m))
    done = proposed(
        folder, monkeypatch, yard, *charge, "--verify", "--cells", "coarse", "--out", out
    )
    assert done.exit_code == 0, done.output
    assert "by the weights of walled_yard" in done.output
    for row in ("no barrier", "wall near the charge", "most sight lines cut", "this proposal"):
        assert row in done.output
    assert f"wrote {out.with_suffix('.png')}" in done.output
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    layout = LayoutFile.load(out)
    agent = packaged_agent(wide_yard(), "visible", folder)
    assert agent is not None
    wanted = agent[0].propose(wide_yard(), CHARGE)
    assert layout.layout_for(wide_yard()) == tuple(sorted(wanted))
    assert layout.provenance["weights"] == wide_yard().content_hash[:12]


@pytest.mark.parametrize("quantity", ["impulse", "peak"])
def test_without_weights_the_surrogate_proposes_and_no_blast_is_run(
    quantity: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = wide_yard().model_dump() | {"objective": {"quantity": quantity}}
    site = Scenario.from_document(document, "yard")
    yard = tmp_path / "yard.toml"
    save_scenario(site, yard)

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a blast is simulated")

    monkeypatch.setattr(BlastEvaluator, "loads_of_many", refuse)
    out = tmp_path / "layout.json"
    done = proposed(
        tmp_path, monkeypatch, yard, "--charge", "{},{}".format(*CHARGE.position_m), "--out", out
    )
    assert done.exit_code == 0, done.output
    assert "by the surrogate of gas dynamics (--verify evaluates it)" in done.output
    surrogate = packaged_surrogate()
    wanted = LearntSearch(surrogate).at_once(site, CHARGE)
    layout = LayoutFile.load(out)
    assert layout.layout_for(site) == tuple(sorted(wanted))
    assert layout.provenance["surrogate"] == surrogate.digest


def test_single_modules_are_proposed_without_a_blast(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a site of 120 m the blasts of all rules took 3.3 hours."""
    document = wide_yard().model_dump() | {"build_zone": MODULES}
    path = tmp_path / "other.toml"
    save_scenario(Scenario.from_document(document, "other"), path)
    done = proposed(tmp_path, monkeypatch, path, "--charge", "{},{}".format(*CHARGE.position_m))
    assert done.exit_code == 0, done.output
    assert "by the surrogate of gas dynamics" in done.output
    assert "no blast was run" in done.output
    assert re.search(r"[1-6] modules?, expected reduction", done.output)


def test_modules_side_by_side_are_a_wall_to_the_surrogate() -> None:
    document = wide_yard().model_dump() | {"build_zone": MODULES}
    site = site_of(Scenario.from_document(document, "other"))
    barrier = site.barrier([(5, 0), (3, 0), (4, 0), (4, 1), (9, 1)])
    assert sorted(map(tuple, barrier)) == [
        (4.0, 4.5, 4.5, 6.0, 2.0),
        (4.5, 5.0, 5.0, 5.5, 2.0),
        (4.5, 7.5, 5.0, 8.0, 2.0),
    ]
    guess = packaged_surrogate().guess(site, [(), ((3, 0), (4, 0), (5, 0))], [CHARGE, CHARGE])
    bare, behind = guess.impulse_pa_s[:, 0]
    assert behind < 0.99 * bare


@pytest.mark.parametrize("load", ["impulse_pa_s", "peak_pa"])
def test_the_surrogate_of_the_package_ranks_layouts_of_a_site_that_it_was_not_fitted_to(
    load: str,
) -> None:
    table = pd.read_parquet(BLASTS)
    one = table[(table["scenario"] == "visitor_entrance") & table["protected"]].groupby(
        ["charge_x_m", "charge_y_m", "structure"]
    )
    _, rows = next(iter(one))
    rows = rows.iloc[:: len(rows) // 40]
    document = load_scenario("visitor_entrance").model_dump() | {"objective": {"quantity": "peak"}}
    site = site_of(Scenario.from_document(document, "peaks"))
    columns = rows[["charge_x_m", "charge_y_m", "tnt_kg", "charge_height_m"]]
    charges = [Charge((x, y), tnt, up) for x, y, tnt, up in columns.itertuples(index=False)]
    layouts = [elements(text) for text in rows["layout"]]
    guess = getattr(packaged_surrogate().guess(site, layouts, charges), load)[:, 0]
    assert spearmanr(guess, rows[load]).statistic > 0.6
    assert packaged_surrogate().fit.sites == 634


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["free_field"], "no build zone"),
        (["yard", "--tnt-kg", 5], "--tnt-kg is given without --charge"),
        (["yard", "--charge", "9,6"], "charge"),
        (["courtyrd"], "did you mean 'courtyard'"),
        (["yard", "--out", "nowhere/layout.json"], "there is no folder"),
        (["yard", "--out", "layout.toml"], "suffix is '.toml', must be .json"),
    ],
)
def test_what_is_of_no_use_is_refused_with_the_reason(
    yard: Path, folder: Path, arguments: list[Any], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = [yard if each == "yard" else each for each in arguments]
    done = proposed(folder, monkeypatch, *chosen, "--verify")
    assert done.exit_code == 2
    assert words in done.output
    assert "Traceback" not in done.output
