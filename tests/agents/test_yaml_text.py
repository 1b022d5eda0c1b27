"""YAML is read as plain data, or refused with the reason, and at once."""

import time

import pytest
from blast_agents.training.hyperparameters import parse_yaml
from hypothesis import given
from hypothesis import strategies as st

from blast_env.documents import DocumentError

BOMB = "a0: &a0 [x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 40)
)


def test_plain_data_is_read() -> None:
    text = "a: 1\nb: [1.5, true, null, 'x']\nc: 2024-01-01\nd: {e: 3e-4}"
    assert parse_yaml(text) == {
        "a": 1,
        "b": [1.5, True, None, "x"],
        "c": "2024-01-01",  # a text: no setting is a date
        "d": {"e": "3e-4"},
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BOMB, "line 2, column 10: has an alias, must have none"),  # took 2.8 GB
        ("[" * 3000, "line 1, column 51: is nested too deeply"),
        ("- " * 3000, "is nested too deeply"),
        ("9" * 6000, "has a number of 6000 digits"),
        ("a: 1\na: 2", "has a key twice"),
        ("? [a]\n: 1", "line 1, column 3: is not YAML"),
        ("a: \x00", "is not YAML"),
        ("0b_", "is not YAML"),
        ("!!bool x", "is not YAML"),
        ("!!timestamp x", "is not YAML: could not determine a constructor"),
        ("!!python/object:os.system x", "is not YAML: could not determine a constructor"),
        ("x" * 100_001, "has 100001 characters"),
    ],
)
def test_anything_else_is_refused_at_once(text: str, words: str) -> None:
    began_s = time.perf_counter()
    with pytest.raises(DocumentError, match=words):
        parse_yaml(text)
    assert time.perf_counter() - began_s < 2.0


@given(st.text(alphabet="ab:&*-?[]{}!|>'\"#% \n019._<=~e+", max_size=40))
def test_any_text_is_yaml_or_an_error(text: str) -> None:
    try:
        parse_yaml(text)
    except DocumentError as error:
        words = str(error)
    else:
        words = "YAML"
    assert words
