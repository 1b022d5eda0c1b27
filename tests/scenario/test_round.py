"""Round structures: modules that make a disc, and errors with the keys of the file."""

from math import pi
from pathlib import Path
from typing import Any

import pytest

from blast_env.engines.gas import GasBlast, GasEngine
from blast_env.scenario import Scenario, ScenarioError, load_scenario, save_scenario
from blast_env.scenario.build_scene import build_scene
from blast_env.scenario.round import disc
from tests.gas_sites import site_document

COLUMN: dict[str, Any] = {
    "kind": "round",
    "name": "column",
    "centre_m": [7.0, 6.5],
    "diameter_m": 2.0,
    "height_m": 3.0,
}


def with_column(**changes: Any) -> Scenario:
    """Return the hut's site with a column before the hut in the file."""
    document = site_document()
    document["structures"].insert(0, COLUMN | changes)
    return Scenario.from_document(document, "site.toml")


@pytest.mark.parametrize("side", range(4, 41))
def test_a_disc_has_the_area_and_the_width_of_a_circle(side: int) -> None:
    rectangles, walls = disc(side)
    area = sum(rows * columns for _, _, rows, columns in rectangles.tolist())
    assert area == pytest.approx(0.25 * pi * side**2, rel=0.14)
    assert sum(walls) == 4 * side
    assert max(columns for _, _, _, columns in rectangles.tolist()) == side


def test_a_column_is_one_building_of_rectangles_round_its_centre() -> None:
    parts = [each for each in with_column().structures if each.building_name == "column"]
    assert [each.name for each in parts] == ["column_1", "column_2", "column_3"]
    assert [each.rectangle_m for each in parts] == [
        (6.5, 5.5, 7.5, 6.0),
        (6.0, 6.0, 8.0, 7.0),
        (6.5, 7.0, 7.5, 7.5),
    ]
    assert {each.height_m for each in parts} == {3.0}


def test_a_thin_column_is_a_module_with_its_name() -> None:
    thin = with_column(diameter_m=0.6).structures[0]
    assert (thin.name, thin.building, thin.rows, thin.columns) == ("column", None, 1, 1)


def test_a_protected_one_weighs_as_much_as_one_structure() -> None:
    parts = with_column(protected=True, weight=3.0).structures[:3]
    assert sum(each.weight for each in parts) == pytest.approx(3.0)
    assert parts[0].weight == pytest.approx(parts[2].weight)


def test_tables_have_it_as_one_and_files_keep_it(tmp_path: Path) -> None:
    scenario = with_column()
    buildings = GasBlast(scenario, engine=GasEngine(border_m=0.0, until=0.01)).run().buildings
    assert buildings["building"].tolist() == ["column", "hut"]
    assert buildings["area_m2"][0] == pytest.approx(4 * 2.0 * 3.0)
    save_scenario(scenario, tmp_path / "saved.toml")
    assert load_scenario(tmp_path / "saved.toml") == scenario


def test_particles_meet_its_modules() -> None:
    document = load_scenario("courtyard").model_dump(mode="json", exclude_none=True)
    document["structures"].append(COLUMN | {"centre_m": [3.0, 3.0]})
    scene = build_scene(Scenario.from_document(document, "courtyard"))
    modules = [each for each in scene.obstacles() if each.name.startswith("column")]
    assert sum(len(each.parts) for each in modules) == 12


def test_measures_name_it_as_the_file_does() -> None:
    document = site_document()
    document["structures"].append(COLUMN)
    taken = {"name": "no_column", "structures": ["column"], "cost": 1.0}
    document["build_zone"]["removable"] = [taken]
    document["build_zone"]["items"] = [
        {"name": "block", "length_modules": 1, "height_m": 1.0, "stock": 2, "cost": 1.0}
    ]
    for key in ("stock", "height_m"):
        del document["build_zone"][key]
    zone = Scenario.from_document(document, "yard").zone
    assert zone.removable[0].structures == ("column_1", "column_2", "column_3")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"diameter_m": 0.2}, "structures[0].diameter_m: is 0.2, must be at least 0.5"),
        ({"centre_m": [1.0]}, "structures[0].centre_m"),
        ({"centre_m": [0.5, 6.0]}, "structures[0].centre_m: is (0.5, 6), must be at least 1 from"),
        ({"rows": 3}, "structures[0].rows: unknown key"),
        ({"kind": "Round"}, "structures[0].kind: is 'Round', must be 'round'"),
        ({"hight_m": 3.0}, "structures[0].hight_m: unknown key, did you mean 'height_m'?"),
        ({"height_m": 100.0}, "structures[0].height_m: is 100, must be at most 5"),
        ({"centre_m": [9.9, 6.5]}, "structures[0]: 'column_1' (x 9.4 to 10.4 m"),
        ({"centre_m": [7.0, 3.0]}, "structures[1]: 'hut' (x 6 to 8 m, y 3 to 5 m) overlaps"),
        ({"name": "hut"}, "structures[0].name: is 'hut', which another structure has"),
        ({"name": "x" * 40}, "must have at most 36 characters"),
    ],
)
def test_errors_have_the_keys_of_the_file(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        with_column(**changes)
    assert message in str(caught.value)
    assert "structures[2]" not in str(caught.value)
