"""Values of options: numbers that are refused, alone and with commas."""

import pytest
from typer.testing import CliRunner

from blast_env.cli import app
from blast_env.cli.options import numbers
from blast_env.errors import BlastEnvError


@pytest.mark.parametrize(
    "words",
    [
        *(("--tnt-kg", "1_000"), ("--tnt-kg", "nan"), ("--tnt-kg", "1,5"), ("--seed", "1_0")),
        *(("--cell", "inf"), ("--tnt-kg", "\uff11")),
    ],
)
def test_a_number_that_python_reads_and_nobody_means_is_refused(words: tuple[str, ...]) -> None:
    result = CliRunner().invoke(app, ["simulate", "courtyard", *words])
    assert result.exit_code == 2
    assert "is no number such as 1000 or 0.5" in result.output


def test_numbers_with_commas_are_as_many_as_their_form_has() -> None:
    assert numbers("--charge", "1,2.5", "X,Y[,KG]") == (1.0, 2.5)
    assert numbers("--charge", "-3,4,60", "X,Y[,KG]") == (-3.0, 4.0, 60.0)


@pytest.mark.parametrize("text", ["1", "1,2,3", "a,b", "1_0,2", ""])
def test_numbers_in_another_form_are_refused(text: str) -> None:
    with pytest.raises(BlastEnvError) as caught:
        numbers("--at", text, "X,Y")
    assert str(caught.value) == f"--at is {text!r}, must be two numbers as X,Y"
