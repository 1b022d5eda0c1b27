"""Checks of the response of buildings: the tables of docs/engineers/response.md.

`python -m studies.response tables` prints those without a blast, `cells`, `angles`, `peaks` and
`raised` the others.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from math import atan2, degrees, pi
from typing import Annotated, Final

import numpy as np
import typer

from blast_env.answers.terminal import print_line
from blast_env.arrays import FloatArray
from blast_env.bays import BAY_M, Bay
from blast_env.calibration import kingery_bulmash
from blast_env.cli.output import progress_bar, user_errors
from blast_env.curves import normally_reflected_pa, oblique, reflected_pa
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.evaluation.questions.screening import screen
from blast_env.response.components import FacadeBay, Glazing, catalogue
from blast_env.response.facade import FacadeResponse, peak_corrected, peak_factor, respond
from blast_env.response.glass import Pane, glazing_responses
from blast_env.response.sdof import Resistance, System, impulses, responses
from blast_env.response.wall_sections import ReinforcedConcrete
from blast_env.response.walls import Panel, PanelResponses, panel_responses
from blast_env.site import Scenario
from blast_env.tables import markdown_table
from blast_env.units import MS_PER_S
from studies.gas.reference import free_field_gauges

E1300: Final = (
    (4.57, 2.0, 2.0, 1.048),
    (4.57, 1.6, 1.0, 2.064),
    (4.57, 1.0, 0.8, 3.678),
    (5.56, 1.2, 1.0, 3.426),
    (5.56, 1.6, 1.0, 2.476),
    (5.56, 2.2, 1.4, 1.602),
    (7.42, 2.0, 2.0, 1.943),
    (7.42, 1.0, 0.6, 9.786),
    (7.42, 2.2, 1.0, 2.596),
)
"""Least thickness (mm), sides (m), non-factored load (kPa): others' readings of E1300's charts."""

Row = tuple[str, ...]


def non_factored_loads() -> Iterator[Row]:
    """Yield one row per pane: E1300's load, this project's, and their ratio."""
    for thickness_mm, long_m, short_m, load_kpa in E1300:
        own_kpa = 1e-3 * Pane(long_m, short_m, 1e-3 * thickness_mm).load_resistance_pa()
        pane = f"{thickness_mm:g} mm, {long_m:g} x {short_m:g} m"
        yield pane, f"{load_kpa:.2f}", f"{own_kpa:.2f}", f"{own_kpa / load_kpa:.3f}"


def halved_peaks(impulse_pa_s: float = 60.0) -> Iterator[Row]:
    """Yield one row per pane: probability of breakage at two peaks of the same impulse."""
    for thickness_mm in (3.78, 5.56, 9.02):
        pane = Pane(1.2, 1.5, 1e-3 * thickness_mm)
        shares = []
        for peak_pa in (8e3, 4e3):
            end_s = 2.0 * impulse_pa_s / peak_pa
            history = np.array([[peak_pa, 0.0, 0.0]])
            found = glazing_responses([pane], np.array([0.0, end_s, 2.0 * end_s]), history)
            shares.append(f"{100.0 * float(found.break_probability[0]):.1f} %")
        yield f"{thickness_mm:g} mm, 1.2 x 1.5 m", *shares


BEAM_LOAD: Final = (
    (0.0, 0.0),
    (0.16, 1100.0),
    (1.76, 810.0),
    (2.36, 580.0),
    (3.04, 750.0),
    (5.52, 390.0),
    (5.76, 485.0),
    (8.10, 280.0),
    (14.5, 100.0),
    (24.0, 0.0),
)
"""Time (ms) and pressure (kPa) of an air blast on a beam tested by the Swedish defence research
establishment (Magnusson & Hallgren 2000), as in table 7.1 of U. Nystroem, Concrete structures
subjected to blast and fragment impacts, Chalmers University of Technology, Lic 2008:4."""

BEAM_DEFLECTION_MM: Final = 23.0
"""Largest deflection of the beam, 8 ms after the arrival (there, section 7.2.1). J. Ekstroem,
Concrete structures subjected to blast loading, Chalmers, Lic 2015:04, paper B, has 24 mm."""

BEAM_STEEL_DEPTHS_M: Final = (0.036, 0.041)
"""Depth of the middle of the tension steel: in Nystroem's mesh, and with an assumed cover of 25 mm
over stirrups of 8 mm."""


def beam_response(steel_depth_m: float, dynamic_increase: float) -> PanelResponses:
    """Return the computed response of the tested beam.

    160 mm deep and 300 mm wide with five bars of 16 mm, span 1.5 m, concrete of 50 MPa (Ekstroem,
    section 3.2), steel with a yield stress of 549 MPa (Nystroem, table 7.2).
    """
    depth_m = 0.16 - steel_depth_m
    steel_m2 = 5.0 * pi * 0.008**2
    section = ReinforcedConcrete(
        thickness_m=0.16,
        steel_share=steel_m2 / (0.3 * depth_m),
        cover_m=steel_depth_m,
        concrete_pa=50e6,
        steel_pa=549e6,
        dynamic_increase=dynamic_increase,
    )
    time_ms, pressure_kpa = np.array(BEAM_LOAD).T
    return panel_responses([Panel(section, 1.5)], 1e-3 * time_ms, 1e3 * pressure_kpa[np.newaxis])


def beam_rows() -> Iterator[Row]:
    """Yield one row per model of the beam: deflection, its ratio to the test, and its time."""
    increases = (ReinforcedConcrete.model_fields["dynamic_increase"].default, 1.0)
    for steel_m, increase in product(BEAM_STEEL_DEPTHS_M, increases):
        motion = beam_response(steel_m, increase).motion
        peak_mm, time_ms = (
            MS_PER_S * float(motion.peak_m[0]),
            MS_PER_S * float(motion.peak_time_s[0]),
        )
        ratio = f"{peak_mm / BEAM_DEFLECTION_MM:.2f}"
        yield (
            f"{MS_PER_S * steel_m:.0f} mm",
            f"{increase:g}",
            f"{peak_mm:.1f}",
            ratio,
            f"{time_ms:.1f}",
        )


# With blasts: a wall in the open, in front of a charge on the ground.

OPEN_KG: Final = 30.0
OPEN_M: Final = 22.0
PERIODS_S: Final = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16)


def open_wall(
    stand_off_m: float, width_m: float, height_m: float, tnt_kg: float, up_m: float = 0.0
) -> Scenario:
    """Return a scene in the open: a charge in front of the middle of a wall, at a height."""
    middle_m = 0.5 * width_m + 4.0
    office = {
        "kind": "ModularObstacle",
        "name": "office",
        "corner_m": [4.0 + stand_off_m, 4.0],
        "rows": round(2.0 * width_m),
        "columns": 4,
        "height_m": height_m,
        "protected": True,
        "faces": ["west"],
        "facade": {"wall": "brick_215", "glazing": "window_annealed_6"},
    }
    document = {
        "schema_version": 2,
        "name": "open",
        "site": {
            "width_m": stand_off_m + 7.0,
            "height_m": width_m + 8.0,
            "air_height_m": height_m + 5.0,
        },
        "charge": [
            {
                "kind": "point",
                "position_m": [4.0, middle_m],
                "tnt_kg": tnt_kg,
                "height_m": up_m,
            }
        ],
        "structures": [office],
    }
    return Scenario.from_document(document, "open")


def facade_on(site: Scenario, cell_m: float) -> FacadeResponse:
    """Return the response of a site's facade to a blast on cells of a given side."""
    loads = GasBlast(site, engine=GasEngine(cell_m=cell_m)).run().bay_loads
    return loads.response


def filled_with(bays: list[Bay], name: str) -> list[FacadeBay]:
    """Return bays with a component of the catalogue."""
    component = catalogue()[name]
    if isinstance(component, Glazing):
        return [FacadeBay(bay, glazing=component) for bay in bays]
    return [FacadeBay(bay, wall=component) for bay in bays]


def reflected_peaks_pa(
    bays: list[Bay], stand_off_m: float, tnt_kg: float, middle_m: float
) -> FloatArray:
    """Return Kingery and Bulmash's reflected peak at the middle of each bay (bays,)."""
    across_m = np.array([0.5 * (bay.left_m + bay.right_m) - middle_m for bay in bays])
    up_m = np.array([0.5 * (bay.floor_m + bay.top_m) for bay in bays])
    distance_m = np.sqrt(stand_off_m**2 + across_m**2 + up_m**2)
    return np.asarray(kingery_bulmash("reflected_overpressure", distance_m, tnt_kg))


def period_rows(found: dict[float, FacadeResponse]) -> Iterator[Row]:
    """Yield one row per period: deflection of elastic components over that on the finest cells."""
    cells = sorted(found, reverse=True)
    for period_s in PERIODS_S:
        stiffness = (2.0 * pi / period_s) ** 2 * 50.0
        system = System(50.0, 1.0, Resistance.elastic_plastic(stiffness, 1e12))
        peaks = {}
        for cell_m in cells:
            facade = found[cell_m]
            systems = [system] * len(facade.bays)
            peaks[cell_m] = responses(systems, facade.time_s, facade.pressure_pa).peak_m
        ratios = ((peaks[cell_m] / peaks[cells[-1]]).mean() for cell_m in cells)
        yield f"{MS_PER_S * period_s:g} ms", *(f"{ratio:.2f}" for ratio in ratios)


def component_rows(found: dict[float, FacadeResponse], tnt_kg: float) -> Iterator[Row]:
    """Yield one row per component: level of protection of the worst bay, by size of cells.

    A worse level with histories sharpened by `peak_factor` follows in brackets.
    """
    cells = sorted(found, reverse=True)
    for name in catalogue():
        levels = []
        for cell_m in cells:
            facade = found[cell_m]
            bays = filled_with([bay.bay for bay in facade.bays], name)
            histories = facade.time_s, facade.pressure_pa
            own = respond(bays, *histories).level_of_protection
            sharper = peak_corrected(*histories, peak_factor(cell_m, tnt_kg))
            worse = min(own, respond(bays, *sharper).level_of_protection)
            levels.append(own.label if worse == own else f"{own.label} ({worse.label})")
        yield name, *levels


def peak_rows(found: dict[float, FacadeResponse], reference_pa: FloatArray) -> Iterator[Row]:
    """Yield one row per size of cells: peaks over the curves, impulses over the finest cells."""
    finest = found[min(found)]
    fine = np.trapezoid(np.maximum(finest.pressure_pa, 0.0), finest.time_s, axis=1)
    for cell_m, facade in sorted(found.items(), reverse=True):
        impulse = np.trapezoid(np.maximum(facade.pressure_pa, 0.0), facade.time_s, axis=1)
        ratio = (facade.pressure_pa.max(axis=1) / reference_pa).mean()
        allowed = 1.0 / peak_factor(cell_m, OPEN_KG)
        yield f"{cell_m:g} m", f"{ratio:.2f}", f"{allowed:.2f}", f"{(impulse / fine).mean():.3f}"


def angle_rows(width_m: float) -> Iterator[Row]:
    """Yield one row per bay from the middle of a wall: angle, impulse by gas, by the rule."""
    site = open_wall(20.0, width_m, 10.0, 100.0)
    loads = GasBlast(site, engine=GasEngine(cell_m=0.5)).run().bay_loads
    gas_pa_s = dict(
        zip(
            (bay.bay.name for bay in loads.bays),
            impulses(*loads.histories).max(axis=1).tolist(),
            strict=True,
        )
    )
    found = screen(site).threats[0]
    count = round(width_m / BAY_M)
    lowest = found.bays[:count]
    for load in lowest[count // 2 :: 2]:
        bay = load.filled.bay
        aside_m = 0.5 * (bay.left_m + bay.right_m) - found.charge.position_m[1]
        own = gas_pa_s[bay.name]
        yield (
            f"{degrees(atan2(aside_m, 20.0)):.0f} degrees",
            f"{own:.0f}",
            f"{load.impulse_pa_s:.0f}",
            f"{own / load.impulse_pa_s:.2f}",
        )


_FARTHEST: Final = 2.9  # of a place aside, over the distance of the wall
_SLANTS_DEG: Final = (5.0, 20.0, 30.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 70.0)

RAISED_KG: Final = 20.0
"""Mass of the charges of `raised_rows`."""


def raised_rows(distance_m: float, heights_m: Sequence[float], cell_m: float) -> Iterator[Row]:
    """Yield one row per height of a charge: impulse and peak of a wall by gas and by screening.

    They are those of the lowest bay before the charge, peaks over those of a charge on the ground;
    the last column has the largest ratio of impulses of all bays.
    """
    first: tuple[float, float] | None = None
    for height_m in heights_m:
        site = open_wall(distance_m, 12.0, 7.0, RAISED_KG, height_m)
        loads = GasBlast(site, engine=GasEngine(cell_m=cell_m)).run().bay_loads
        screened = screen(site).threats[0].bays
        time_s, pressure_pa = loads.histories
        names = [own.bay.name for own in loads.bays]
        by_gas = dict(zip(names, impulses(time_s, pressure_pa).max(axis=1).tolist(), strict=True))
        bay = screened[1]
        index, gas_pa_s = names.index(bay.filled.bay.name), by_gas[bay.filled.bay.name]
        largest = max(by_gas[own.filled.bay.name] / own.impulse_pa_s for own in screened)
        peaks = float(pressure_pa[index].max()), bay.peak_pa
        first = peaks if first is None else first
        yield (
            f"{distance_m:g} m",
            f"{height_m:g} m",
            f"{gas_pa_s:.0f}",
            f"{bay.impulse_pa_s:.0f}",
            f"{gas_pa_s / bay.impulse_pa_s:.2f}",
            f"{peaks[0] / first[0]:.2f}",
            f"{peaks[1] / first[1]:.2f}",
            f"{largest:.2f}",
        )


def slanting_rows(distance_m: float, tnt_kg: float, cell_m: float) -> Iterator[Row]:
    """Yield one row per angle: peak on a wall over the incident one, by gas, theory and rule."""
    site = open_wall(distance_m, 2.0 * _FARTHEST * distance_m, 3.0, tnt_kg)
    faces = GasBlast(site, engine=GasEngine(cell_m=cell_m)).run().faces
    charge_y_m = 0.5 * site.site.height_m
    own = faces[(faces["face"] == "west") & (faces["z_m"] < cell_m) & (faces["y_m"] > charge_y_m)]
    aside_m = own["y_m"].to_numpy() - charge_y_m
    angle_deg = np.degrees(np.arctan2(aside_m, distance_m))
    farther_m = (distance_m * np.linspace(0.9, 1.1 * _FARTHEST, 24)).tolist()
    gauges = free_field_gauges(tnt_kg, farther_m, cell_m)
    at_m = cell_m * np.array([np.hypot(x + 0.5, np.sqrt(0.5)) for x, *_ in gauges.cells])
    for wanted_deg in _SLANTS_DEG:
        index = int(np.abs(angle_deg - wanted_deg).argmin())
        away_m = np.hypot(distance_m, aside_m[index])
        cosine = np.array(distance_m / away_m)
        log_pa = np.interp(np.log(away_m), np.log(at_m), np.log(gauges.peak_pa))
        gas = own["peak_pa"].to_numpy()[index] / np.exp(log_pa)
        incident = np.array(kingery_bulmash("incident_overpressure", away_m, tnt_kg))
        theory = float(reflected_pa(incident, cosine) / incident)
        rule = float(oblique(normally_reflected_pa(incident), incident, cosine) / incident)
        yield (
            f"{angle_deg[index]:.0f} degrees",
            f"{1e-3 * float(incident):.0f}",
            *(f"{column:.2f}" for column in (gas, theory, rule)),
        )


app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def tables() -> None:
    """Print the tables that need no blast."""
    loads = ("annealed pane, least thickness", "E1300, kPa", "here, kPa", "ratio")
    print_line(markdown_table(loads, non_factored_loads()))
    peaks = ("annealed pane, 60 Pa s", "break, 8 kPa", "break, 4 kPa")
    print_line("\n" + markdown_table(peaks, halved_peaks()))
    beam = ("steel under the face", "strength over the static one", "deflection, mm")
    print_line("\n" + markdown_table((*beam, "over the test", "at, ms"), beam_rows()))


@app.command()
def cells(
    finest: Annotated[float, typer.Option(help="Side of the finest cells, m.")] = 0.125,
) -> None:
    """Print the effect of the cells on the response: 30 kg on the ground, 22 m from a wall."""
    with user_errors():
        site = open_wall(OPEN_M, 6.0, 3.5, OPEN_KG)
        sides_m = [value for value in (0.5, 0.25, 0.125) if value >= finest]
        found = {}
        with progress_bar("cells") as progress:
            for number, cell_m in enumerate(sides_m, start=1):
                found[cell_m] = facade_on(site, cell_m)
                progress(number / len(sides_m))
        bays = [bay.bay for bay in found[sides_m[0]].bays]
        reference_pa = reflected_peaks_pa(bays, OPEN_M, OPEN_KG, 7.0)
        headers = ("cells", "peak over the curve", "allowed for", "impulse over the finest")
        print_line(markdown_table(headers, peak_rows(found, reference_pa)))
        words = [f"{side_m:g} m" for side_m in sides_m]
        print_line("\n" + markdown_table(("period", *words), period_rows(found)))
        levels = markdown_table(("component", *words), component_rows(found, OPEN_KG))
        print_line("\nlevel of protection, in brackets if sharper peaks make it worse\n\n" + levels)


@app.command()
def angles(
    width: Annotated[float, typer.Option(help="Width of the wall, m.")] = 96.0,
) -> None:
    """Print the impulse on a wall by gas and by the rule of screening: 100 kg at 20 m."""
    with user_errors():
        headers = ("angle in plan", "gas, Pa s", "rule, Pa s", "gas over the rule")
        print_line(markdown_table(headers, angle_rows(width)))


@app.command()
def raised(
    cell: Annotated[float, typer.Option(help="Side of the cells, m.")] = 0.5,
    distances: Annotated[str, typer.Option(help="Distances of the wall, m.")] = "8,10,15,20",
    heights: Annotated[str, typer.Option(help="Heights of the charge, m.")] = "0,0.2,0.5,1.1,2,3",
) -> None:
    """Print loads of a charge above the ground on a wall, by gas and by screening: 20 kg."""
    with user_errors():
        at_m, up_m = ([float(word) for word in text.split(",")] for text in (distances, heights))
        headers = ("wall at", "charge at", "gas, Pa s", "screening, Pa s", "gas over screening")
        peaks = ("peak over that on the ground, gas", "screening", "impulses, worst bay")
        rows = [row for away_m in at_m for row in raised_rows(away_m, up_m, cell)]
        print_line(markdown_table((*headers, *peaks), rows))


@app.command()
def peaks(
    cell: Annotated[float, typer.Option(help="Side of the cells, m.")] = 0.25,
    distance: Annotated[float, typer.Option(help="Distance of the wall, m.")] = 8.0,
) -> None:
    """Print peaks of slanting waves on a wall over the incident ones, by gas and theory: 8 kg."""
    with user_errors():
        headers = ("angle", "incident, kPa", "gas", "screening", "rule of impulses")
        print_line(markdown_table(headers, slanting_rows(distance, 8.0, cell)))


if __name__ == "__main__":
    app()
