"""Checking the arguments of environments: the nearest name for a misspelt one."""

from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from inspect import signature
from typing import ParamSpec, TypeVar

import numpy as np

from blast_env.errors import BlastEnvError, UnknownNameError

_Parameters = ParamSpec("_Parameters")
_Returned = TypeVar("_Returned")
_Strategy = TypeVar("_Strategy")


def checked_keywords(
    function: Callable[_Parameters, _Returned],
) -> Callable[_Parameters, _Returned]:
    """Return the function with an error that names the nearest keyword for a misspelt one.

    `gymnasium.make` hands keywords over that no type checker has seen, and Python's own error
    does not say what was meant.
    """
    known = [name for name in signature(function).parameters if name != "self"]

    @wraps(function)
    def checked(*args: _Parameters.args, **kwargs: _Parameters.kwargs) -> _Returned:
        check_names("argument", kwargs, known)
        return function(*args, **kwargs)

    return checked


def check_names(kind: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Refuse a name that is not known.

    Args:
        kind: What is named, for the error.
        names: The names given.
        known: The names that exist.

    Raises:
        UnknownNameError: If there is one; the message names the nearest known one.
    """
    known = list(known)
    for name in names:
        if name not in known:
            raise UnknownNameError(kind, str(name), known)


def strategy(kind: str, value: str | _Strategy, known: Mapping[str, _Strategy]) -> _Strategy:
    """Return the strategy of a name, or the strategy itself.

    Args:
        kind: What is named, for the error.
        value: The name, or an object that is used as it is.
        known: The strategies that have names.

    Raises:
        UnknownNameError: If there is none of that name; the message names the nearest one.
        BlastEnvError: If an object lacks the methods that the known ones have in common.
    """
    if isinstance(value, str):
        check_names(kind, [value], known)
        return known[value]
    missing = [name for name in _common_methods(known.values()) if not hasattr(value, name)]
    if missing:
        names = ", ".join(map(repr, sorted(known)))
        raise BlastEnvError(
            f"{kind} is {value!r}, must be one of {names}, or have the method {missing[0]}"
        )
    return value


def _common_methods(strategies: Iterable[object]) -> list[str]:
    """Return the methods that all of the strategies have, `__call__` among them."""
    of_each = [{name for name in dir(each) if callable(getattr(each, name))} for each in strategies]
    common = set.intersection(*of_each)
    return sorted(name for name in common if name == "__call__" or not name.startswith("_"))


def whole_number(name: str, value: int, least: int, most: int) -> int:
    """Return a count as a plain integer.

    Raises:
        BlastEnvError: If it is no integer or out of bounds.
    """
    is_integer = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not is_integer or not least <= value <= most:
        raise BlastEnvError(f"{name} is {value!r}, must be an integer from {least} to {most}")
    return int(value)


def real_number(name: str, value: float, least: float, most: float) -> float:
    """Return a number as a plain float.

    Raises:
        BlastEnvError: If it is no number or out of bounds.
    """
    is_number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not is_number or not least <= value <= most:
        raise BlastEnvError(f"{name} is {value!r}, must be a number from {least:g} to {most:g}")
    return float(value)
