"""Checks of the arguments of environments and the options of `reset`, kept as plain data."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial, wraps
from inspect import signature
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar

from gymnasium.envs.registration import EnvSpec

from blast_env.errors import BlastEnvError, UnknownArgumentError, UnknownNameError, value_text
from blast_env.geometry import Element
from blast_env.site import AnyCharge, Scenario, VehicleCharge
from blast_env.site.blast_site import Charge
from blast_env.values import MOST_SEED, finite_number, number_pair, whole_number

_Parameters = ParamSpec("_Parameters")
_Returned = TypeVar("_Returned")
_Strategy = TypeVar("_Strategy")


def checked_keywords(
    function: Callable[_Parameters, _Returned],
) -> Callable[_Parameters, _Returned]:
    """Return the function with an `UnknownArgumentError` for a misspelt keyword.

    Keywords to `gymnasium.make` escape type checkers, and the error of Python does not suggest the
    nearest keyword; this one does.
    """
    _, *known = signature(function).parameters  # without `self`

    @wraps(function)
    def checked(*args: _Parameters.args, **kwargs: _Parameters.kwargs) -> _Returned:
        for name in kwargs:
            if name == "autoreset_mode":
                raise UnknownArgumentError(
                    f"{function.__qualname__}() resets nothing by itself: give make_vec "
                    f"vector_kwargs={{{name!r}: ...}}"
                )
            if name not in known:
                raise UnknownArgumentError.of(function.__qualname__, name, known)
        return function(*args, **kwargs)

    return checked


def check_names(kind: str, names: Iterable[object], known: Iterable[str]) -> None:
    """Refuse an unknown name.

    Args:
        kind: Kind of the named thing, for the error.
        names: The names given.
        known: The names that exist.

    Raises:
        UnknownNameError: If a name is unknown; the message has the nearest known one.
    """
    known = list(known)
    for name in names:
        if name not in known:
            raise UnknownNameError(kind, name, known)


def strategy(
    kind: str,
    value: str | _Strategy,
    known: Mapping[str, _Strategy],
    protocols: tuple[type, ...] = (),
) -> _Strategy:
    """Return the strategy of a name, or the strategy itself.

    Args:
        kind: Kind of strategy, for the error.
        value: The name, or an object that is used unchanged.
        known: The named strategies.
        protocols: Protocols of the strategies where they have several, to be checked at run time.

    Raises:
        UnknownNameError: If there is none of that name; the message has the nearest one.
        BlastEnvError: If it is a class, or an object that lacks the methods that the known ones
            have in common, or is of none of the protocols.
    """
    if isinstance(value, str):
        check_names(kind, [value], known)
        return known[value]
    if isinstance(value, type):
        raise BlastEnvError(f"{kind} is the class {value.__name__}, must be an object of it")
    missing = [name for name in _common_methods(known.values()) if not hasattr(value, name)]
    if missing:
        names = ", ".join(map(repr, sorted(known)))
        raise BlastEnvError(
            f"{kind} is {value!r}, must be one of {names}, or have the method {missing[0]}"
        )
    if protocols and not isinstance(value, protocols):
        names = " or ".join(f"`{protocol.__name__}`" for protocol in protocols)
        raise BlastEnvError(f"{kind} is {value!r}, must have all methods of {names}")
    return value


def _common_methods(strategies: Iterable[object]) -> list[str]:
    """Return the public methods common to all the strategies, and `__call__` if they have it."""
    methods = [
        {name for name in dir(strategy) if callable(getattr(strategy, name))}
        for strategy in strategies
    ]
    common = set.intersection(*methods)
    return sorted(name for name in common if name == "__call__" or not name.startswith("_"))


def checked_options(options: Mapping[str, Any] | None, known: Iterable[str]) -> Mapping[str, Any]:
    """Return the options of a call of `reset`.

    Args:
        options: The options given; None for none.
        known: The names that exist.

    Raises:
        UnknownNameError: If there is no such option; the message has the nearest one.
        BlastEnvError: If they are not a mapping.
    """
    options = {} if options is None else options
    if not isinstance(options, Mapping):
        raise BlastEnvError(f"options is {value_text(options)}, must be a mapping")
    check_names("option of reset", options, known)
    return options


_MOST_BLAST_SEED: Final = MOST_SEED - 10**6  # further blasts of an episode use the next seeds


@dataclass(frozen=True)
class ResetOptions:
    """The fixed parts of an episode; None for those that are drawn.

    Attributes:
        charge_position_m: (x, y) of every charge.
        tnt_kg: TNT-equivalent mass of every charge.
        charge_height_m: Height of every charge above the ground.
        layout: The initial layout: cells of modules, or pieces.
        blast_seed: Seed of the first blast; the others use the following ones.
    """

    charge_position_m: tuple[float, float] | None = None
    tnt_kg: float | None = None
    charge_height_m: float | None = None
    layout: Sequence[Element] = ()
    blast_seed: int | None = None

    @classmethod
    def from_mapping(cls, options: Mapping[str, Any] | None) -> "ResetOptions":
        """Return the options of a call of `reset`.

        Raises:
            UnknownNameError: If there is no such option; the message has the nearest one.
            BlastEnvError: If the value of an option is invalid.
        """
        checks: dict[str, Callable[[str, Any], Any]] = {
            "charge_position_m": number_pair,
            "tnt_kg": finite_number,
            "charge_height_m": finite_number,
            "blast_seed": partial(whole_number, least=0, most=_MOST_BLAST_SEED),
        }
        options = checked_options(options, (*checks, "layout"))
        fixed = {}
        for name, check in checks.items():
            if options.get(name) is not None:
                fixed[name] = check(name, options[name])
        return cls(layout=options.get("layout", ()), **fixed)

    @property
    def fix_charge(self) -> bool:
        """Whether any property of the charge is fixed."""
        return (self.charge_position_m, self.tnt_kg, self.charge_height_m) != (None, None, None)

    def charge(self, drawn: AnyCharge) -> AnyCharge:
        """Return a drawn charge with its fixed properties replaced.

        A charge of a vehicle becomes a plain one if its position is fixed.
        """
        if isinstance(drawn, VehicleCharge):
            if self.charge_position_m is None:
                return drawn.with_charge(self.tnt_kg, self.charge_height_m)
            drawn = Charge(self.charge_position_m, drawn.tnt_kg, drawn.height_m)
        return Charge(
            drawn.position_m if self.charge_position_m is None else self.charge_position_m,
            drawn.tnt_kg if self.tnt_kg is None else self.tnt_kg,
            drawn.height_m if self.charge_height_m is None else self.charge_height_m,
        )


class PlainSpec:
    """A mixin for environments: stores the arguments of `gymnasium.make` as plain data.

    A scenario becomes its document, a path becomes text, an enumerated value its name. Other
    objects stay unchanged, and `EnvSpec.to_json` refuses those that are not plain data.
    """

    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """The specification used by `gymnasium.make`; `None` if the class was called directly."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            kwargs = dict(spec.kwargs)
            for name, value in spec.kwargs.items():
                if isinstance(value, Scenario):
                    kwargs[name] = value.model_dump(mode="json", exclude_none=True)
                elif isinstance(value, Path):
                    kwargs[name] = str(value)
                elif isinstance(value, Enum):
                    kwargs[name] = value.value
            spec = replace(spec, kwargs=kwargs)
        self._spec = spec
