"""Texts that would keep a parser busy are refused; numbers and cells are what they say."""

import csv
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from blast_env.documents import (
    MAX_DEPTH,
    DocumentError,
    checked_as,
    parse_csv,
    parse_json,
    parse_toml,
    read_text,
)
from blast_env.errors import BlastEnvError
from blast_env.tables import cell_text, write_csv
from blast_env.values import plain_number, typed_number

DEEP = MAX_DEPTH + 1


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a = 1\n" + ".".join(["a"] * 40_000) + " = 1", 2),  # 80 kB took all memory
        ("[" + " . ".join(['"a.b"', "'c'"] * DEEP) + "]", 1),
        ("x = { " + ".".join(["1"] * DEEP) + " = 2 }", 1),
        ("x = 'y'\n\nx = " + "[" * 2000, 3),
        ("x = " + "{ x = " * 400 + "1" + "}" * 400, 1),
    ],
)
def test_what_is_nested_too_deeply_is_refused_at_once(text: str, line: int) -> None:
    began_s = time.process_time()
    with pytest.raises(DocumentError, match="is nested too deeply") as caught:
        parse_toml(text)
    assert caught.value.place == f"line {line}"
    assert time.process_time() - began_s < 30.0


def test_dots_and_brackets_in_texts_and_comments_are_none() -> None:
    many = ".".join(["a"] * 1000) + "[" * 1000
    text = f"# {many}\na = \"{many}\"\nb = '{many}'\nc = '''\n{many}'''\nd = \"\"\"\\\n{many}\"\"\""
    document = parse_toml(text)
    assert list(document.values()) == [many] * 4
    assert parse_json(json.dumps({"a": many})) == {"a": many}


@given(st.text(alphabet="ab.=[]{}\"'\\#\n 1-", max_size=60))
def test_any_text_is_toml_or_an_error_with_a_place(text: str) -> None:
    try:
        parse_toml(text)
    except DocumentError as error:
        place = error.place
    else:
        place = "line"
    assert place.startswith("line")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[" * DEEP, "line 1: is nested too deeply"),
        ('{"a": 1, "a": 2}', "a key occurs twice"),
        ("9" * 6000, "has 6000 digits"),
        ("[NaN]", "NaN is not a number"),
        ("[1,", "line 1, column 4: is not JSON"),
        ("]" * 99 + "[" * 99_999, "is nested too deeply"),
    ],
)
def test_what_json_may_not_hold_is_named(text: str, words: str) -> None:
    with pytest.raises(DocumentError, match=words):
        parse_json(text)


@dataclass(frozen=True)
class Row:
    name: str
    count: int
    share: Annotated[float, Field(ge=0.0)]


def test_rows_of_a_table_are_what_they_must_be() -> None:
    text = 'share,more,name,count\n0.5,x,"a\nb",3\n1e-3,,c,4\n'
    assert list(parse_csv(text, Row)) == [Row("a\nb", 3, 0.5), Row("c", 4, 1e-3)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("name,count,share\na,1,0.5", "line 2: has no end: was it cut short"),
        ("name,count,share\na,1\n", "line 2: has 2 cells, must have 3"),
        ("name,count\na,1\n", "line 2: share is missing"),
        ("name,count,share\na,1,0.5\nb,1.5,0.5\n", "line 3: count is '1.5': .* integer"),
        ("name,count,share\na,1,-1\n", "line 2: share is '-1': .* greater than or equal to 0"),
        ('name,count,share\n"a,1,2\n', "is no row of a table: unexpected end"),
    ],
)
def test_what_is_no_table_is_named_with_its_line(text: str, words: str) -> None:
    with pytest.raises(DocumentError, match=words):
        list(parse_csv(text, Row))


def test_many_problems_are_counted() -> None:
    with pytest.raises(DocumentError, match=r"; 90 more problems$") as caught:
        checked_as(tuple[int, ...], ["x"] * 100)
    assert len(str(caught.value)) < 2000


def test_a_file_may_have_a_bound_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text("12345")
    assert read_text(path, 5) == "12345"
    with pytest.raises(DocumentError, match="has 5 bytes, must have at most 4"):
        read_text(path, 4)


@dataclass(frozen=True)
class _Numbers:
    count: int
    share: float


@pytest.mark.parametrize(
    "wrong", [{"count": 1.0}, {"count": True}, {"count": "1"}, {"share": "0.5"}, {"share": True}]
)
def test_no_value_of_a_file_is_converted_into_a_number(wrong: dict[str, object]) -> None:
    with pytest.raises(DocumentError):
        checked_as(_Numbers, {"count": 1, "share": 0.5} | wrong)
    assert checked_as(_Numbers, {"count": 1, "share": 1}) == _Numbers(1, 1.0)


def test_a_cell_of_a_table_is_no_number_with_marks_between_its_digits() -> None:
    assert [*parse_csv("count,share\n1000,0.5\n", _Numbers)] == [_Numbers(1000, 0.5)]
    with pytest.raises(DocumentError, match=r"line 2: '1_000' is no number"):
        [*parse_csv("count,share\n1_000,0.5\n", _Numbers)]


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False)))
def test_numbers_keep_their_last_bit(numbers: list[float]) -> None:
    assert list(checked_as(tuple[float, ...], numbers)) == numbers


# --- Numbers that people type: read as they are meant, or refused.


@pytest.mark.parametrize(
    ("text", "number"),
    [
        *(("50,5", 50.5), ("0,125", 0.125), ("1234,567", 1234.567), ("-36.2", -36.2)),
        *((" 36,2 m ", 36.2), ("36.2m", 36.2), ("1e3", 1000.0), (".5", 0.5)),
    ],
)
def test_what_is_clear_is_read(text: str, number: float) -> None:
    assert typed_number("length", text, "m") == number


@pytest.mark.parametrize(
    "text",
    [
        *("1,000", "1.000,5", "1,000.5", "1 000", "1_000", "110 lb", "36 kg", "nan", "inf"),
        *("", "m", "1e999", "\uff11\uff10", "0x10", "5,", "12,345"),
    ],
)
def test_what_is_not_clear_is_refused(text: str) -> None:
    with pytest.raises(BlastEnvError, match=r"^length is "):
        typed_number("length", text, "m")


@pytest.mark.parametrize("text", ["1,5", "1_000", "nan", "inf", " 1", "1 ", "1e999", "\uff11"])
def test_files_and_options_have_plain_numbers(text: str) -> None:
    assert plain_number("mass", "1e3") == 1000.0
    with pytest.raises(BlastEnvError, match=r"^mass is "):
        plain_number("mass", text)


# --- Tables for spreadsheets: a text that begins like a formula stays a text.


@pytest.mark.parametrize("text", ["=1+1", "+1 wall", "-wall", "@SUM(A1)", "\t=1", "\r=1", "-1+1"])
def test_a_text_that_a_spreadsheet_would_calculate_is_marked_as_a_text(text: str) -> None:
    assert cell_text(text) == f"'{text}"


@pytest.mark.parametrize("value", ["wall = 1", "", "-1.5", "+3", "-1e-3", -1.5, 3, None, True])
def test_numbers_and_other_texts_stay(value: object) -> None:
    assert cell_text(value) is value


def test_a_table_keeps_its_numbers(tmp_path: Path) -> None:
    table = pd.DataFrame(
        {"item": ["=HYPERLINK(1)", None], "x_m": [-1.5, np.nan], "n": [-1, 2], "own": [True, False]}
    )
    path = write_csv(table, tmp_path / "table.csv")
    with path.open(newline="") as file:
        rows = [*csv.reader(file)]
    assert rows == [
        ["item", "x_m", "n", "own"],
        ["'=HYPERLINK(1)", "-1.5", "-1", "True"],
        ["", "", "2", "False"],
    ]
    assert table["item"][0] == "=HYPERLINK(1)"
