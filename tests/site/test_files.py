import os
import re
import tomllib
from pathlib import Path

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError
from blast_env.site import (
    Scenario,
    ScenarioError,
    Site,
    bundled_scenarios,
    find_problems,
    load_scenario,
    parse_scenario,
    save_scenario,
    scenario_hash,
)
from blast_env.values import STEERING
from tests.site.documents import (
    REPOSITORY,
    Document,
    all_documents,
    full_document,
    minimal_document,
    tall_document,
)

BUNDLED = tuple(sorted(path.stem for path in (REPOSITORY / "scenarios").glob("*.toml")))
EXAMPLES = REPOSITORY / "docs" / "data"


def test_the_promised_scenarios_are_bundled() -> None:
    assert bundled_scenarios() == BUNDLED
    assert {"courtyard", "free_field", "perimeter_gate", "street_junction"} < set(BUNDLED)


@pytest.mark.parametrize("name", bundled_scenarios())
def test_bundled_scenario_says_what_it_models(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.description
    text = (REPOSITORY / "scenarios" / f"{name}.toml").read_text(encoding="utf-8")
    assert text.startswith("# ")


@pytest.mark.parametrize("name", bundled_scenarios())
def test_bundled_scenario_lies_on_the_module_grid(name: str) -> None:
    scenario = load_scenario(name)
    rectangles = [structure.rectangle_m for structure in scenario.structures]
    rectangles.append(scenario.site.rectangle_m)
    if scenario.build_zone is not None:
        rectangles.append(scenario.build_zone.rectangle_m)
        rectangles += [keep_out.rectangle_m for keep_out in scenario.build_zone.keep_outs]
    assert all((2.0 * side).is_integer() for rectangle in rectangles for side in rectangle)


def texts(least: int, most: int) -> st.SearchStrategy[str]:
    text = st.text(min_size=least, max_size=most)
    return text.filter(lambda case: STEERING.search(case) is None)


@given(
    st.fixed_dictionaries(
        {
            "description": texts(0, 60),
            "width_m": st.floats(25.0, 2000.0),
            "tnt_kg": st.floats(0.01, 100_000.0),
            "reason": texts(1, 40),
            "stock": st.integers(1, 180),
            "budget": st.floats(2.0, 1e12),
            "spacing_units": st.one_of(st.just(0), st.floats(2.0, 1e6)),
        }
    )
)
def test_any_scenario_survives_saving(
    tmp_path_factory: pytest.TempPathFactory, values: Document
) -> None:
    document = full_document()
    document["description"] = values["description"]
    document["site"]["width_m"] = values["width_m"]
    document["charge"][0]["tnt_kg"] = values["tnt_kg"]
    document["build_zone"]["keep_outs"][0]["reason"] = values["reason"]
    document["build_zone"]["stock"] = values["stock"]
    document["build_zone"]["budget"] = values["budget"]
    document["simulation"]["overrides"]["air"]["spacing_units"] = values["spacing_units"]
    scenario = Scenario.from_document(document, "drawn")
    path = tmp_path_factory.getbasetemp() / "drawn.toml"
    save_scenario(scenario, path)
    copy = load_scenario(path)
    assert copy == scenario
    assert copy.content_hash == scenario.content_hash


def test_order_of_keys_does_not_change_the_hash() -> None:
    def reversed_keys(value: object) -> object:
        if isinstance(value, dict):
            return {key: reversed_keys(value[key]) for key in reversed(value)}
        if isinstance(value, list):
            return [reversed_keys(item) for item in value]
        return value

    for document in all_documents():
        backwards = reversed_keys(document)
        assert isinstance(backwards, dict)
        texts = [tomli_w.dumps(case) for case in (document, backwards)]
        assert texts[0] != texts[1]
        first, second = (parse_scenario(text, "f.toml") for text in texts)
        assert scenario_hash(first) == scenario_hash(second)


@pytest.mark.parametrize(
    ("name_or_path", "words"),
    [
        ("curtyard", "is 'curtyard', there is no such bundled scenario, did you mean 'courtyard'?"),
        ("zzz", f"known: {', '.join(BUNDLED)}"),
        ("missing.toml", "missing.toml: there is no such file"),
        ("folder/courtyard", "must be a .toml file"),
        ("courtyard.yaml", "must be a .toml file"),
        ("", "is a folder, must be a file"),
        ("x" * 4000, "there is no such bundled scenario"),
        ("x" * 4000 + ".toml", "cannot be read"),
        ("x" * 5000 + ".toml", "of 5005 characters, must have at most 4096"),
        ("a\0b.toml", "must be a text without null characters"),
    ],
)
def test_unknown_scenario_is_a_clear_error(name_or_path: str, words: str) -> None:
    with pytest.raises(ScenarioError, match=re.escape(words)):
        load_scenario(name_or_path)


def test_name_means_the_bundled_scenario_wherever_one_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "courtyard").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load_scenario("courtyard").name == "courtyard"


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"a = 1\nb = = 2", "line 2, column 5: is not TOML: Invalid value"),
        (b"a = 1\r\n\xff = 2", "line 2: is not UTF-8 text: byte 0xff"),
        (b"", "schema_version: missing"),
    ],
)
def test_unreadable_file_is_named_with_the_place(tmp_path: Path, content: bytes, line: str) -> None:
    path = tmp_path / "f.toml"
    path.write_bytes(content)
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    assert f"{path}: {line}" in str(caught.value)


def test_byte_order_mark_is_no_part_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "f.toml"
    path.write_bytes(b"\xef\xbb\xbf" + tomli_w.dumps(minimal_document()).encode())
    assert load_scenario(str(path)).name == "minimal"


def test_all_problems_of_the_sections_are_found_at_once(tmp_path: Path) -> None:
    document = full_document()
    document["site"]["widht_m"] = document["site"].pop("width_m")
    document["structures"][0]["rows"] = -3
    document["structures"].append({**document["structures"][1], "name": "twin"})
    document["build_zone"]["stock"] = 1000
    document["simulation"]["preset"] = "balistic"
    path = tmp_path / "f.toml"
    path.write_text(tomli_w.dumps(document), encoding="utf-8")
    assert {problem.key for problem in find_problems(path)} == {
        "site.width_m",
        "site.widht_m",
        "structures[0].rows",
        "simulation.preset",
    }


def test_unreadable_file_is_a_problem_too(tmp_path: Path) -> None:
    (problem,) = find_problems(tmp_path / "missing.toml")
    assert (problem.key, problem.message) == ("", "there is no such file")


def test_unsound_scenario_is_not_saved(tmp_path: Path) -> None:
    path = tmp_path / "f.toml"
    scenario = load_scenario("courtyard").model_copy(
        update={"site": Site(width_m=10.0, height_m=10.0)}
    )
    with pytest.raises(ScenarioError, match="must lie inside the site"):
        save_scenario(scenario, path)
    assert not path.exists()


def test_scenario_is_saved_only_where_it_can_be_loaded(tmp_path: Path) -> None:
    scenario = load_scenario("courtyard")
    with pytest.raises(ScenarioError, match=r"must be a \.toml file"):
        save_scenario(scenario, tmp_path / "f.json")
    with pytest.raises(BlastEnvError, match="there is no folder"):
        save_scenario(scenario, tmp_path / "missing" / "f.toml")
    assert os.listdir(tmp_path) == []


def test_example_of_heights_fits_into_the_whole_example() -> None:
    whole, heights = (
        tomllib.loads((EXAMPLES / name).read_text(encoding="utf-8"))
        for name in ("example.toml", "example_heights.toml")
    )
    scenario = Scenario.from_document({**whole, **heights}, "example")
    assert scenario.air_height_m == 12.0
    for key in ("charge", "structures"):  # what the second one repeats is as in the first
        for item in heights[key]:
            assert {k: v for k, v in item.items() if k not in ("height_m", "faces")} in whole[key]


def test_format_description_names_every_key() -> None:
    text = (REPOSITORY / "docs" / "reference" / "scenario_format.md").read_text(encoding="utf-8")
    document = tall_document()
    keys = {
        *document,
        *document["site"],
        "reason",
        *document["build_zone"],
        *document["build_zone"]["cost_areas"][0],
        *document["build_zone"]["access_way"],
        *document["simulation"],
    }
    for item in (*document["charge"], *document["structures"], *document["gauges"]):
        keys |= set(item)
    assert {key for key in keys if f"`{key}`" not in text} == set()
