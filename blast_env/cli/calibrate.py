"""`blast-env calibrate`: a free-field study, its three laws, and a stored calibration."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from blast_env.calibration.calibrate import LawName
from blast_env.calibration.model import SimulatedQuantity
from blast_env.cli.calibrate_free_field import (
    Burst,
    FreeFieldOptions,
    ReferenceName,
    calibrate_free_field,
)
from blast_env.cli.calibrate_shielding import (
    DEFAULT_PRESET,
    ShieldingOptions,
    calibrate_shielding,
)
from blast_env.cli.output import user_errors
from blast_env.errors import BlastEnvError

PAPER_DISTANCES = "15,30,45,60,75,90,105,120"
_SHIELDING_PANEL = "Shielding study"
_FREE_FIELD_OPTIONS = (
    "name",
    "reference",
    "distances",
    "scenario",
    "tnt_kg",
    "tnt_range",
    "law",
    "simulated",
    "burst",
)
_SHIELDING_OPTIONS = ("exponent", "calibration")


def calibrate(
    context: typer.Context,
    name: Annotated[
        str | None, typer.Option(help="Name of the calibration and of its files.")
    ] = None,
    reference: Annotated[
        ReferenceName | None, typer.Option(help="What to calibrate against.")
    ] = None,
    distances: Annotated[
        str, typer.Option(help="Distances from charge to facade, m, separated by commas.")
    ] = PAPER_DISTANCES,
    seeds: Annotated[int, typer.Option(min=2, help="Blasts at each distance.")] = 16,
    first_seed: Annotated[int, typer.Option(min=0, help="The seeds count from here.")] = 1000,
    scenario: Annotated[
        str, typer.Option(help="A scenario with one point charge and one structure.")
    ] = "free_field",
    preset: Annotated[str | None, typer.Option(help="Parameters of this name.")] = None,
    engine: Annotated[
        str | None, typer.Option(help="pymunk or event; without it pymunk, for --shielding event.")
    ] = None,
    law: Annotated[LawName, typer.Option(help="The law to store.")] = "power",
    simulated: Annotated[
        SimulatedQuantity, typer.Option(help="Convert m|v|, or the momentum really transferred.")
    ] = "impulse",
    burst: Annotated[Burst, typer.Option(help="For Kingery-Bulmash.")] = "hemispherical",
    tnt_kg: Annotated[
        float | None, typer.Option(help="Mass of the charge, instead of the scenario's.")
    ] = None,
    tnt_range: Annotated[
        str | None,
        typer.Option(help="LOW,HIGH: masses, kg, for which the law shall hold by scaling."),
    ] = None,
    processes: Annotated[int, typer.Option(min=1, help="Worker processes.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder for all files.")] = Path("out/calibration"),
    shielding: Annotated[
        bool,
        typer.Option(
            "--shielding",
            help="Instead: compare the impulse behind the corners of a block with experiments.",
            rich_help_panel=_SHIELDING_PANEL,
        ),
    ] = False,
    exponent: Annotated[
        float | None,
        typer.Option(
            help="Scale the ratios with this exponent B of a power law.",
            rich_help_panel=_SHIELDING_PANEL,
        ),
    ] = None,
    calibration: Annotated[
        str | None,
        typer.Option(
            help="Scale them with the exponent of this calibration, a name or a file.",
            rich_help_panel=_SHIELDING_PANEL,
        ),
    ] = None,
) -> None:
    """Run blasts at many distances, fit the three laws, and store one as a calibration.

    Needs --name and --reference. Finished blasts are kept in NAME.ENGINE.runs.jsonl: after an
    interruption, the same command goes on from there.

    With --shielding: study how much of the impulse gets round the corners of a block. That takes
    --preset, --engine, --seeds, --first-seed, --processes and --out of the options above.
    """
    numbers = tuple(range(first_seed, first_seed + seeds))
    with user_errors():
        if shielding:
            _refuse(context, _FREE_FIELD_OPTIONS, "does not go with --shielding")
            used, engine = preset or DEFAULT_PRESET, engine or "event"
            calibrate_shielding(
                ShieldingOptions(used, engine, numbers, processes, out, exponent, calibration)
            )
            return
        _refuse(context, _SHIELDING_OPTIONS, "goes with --shielding only")
        if name is None or reference is None:
            missing = "--name" if name is None else "--reference"
            raise BlastEnvError(f"{missing} is missing: it is needed without --shielding")
        calibrate_free_field(
            FreeFieldOptions(
                name=name,
                reference=reference,
                distances=distances,
                seeds=numbers,
                scenario=scenario,
                preset=preset,
                engine=engine or "pymunk",
                tnt_kg=tnt_kg,
                tnt_range=tnt_range,
                law=law,
                simulated=simulated,
                burst=burst,
                processes=processes,
                out=out,
            )
        )


def _refuse(context: typer.Context, options: Sequence[str], why: str) -> None:
    """Refuse options that were given but would have no effect."""
    for option in options:
        source = context.get_parameter_source(option)
        if source is not None and source.name != "DEFAULT":
            raise BlastEnvError(f"--{option.replace('_', '-')} {why}")
