"""Options that commands and studies share, with one name and one meaning in all."""

import logging
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Final

import typer

from blast_env.cli.command import checked_first
from blast_env.cli.output import message_console
from blast_env.cluster import on_cluster
from blast_env.envs.arguments import ResetOptions
from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import (
    LoadCase,
    draw_threats,
    fixed_charges,
    in_turn,
    judged_threats,
    one_per_charge,
)
from blast_env.evaluation.engines.contract import (
    CALIBRATED_ENGINES,
    ENGINE_NAMES,
    JUDGE,
    PAPER_ENGINES,
    Engine,
)
from blast_env.response.levels import LevelOfProtection
from blast_env.sections import PointM
from blast_env.site import AnyCharge, Scenario
from blast_env.site.blast_site import Charge
from blast_env.values import plain_number, printable

SCENARIO_HELP: Final = "Bundled name, or a scenario file."
ENGINE_HELP: Final = (
    f"Engine: {', '.join(ENGINE_NAMES)}. {JUDGE} is gas dynamics, "
    f"{' and '.join(CALIBRATED_ENGINES)} are the paper's particles."
)
BY_SITE: Final = f"{PAPER_ENGINES['train']}, or {JUDGE} where the site states heights"
CELLS_HELP: Final = (
    "Whether cells of gas dynamics grow with the blast. uniform: no; on large sites coarse: soon, "
    "for search; fine: later, for final results."
)
FINAL_CELLS: Final = "uniform of 0.25 m, fine on sites wider than 40 m"
UNTIL_HELP: Final = (
    "Loads that a blast of gas dynamics waits for. structures: those protected; walls: all; "
    "gauges; or a number of seconds."
)
CHARGE: Final = "X,Y[,KG]"
"""The form of a charge in all commands."""

ScenarioArgument = Annotated[str, typer.Argument(help=SCENARIO_HELP)]
LayoutOption = Annotated[
    Path | None, typer.Option("--layout", help="Layout file; without it, the empty site.")
]
ChargeOption = Annotated[
    str | None,
    typer.Option(
        "--charge",
        help="Place of the charge, m, and its mass, kg TNT, instead of drawn ones.",
        metavar=CHARGE,
    ),
]
TntOption = Annotated[
    float | None,
    typer.Option(
        "--tnt-kg", help="Mass of the charge, kg TNT, instead of the scenario's.", metavar="KG"
    ),
]
DrawsOption = Annotated[
    int,
    typer.Option("--charges", help="Draws of the charge; each place counts once.", min=1),
]
EngineChoice = Annotated[str, typer.Option("--engine", help=ENGINE_HELP)]
CellOption = Annotated[
    float | None, typer.Option("--cell", help="Side of the cells of gas dynamics, m; else 0.5.")
]
CellsOption = Annotated[
    str | None, typer.Option("--cells", help=CELLS_HELP, show_default="uniform")
]
FinalCellOption = Annotated[
    float | None,
    typer.Option(
        "--cell", help="Side of the cells of gas dynamics, m; else 0.25, for final statements."
    ),
]
FinalCellsOption = Annotated[
    str | None, typer.Option("--cells", help=CELLS_HELP, show_default=FINAL_CELLS)
]
GlazingOption = Annotated[
    str | None,
    typer.Option(
        "--glazing", help="Windows of protected structures that have no facade, a component."
    ),
]
WallOption = Annotated[
    str | None,
    typer.Option("--wall", help="Walls of protected structures that have no facade, a component."),
]
TARGET_HELP: Final = "Required level of protection; else the scenario's, else {}."
TargetOption = Annotated[str | None, typer.Option("--target", help=TARGET_HELP.format("low"))]
MassErrorOption = Annotated[
    float,
    typer.Option(
        "--mass-error",
        help="Half the width of the 95 % interval of the charges' masses, as a share, for the "
        "probability of the level.",
        min=0.0,
        max=0.3,
    ),
]
RequireOption = Annotated[
    list[str] | None,
    typer.Option(
        "--require",
        help="Requirement beside or instead of the level: a level of protection, 'gsa 3a', "
        "'iso D', 'peak KPA' or 'impulse PA_S'. May be repeated.",
    ),
]
ProcessesOption = Annotated[int, typer.Option("--processes", help="Worker processes.", min=1)]
ClusterAddress = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        help="Address or scheduler file of a Dask cluster, which then runs the blasts in the place "
        "of worker processes (docs/howto/cluster.md).",
    ),
]
CacheOption = Annotated[
    Path | None,
    typer.Option(
        "--cache",
        help="Folder in which blasts are kept for the next run.",
        callback=checked_first(),
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print a summary of the result as JSON.")]


@contextmanager
def running_on(cluster: str | None) -> Iterator[int]:
    """Run the blasts of this block on a cluster, if one is given; see `on_cluster`.

    Yields:
        Number of the cluster's threads now; 1 without a cluster.
    """
    if cluster is None:
        yield 1
        return
    # Dask logs the fate of its workers; `on_cluster` turns serious losses into errors.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with on_cluster(cluster) as size:
        now = f"{size.workers} workers with {size.threads} threads now"
        text = f"cluster {cluster}: {now if size.workers else 'waits for the first worker'}"
        message_console().print(printable(text))
        yield max(size.threads, 1)


def resume_words(cache: Path | None) -> str:
    """Return the way to resume after Ctrl-C: from the cached blasts, if there is a cache."""
    if cache is None:
        return "with --cache FOLDER the blasts would have been kept for the next call"
    return f"the same command resumes with the blasts kept in {cache}"


_COUNTS: Final = MappingProxyType({2: "two", 3: "three", 4: "four"})


def numbers(option: str, text: str, form: str) -> tuple[Any, ...]:
    """Return the numbers of a text with commas, as in a form such as `X,Y[,KG]`.

    Brackets enclose a number that may be left out.
    """
    most = form.count(",") + 1
    counts = range(most - form.count("["), most + 1)
    with suppress(BlastEnvError):
        found = tuple(plain_number(option, part) for part in text.split(","))
        if len(found) in counts:
            return found
    words = " or ".join(_COUNTS[count] for count in counts)
    raise BlastEnvError(f"{option} is {text!r}, must be {words} numbers as {form}")


def refuse_given(context: typer.Context, names: Collection[str], reason: str) -> None:
    """Refuse options on the command line that do not apply, with the reason."""
    for parameter in context.command.params:
        name = parameter.name or ""
        source = context.get_parameter_source(name)
        if name in names and source is not None and source.name == "COMMANDLINE":
            raise BlastEnvError(f"{parameter.opts[0]} {reason}")


def wanted_level(
    label: str | None, scenario: Scenario, otherwise: LevelOfProtection
) -> LevelOfProtection:
    """Return the requested level of protection, else the scenario's target, else another one."""
    if label is not None:
        return LevelOfProtection.named(label)
    target = scenario.objective.level
    return otherwise if target is None else target


@dataclass(frozen=True)
class ChargeInput:
    """The place and the mass of the charge, where the user gives them.

    Attributes:
        mass_kg: The mass, kg TNT.
    """

    place_m: PointM | None
    mass_kg: float | None

    @classmethod
    def of(cls, charge: str | None, tnt_kg: float | None) -> "ChargeInput":
        """Return the charge of the options `--charge` and `--tnt-kg`; refuse two masses."""
        if charge is None:
            return cls(None, tnt_kg)
        x_m, y_m, *own_kg = numbers("--charge", charge, CHARGE)
        if own_kg and tnt_kg is not None:
            raise BlastEnvError(
                f"--charge has the mass {own_kg[0]:g} kg, and --tnt-kg is {tnt_kg:g}: give one of "
                "them"
            )
        return cls((x_m, y_m), own_kg[0] if own_kg else tnt_kg)

    def fixed(self, scenario: Scenario, drawn: AnyCharge) -> AnyCharge:
        """Return a charge drawn from a scenario with the given place and mass, if any.

        With a given place it is in no vehicle. One that is out of bounds or not clear is refused.
        """
        options = ResetOptions(charge_position_m=self.place_m, tnt_kg=self.mass_kg)
        if not options.fix_charge:
            return drawn
        charge = options.charge(drawn)
        scenario.check_charge(charge)
        return charge

    def threats(self, scenario: Scenario, draws: int) -> tuple[LoadCase, ...]:
        """Return drawn threats with the given place and mass, each place once.

        Fixed charges come in turn, each once before any repeats. At a given place every mass of the
        site counts once, unless it is given, too.
        """
        if self.place_m is not None and not fixed_charges(scenario):
            return self._at_the_place(scenario, range(draws))
        drawn = in_turn(scenario, draw_threats(scenario, range(draws)))
        fixed = (replace(draw, charge=self.fixed(scenario, draw.charge)) for draw in drawn)
        return one_per_charge(fixed)

    def _at_the_place(self, scenario: Scenario, seeds: Sequence[int]) -> tuple[LoadCase, ...]:
        """Return a threat of each mass and height at the given place: draws may miss a rare one."""
        charges = (Charge((0.0, 0.0), own.tnt_kg, own.height_m) for own in scenario.charge)
        placed = dict.fromkeys(self.fixed(scenario, charge) for charge in charges)
        # Without noise a seed tells nothing but which draw it was.
        return tuple(LoadCase(charge, seeds[k % len(seeds)]) for k, charge in enumerate(placed))

    def drawn_by(
        self, scenario: Scenario, seeds: Sequence[int], engine: Engine
    ) -> tuple[LoadCase, ...]:
        """Return the threats drawn by seeds, with the given place and mass.

        Fixed charges come in turn, each once before any repeats; see `judged_threats` for those
        that are dropped. At a given place a charge of one mass is dropped, too; without noise
        every mass of the site counts once there.
        """
        if self.place_m is not None and not (engine.has_noise or fixed_charges(scenario)):
            return self._at_the_place(scenario, seeds)
        drawn = judged_threats(scenario, seeds, has_noise=engine.has_noise)
        threats = tuple(LoadCase(self.fixed(scenario, draw.charge), draw.seed) for draw in drawn)
        is_free = self.place_m is None or engine.has_noise
        return threats if is_free else one_per_charge(threats)
