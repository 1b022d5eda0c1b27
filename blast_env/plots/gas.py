"""Figures of a blast of the gas engine: unfolded facades, and histories of gauges.

Two results can be drawn beside each other on one scale, for example without and with a barrier.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import dist
from re import sub
from textwrap import wrap
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.curves import Friedlander, burst_of, kingery_bulmash
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation.engines.gas import GasBlast, GasResult
from blast_env.geometry import WALLS, Rectangle, WallName
from blast_env.plots.plan import FAINT, QUIET_INK
from blast_env.plots.site_plan import add_bar, load_colours, write_heading
from blast_env.plots.style import barrier_text, nice_ceiling, render_extra, unit_interval
from blast_env.response.sdof import impulses
from blast_env.site.structures import StructureOutline, buildings_of
from blast_env.units import MS_PER_S, PA_PER_KPA

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap, Normalize
    from matplotlib.figure import Figure

MINUS: Final = "\N{MINUS SIGN}"
_PERCENT: Final = 100.0


@dataclass(frozen=True)
class Kind:
    """The presentation of a quantity.

    Attributes:
        unit: Its unit.
        column: Its column in the tables of a result.
        factor: Conversion from the column to the unit.
        summary: Name of the value for a whole wall: `mean` or `largest`.
        of_all: Reduces the values of a wall to that one.
    """

    name: str
    unit: str
    column: str
    factor: float
    summary: str
    of_all: Callable[[FloatArray], float]

    @property
    def label(self) -> str:
        """Its name with its unit."""
        return f"{self.name} ({self.unit})"


KINDS: Final = {
    "impulse": Kind(
        "peak specific impulse",
        "Pa·s",
        "impulse_pa_s",
        1.0,
        "mean",
        lambda values: float(np.nanmean(values)),
    ),
    "peak": Kind(
        "peak overpressure",
        "kPa",
        "peak_pa",
        1.0 / PA_PER_KPA,
        "largest",
        lambda values: float(np.nanmax(values)),
    ),
}


def kind_of(quantity: str) -> Kind:
    """Return the presentation of a quantity."""
    if quantity not in KINDS:
        raise UnknownNameError("quantity", quantity, KINDS)
    return KINDS[quantity]


def gas_subtitle(blasts: Sequence[GasBlast]) -> str:
    """Return charge and cells of blasts in words; with them, a seed has no further effect.

    The place of a vehicle's charge depends on the layout; then all places are named, from left to
    right.
    """
    charge = blasts[-1].site.charge
    places_m = dict.fromkeys(blast.site.charge.position_m for blast in blasts)
    place = " and ".join(f"({x_m:.1f} m, {y_m:.1f} m)" for x_m, y_m in places_m)
    if charge.height_m > 0.0:
        place += f", {charge.height_m:g} m high"
    return f"charge {charge.tnt_kg:g} kg TNT at {place}, gas in {blasts[-1].engine.cell_words}"


def check_comparable(blasts: Sequence[GasBlast]) -> None:
    """Check that blasts have the same site and the same charge or vehicle."""
    first = blasts[0]
    for blast in blasts[1:]:
        if blast.site.site_m != first.site.site_m:
            raise BlastEnvError("the blasts to be compared have different sites")
        if blast.threat != first.threat:
            raise BlastEnvError(
                f"the blasts to be compared have different charges, {first.threat} and "
                f"{blast.threat}"
            )


def both_results(result: GasResult, beside: GasResult | None) -> list[GasResult]:
    """Return one or two results from left to right, checked with `check_comparable`."""
    results = [result] if beside is None else [beside, result]
    check_comparable([result.blast for result in results])
    return results


def gas_heading(results: Sequence[GasResult], what: str) -> tuple[str, str]:
    """Return the heading of a figure of results, and the line under it."""
    blast = results[-1].blast
    subtitle = gas_subtitle([result.blast for result in results])
    if len(results) == 1:
        subtitle += f", {barrier_text(blast.layout)}"
    return f"{blast.scenario.name}: {what}", subtitle


def loads_and_solids() -> Colormap:
    """Return the colours of loads, with grey for solids."""
    return load_colours().with_extremes(bad=unit_interval(FAINT))


# Facades.

_FACADES_IN: Final = 11.0
_ROW_LETTERS: Final = 26  # most letters in a line beside a row of walls
_LEAST_WALL_SHARE: Final = 0.13  # of the width of all walls, for the title
_WALL_HEIGHTS_IN: Final = (1.0, 4.0)
_SHOWN_SHARE: Final = 0.99  # of the drawn area, on the scale

_LEFT_TO_RIGHT: Final[dict[WallName, tuple[str, bool]]] = {
    "west": ("y", True),
    "south": ("x", False),
    "east": ("y", False),
    "north": ("x", True),
}
"""The walls in the order of a walk around a structure, with the axis along each and whether its
values decrease to the right."""


def facades(
    result: GasResult,
    structure: str | None = None,
    quantity: str = "impulse",
    beside: GasResult | None = None,
    full: float | None = None,
) -> Figure:
    """Return the unfolded walls of a structure, with the load on every cell's face.

    The walls are seen from outside, in the order of a walk around the structure: west, south, east,
    north, so that neighbours share a corner.

    Args:
        result: The blast.
        structure: Name of the structure, or of a building: its parts are unfolded as one, and where
            one wall of it is behind another, the larger load is shown. The protected building with
            the largest impulse without it.
        quantity: `"impulse"`, peak specific impulse in Pa s, or `"peak"`, overpressure in kPa.
        beside: Another result with the same site and charge, drawn above on the same scale:
            without the barrier, or with another layout.
        full: End of the scale, for comparisons of figures; see `full_load`. By default the load
            that 99 % of the drawn area do not exceed, rounded up: the cells before a charge at the
            wall would leave all others pale. Larger loads have the darkest colour.

    Raises:
        BlastEnvError: If site or charge of the results differ, or there is no structure.
        UnknownNameError: If there is no such structure or quantity.
    """
    kind, results = kind_of(quantity), both_results(result, beside)
    outline = _walled(results[0], structure)
    walls = [
        {wall: _wall(result, outline, wall, kind) for wall in _LEFT_TO_RIGHT} for result in results
    ]
    # One scale for all walls and both blasts, so that colours compare.
    end = _full(walls) if full is None else full
    scale = Normalize(0.0, end)
    lengths = np.array([_length_m(outline, wall) for wall in _LEFT_TO_RIGHT])
    # Walls as wide as they are long, but short ones wide enough for their axes.
    widths = np.maximum(lengths, _LEAST_WALL_SHARE * lengths.sum())
    height_m = outline.height_m
    low, high = _WALL_HEIGHTS_IN
    row_in = min(max(_FACADES_IN * height_m / float(widths.sum()), low), high) + 0.85
    figure = Figure(figsize=(_FACADES_IN + 2.2, row_in * len(results) + 0.9), layout="compressed")
    panels = figure.subplots(
        len(results), len(WALLS), squeeze=False, sharey=True, width_ratios=widths.tolist()
    )
    for row, item in enumerate(results):
        for axes, wall in zip(panels[row], _LEFT_TO_RIGHT, strict=True):
            _draw_wall(axes, outline, wall, walls[row][wall], scale, height_m)
            before = walls[0][wall] if row else None
            axes.set_title(_wall_title(outline, wall, walls[row][wall], before, kind), fontsize=9.5)
        words = f"{_row_words(item.blast)}\n" if beside is not None else ""
        panels[row][0].set_ylabel(f"{words}z (m)")
    for axes, wall in zip(panels[-1], _LEFT_TO_RIGHT, strict=True):
        axes.set_xlabel(f"{_LEFT_TO_RIGHT[wall][0]} (m)")
    colours = ScalarMappable(scale, load_colours())
    extend = "max" if _largest(walls) > end else "neither"
    around = panels.ravel().tolist()
    add_bar(figure, around, colours, kind.label, shrink=0.85, pad=0.02, extend=extend)
    name = results[0].blast.scenario.title_of(outline.name)
    title, subtitle = gas_heading(results, f"{kind.name} on the walls of {name}")
    write_heading(figure, title, f"{subtitle}; walls seen from outside")
    return figure


def _row_words(blast: GasBlast) -> str:
    """Return the barrier of a blast in words, wrapped for the side of a row."""
    kept_together = sub(r"([(,] ?\d+) ", "\\1\N{NO-BREAK SPACE}", barrier_text(blast.layout))
    return "\n".join(wrap(kept_together, _ROW_LETTERS))


def full_load(result: GasResult, structure: str, quantity: str) -> float:
    """Return the end of the scale of `facades` for a structure, in Pa s or kPa.

    Raises:
        UnknownNameError: If there is no such structure or quantity.
    """
    kind, outline = kind_of(quantity), _walled(result, structure)
    return _full([{wall: _wall(result, outline, wall, kind) for wall in _LEFT_TO_RIGHT}])


def _full(walls: Sequence[Mapping[WallName, FloatArray]]) -> float:
    """Return the load that most of the drawn area does not exceed, rounded up."""
    loads = np.concatenate([array.ravel() for row in walls for array in row.values()])
    loads = loads[np.isfinite(loads)]
    most = float(np.quantile(loads, _SHOWN_SHARE)) if len(loads) else 0.0
    return nice_ceiling(most) if most > 0.0 else 1.0


def _largest(walls: Sequence[Mapping[WallName, FloatArray]]) -> float:
    return max(float(np.nanmax(v, initial=0.0)) for row in walls for v in row.values())


@dataclass(frozen=True)
class _BuildingWalls:
    """A structure, or the parts of a building, as a single box with walls.

    Attributes:
        rectangle_m: The rectangle around them.
        height_m: The height of the highest.
        faces: The assessed walls for at least one of them.
    """

    name: str
    parts: tuple[str, ...]
    rectangle_m: Rectangle
    height_m: float
    faces: frozenset[WallName]

    @classmethod
    def of(
        cls, name: str, parts: Sequence[StructureOutline], air_height_m: float
    ) -> "_BuildingWalls":
        """Combine structures into one."""
        return cls(
            name,
            tuple(part.name for part in parts),
            Rectangle.around([part.rectangle_m for part in parts]),
            max(part.height_m or air_height_m for part in parts),
            frozenset(face for part in parts for face in part.faces),
        )


def _walled(result: GasResult, name: str | None) -> _BuildingWalls:
    """Return the structure or building with a name, or by default the worst building."""
    site, scenario = result.run.site, result.blast.scenario
    known = {
        structure.name: (structure,) for structure in site.structures if not structure.is_barrier
    }
    buildings = {
        building: tuple(outline for part in parts for outline in known[part.name])
        for building, parts in buildings_of(scenario.structures_with(result.blast.layout)).items()
    }
    if name is None:
        table = result.buildings
        if not len(table):
            raise BlastEnvError(f"{scenario.name} has no structure with walls")
        chosen = table[table["protected"]] if table["protected"].any() else table
        worst = int(chosen["impulse_pa_s"].to_numpy().argmax())
        name = str(chosen["building"].iloc[worst])
    found = {**known, **buildings}  # a building may have the name of a part
    if name not in found:
        raise UnknownNameError("structure", name, found)
    return _BuildingWalls.of(name, found[name], site.air_height_m)


def _wall(result: GasResult, walled: _BuildingWalls, wall: WallName, kind: Kind) -> FloatArray:
    """Return the load on each cell's face of a wall, by height and along x or y.

    It is NaN where an obstacle touches the wall.
    """
    cell_m = result.run.grid.cell_m
    axis = _LEFT_TO_RIGHT[wall][0]
    low = walled.rectangle_m["xy".index(axis)]
    shape = (round(walled.height_m / cell_m), round(_length_m(walled, wall) / cell_m))
    values = np.full(shape, np.nan)
    own = result.on_walls
    own = own[own["structure"].isin(walled.parts) & (own["face"] == wall)]
    along = np.floor((own[f"{axis}_m"].to_numpy() - low) / cell_m).astype(int)
    along = along.clip(0, shape[1] - 1)  # steps of oblique walls may lie on the border
    up = np.floor(own["z_m"].to_numpy() / cell_m).astype(int)
    np.fmax.at(values, (up, along), kind.factor * own[kind.column].to_numpy())
    return values


def _length_m(walled: _BuildingWalls, wall: WallName) -> float:
    left, bottom, right, top = walled.rectangle_m
    return right - left if _LEFT_TO_RIGHT[wall][0] == "x" else top - bottom


def _draw_wall(
    axes: Axes,
    outline: _BuildingWalls,
    wall: WallName,
    values: FloatArray,
    scale: Normalize,
    height_m: float,
) -> None:
    axis, falls = _LEFT_TO_RIGHT[wall]
    low = outline.rectangle_m["xy".index(axis)]
    high = low + _length_m(outline, wall)
    axes.imshow(
        values,
        norm=scale,
        cmap=loads_and_solids(),
        origin="lower",
        interpolation="nearest",
        extent=(low, high, 0.0, height_m),
        aspect="auto",  # narrow walls have room for their title, and the height of the others
    )
    axes.set_xlim((high, low) if falls else (low, high))
    for spine in axes.spines.values():
        spine.set_color(unit_interval(QUIET_INK))


def _figures(load: Any) -> str:
    """Return a load in three figures, never as a power of ten."""
    return f"{float(f'{load:.3g}'):,g}"


def _wall_title(
    outline: _BuildingWalls,
    wall: WallName,
    values: FloatArray,
    before: FloatArray | None,
    kind: Kind,
) -> str:
    name = wall if wall in outline.faces else f"{wall} (does not count)"
    if not np.isfinite(values).any():
        return f"{name}\nno air before it"
    now = kind.of_all(values)
    words = f"{kind.summary} {_figures(now)} {kind.unit}"
    if before is not None and np.isfinite(before).any() and kind.of_all(before) > 0.0:
        change = f"{_PERCENT * (now / kind.of_all(before) - 1.0):+z.0f} %"
        words += f" ({change.replace('-', MINUS)})"
    return f"{name}\n{words}"


# Gauges.

# Okabe and Ito's colours, distinct for any colour vision.
_MAIN, _BESIDE, _REFERENCE = "#0072B2", "#D55E00", "#000000"


def gauge_history(
    result: GasResult, gauge: str, *, free_field: bool = False, beside: GasResult | None = None
) -> Figure:
    """Return overpressure and impulse at a gauge over time.

    Args:
        result: The blast.
        free_field: Whether to draw Kingery and Bulmash's incident wave at its distance, with
            Friedlander's waveform: the wave at the same place on an empty site.
        beside: Another result with the same site and charge, drawn into the same axes.

    Raises:
        UnknownNameError: If there is no gauge of that name.
        BlastEnvError: If the curves of Kingery and Bulmash do not cover this distance, or site or
            charge differ.
    """
    results = both_results(result, beside)
    figure = Figure(figsize=(8.6, 6.8), layout="constrained")
    panels = upper, lower = figure.subplots(2, 1, sharex=True)
    end_s = max(result.time_s for result in results)
    for item in results:
        colour, style = (_MAIN, "-") if item is result else (_BESIDE, "--")
        _draw_history(panels, item, gauge, color=colour, linestyle=style, linewidth=1.8)
    own = result.gauges.set_index("name").to_dict("index")[gauge]
    place = own["x_m"], own["y_m"], own["z_m"]
    if free_field:
        _draw_free_field(panels, result, place, end_s)
    upper.axhline(0.0, color=unit_interval(QUIET_INK), linewidth=0.8, zorder=1)
    upper.set_ylabel("overpressure (kPa)")
    lower.set(ylabel="impulse up to then (Pa·s)", xlabel="time since the detonation (ms)")
    lower.set_xlim(0.0, end_s * MS_PER_S)
    for axes in panels:
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(fontsize=9, frameon=False, loc="best")
    title, subtitle = gas_heading(results, f"gauge {gauge}")
    at = ", ".join(f"{value:.2f}" for value in place)
    write_heading(figure, title, f"{subtitle}; gauge at ({at}) m")
    return figure


def _draw_history(panels: tuple[Axes, Axes], result: GasResult, gauge: str, **style: Any) -> None:
    """Draw what a gauge has recorded, after the ambient pressure before the first sample."""
    history, row = result.history(gauge), result.gauges.set_index("name").to_dict("index")[gauge]
    time_s, overpressure = history["time_s"].to_numpy(), history["overpressure_pa"].to_numpy()
    time_s = np.concatenate(([0.0, 2.0 * time_s[0] - time_s[1]], time_s))
    overpressure = np.concatenate(([0.0, 0.0], overpressure))
    wave = time_s, overpressure, impulses(time_s, overpressure)
    loads = row["peak_pa"], row["impulse_pa_s"]
    _draw_wave(panels, wave, barrier_text(result.blast.layout), loads, **style)


def _draw_free_field(
    panels: tuple[Axes, Axes], result: GasResult, place: tuple[float, float, float], end_s: float
) -> None:
    """Draw Kingery and Bulmash's incident wave at a place."""
    wave, words = _free_field(result, place)
    time_s = np.unique([*np.linspace(0.0, end_s, 2000), wave.arrival_s, wave.arrival_s - 1e-9])
    drawn = time_s, wave.pressure(time_s), wave.impulse_until(time_s)
    loads = float(wave.peak), float(wave.impulse())
    style = {"color": _REFERENCE, "linestyle": (0, (1.2, 1.2)), "linewidth": 1.6}
    _draw_wave(panels, drawn, words, loads, **style)


def _draw_wave(
    panels: tuple[Axes, Axes],
    wave: tuple[FloatArray, FloatArray, FloatArray],
    words: str,
    loads: tuple[float, float],
    **style: Any,
) -> None:
    """Draw the overpressures and impulses of a wave, Pa and Pa s, over its times in s.

    The legend has its name, peak and impulse.
    """
    time_s, overpressure_pa, impulse_pa_s = wave
    peak = f"{words}: peak {_figures(loads[0] / PA_PER_KPA)} kPa"
    panels[0].plot(MS_PER_S * time_s, overpressure_pa / PA_PER_KPA, label=peak, **style)
    impulse = f"{words}: {_figures(loads[1])} Pa·s"
    panels[1].plot(MS_PER_S * time_s, impulse_pa_s, label=impulse, **style)


def _free_field(result: GasResult, place: tuple[float, float, float]) -> tuple[Friedlander, str]:
    """Return Kingery and Bulmash's incident wave at a place, and its name."""
    charge = result.run.charge
    x_m, y_m, z_m = charge.position_m
    burst = burst_of(z_m, charge.mass_kg)
    on_ground = burst == "hemispherical"
    distance_m = dist((x_m, y_m, 0.0 if on_ground else z_m), place)
    peak_pa, duration_s, impulse_pa_s, arrival_s = (
        kingery_bulmash(quantity, distance_m, charge.mass_kg, burst)
        for quantity in (
            "incident_overpressure",
            "positive_duration",
            "incident_impulse",
            "arrival_time",
        )
    )
    wave = Friedlander.from_impulse(peak_pa, duration_s, impulse_pa_s, arrival_s)
    kind = "free field" if on_ground else "free air, no ground"
    return wave, f"Kingery-Bulmash, {kind}, incident at {distance_m:.1f} m"
