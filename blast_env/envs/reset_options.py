"""The options of `reset`: what of an episode is fixed instead of drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import isfinite
from typing import Any

from blast_env.envs.arguments import check_names, whole_number
from blast_env.errors import BlastEnvError
from blast_env.scenario import Cell, Charge, Scenario


@dataclass(frozen=True)
class ResetOptions:
    """What of an episode is fixed.

    Attributes:
        charge_position_m: (x, y) of every charge.
        tnt_kg: TNT-equivalent mass of every charge.
        layout: Cells that hold a module from the start.
        blast_seed: Seed of the first blast; the others have the following ones.
    """

    charge_position_m: tuple[float, float] | None = None
    tnt_kg: float | None = None
    layout: Sequence[Cell] = ()
    blast_seed: int | None = None

    @classmethod
    def from_mapping(cls, options: Mapping[str, Any] | None) -> "ResetOptions":
        """Return the options of a call of `reset`.

        Raises:
            UnknownNameError: If there is no such option; the message names the nearest one.
            BlastEnvError: If the value of an option is of no use.
        """
        options = options or {}
        check_names("option of reset", options, (field.name for field in fields(cls)))
        seed = options.get("blast_seed")
        tnt_kg = options.get("tnt_kg")
        position_m = options.get("charge_position_m")
        return cls(
            charge_position_m=None if position_m is None else _position_m(position_m),
            tnt_kg=None if tnt_kg is None else _number("tnt_kg", tnt_kg),
            layout=options.get("layout", ()),
            blast_seed=None if seed is None else whole_number("blast_seed", seed, 0, 2**63),
        )

    @property
    def fix_charge(self) -> bool:
        """Whether anything of the charge is fixed."""
        return self.charge_position_m is not None or self.tnt_kg is not None

    def charge(self, drawn: Charge) -> Charge:
        """Return a charge that was drawn, with what is fixed in its place."""
        return Charge(
            drawn.position_m if self.charge_position_m is None else self.charge_position_m,
            drawn.tnt_kg if self.tnt_kg is None else self.tnt_kg,
        )


def with_possible_charges(scenario: Scenario, charges: Sequence[Charge]) -> Scenario:
    """Return the scenario in which these charges are possible as well.

    A module must keep clear of a charge that an option has put where the scenario has none.

    Raises:
        ScenarioError: If a charge is out of bounds, or not clear of a structure or the border.
    """
    document = scenario.model_dump()
    points = [{"kind": "point", **charge._asdict()} for charge in dict.fromkeys(charges)]
    document["charge"] = [*document["charge"], *points]
    return Scenario.from_document(document, scenario.name)


def _position_m(value: Any) -> tuple[float, float]:
    try:
        x_m, y_m = (_number("charge_position_m", coordinate) for coordinate in value)
    except (TypeError, ValueError):
        raise BlastEnvError(
            f"charge_position_m is {value!r}, must be a pair of numbers (x, y)"
        ) from None
    return x_m, y_m


def _number(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise BlastEnvError(f"{name} is {value!r}, must be a number") from None
    if not isfinite(number):
        raise BlastEnvError(f"{name} is {value!r}, must be a finite number")
    return number
