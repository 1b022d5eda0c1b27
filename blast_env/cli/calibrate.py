"""A free-field study from the command line: its three laws, and a stored calibration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final, Literal

import typer

from blast_env.calibration.metrics import shape_rms_percent
from blast_env.calibration.model import (
    Calibration,
    SimulatedQuantity,
    load_calibration,
    save_calibration,
)
from blast_env.calibration.references import paper_table
from blast_env.cli.cluster import ClusterAddress, running_on
from blast_env.cli.options import Processes, TntMass
from blast_env.cli.output import (
    engine_text,
    make_table,
    print_line,
    progress_bar,
    result_console,
    save_pictures,
    user_errors,
)
from blast_env.cli.targets import checked_targets
from blast_env.errors import BlastEnvError
from blast_env.files import make_folder, write_atomically
from blast_env.fitting.free_field import (
    CalibrationReport,
    FreeFieldStudy,
    LawName,
    Reference,
    kingery_bulmash_reference,
    paper_reference,
)
from blast_env.fitting.free_field import calibrate as fit_laws
from blast_env.physics.engines import find_engine
from blast_env.scenario import Scenario, load_scenario
from blast_env.statistics import Estimate
from blast_env.studies.shielding.ratios import check_exponent
from blast_env.studies.shielding.reflection import ReflectionReport, ReflectionStudy
from blast_env.studies.shielding.report import (
    EXPERIMENT,
    Region,
    ShieldingReport,
    ShieldingStudy,
    scaled_ratio,
)
from blast_env.tables import write_csv
from blast_env.units import MS_PER_S

ReferenceName = Literal["paper_ufc", "reflected_impulse", "incident_impulse"]


Burst = Literal["hemispherical", "spherical"]


@dataclass(frozen=True)
class FreeFieldOptions:
    """What the command was called with; see `blast-env calibrate --help`.

    Attributes:
        name: Name of the calibration and of its files.
        reference: What to calibrate against.
        distances: Distances, m, separated by commas.
        seeds: Seeds at every distance.
        scenario: A scenario with one point charge and one structure.
        preset: Parameters, instead of the scenario's.
        engine: Name of the engine.
        tnt_kg: Mass of the charge, instead of the scenario's.
        tnt_range: Masses "LOW,HIGH" for which the calibration is to hold by scaling.
        law: The law to store.
        simulated: Which sum over the collisions to convert.
        burst: For Kingery-Bulmash.
        processes: Worker processes.
        out: Folder for all files.
    """

    name: str
    reference: ReferenceName
    distances: str
    seeds: tuple[int, ...]
    scenario: str
    preset: str | None
    engine: str
    tnt_kg: float | None
    tnt_range: str | None
    law: LawName
    simulated: SimulatedQuantity
    burst: Burst
    processes: int
    out: Path

    @property
    def stem(self) -> str:
        """Path of all files without their suffix."""
        return str(self.out / f"{self.name}.{self.engine}")


def calibrate_free_field(options: FreeFieldOptions) -> None:
    """Run the study, write its files and print its tables.

    Raises:
        BlastEnvError: If an option is wrong.
    """
    distances_m = _parse_numbers("--distances", options.distances)
    tnt_range_kg = _parse_range(options.tnt_range)
    make_folder(options.out)
    engine = find_engine(options.engine)
    study = FreeFieldStudy(_scenario(options), distances_m, options.seeds, engine.name)
    reference = _reference(options.reference, study, options.burst)
    with progress_bar(f"{len(options.seeds) * len(distances_m)} blasts") as progress:
        runs = study.run(options.processes, Path(f"{options.stem}.runs.jsonl"), progress)
    report = fit_laws(study, runs, reference, options.simulated)
    stored = report.calibration(options.name, options.law)
    stored = stored.model_copy(update={"tnt_range_kg": tnt_range_kg})
    written = _write(report, stored, options.stem)
    _print(report, stored)
    print_line(engine_text(engine, [study.scenario]))
    for path in (*written, f"{options.stem}.runs.jsonl"):
        print_line(f"wrote {path}")


def _scenario(options: FreeFieldOptions) -> Scenario:
    scenario = load_scenario(options.scenario)
    if options.preset is not None:
        scenario = scenario.with_simulation(options.preset)
    if options.tnt_kg is None:
        return scenario
    document = scenario.model_dump()
    for source in document["charge"]:
        source["tnt_kg"] = options.tnt_kg
    return Scenario.from_document(document, f"{options.scenario} with --tnt-kg")


def _parse_numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise BlastEnvError(
            f"{option} is {text!r}, must be numbers separated by commas, e.g. 8,10,15"
        ) from None


def _parse_range(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    numbers = _parse_numbers("--tnt-range", text)
    if len(numbers) != 2 or not 0.0 < numbers[0] <= numbers[1]:
        raise BlastEnvError(f"--tnt-range is {text!r}, must be LOW,HIGH in kg, e.g. 20,1000")
    return numbers[0], numbers[1]


def _reference(name: ReferenceName, study: FreeFieldStudy, burst: Burst) -> Reference:
    if name == "paper_ufc":
        return paper_reference(study.distances_m)
    charge_kg = study.scenario.charge[0].tnt_kg
    return kingery_bulmash_reference(study.distances_m, charge_kg, name, burst)


def _write(report: CalibrationReport, stored: Calibration, stem: str) -> list[Path]:
    record, picture = Path(f"{stem}.json"), Path(f"{stem}.png")
    save_calibration(stored, record)
    table = write_csv(report.table(), f"{stem}.csv")
    return [record, table, *save_pictures(lambda: _save_figure(report, stored, picture))]


def _save_figure(report: CalibrationReport, stored: Calibration, path: Path) -> list[Path]:
    # Here, because pictures need the extra `render`.
    from blast_env.fitting.figure import calibration_figure
    from blast_env.rendering.figures import save_figure

    return [save_figure(calibration_figure(report, stored.name), path)]


def _print(report: CalibrationReport, stored: Calibration) -> None:
    table = make_table(
        f"{stored.name}: {len(stored.seeds)} seeds at each distance, reference "
        f"{stored.reference.source}, {stored.reference.quantity.replace('_', ' ')}",
        ("R (m)", "i_sim", "95 % +-", "reference (psi s)", *report.laws, "error of stored law"),
        text_columns=0,
    )
    for row in report.table().to_dict("records"):
        table.add_row(
            f"{row['distance_m']:g}",
            f"{row['i_sim']:,.0f}",
            f"{row['ci95']:,.0f}",
            f"{row['reference_psi_s']:.4f}",
            *(f"{row[f'{name}_psi_s']:.4f}" for name in report.laws),
            f"{row[f'{stored.law}_error_percent']:+.1f} %",
        )
    result_console().print(table)
    for name, metrics in report.metrics.items():
        coefficients = ", ".join(
            f"{k} = {v:.5g}" for k, v in report.laws[name].coefficients.items()
        )
        print_line(
            f"{name}: {coefficients}; MAPE {metrics.mape_percent:.2f} %, RMSE {metrics.rmse:.4f} "
            f"psi s, integral error {metrics.integral_error_percent:.2f} %"
        )
    intervals = ", ".join(
        f"{k} {low:.4g} to {high:.4g}" for k, (low, high) in stored.coefficient_intervals.items()
    )
    print_line(
        f"stored: {stored.law}; 95 % intervals over seeds: {intervals}; leave-one-distance-out "
        f"MAPE {stored.metrics.leave_one_out_mape_percent:.2f} %"
    )
    if stored.reference.source == "paper UFC column":
        own = paper_table().set_index("r_m").i_sim.loc[list(stored.distances_m)].to_numpy()
        rms = shape_rms_percent(stored.i_sim, own)
        print_line(f"against the paper's own i_sim: {rms:.1f} % rms after one common factor")


DEFAULT_PRESET: Final = "ballistic"


_REGION_WORDS: Final[Mapping[Region, str]] = MappingProxyType(
    {
        "one_corner": "sides, one corner",
        "one_corner_near": "  front third",
        "one_corner_far": "  back third",
        "two_corners": "back, two corners",
    }
)


_MOST_LATE: Final = 0.02  # share of a load that may come in the last fifth of the time


_PERCENT: Final = 100.0


@dataclass(frozen=True)
class ShieldingOptions:
    """The options of the command.

    Attributes:
        preset: Name of the preset that is studied.
        engine: Name of the engine.
        seeds: Seeds of the blasts.
        processes: Worker processes.
        out: Folder for all files.
        exponent: Exponent B of a power law, or None.
        calibration: Name or file of a calibration with a power law, instead of the exponent.
    """

    preset: str
    engine: str
    seeds: tuple[int, ...]
    processes: int
    out: Path
    exponent: float | None = None
    calibration: str | None = None


def calibrate_shielding(options: ShieldingOptions) -> None:
    """Run the shielding study and the reflection study, print both, write the files.

    Args:
        options: The options.

    Raises:
        BlastEnvError: If an option is unusable, or a study cannot be done with the preset.
    """
    settings = (options.preset, options.seeds, options.engine)
    study, reflection_study = ShieldingStudy(*settings), ReflectionStudy(*settings)
    exponent = _exponent(options, study)
    make_folder(options.out)
    blasts = 2 * len(study.seeds)
    with progress_bar(f"{blasts} blasts on a block and in the open") as progress:
        report = study.run(options.processes, progress)
    blasts = (len(reflection_study.distances_m) + 1) * len(study.seeds)
    with progress_bar(f"{blasts} blasts on facades") as progress:
        reflection = reflection_study.run(options.processes, progress)
    written = _write_shielding(report, reflection, exponent, options)
    _print_ratios(report, exponent)
    _print_reflection(reflection)
    engine = find_engine(options.engine)
    print_line(f"{engine_text(engine)}, preset {options.preset}")
    for path in written:
        print_line(f"wrote {path}")


def _exponent(options: ShieldingOptions, study: ShieldingStudy) -> float | None:
    """Return the exponent B that scales the ratios, if there is one.

    Raises:
        BlastEnvError: If both an exponent and a calibration are given, or the calibration does
            not belong to the simulation, or has no exponent.
    """
    if options.calibration is None:
        if options.exponent is not None:
            check_exponent(options.exponent)
        return options.exponent
    if options.exponent is not None:
        raise BlastEnvError("--exponent and --calibration: give one of them, not both")
    calibration = load_calibration(options.calibration, options.engine)
    calibration.check(study.parameters, options.engine)
    if calibration.law != "power":
        raise BlastEnvError(
            f"calibration {calibration.name!r} has a {calibration.law} law, must have a power law: "
            "only that one has an exponent"
        )
    return calibration.coefficients["B"]


def _write_shielding(
    report: ShieldingReport,
    reflection: ReflectionReport,
    exponent: float | None,
    options: ShieldingOptions,
) -> list[Path]:
    stem = f"shielding.{options.preset}.{options.engine}"
    record = options.out / f"{stem}.json"
    with write_atomically(record) as temporary:
        temporary.write_text(report.to_json(exponent, reflection), encoding="utf-8")
    gauges = write_csv(report.gauges, options.out / f"{stem}.csv")
    picture = options.out / f"{stem}.png"
    return [record, gauges, *save_pictures(lambda: _save_shielding(report, exponent, picture))]


def _save_shielding(report: ShieldingReport, exponent: float | None, path: Path) -> list[Path]:
    # Here, because pictures need the extra `render`.
    from blast_env.rendering.figures import save_figure
    from blast_env.studies.shielding.figure import shielding_figure

    return [save_figure(shielding_figure(report, exponent), path)]


def _print_ratios(report: ShieldingReport, exponent: float | None) -> None:
    study = report.study
    scaled = () if exponent is None else (f"scaled, B = {exponent:.4g}", "95 %")
    table = make_table(
        f"{study.simulation}, engine {study.engine}: load on a block over the free field's at the "
        f"same path length, {len(study.seeds)} seeds",
        ("", "normal impulse", "95 %", *scaled, "m|v|", "experiments", ""),
    )
    for region, words in _REGION_WORDS.items():
        ratio = report.ratio(region)
        cells = [words, *_value_and_interval(ratio)]
        if exponent is not None:
            ratio = scaled_ratio(ratio, exponent)
            cells += _value_and_interval(ratio)
        cells.append(f"{report.ratio(region, 'impulse').value:.2f}")
        table.add_row(*cells, *_target(region, ratio))
    result_console().print(table)
    print_line(
        f"free field: side-on load on average as path^{report.free_field_slope.value:.2f}, "
        f"Kingery-Bulmash's incident impulse as path^{report.reference_slope:.2f}"
    )
    for place, share in report.late_shares._asdict().items():
        if share > _MOST_LATE:
            print_line(
                f"note: {place.replace('_', ' ')}: {_PERCENT * share:.1f} % of the impulse came in "
                f"the last fifth of {study.time_limit_s:g} s: loads are not complete"
            )


def _value_and_interval(ratio: Estimate) -> tuple[str, str]:
    interval = "-" if isnan(ratio.low) else f"{ratio.low:.2f} to {ratio.high:.2f}"
    return f"{ratio.value:.2f}", interval


def _target(region: Region, ratio: Estimate) -> tuple[str, str]:
    """Return what the experiments gave, and how the ratio compares."""
    band = EXPERIMENT.get(region)
    if band is None:
        return "", ""
    low, high = band.bounds
    verdict = "too low" if ratio.value < low else "too high" if ratio.value > high else "agrees"
    return f"{band.value:.2f} +- {band.tolerance:.2f}", verdict


def _print_reflection(report: ReflectionReport) -> None:
    table = make_table(
        "Reflection at normal incidence (head-on over side-on impulse) and arrival; no targets",
        (
            "R (m)",
            "Z (m/kg^1/3)",
            "ratio",
            "95 %",
            "Kingery-Bulmash",
            "arrival (ms)",
            "Kingery-Bulmash (ms)",
            "residual",
        ),
        text_columns=0,
    )
    rows = report.reflection.merge(report.arrivals, on="distance_m").to_dict("records")
    for row in rows:
        ratio = Estimate(row["ratio"], row["ratio_low"], row["ratio_high"])
        table.add_row(
            f"{row['distance_m']:g}",
            f"{row['scaled_distance']:.2f}",
            *_value_and_interval(ratio),
            f"{row['kingery_bulmash_ratio']:.2f}",
            f"{MS_PER_S * row['scaled_s']:.1f}",
            f"{MS_PER_S * row['kingery_bulmash_s']:.1f}",
            f"{row['residual_percent']:+.0f} %",
        )
    result_console().print(table)
    print_line(f"arrivals: simulated times {rows[0]['time_scale']:.3g}, the one free factor")


PAPER_DISTANCES = "15,30,45,60,75,90,105,120"


_SHIELDING_PANEL = "Shielding study"


_RESUME: Final = "the same command goes on from the blasts that are finished"
_RESUME_SHIELDING: Final = "nothing of it is kept: the same command begins anew"


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
        ReferenceName | None,
        typer.Option(
            metavar="REFERENCE",
            help="paper_ufc, or Kingery-Bulmash: reflected_ or incident_impulse.",
        ),
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
    law: Annotated[
        LawName,
        typer.Option(metavar="LAW", help="The law to store: proportional, linear or power."),
    ] = "power",
    simulated: Annotated[
        SimulatedQuantity,
        typer.Option(
            metavar="QUANTITY",
            help="Convert impulse (m|v|), or transferred_impulse (momentum really transferred).",
        ),
    ] = "impulse",
    burst: Annotated[
        Burst,
        typer.Option(metavar="BURST", help="For Kingery-Bulmash: hemispherical or spherical."),
    ] = "hemispherical",
    tnt_kg: TntMass = None,
    tnt_range: Annotated[
        str | None,
        typer.Option(help="LOW,HIGH: masses, kg, for which the law shall hold by scaling."),
    ] = None,
    processes: Processes = 1,
    cluster: ClusterAddress = None,
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
    --preset, --engine, --seeds, --first-seed, --processes, --cluster and --out of the options
    above.
    """
    numbers = tuple(range(first_seed, first_seed + seeds))
    resume = _RESUME_SHIELDING if shielding else _RESUME
    with user_errors(lambda: resume), checked_targets(folders={"--out": out}), running_on(cluster):
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
