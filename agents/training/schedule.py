"""Amounts that may fall as training goes on, written as RL Zoo writes them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final

from pydantic import AfterValidator

LINEAR: Final = "lin_"


def _checked(value: float | str) -> float | str:
    number = value
    if isinstance(value, str):
        if not value.startswith(LINEAR):
            raise ValueError("must be a number, or 'lin_' and a number")
        try:
            number = float(value.removeprefix(LINEAR))
        except ValueError:
            raise ValueError("must be a number, or 'lin_' and a number") from None
    if not 0.0 < float(number) <= 1.0:
        raise ValueError("must be above 0 and at most 1")
    return value


Amount = Annotated[float | str, AfterValidator(_checked)]
"""A number from 0 to 1, or `"lin_"` and a number: from that to 0 at the end of training."""


@dataclass(frozen=True)
class Falling:
    """Falls in a straight line to 0.

    Attributes:
        start: What it begins with.
    """

    start: float

    def __call__(self, share_left: float) -> float:
        """Return the amount when a share of the training is left."""
        return self.start * share_left


def schedule(amount: float | str) -> float | Callable[[float], float]:
    """Return an amount as stable-baselines3 takes it: a number, or a function."""
    if isinstance(amount, str):
        return Falling(float(amount.removeprefix(LINEAR)))
    return amount
