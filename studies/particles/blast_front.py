"""How fast the blast front runs in the event engine, against the laws of strong blasts.

The front is where the air is densest. Two laws for a charge in cold, dilute air, without any
parameter to fit:

- Elastic balls: the cylindrical strong blast of Taylor, von Neumann and Sedov. Hard discs are a gas
  with gamma = 2, for which R = (E t^2 / (0.3519 rho))^(1/4); E is the energy of the charge per
  length, rho the mass of the air per area. Air of a finite packing fraction resists being
  compressed, which makes the constant smaller: `sedov_constant` solves the equations for it too.
- Inelastic balls: energy is lost but momentum is not, and the air is swept up as by a snowplough.
  A mass rho pi R^2 with the radial momentum P moves at dR/dt, so R = (3 P t / (pi rho))^(1/3), the
  t^(1/(D + 1)) of Jabeen, Rajesh and Ray, Europhys. Lett. 89 (2010) 34001, for D = 2.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np
from scipy.integrate import solve_ivp
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import brentq

from blast_env.arrays import FloatArray
from blast_env.geometry import Rectangle
from blast_env.physics.engine import BallStates
from blast_env.physics.event.engine import EventEngine
from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.particles import Balls, air_lattice, explosion_fan
from blast_env.physics.scene import Charge, Scene, StructureOutline
from blast_env.physics.structure import ModularObstacle
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import count_of, render_extra

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, NullFormatter, StrMethodFormatter

SPACING_UNITS: Final = 10.0

AIR_DENSITY: Final = 1.0 / SPACING_UNITS**2
"""Mass of the air per area; every ball has the mass 1."""

SEDOV_GAS: Final = 0.3519
"""The constant for hard discs of no size; see `sedov_constant`."""

_BIN: Final = 0.005  # of ln r, in which the density is counted

_SMOOTHING: Final = 0.02  # of ln r; the front of so few balls is no sharper

_INNERMOST_SPACINGS: Final = 15.0  # nearer by, a few balls make any density


@dataclass(frozen=True)
class FrontCase:
    """A charge in the middle of a square of cold air.

    Attributes:
        restitution: Of all collisions.
        side_spacings: Side of the square, in spacings of the air.
        packing_fraction: Share of the area that the balls of the air cover.
        ball_count: Balls of the charge, each as heavy as one of the air.
        speed_units_per_s: Their speed.
    """

    restitution: float
    side_spacings: int
    packing_fraction: float = 0.03
    ball_count: int = 300
    speed_units_per_s: float = 1000.0

    @property
    def energy(self) -> float:
        """Energy of the charge per length."""
        return 0.5 * self.ball_count * self.speed_units_per_s**2

    def scene(self, seed: int) -> Scene:
        """Lay out the charge and the air."""
        radius = SPACING_UNITS * (self.packing_fraction / pi) ** 0.5
        of_ball = {"mass": 1.0, "radius_units": radius, "elasticity": self.restitution**0.5}
        charge = {
            "ball_count": self.ball_count,
            "speed_units_per_s": self.speed_units_per_s,
            "offset_units": SPACING_UNITS,
        }
        parameters = with_overrides(
            SimulationParameters(),
            {
                "air": {**of_ball, "spacing_units": SPACING_UNITS},
                "explosive": of_ball | charge,
                "contact": {"air_shrink": 1.0, "minimum_radius_units": 0.001},
                "stepping": {"time_limit_s": 60.0},
            },
        )
        side = self.side_spacings * SPACING_UNITS
        site, centre = Rectangle(0.0, 0.0, side, side), (side / 2.0, side / 2.0)
        rng = np.random.default_rng(seed)
        air = air_lattice(parameters.air, site, [], centre, SPACING_UNITS + radius, rng)
        fan = explosion_fan(parameters.explosive, centre, rng)
        # A run ends when no structure can be reached: this one is in a corner.
        far = StructureOutline(ModularObstacle, "far", (2.0, 2.0), 1, 1, True, 1.0, None, None)
        balls = Balls.concatenate((air, fan))
        return Scene(
            site=site,
            charge_centre=centre,
            charge=Charge(centre, 100.0),
            balls=balls,
            structures=(far,),
            parameters=parameters,
        )


@dataclass(frozen=True, eq=False)
class FrontTrace:
    """What a front did.

    Attributes:
        time_s: Times (n,).
        radius: Where the air is densest, spacings (n,).
        law: What the law says, spacings (n,).
        compression: Density there over that of the air before (n,).
    """

    time_s: FloatArray
    radius: FloatArray
    law: FloatArray
    compression: FloatArray

    def from_radius(self, radius_spacings: float) -> "FrontTrace":
        """Return the part from the time on at which the law says a radius."""
        late = self.law >= radius_spacings * (1.0 - 1e-9)
        return FrontTrace(
            self.time_s[late], self.radius[late], self.law[late], self.compression[late]
        )

    @property
    def exponent(self) -> float:
        """Of the power of the time that fits the radii best."""
        return float(np.polyfit(np.log(self.time_s), np.log(self.radius), 1)[0])

    @property
    def ratio(self) -> float:
        """Geometric mean of simulated over predicted radii."""
        return float(np.exp(np.log(self.radius / self.law).mean()))


def elastic_front(case: FrontCase, radii_spacings: Sequence[float], seed: int) -> FrontTrace:
    """Run an elastic case; look where the front is when the law says it is at certain radii.

    Args:
        case: The case; its restitution is 1.
        radii_spacings: Radii by the law for a gas, spacings.
        seed: Draws the air.
    """
    law = np.asarray(radii_spacings, dtype=np.float64)
    time_s = (law * SPACING_UNITS) ** 2 * (SEDOV_GAS * AIR_DENSITY / case.energy) ** 0.5
    run = EventEngine().start(case.scene(seed))
    peaks = []
    for end_s in time_s.tolist():
        run.advance(end_s)
        peaks.append(density_peak(run.balls(), run.scene))
    radius, compression = np.array(peaks).T
    return FrontTrace(time_s, radius, law, compression)


def inelastic_front(case: FrontCase, radii_spacings: Sequence[float], seed: int) -> FrontTrace:
    """Run an inelastic case; `law` is with the radial momentum that there is at each time.

    That is not quite the charge's: as long as the swept air is hot, its pressure adds to it.
    """
    momentum = case.ball_count * case.speed_units_per_s
    volume = (np.asarray(radii_spacings) * SPACING_UNITS) ** 3 * pi * AIR_DENSITY / 3.0
    time_s: FloatArray = volume / momentum
    run = EventEngine().start(case.scene(seed))
    peaks, law = [], []
    for end_s in time_s.tolist():
        run.advance(end_s)
        balls = run.balls()
        peaks.append(density_peak(balls, run.scene))
        momentum = radial_momentum(balls, run.scene)
        law.append((3.0 * momentum * end_s / (pi * AIR_DENSITY)) ** (1.0 / 3.0) / SPACING_UNITS)
    radius, compression = np.array(peaks).T
    return FrontTrace(time_s, radius, np.array(law), compression)


def density_peak(balls: BallStates, scene: Scene) -> tuple[float, float]:
    """Return where the mass per area is highest, spacings, and how high above the air's."""
    distance = np.hypot(*(balls.position - scene.charge_centre).T) / SPACING_UNITS
    outermost = 0.5 * (scene.site.right - scene.site.left) / SPACING_UNITS
    edges = np.exp(np.arange(np.log(_INNERMOST_SPACINGS), np.log(outermost), _BIN))
    mass, _ = np.histogram(distance, edges, weights=balls.mass)
    density = gaussian_filter1d(mass / (pi * np.diff(edges**2)), _SMOOTHING / _BIN)
    place = int(density.argmax())
    return float((edges[place] * edges[place + 1]) ** 0.5), float(density[place])


def radial_momentum(balls: BallStates, scene: Scene) -> float:
    """Return the sum of the momenta outwards."""
    from_centre = balls.position - scene.charge_centre
    outwards = (balls.velocity * from_centre).sum(axis=1) / np.hypot(*from_centre.T)
    return float((balls.mass * outwards).sum())


def sedov_constant(packing_fraction: float = 0.0) -> float:
    """Return a in R = (E t^2 / (a rho))^(1/4) for hard discs, from the self-similar equations.

    With x = r / R, the velocity is dR/dt V(x), the density rho G(x), and the thermal energy per
    mass (dR/dt)^2 H(x). They are integrated inwards from a strong shock, together with the energy.

    Args:
        packing_fraction: Of the air before the blast; 0 is a gas.
    """

    def slopes(x: float, state: FloatArray) -> list[float]:
        velocity, log_density, log_heat, _ = state
        density, heat, drift, spread = (
            np.exp(log_density),
            np.exp(log_heat),
            velocity - x,
            velocity / x,
        )
        z, stiffness = _pressure_factor(packing_fraction * density)
        push = velocity + heat * (stiffness * spread - z * (2.0 - z * spread)) / drift
        gradient = push / (drift - heat * (stiffness + z * z) / drift)
        return [
            gradient,
            -(spread + gradient) / drift,
            (2.0 - z * (gradient + spread)) / drift,
            -density * (0.5 * velocity**2 + heat) * x,
        ]

    def misfit(density: float) -> float:
        return (density - 1.0) * _pressure_factor(packing_fraction * density)[0] - 2.0

    density = float(brentq(misfit, 1.01, 3.0 + 1e-9))  # behind the shock
    velocity = 1.0 - 1.0 / density
    at_shock = [velocity, np.log(density), np.log(0.5 * velocity**2), 0.0]
    profile = solve_ivp(slopes, (1.0, 1e-3), at_shock, method="Radau", rtol=1e-9, atol=1e-11)
    return float(0.5 * pi * profile.y[3, -1])


def _pressure_factor(packing_fraction: float) -> tuple[float, float]:
    """Return Z and d(f Z)/df at a packing fraction f.

    The pressure is Z times density and thermal energy per mass. Henderson's equation of state.
    """
    f = packing_fraction
    z = (1.0 + f * f / 8.0) / (1.0 - f) ** 2
    slope = 0.25 * f / (1.0 - f) ** 2 + 2.0 * z / (1.0 - f)
    return z, z + f * slope


@dataclass(frozen=True)
class Study:
    """One law on trial.

    Attributes:
        title: Of the panel.
        case: The blast.
        radii_spacings: Radii by the law, spacings, at which to look.
        fitted_from: Radius by the law from which on it should hold: the swept air then weighs
            much more than the charge.
        exponent: Of the time in the law.
        law: Formula of the law.
        measure: Runs the case.
    """

    title: str
    case: FrontCase
    radii_spacings: tuple[float, ...]
    fitted_from: float
    exponent: str
    law: str
    measure: Callable[[FrontCase, Sequence[float], int], FrontTrace]

    def traces(self, seeds: int) -> list[FrontTrace]:
        """Return the fronts of so many seeds."""
        return [self.measure(self.case, self.radii_spacings, seed) for seed in range(seeds)]


def _radii(first: float, last: float, count: int) -> tuple[float, ...]:
    return tuple(np.geomspace(first, last, count).tolist())


STUDIES: Final = (
    Study(
        "elastic",
        FrontCase(restitution=1.0, side_spacings=500),
        _radii(25.0, 220.0, 14),
        50.0,
        "1/2",
        "$(E t^2 / 0.3519 \\rho)^{1/4}$",
        elastic_front,
    ),
    Study(
        "restitution 0.3",
        FrontCase(restitution=0.3, side_spacings=180, ball_count=100),
        _radii(18.0, 75.0, 12),
        20.0,
        "1/3",
        "$(3 P t / \\pi \\rho)^{1/3}$",
        inelastic_front,
    ),
)


def front_figure(found: Sequence[Sequence[FrontTrace]]) -> Figure:
    """Return a figure of the fronts of each of `STUDIES`: the radii, and how far off the law."""
    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    panels = figure.subplots(2, len(STUDIES), height_ratios=(2, 1), sharex="col")
    for column, (study, traces) in enumerate(zip(STUDIES, found, strict=True)):
        _draw_radii(panels[0, column], study, traces)
        _draw_ratios(panels[1, column], study, traces)
    balls = ", ".join(f"{study.case.side_spacings**2:,} ({study.title})" for study in STUDIES)
    write_heading(
        figure,
        "The blast front in cold air of hard discs, event engine",
        f"where the air is densest; balls of the air: {balls}; grey: within 5 %; blue: fitted",
    )
    return figure


def _draw_radii(axes: Axes, study: Study, traces: Sequence[FrontTrace]) -> None:
    time_s, law = traces[0].time_s, np.mean([trace.law for trace in traces], axis=0)
    axes.plot(time_s, law, color="#D55E00", lw=1.6, label=f"law: {study.law}")
    for number, trace in enumerate(traces):
        label = f"simulated, {count_of('seed', len(traces))}" if number == 0 else None
        axes.plot(time_s, trace.radius, "o", ms=4.0, color="#0072B2", alpha=0.6, label=label)
    late = [trace.from_radius(study.fitted_from).exponent for trace in traces]
    axes.set_title(f"{study.title}: $R \\propto t^{{{np.mean(late):.3f}}}$, law {study.exponent}")
    axes.set_yscale("log")
    ticks = [
        r for r in (10, 20, 30, 50, 70, 100, 150, 200, 300) if law[0] * 0.7 < r < law[-1] * 1.3
    ]
    axes.yaxis.set_major_locator(FixedLocator(ticks))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("radius of the front (spacings of the air)")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left")


def _draw_ratios(axes: Axes, study: Study, traces: Sequence[FrontTrace]) -> None:
    time_s = traces[0].time_s
    for trace in traces:
        axes.plot(time_s, trace.radius / trace.law, "o", ms=4.0, color="#0072B2", alpha=0.6)
    axes.axhspan(0.95, 1.05, color="#000000", alpha=0.07, lw=0)
    axes.axhline(1.0, color="#D55E00", lw=1.6)
    fitted = time_s[np.asarray(study.radii_spacings) >= study.fitted_from]
    axes.axvspan(fitted[0] * 0.96, fitted[-1] * 1.04, color="#0072B2", alpha=0.06, lw=0)
    axes.set_xscale("log")
    axes.set_ylim(0.8, 1.2)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("simulated / law")
    axes.grid(alpha=0.3)


HEADERS: Final = ("balls", "air balls", "R / spacing", "exponent", "law", "R / law", "densest")
"""Of the columns of `front_rows`."""


def front_rows(found: Sequence[Sequence[FrontTrace]]) -> list[tuple[str, ...]]:
    """Return a row for each of `STUDIES`: mean over the seeds, in the fitted range."""
    rows: list[tuple[str, ...]] = []
    for study, traces in zip(STUDIES, found, strict=True):
        late = [trace.from_radius(study.fitted_from) for trace in traces]
        exponents, ratios = ([getattr(t, name) for t in late] for name in ("exponent", "ratio"))
        densest = np.mean([trace.compression[-1] for trace in traces])
        rows.append(
            (
                study.title,
                f"{study.case.side_spacings**2:,}",
                f"{study.fitted_from:g} to {study.radii_spacings[-1]:g}",
                f"{np.mean(exponents):.3f} ± {np.std(exponents):.3f}",
                study.exponent,
                f"{np.mean(ratios):.3f} ± {np.std(ratios):.3f}",
                f"{densest:.2f}",
            )
        )
    return rows


def size_note() -> str:
    """Return what the size of the discs alone would do to the elastic front."""
    packing = STUDIES[0].case.packing_fraction
    larger = (SEDOV_GAS / sedov_constant(packing)) ** 0.25
    return (
        f"A packing fraction of {packing:g} alone would put the elastic front at {larger:.3f}; "
        "its width, which is that of a few free paths, pulls the densest place inwards."
    )
