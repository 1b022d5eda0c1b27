"""Damaged scenario files, hundreds: each a clear error, none a traceback."""

from difflib import get_close_matches
from typing import Any

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from blast_env.site import Scenario, ScenarioError, parse_scenario
from tests.site.documents import (
    Document,
    KeyPath,
    all_documents,
    changed,
    key_paths,
    value_at,
    without,
    written,
)

SOURCE = "damaged.toml"
OPTIONAL = {
    *("description", "calibration", "build_zone", "simulation", "weight", "protected"),
    *("module_capacity", "keep_outs", "preset", "overrides", "air", "explosive", "spacing_units"),
    *("jitter", "ball_count", "collide_within_charge"),
    *("clearance_m", "module_cost", "cost_areas", "budget", "access_way"),
    *("air_height_m", "height_m", "faces", "gauges", "gate"),
    *("building", "georeference", "crs", "rotation_deg"),
    *("drivable", "places", "apart_m"),
    *("peak_weight", "objective", "quantity", "charges", "cvar_level"),
    *("reference_impulse_pa_s", "reference_peak_pa"),
    *("motion", "entry_speed_km_h", "grip", "slow", "crash_rating", "penetration_m", "test"),
}
CASES = [(document, path) for document in all_documents() for path in key_paths(document)]
KEYS = [(document, path) for document, path in CASES if isinstance(path[-1], str)]
REQUIRED = [
    (document, path)
    for document, path in KEYS
    if path[-1] not in OPTIONAL or path == ("site", "height_m")
]
LEAVES = [case for case in CASES if not isinstance(value_at(*case), dict | list)]
NUMBERS = [
    case
    for case in LEAVES
    if isinstance(value_at(*case), int | float) and not isinstance(value_at(*case), bool)
]
LETTERS = "abcdefghijklmnopqrstuvwxyz_"


def error_of(text: str) -> str:
    """Return the message of the error, or fail if there is none or one without a place."""
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text, SOURCE)
    assert caught.value.problems
    for line in str(caught.value).split("\n"):
        if line.endswith((" more problems", " more problem")):
            continue
        source, key, message = line.split(": ", 2)
        assert source == SOURCE
        assert key
        assert message
    return str(caught.value)


def error_of_document(document: Document) -> str:
    return error_of(tomli_w.dumps(document))


@st.composite
def misspelt(draw: st.DrawFn, word: str) -> str:
    """A word with one letter left out, doubled, replaced or swapped with the next."""
    i = draw(st.integers(0, len(word) - 1))
    letter = draw(st.sampled_from(LETTERS))
    return draw(
        st.sampled_from(
            [
                word[:i] + word[i + 1 :],
                word[:i] + word[i] + word[i:],
                word[:i] + letter + word[i + 1 :],
                word[:i] + word[i + 1 : i + 2] + word[i : i + 1] + word[i + 2 :],
            ]
        )
    )


def siblings_of(document: Document, path: KeyPath) -> Document:
    siblings = value_at(document, path[:-1])
    assert isinstance(siblings, dict)
    return siblings


def wrong_values(value: Any) -> st.SearchStrategy[Any]:
    """Values of another type than the one given, as far as a file can hold them."""
    texts, flags = st.text(max_size=80), st.booleans()
    numbers = st.integers() | st.floats()
    arrays = st.lists(texts, max_size=3)
    tables = st.dictionaries(texts, numbers)
    dates = st.dates() | st.times() | st.datetimes()
    if isinstance(value, bool):
        return texts | numbers | arrays | tables | dates
    if isinstance(value, int | float):
        return texts | flags | arrays | tables | dates
    if isinstance(value, str):
        return flags | numbers | arrays | tables | dates
    if isinstance(value, list):
        return texts | flags | numbers | tables | dates
    return texts | flags | numbers | arrays | dates


@given(st.data())
def test_misspelt_key_is_named_with_the_nearest_one(data: st.DataObject) -> None:
    document, path = data.draw(st.sampled_from(KEYS))
    key = str(path[-1])
    wrong = data.draw(
        misspelt(key).filter(lambda word: word and word not in siblings_of(document, path))
    )
    damaged = changed(without(document, path), (*path[:-1], wrong), value_at(document, path))
    message = error_of_document(damaged)
    assert f"{written((*path[:-1], wrong))}: unknown key" in message
    if get_close_matches(wrong, [key]) and len(key) > 4:
        assert f"did you mean '{key}'?" in message
    if (document, path) in REQUIRED:
        assert f"{written(path)}: missing" in message


def test_deleted_key_is_named() -> None:
    """Each key of each kind of table once."""
    kinds = {tuple(k for k in case[1] if isinstance(k, str)): case for case in REQUIRED}
    for document, path in kinds.values():
        assert f"{SOURCE}: {written(path)}: missing" in error_of_document(without(document, path))


@given(st.data())
def test_value_of_the_wrong_type_is_named(data: st.DataObject) -> None:
    document, path = data.draw(st.sampled_from(CASES))
    wrong = data.draw(wrong_values(value_at(document, path)))
    message = error_of_document(changed(document, path, wrong))
    assert f"{SOURCE}: {written(path)}" in message


@given(
    st.sampled_from(NUMBERS),
    st.floats(max_value=-1.0)
    | st.floats(min_value=1e13)
    | st.just(float("nan"))
    | st.integers(max_value=-1)
    | st.integers(min_value=10**13)
    | st.integers(1, 4000).map(lambda exponent: -(10**exponent))
    | st.integers(13, 4000).map(lambda exponent: 10**exponent),
)
def test_number_out_of_bounds_is_named(case: tuple[Document, KeyPath], wrong: float) -> None:
    document, path = case
    message = error_of_document(changed(document, path, wrong))
    line = next(line for line in message.split("\n") if f": {written(path)}: " in line)
    assert "must be" in line or "Input should be" in line
    assert len(line) < 300


TOML_VALUES = st.recursive(
    st.booleans() | st.integers() | st.floats() | st.text(max_size=20) | st.dates(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=10), inner),
    max_leaves=8,
)
TOP_KEYS = sorted(set(Scenario.model_fields))


@given(st.dictionaries(st.sampled_from(TOP_KEYS) | st.text(max_size=10), TOML_VALUES, max_size=8))
def test_any_other_toml_is_an_error(document: Document) -> None:
    error_of_document(document)


@pytest.mark.parametrize(
    "text",
    [
        "site = " + "[" * 50_000,
        "site = " + "{a = " * 20_000,
        "a" + ".a" * 3000 + " = 1",
        "[" + "a." * 3000 + "a]",
        "schema_version = " + "9" * 5000,
        "schema_version = 0x" + "f" * 9000,
        "site.width_m = 0x" + "f" * 9000,
        "site = " + "[" * 80 + "]" * 80,
        "name = '''" + "x" * 100_000 + "'''",
        "'a\tb' = 1",
        '"a\\nb" = 1',
        "structures = " + str([0] * 20_000),
        "\x00",
        "# only a comment",
    ],
    ids=lambda text: repr(text[:12]),
)
def test_monstrous_file_is_an_error(text: str) -> None:
    message = error_of(text)
    assert max(map(len, message.split("\n"))) < 400
