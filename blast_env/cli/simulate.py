"""`blast-env simulate`: run one blast; print its loads and write its files."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar, cast

from blast_env.cli.command import argument, option, options_of
from blast_env.cli.options import (
    BY_SITE,
    CELL_HELP,
    CELLS_HELP,
    ENGINE_HELP,
    SCENARIO_HELP,
    UNTIL_HELP,
    ChargeOptions,
    JsonOptions,
)
from blast_env.cli.output import (
    ResultTable,
    building_words,
    print_json,
    print_line,
    print_pieces,
    print_table,
    print_written,
    progress_bar,
    result_console,
)
from blast_env.cli.targets import PICTURES
from blast_env.errors import BlastEnvError, UnknownNameError, import_extra
from blast_env.evaluation.engines import Blast, BlastResult, Engine, default_engine, find_engine
from blast_env.geometry import Layout, layout_counts
from blast_env.layout import load_layout
from blast_env.layout.build_scene import draw_threat
from blast_env.runner import Tell, share_of
from blast_env.site import AnyCharge, Scenario, load_scenario
from blast_env.site.scene import Charge
from blast_env.site.sections import buildings_of
from blast_env.site.structure import ModularObstacle
from blast_env.tables import table_records
from blast_env.units import MS_PER_S, PA_PER_KPA
from blast_env.values import plain_number

if TYPE_CHECKING:  # pandas and Numba take a third of a second each to import
    import pandas as pd

    from blast_env.evaluation.engines.gas import GasBlast, GasResult
    from blast_env.gas.engine import Recorders
    from blast_env.plots.pressure_frames import VerticalSection

_GAS_PANEL: Final = "Gas dynamics only"
_PARTICLES_PANEL: Final = "Particles only"


@dataclass(frozen=True, kw_only=True)
class SimulateCommand(ChargeOptions, JsonOptions):
    """Run one blast and print the load on each structure.

    Each picture shows the same for either engine: --film the spread of the blast, --heat-map the
    places of the load, --history its course over time.
    """

    scenario: str = argument(SCENARIO_HELP)
    layout: Path | None = option(None, "JSON file with the barrier's [row, column] cells.")
    seed: int = option(0, "Decides charge, fan and air.", min=0)
    engine: str | None = option(None, ENGINE_HELP, show_default=BY_SITE)
    stand_off_m: float | None = option(None, "Distance from charge to facade, m (free_field).")
    film: Path | None = option(None, "Write a film: .mp4 or .gif.", writes=(".mp4", ".gif"))
    excel: Path | None = option(None, "Write a workbook: .xlsx.", writes=(".xlsx",))
    parquet: Path | None = option(
        None, "Write the collisions, or the loads of all faces: .parquet.", writes=(".parquet",)
    )
    heat_map: Path | None = option(
        None,
        "Write a picture of the load over the protected facades: .png, .svg, .pdf.",
        writes=PICTURES,
    )
    history: Path | None = option(
        None, "Write a picture of the load over time (gas: at --gauge).", writes=PICTURES
    )
    side_by_side: bool = option(False, "Show in all pictures the site without the barrier as well.")
    cell_m: float | None = option(None, CELL_HELP, panel=_GAS_PANEL)
    cells: str | None = option(None, CELLS_HELP, panel=_GAS_PANEL, show_default="uniform")
    until: str | None = option(None, UNTIL_HELP, panel=_GAS_PANEL, show_default="structures")
    impulse_map: Path | None = option(
        None, "Write a map of the impulse over the ground.", writes=PICTURES, panel=_GAS_PANEL
    )
    peak_map: Path | None = option(
        None,
        "Write a map of the peak overpressure over the ground.",
        writes=PICTURES,
        panel=_GAS_PANEL,
    )
    risk_map: Path | None = option(
        None,
        "Write a map of where windows and eardrums are at risk.",
        writes=PICTURES,
        panel=_GAS_PANEL,
    )
    quantity: str | None = option(
        None, "Quantity of --heat-map: impulse or peak.", show_default="impulse", panel=_GAS_PANEL
    )
    gauge: str | None = option(
        None,
        "Gauge of --history, beside Kingery-Bulmash.",
        show_default="the scenario's first",
        panel=_GAS_PANEL,
    )
    film_height_m: float | None = option(
        None, "Height of the film's plan, m.", show_default="1.5", panel=_GAS_PANEL
    )
    film_section: str | None = option(
        None,
        "The film's vertical section: x=12.5 or y=4.",
        metavar="AXIS=M",
        show_default="through the charge",
        panel=_GAS_PANEL,
    )
    preset: str | None = option(
        None, "Parameters of this name instead of the scenario's.", panel=_PARTICLES_PANEL
    )
    scheme: Path | None = option(
        None, "Write a picture of the initial state.", writes=PICTURES, panel=_PARTICLES_PANEL
    )
    velocities: Path | None = option(
        None, "Write a picture of the fan's velocities.", writes=PICTURES, panel=_PARTICLES_PANEL
    )

    def __call__(self) -> None:
        """Run the blast, write its files and print its loads."""
        site = load_scenario(self.scenario)
        scenario = site if self.stand_off_m is None else site.at_stand_off(self.stand_off_m)
        scenario = scenario.with_simulation(self.preset)
        # A layout belongs to the site of the file, before preset and stand-off change it.
        layout: Layout = () if self.layout is None else tuple(load_layout(self.layout, site))
        engine = find_engine(
            self.engine or default_engine(scenario), self.cell_m, self.until, self.cells
        )
        self._check(engine, layout)
        charge = self.fixed(scenario, draw_threat(scenario, self.seed))
        shown = self._shown(scenario, layout, engine, charge)
        with progress_bar(f"blast in {scenario.name}") as progress:
            bare, result = shown.run(progress)
        written = [path for path in (self.film,) if path is not None]
        if self.excel is not None:
            written.append(result.to_excel(self.excel))
        if self.parquet is not None:
            written.append(result.to_parquet(self.parquet))
        written += shown.write_pictures(result, bare)
        if self.any_json:
            print_json(_record(result, written, all_of_it=self.json_all))
        else:
            print_line(engine.describe([scenario]))
            shown.print_loads(result)
            print_written(written)

    def _check(self, engine: Engine, layout: Layout) -> None:
        """Refuse options that do not apply, before anything is run."""
        own = f"{engine.title} only"
        for each in options_of(type(self)):
            panel = each.text.panel or ""
            is_given = getattr(self, each.name) != each.default
            if is_given and panel.endswith(" only") and panel != own:
                what = panel.removesuffix(" only").lower()
                raise BlastEnvError(f"{each.flag} is for {what}: engine is {engine.name!r}")
        if self.side_by_side and not layout:
            raise BlastEnvError("--side-by-side compares with the empty site: --layout is missing")

    def _shown(
        self, scenario: Scenario, layout: Layout, engine: Engine, charge: AnyCharge
    ) -> "ShownBlast[Any, Any]":
        blast = engine.blast(scenario, layout, self.seed, charge)
        if isinstance(blast, Blast):
            return ShownParticles(self, blast)
        return ShownGas(self, cast("GasBlast", blast))


_AnyBlast = TypeVar("_AnyBlast", Blast, "GasBlast")
_AnyResult = TypeVar("_AnyResult", BlastResult, "GasResult")


class ShownBlast(ABC, Generic[_AnyBlast, _AnyResult]):
    """A blast, and the output of its result.

    Args:
        command: The options.
        blast: The blast.

    Raises:
        BlastEnvError: If an option does not apply to it.
    """

    headers: tuple[str, ...]

    def __init__(self, command: SimulateCommand, blast: _AnyBlast) -> None:
        self.command = command
        self.blast: _AnyBlast = blast
        self.check()

    def check(self) -> None:
        """Refuse options that do not apply, before anything is run."""

    def run(self, progress: Tell) -> tuple[_AnyResult | None, _AnyResult]:
        """Run the blast, and that without a barrier if it is shown beside it."""
        bare = replace(self.blast, layout=()) if self.command.side_by_side else None
        if self.command.film is not None:
            return self.write_film(self.command.film, bare, progress)
        if bare is None:
            return None, self.run_one(self.blast, progress)
        first = self.run_one(bare, share_of(progress, 0, 2))
        return first, self.run_one(self.blast, share_of(progress, 1, 2))

    @abstractmethod
    def run_one(self, blast: _AnyBlast, progress: Tell) -> _AnyResult:
        """Run one blast to its end."""

    @abstractmethod
    def write_film(
        self, path: Path, bare: _AnyBlast | None, progress: Tell
    ) -> tuple[_AnyResult | None, _AnyResult]:
        """Write the film of the blast, and of the other beside it; return their results."""

    @abstractmethod
    def write_pictures(self, result: _AnyResult, bare: _AnyResult | None) -> list[Path]:
        """Write the requested pictures; return their files."""

    @abstractmethod
    def print_loads(self, result: _AnyResult) -> None:
        """Print a table of the structures' loads, and the end of the run."""

    def print_table(self, charge: Charge, more: str, rows: Sequence[Sequence[str]]) -> None:
        """Print the table of the structures' loads.

        Args:
            charge: The charge of the blast.
            more: Other inputs of the result, in words.
            rows: The rows.
        """
        x_m, y_m = charge.position_m
        print_table(
            f"{self.blast.scenario.name}: {charge.tnt_kg:g} kg TNT at ({x_m:.2f}, {y_m:.2f}) m, "
            f"{more}, {layout_counts(self.blast.layout, 'barrier')}",
            self.headers,
            rows,
            text_columns=2,
        )

    def print_end(self, result: _AnyResult, what: str, steps: str, notes: Sequence[str]) -> None:
        """Print the engine, the end of the run, notes and the digest."""
        print_line(
            f"{what}, {result.steps:,} {steps}, {MS_PER_S * result.time_s:.0f} ms simulated; ended "
            f"because {result.end_reason}"
        )
        for note in notes:
            print_line(note)
        print_line(f"digest {result.digest}")


class ShownParticles(ShownBlast[Blast, BlastResult]):
    """A blast of particles."""

    headers = (
        *("building", "protected", "modules", "hits", "impulse m|v| (sim)"),
        *("transferred (sim)", "impulse (Pa s)", "first hit (ms)"),
    )

    def run_one(self, blast: Blast, progress: Tell) -> BlastResult:
        """Run one blast to its end."""
        return blast.run(progress)

    def write_film(
        self, path: Path, bare: Blast | None, progress: Tell
    ) -> tuple[BlastResult | None, BlastResult]:
        """Write the film of the blast, and of the other beside it; return their results."""
        # Here, because films need the extra `render`.
        from blast_env.plots.film import write_film

        results = write_film(self.blast, path, beside=bare, progress=progress)
        return (None if bare is None else results[0]), results[-1]

    def write_pictures(self, result: BlastResult, bare: BlastResult | None) -> list[Path]:
        """Write the pictures; those of the empty site go into separate files."""
        asked = self.command
        if not any((asked.heat_map, asked.history, asked.scheme, asked.velocities)):
            return []
        # Here, because pictures need the extra `render`.
        from blast_env.plots import figures

        results = [result] if bare is None else [result, bare]
        heat_map = partial(figures.heat_map, scale=figures.common_scale(results))
        scheme = partial(figures.model_scheme, result.blast.scene)
        fan = partial(figures.initial_velocities, result.blast.scenario.parameters)
        pictures: list[tuple[Path | None, Callable[[], figures.Figure]]] = [
            *((_named(asked.heat_map, each is bare), partial(heat_map, each)) for each in results),
            *(
                (_named(asked.history, each is bare), partial(figures.impulse_over_time, each))
                for each in results
            ),
            (asked.scheme, scheme),
            (asked.velocities, fan),
        ]
        return [figures.save_figure(draw(), path) for path, draw in pictures if path is not None]

    def print_loads(self, result: BlastResult) -> None:
        """Print a table of the buildings' loads, and the end of the run."""
        blast, scene = result.blast, result.blast.scene
        scaled = {
            each.name: _scaled(result, each.name)
            for each in result.obstacles
            if not each.is_barrier
        }
        names = blast.scenario.building_names
        buildings: dict[str, list[ModularObstacle]] = {}
        for obstacle in result.obstacles:
            buildings.setdefault(names.get(obstacle.name, obstacle.name), []).append(obstacle)
        rows = [
            (
                building_words(blast.scenario, name),
                "yes" if any(each.protected for each in parts) else "no",
                f"{sum(len(each.parts) for each in parts):,}",
                f"{sum(each.hits for each in parts):,}",
                f"{sum(each.impulse for each in parts):,.0f}",
                f"{sum(each.transferred_impulse for each in parts):,.0f}",
                _pa_s_text(_mean_of(parts, scaled)),
                _first_hit_text(parts),
            )
            for name, parts in buildings.items()
        ]
        self.print_table(scene.charge, f"seed {blast.seed}", rows)
        notes = {str(each["error"]) for each in scaled.values() if "error" in each}
        for name, each in scaled.items():
            where = f"outside the range of the calibration (marked ~): {name}"
            notes |= {f"{where}, {text}" for text in _notes(each)}
        what = f"{len(scene.balls):,} balls"
        texts = [f"impulse (Pa s): {note}" for note in sorted(notes)]
        texts += blast.scenario.height_notes
        self.print_end(result, what, result.step_name, texts)


def _mean_of(
    parts: Sequence[ModularObstacle], scaled: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the impulse on a building: the mean over its parts by their weights; empty if none."""
    counted = [each for each in parts if each.protected] or parts
    found = [scaled.get(each.name, {}) for each in counted]
    if not all("pa_s" in each for each in found):
        return {}
    total = sum(each.weight for each in counted)
    mean = sum(each.weight * own["pa_s"] / total for each, own in zip(counted, found, strict=True))
    return {"pa_s": mean, "in_range": all(each["in_range"] for each in found)}


def _first_hit_text(parts: Sequence[ModularObstacle]) -> str:
    times_s = [each.first_hit_s for each in parts if each.first_hit_s is not None]
    return f"{MS_PER_S * min(times_s):.1f}" if times_s else "never"


def _named(path: Path | None, is_bare: bool) -> Path | None:
    """Return the path of a picture, that of the empty site beside it."""
    if path is None or not is_bare:
        return path
    return path.with_name(f"{path.stem}_without{path.suffix}")


class ShownGas(ShownBlast["GasBlast", "GasResult"]):
    """A blast of gas dynamics."""

    headers = (
        *("building", "protected", "impulse (Pa s)", "captured"),
        *("peak (kPa)", "arrival (ms)", "most loaded wall", "roof (Pa s)"),
    )

    def check(self) -> None:
        """Refuse options that do not apply, before anything is run."""
        asked = self.command
        for flag, value in (
            ("--film-height", asked.film_height_m),
            ("--film-section", asked.film_section),
        ):
            if value is not None and asked.film is None:
                raise BlastEnvError(f"{flag} is for --film: no film is to be written")
        if asked.heat_map is not None:
            with import_extra("render", "pictures and films"):
                from blast_env.plots.gas import kind_of
            kind_of(asked.quantity or "impulse")
        _section(asked.film_section)
        self._check_gauge([each.name for each in self.blast.site.gauges])

    def _check_gauge(self, names: Sequence[str]) -> None:
        gauge = self.command.gauge
        if self.command.history is None:
            if gauge is not None:
                raise BlastEnvError("--gauge is for --history: no history is to be drawn")
            return
        if not names:
            raise BlastEnvError(
                f"--history: {self.blast.scenario.name} has no gauges ([[gauges]]), and gas "
                "dynamics keeps the load over time at gauges only"
            )
        if gauge is not None and gauge not in names:
            raise UnknownNameError("gauge", gauge, names)

    def run_one(self, blast: "GasBlast", progress: Tell) -> "GasResult":
        """Run one blast to its end."""
        return blast.run(progress, self._recorders)

    @property
    def _recorders(self) -> "Recorders":
        """The recorders of the ground, if a map of it is requested."""
        asked = self.command
        if not any((asked.impulse_map, asked.peak_map, asked.risk_map)):
            return lambda _: ()
        from blast_env.plots.ground_map import ground_recorders

        return ground_recorders

    def write_film(
        self, path: Path, bare: "GasBlast | None", progress: Tell
    ) -> "tuple[GasResult | None, GasResult]":
        """Write the film of the blast, and of the other beside it; return their results."""
        # Here, because films need the extra `render`.
        from blast_env.plots.pressure_film import PLAN_HEIGHT_M, write_pressure_film

        height_m = self.command.film_height_m
        results = write_pressure_film(
            self.blast,
            path,
            beside=bare,
            height_m=PLAN_HEIGHT_M if height_m is None else height_m,
            section=_section(self.command.film_section),
            further=self._recorders,
            progress=progress,
        )
        return (None if bare is None else results[0]), results[-1]

    def write_pictures(self, result: "GasResult", bare: "GasResult | None") -> list[Path]:
        """Write the pictures, each with the empty site beside the layout if requested."""
        asked = self.command
        maps = (asked.impulse_map, asked.peak_map, asked.risk_map)
        if not any((asked.heat_map, asked.history, *maps)):
            return []
        # Here, because pictures need the extra `render`.
        from blast_env.plots import gas
        from blast_env.plots.figures import save_figure
        from blast_env.plots.ground_map import ground_map, threshold_map

        kind = gas.kind_of(asked.quantity or "impulse")
        gauge = asked.gauge or next((each.name for each in self.blast.site.gauges), "")
        pictures: tuple[tuple[Path | None, Callable[[], Any]], ...] = (
            (asked.heat_map, lambda: gas.facades(result, quantity=kind, beside=bare)),
            (asked.history, lambda: gas.gauge_history(result, gauge, free_field=True, beside=bare)),
            (asked.impulse_map, lambda: ground_map(result, "impulse", bare)),
            (asked.peak_map, lambda: ground_map(result, "peak", bare)),
            (asked.risk_map, lambda: threshold_map(result, bare)),
        )
        return [save_figure(draw(), path) for path, draw in pictures if path is not None]

    def print_loads(self, result: "GasResult") -> None:
        """Print tables of the buildings' loads and of the gauges, and the end of the run."""
        scaled = {name: _scaled(result, name) for name in result.structures["structure"]}
        in_range = {
            name: all(scaled[each.name]["in_range"] for each in parts)
            for name, parts in buildings_of(self.blast.scenario.structures).items()
        }
        rows = [
            (
                building_words(self.blast.scenario, each["building"]),
                "yes" if each["protected"] else "no",
                f"{'' if in_range[each['building']] else '~'}{each['impulse_pa_s']:,.0f}",
                _known_text(each),
                f"{each['peak_pa'] / PA_PER_KPA:,.1f}",
                _number(MS_PER_S * each["arrival_s"], ".1f"),
                f"{each['most_loaded_face']} {each['most_loaded_pa_s']:,.0f}",
                _number(each["roof_impulse_pa_s"], ",.0f"),
            )
            for each in result.buildings.to_dict("records")
        ]
        charge = result.run.site.charge
        self.print_table(charge, f"{charge.height_m:g} m high", rows)
        _print_gauges(result.gauges)
        print_pieces(result.pieces, "stability of the barrier")
        cells = " x ".join(str(count) for count in result.run.grid.shape)
        notes = dict.fromkeys(note for each in scaled.values() for note in _notes(each))
        texts = [f"outside the validated range (marked ~): {note}" for note in notes]
        texts += (*result.stepped_notes, *result.moved_gauges)
        texts += (f"{each.building}: {each.words}" for each in result.unjudged)
        self.print_end(result, f"{cells} cells", "steps", texts)


def _section(text: str | None) -> "VerticalSection | None":
    """Return the section of `--film-section`.

    Raises:
        BlastEnvError: If it is no section.
        MissingExtraError: If the extra `render` is not installed.
    """
    if text is None:
        return None
    with import_extra("render", "pictures and films"):
        from blast_env.plots.pressure_frames import VerticalSection

    axis, _, number = text.partition("=")
    with suppress(BlastEnvError):
        at_m = plain_number("--film-section", number)
        if axis in ("x", "y"):
            return VerticalSection("x" if axis == "x" else "y", at_m)
    raise BlastEnvError(f"--film-section is {text!r}, must be x=M or y=M, e.g. x=12.5")


def _print_gauges(gauges: "pd.DataFrame") -> None:
    if not len(gauges):
        return
    table = ResultTable(
        "gauges",
        ("gauge", "x (m)", "y (m)", "z (m)", "peak (kPa)", "impulse (Pa s)", "captured"),
        1,
    )
    for row in gauges.to_dict("records"):
        places = (f"{row[axis]:.2f}" for axis in ("x_m", "y_m", "z_m"))
        peak, impulse = row["peak_pa"] / PA_PER_KPA, row["impulse_pa_s"]
        table.add_row(row["name"], *places, f"{peak:,.1f}", f"{impulse:,.0f}", _known_text(row))
    result_console().print(table)


def _known_text(row: Mapping[Any, Any]) -> str:
    """Return whether an impulse was captured when the run ended."""
    return "yes" if row["known"] else "not yet"


def _number(value: float, form: str) -> str:
    return "-" if isnan(value) else format(value, form)


def _scaled(result: "BlastResult | GasResult", name: str) -> dict[str, Any]:
    """Return the impulse on a structure in Pa s and psi s, or the error without one."""
    try:
        impulse = result.impulse(name)
    except BlastEnvError as error:
        return {"error": str(error)}
    return {**impulse._asdict(), "psi_s": impulse.psi_s}


def _pa_s_text(scaled: Mapping[str, Any]) -> str:
    if "pa_s" not in scaled:
        return "-"
    return f"{'' if scaled['in_range'] else '~'}{scaled['pa_s']:,.0f}"


def _notes(scaled: Mapping[str, Any]) -> tuple[str, ...]:
    notes: tuple[str, ...] = scaled.get("notes", ())
    return notes


def _record(
    result: "BlastResult | GasResult", written: Sequence[Path], *, all_of_it: bool
) -> dict[str, object]:
    """Return the result as plain data; missing numbers are null.

    The short form leaves out the modules and the single parameters, which the preset implies.
    """
    content: dict[str, object] = {
        "run": {
            name: value
            for name, value in result.run_record.items()
            if all_of_it or not name.startswith("parameter ")
        },
        "structures": table_records(result.structures),
        "buildings": table_records(result.buildings),
        "impulse": {name: _scaled(result, name) for name in result.structures["structure"]},
    }
    if not isinstance(result, BlastResult):
        content["gauges"] = table_records(result.gauges)
        content["bays"] = table_records(result.bays)
        content["pieces"] = table_records(result.pieces)
    if all_of_it:
        content["modules"] = table_records(result.modules)
    return content | {"files": [str(path) for path in written]}
