"""Texts of users and files in messages."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from blast_env.errors import MAX_TEXT, key_path, named, quoted, reason_of, shortened, value_text


@given(st.text(max_size=300), st.integers(10, 200))
@example("\x00" * 300, MAX_TEXT)
@example("\ud800" * 80, MAX_TEXT)
@example("'\"" * 41, MAX_TEXT)
def test_a_quoted_text_fits_and_is_printable(text: str, most: int) -> None:
    shown = quoted(text, most)
    assert len(shown) <= most
    assert shown.isprintable()
    if len(repr(text)) <= most:
        assert shown == repr(text)


@given(st.text(min_size=1, max_size=300))
def test_no_name_value_or_key_is_longer_than_a_quoted_text(text: str) -> None:
    for shown in (named(text), value_text(text), key_path([text])):
        assert len(shown) <= MAX_TEXT
        assert shown.isprintable()


def test_numbers_of_numpy_are_shown_as_numbers() -> None:
    values = (np.int64(7), np.float32(0.5), np.bool_(True), np.str_("a"))
    assert [value_text(value) for value in values] == ["7", "0.5", "true", "'a'"]


def test_a_single_word_needs_no_quotes() -> None:
    assert [named(case) for case in ("A-WALL", "Wände", "2O$4", "east wing", "", "a" * 81)] == [
        *("A-WALL", "Wände", "2O$4", "'east wing'", "''"),
        quoted("a" * 81),
    ]


@given(st.text(max_size=2_000))
@example("x" * 2_000)
@example("a b " * 500)
def test_the_reason_of_another_library_is_a_short_line(text: str) -> None:
    reason = reason_of(ValueError(text))
    assert 0 < len(reason) <= 300
    assert "\n" not in reason
    assert max(map(len, reason.split())) <= MAX_TEXT
    if not text.split():
        assert reason == "ValueError"


def test_a_short_reason_is_unchanged() -> None:
    assert reason_of(OSError("no such file: a.dxf")) == "no such file: a.dxf"
    assert reason_of(ValueError("x" * 100)) == shortened("x" * 100)
