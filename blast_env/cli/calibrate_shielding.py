"""`blast-env calibrate --shielding`: what gets round a block, against experiments."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from types import MappingProxyType
from typing import Final

from blast_env.atomic import make_folder, write_atomically
from blast_env.calibration.shielding import (
    EXPERIMENT,
    Region,
    ShieldingReport,
    ShieldingStudy,
    scaled_ratio,
)
from blast_env.calibration.shielding_ratios import check_exponent
from blast_env.calibration.shielding_reflection import ReflectionReport, ReflectionStudy
from blast_env.calibration.stored import load_calibration
from blast_env.cli.output import make_table, print_line, progress_bar, result_console
from blast_env.errors import BlastEnvError
from blast_env.evaluation.statistics import Estimate
from blast_env.units import MS_PER_S

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
    written = _write(report, reflection, exponent, options)
    _print_ratios(report, exponent)
    _print_reflection(reflection)
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


def _write(
    report: ShieldingReport,
    reflection: ReflectionReport,
    exponent: float | None,
    options: ShieldingOptions,
) -> list[Path]:
    from blast_env.rendering.figures import save_figure
    from blast_env.rendering.shielding_figure import shielding_figure

    stem = f"shielding.{options.preset}.{options.engine}"
    record, gauges = options.out / f"{stem}.json", options.out / f"{stem}.csv"
    with write_atomically(record) as temporary:
        temporary.write_text(report.to_json(exponent, reflection), encoding="utf-8")
    with write_atomically(gauges) as temporary:
        report.gauges.to_csv(temporary, index=False)
    figure = save_figure(shielding_figure(report, exponent), options.out / f"{stem}.png")
    return [record, gauges, figure]


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
