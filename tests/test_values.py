"""Numbers that people type: read as they are meant, or refused."""

import pytest

from blast_env.errors import BlastEnvError
from blast_env.values import plain_number, typed_number


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
