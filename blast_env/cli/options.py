"""Options that several commands have in common, with one name and one meaning in all of them."""

from pathlib import Path
from typing import Annotated

import typer

from blast_env.envs.arguments import ResetOptions
from blast_env.scenario import AnyCharge, Scenario, VehicleCharge

ChargePlace = Annotated[
    tuple[float, float] | None,
    typer.Option("--charge", metavar="X Y", help="Where the charge is, m, instead of drawing it."),
]

TntMass = Annotated[
    float | None,
    typer.Option("--tnt-kg", metavar="KG", help="Its mass, kg TNT, instead of the scenario's."),
]

CellSide = Annotated[
    float | None, typer.Option("--cell", help="Side of the cells of gas dynamics, m; else 0.5.")
]

Processes = Annotated[int, typer.Option(min=1, help="Worker processes.")]

CacheFolder = Annotated[
    Path | None, typer.Option(help="Folder in which blasts are kept for the next run.")
]

CvarLevel = Annotated[
    float, typer.Option(help="0.8: the mean of the worst 20 %, beside or instead of that of all.")
]

AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON, in short.")]

JsonAll = Annotated[
    bool, typer.Option("--json-all", help="Print as JSON all that there is to know of it.")
]


def fixed_charge(
    scenario: Scenario,
    drawn: AnyCharge,
    position_m: tuple[float, float] | None,
    tnt_kg: float | None,
) -> AnyCharge:
    """Return a charge with the place and the mass that `--charge` and `--tnt-kg` give, if any.

    Args:
        scenario: The scenario.
        drawn: The charge that is drawn otherwise.
        position_m: Where it is to be; one in a vehicle is in none then.
        tnt_kg: Its mass.

    Raises:
        ScenarioError: If it is out of bounds, or not clear of a structure or the border.
    """
    if position_m is None and tnt_kg is None:
        return drawn
    charge = ResetOptions(charge_position_m=position_m, tnt_kg=tnt_kg).charge(drawn)
    if not isinstance(charge, VehicleCharge):
        scenario.with_charge(charge)  # refuses a place that is not clear
    return charge
