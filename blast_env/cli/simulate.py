"""`blast-env simulate`: run one blast."""

from pathlib import Path
from typing import Annotated

import typer

from blast_env.cli.options import AsJson, CellSide, ChargePlace, JsonAll, TntMass, fixed_charge
from blast_env.cli.output import check_json, user_errors
from blast_env.cli.particle_blast import ParticleOutput, report_particle_blast
from blast_env.cli.targets import PICTURES, FileTarget, checked_targets
from blast_env.errors import BlastEnvError
from blast_env.physics.engines import find_engine, is_gas
from blast_env.scenario import Scenario, load_layout, load_scenario
from blast_env.scenario.build_scene import draw_threat
from blast_env.simulation import Blast

_FILMS = (".mp4", ".gif")
_GAS_PANEL = "Gas dynamics only"
_PARTICLES_PANEL = "Particles only"

Picture = Path | None


def simulate(
    scenario: Annotated[str, typer.Argument(help="Bundled name, or a scenario file.")],
    layout: Annotated[
        Path | None, typer.Option(help="JSON file with the barrier's [row, column] cells.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Decides charge, fan and air.")] = 0,
    preset: Annotated[
        str | None, typer.Option(help="Parameters of this name instead of the scenario's.")
    ] = None,
    engine: Annotated[
        str, typer.Option(help="pymunk or event (particles), or gas (gas dynamics).")
    ] = "pymunk",
    cell: CellSide = None,
    charge: ChargePlace = None,
    tnt_kg: TntMass = None,
    stand_off: Annotated[
        float | None, typer.Option(help="Distance from charge to facade, m (free_field).")
    ] = None,
    film: Annotated[Path | None, typer.Option(help="Write a film: .mp4 or .gif.")] = None,
    excel: Annotated[Path | None, typer.Option(help="Write a workbook: .xlsx.")] = None,
    parquet: Annotated[
        Path | None, typer.Option(help="Write the collisions, or the loads of all faces: .parquet.")
    ] = None,
    heat_map: Annotated[
        Picture,
        typer.Option(
            help="Write a picture of the load on what is protected, by place: .png, .svg, .pdf."
        ),
    ] = None,
    history: Annotated[
        Picture, typer.Option(help="Write a picture of the load over time (gas: at --gauge).")
    ] = None,
    side_by_side: Annotated[
        bool,
        typer.Option(
            "--side-by-side", help="Show in all pictures the site without the barrier as well."
        ),
    ] = False,
    impulse_map: Annotated[
        Picture,
        typer.Option(
            help="Write a map of the impulse over the ground.", rich_help_panel=_GAS_PANEL
        ),
    ] = None,
    peak_map: Annotated[
        Picture,
        typer.Option(
            help="Write a map of the peak overpressure, likewise.", rich_help_panel=_GAS_PANEL
        ),
    ] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            help="impulse or peak: what --heat-map shows.",
            show_default="impulse",
            rich_help_panel=_GAS_PANEL,
        ),
    ] = None,
    gauge: Annotated[
        str | None,
        typer.Option(
            help="Gauge of --history, beside Kingery-Bulmash.",
            show_default="the scenario's first",
            rich_help_panel=_GAS_PANEL,
        ),
    ] = None,
    film_height: Annotated[
        float | None,
        typer.Option(
            help="Height of the film's plan, m.", show_default="1.5", rich_help_panel=_GAS_PANEL
        ),
    ] = None,
    film_section: Annotated[
        str | None,
        typer.Option(
            metavar="AXIS=M",
            help="The film's vertical section: x=12.5 or y=4.",
            show_default="through the charge",
            rich_help_panel=_GAS_PANEL,
        ),
    ] = None,
    scheme: Annotated[
        Picture,
        typer.Option(
            help="Write a picture of the initial state.", rich_help_panel=_PARTICLES_PANEL
        ),
    ] = None,
    velocities: Annotated[
        Picture,
        typer.Option(
            help="Write a picture of the fan's velocities.", rich_help_panel=_PARTICLES_PANEL
        ),
    ] = None,
    as_json: AsJson = False,
    json_all: JsonAll = False,
) -> None:
    """Run one blast and print what each structure took.

    A picture answers the same question on either engine: --film how the blast spreads, --heat-map
    where the load falls, --history when it comes.
    """
    pictures = {
        "--heat-map": heat_map,
        "--history": history,
        "--impulse-map": impulse_map,
        "--peak-map": peak_map,
        "--scheme": scheme,
        "--velocities": velocities,
    }
    files = {option: FileTarget(path, PICTURES) for option, path in pictures.items()}
    files |= {
        "--film": FileTarget(film, _FILMS),
        "--excel": FileTarget(excel, (".xlsx",)),
        "--parquet": FileTarget(parquet, (".parquet",)),
    }
    for_gas = {
        "--impulse-map": impulse_map,
        "--peak-map": peak_map,
        "--quantity": quantity,
        "--gauge": gauge,
        "--film-height": film_height,
        "--film-section": film_section,
    }
    with user_errors(), checked_targets(files):
        check_json(as_json, json_all)
        named = load_scenario(scenario)
        chosen = _changed(named, preset, stand_off)
        # A layout is for the site of the file; preset and stand-off are this command's.
        cells = () if layout is None else load_layout(layout, named)
        found = find_engine(engine, cell)
        drawn = fixed_charge(chosen, draw_threat(chosen, seed), charge, tnt_kg)
        if not is_gas(found):
            for option, value in for_gas.items():
                if value is not None:
                    raise BlastEnvError(f"{option} is for gas dynamics: engine is {found.name!r}")
            report_particle_blast(
                Blast(chosen, cells, seed, found, drawn),
                ParticleOutput(
                    film=film,
                    excel=excel,
                    parquet=parquet,
                    heat_map=heat_map,
                    history=history,
                    scheme=scheme,
                    velocities=velocities,
                    side_by_side=side_by_side,
                    as_json=as_json,
                    json_all=json_all,
                ),
            )
            return
        for option, path in (("--scheme", scheme), ("--velocities", velocities)):
            if path is not None:
                raise BlastEnvError(f"{option} draws particles: engine 'gas' has none")
        if preset is not None:
            raise BlastEnvError("--preset is for particles: engine 'gas' has no parameters")
        # Here, because Numba takes half a second to import.
        from blast_env.cli.gas_blast import GasOutput, parsed_section, report_gas_blast
        from blast_env.simulation.gas import GasBlast

        report_gas_blast(
            GasBlast(chosen, tuple(cells), seed, found, drawn),
            GasOutput(
                film=film,
                excel=excel,
                parquet=parquet,
                heat_map=heat_map,
                history=history,
                impulse_map=impulse_map,
                peak_map=peak_map,
                quantity=quantity or "impulse",
                gauge=gauge,
                film_height_m=film_height,
                film_section=parsed_section(film_section),
                side_by_side=side_by_side,
                as_json=as_json,
                json_all=json_all,
            ),
        )


def _changed(scenario: Scenario, preset: str | None, stand_off: float | None) -> Scenario:
    if stand_off is not None:
        scenario = scenario.at_stand_off(stand_off)
    return scenario.with_simulation(preset)
