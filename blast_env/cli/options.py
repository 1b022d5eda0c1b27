"""Options that commands and studies share, with one name and one meaning in all."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import typer

from blast_env.cli.command import FOLDER, Command, option
from blast_env.cli.output import message_console
from blast_env.cluster import on_cluster
from blast_env.envs.arguments import ResetOptions
from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import draw_threats, one_of_each_charge
from blast_env.evaluation.engines.contract import CALIBRATED_ENGINES, ENGINE_NAMES, JUDGE
from blast_env.response.buildings import LevelOfProtection
from blast_env.site import AnyCharge, Scenario, VehicleCharge
from blast_env.site.sections import PointM
from blast_env.values import printable

CLUSTER_HELP: Final = (
    "Address or scheduler file of a Dask cluster, which then runs the blasts in the place of "
    "worker processes (docs/howto/cluster.md)."
)

ClusterAddress = Annotated[str | None, typer.Option("--cluster", help=CLUSTER_HELP)]


@contextmanager
def running_on(cluster: str | None) -> Iterator[None]:
    """Run the blasts of this block on a cluster, if one is given; see `on_cluster`."""
    if cluster is None:
        yield
        return
    # Dask logs the fate of its workers; `on_cluster` turns serious losses into errors.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with on_cluster(cluster) as size:
        now = f"{size.workers} workers with {size.threads} threads now"
        text = f"cluster {cluster}: {now if size.workers else 'waits for the first worker'}"
        message_console().print(printable(text))
        yield


SCENARIO_HELP: Final = "Bundled name, or a scenario file."
ENGINE_HELP: Final = (
    f"Engine: {', '.join(ENGINE_NAMES)}. {JUDGE} is gas dynamics, "
    f"{' and '.join(CALIBRATED_ENGINES)} are the paper's particles."
)
BY_SITE: Final = f"{JUDGE} where the site states heights, else particles"
CELL_HELP: Final = "Side of the cells of gas dynamics, m; else 0.5."
CELLS_HELP: Final = (
    "Whether cells of gas dynamics grow with the blast. uniform: no; on large sites coarse: soon, "
    "for search; fine: later, for final results."
)
FINAL_CELL_HELP: Final = "Side of the cells of gas dynamics, m; else 0.25, for final statements."
FINAL_CELLS: Final = "uniform of 0.25 m, fine on sites wider than 40 m"
UNTIL_HELP: Final = (
    "Loads that a blast of gas dynamics waits for. structures: those protected; walls: all; "
    "gauges; or a number of seconds."
)
CHARGE: Final = "X,Y[,KG]"
"""The form of a charge in all commands."""

GivenCharge = tuple[float, float] | tuple[float, float, float]
"""Place of a charge, m, with its mass, kg TNT, unless the scenario's is meant."""

TARGET_HELP: Final = "Required level of protection; else the scenario's, else {}."
MASS_ERROR_HELP: Final = (
    "Half the width of the 95 % interval of the charges' masses, as a share, for the probability "
    "of the level."
)
REQUIRE_HELP: Final = (
    "Requirement beside or instead of the level: a level of protection, 'gsa 3a', 'iso D', "
    "'peak KPA' or 'impulse PA_S'. May be repeated."
)
CVAR_HELP: Final = "Level of the CVaR: 0.8 is the mean of the worst 20 % of the loads."


def wanted_level(
    label: str | None, scenario: Scenario, otherwise: LevelOfProtection
) -> LevelOfProtection:
    """Return the requested level of protection, else the scenario's target.

    Args:
        label: Label of the requested level, if any.
        scenario: Its objective may have a target.
        otherwise: The level if it has none.

    Raises:
        UnknownNameError: If there is no such level.
    """
    if label is not None:
        return LevelOfProtection.named(label)
    target = scenario.objective.level
    return otherwise if target is None else target


@dataclass(frozen=True, kw_only=True)
class ChargeOptions(Command):
    """The place and the mass of the charge, if the user gives them."""

    charge: GivenCharge | None = option(
        None, "Place of the charge, m, and its mass, kg TNT, instead of drawn ones.", metavar=CHARGE
    )
    tnt_kg: float | None = option(
        None, "Mass of the charge, kg TNT, instead of the scenario's.", metavar="KG"
    )

    @property
    def place_m(self) -> PointM | None:
        """The place of the charge, if the user gives one."""
        return None if self.charge is None else self.charge[:2]

    @property
    def mass_kg(self) -> float | None:
        """The mass of the charge, if the user gives one.

        Raises:
            BlastEnvError: If it is given twice.
        """
        if self.charge is None or len(self.charge) == 2:
            return self.tnt_kg
        if self.tnt_kg is not None:
            raise BlastEnvError(
                f"--charge has the mass {self.charge[2]:g} kg, and --tnt-kg is {self.tnt_kg:g}: "
                "give one of them"
            )
        return self.charge[2]

    def fixed(self, scenario: Scenario, drawn: AnyCharge) -> AnyCharge:
        """Return a charge with the place and the mass that the user gives, if any.

        Args:
            scenario: The scenario.
            drawn: The charge drawn without them; with a given place, it is in no vehicle.

        Raises:
            BlastEnvError: If the mass is given twice.
            ScenarioError: If it is out of bounds, or not clear of a structure or the border.
        """
        options = ResetOptions(charge_position_m=self.place_m, tnt_kg=self.mass_kg)
        if not options.fix_charge:
            return drawn
        charge = options.charge(drawn)
        if not isinstance(charge, VehicleCharge):
            scenario.with_charge(charge)  # refuses a place that is not clear
        return charge

    def fixed_charges(self, scenario: Scenario, draws: int) -> list[AnyCharge]:
        """Return the drawn charges, each place once, with the place and mass that the user gives.

        Args:
            scenario: The scenario.
            draws: Number of draws.
        """
        threats = one_of_each_charge(draw_threats(scenario, range(draws)))
        return list(dict.fromkeys(self.fixed(scenario, threat.charge) for threat in threats))


@dataclass(frozen=True, kw_only=True)
class ProcessOptions(Command):
    """Worker processes on this machine."""

    processes: int = option(1, "Worker processes.", min=1)


@dataclass(frozen=True, kw_only=True)
class ClusterOptions(Command):
    """A cluster instead of processes on this machine."""

    cluster: str | None = option(None, CLUSTER_HELP)


@dataclass(frozen=True, kw_only=True)
class CacheOptions(Command):
    """A cache of blasts."""

    cache: Path | None = option(
        None, "Folder in which blasts are kept for the next run.", writes=FOLDER
    )

    def how_to_resume(self) -> str:
        """Return the way to resume after Ctrl-C: from the cached blasts, if there is a cache."""
        if self.cache is None:
            return "with --cache FOLDER the blasts would have been kept for the next call"
        return f"the same command resumes with the blasts kept in {self.cache}"


@dataclass(frozen=True, kw_only=True)
class JsonOptions(Command):
    """The result as JSON, short or complete."""

    as_json: bool = option(False, "Print a summary of the result as JSON.", flag="--json")
    json_all: bool = option(False, "Print the complete result as JSON.")

    def __post_init__(self) -> None:
        """Refuse both at once.

        Raises:
            BlastEnvError: If both are given.
        """
        if self.as_json and self.json_all:
            raise BlastEnvError("--json and --json-all exclude each other: one of them is printed")

    @property
    def any_json(self) -> bool:
        """Whether the result is printed as JSON."""
        return self.as_json or self.json_all
