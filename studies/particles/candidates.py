"""Candidates for the `collisional` presets: dense air and a charge, and how well they do.

Three things at once: agreement with Kingery-Bulmash's reflected impulse over distance, agreement
with measured shielding behind a box, and few events a blast. The base impulse I_b stays 0: at every
contact it feeds in energy that the charge does not have.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import partial
from math import pi, sqrt
from pathlib import Path
from typing import ClassVar, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import ConfigDict

from blast_env.calibration import fit_metrics, fit_power_law, kingery_bulmash
from blast_env.fitting.free_field import FreeFieldStudy, free_field, impulse_by_seed
from blast_env.journal import Journal
from blast_env.physics.event.engine import EventEngine
from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.presets import preset, with_resolution
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import render_extra
from blast_env.runner import in_order
from blast_env.scenario import Scenario, load_scenario
from blast_env.scenario.build_scene import build_scene
from blast_env.studies.shielding.report import EXPERIMENT, ShieldingStudy

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

DISTANCES_M = (8.0, 14.0, 24.0, 40.0)
CHARGE_MASS = 720.0  # of all balls together at 100 kg TNT, as in the preset `ballistic`
MOST_MAPE_PERCENT, MOST_INTEGRAL_PERCENT, MOST_EXPONENT_OFF_ONE = 6.0, 1.5, 0.4

# packing fraction, radius, loss, log10 of the air's density, C_e, shrinking at air, thermal share,
# balls of the charge, modules of the facade
LOW = np.array([0.20, 0.80, 0.0, -2.8, 0.75, 0.90, 0.0, 360.0, 20.0])
HIGH = np.array([0.45, 1.20, 0.06, -2.0, 1.0, 1.0, 0.9, 1440.0, 40.0])


@dataclass(frozen=True)
class Candidate:
    """A point of the search; values per collision are those of balls of radius 1.

    Attributes:
        packing_fraction: Share of the area that air balls cover.
        radius_units: Radius of all balls.
        loss: 1 - restitution.
        air_density: Mass of air per square unit.
        module_restitution: C_e.
        air_shrink: Factor on explosive balls at air.
        thermal_share: Share of the charge's energy that is random in direction.
        ball_count: Balls of the charge.
        facade_modules: Width of the calibration's facade.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", allow_inf_nan=False)

    packing_fraction: float
    radius_units: float
    loss: float
    air_density: float
    module_restitution: float
    air_shrink: float
    thermal_share: float
    ball_count: int
    facade_modules: int

    @classmethod
    def from_point(cls, point: NDArray[np.float64]) -> "Candidate":
        """Return the candidate of a point between `LOW` and `HIGH`."""
        return cls(
            packing_fraction=round(float(point[0]), 3),
            radius_units=round(float(point[1]), 2),
            loss=round(float(point[2]), 3),
            air_density=float(f"{10.0 ** point[3]:.2g}"),
            module_restitution=round(float(point[4]), 2),
            air_shrink=round(float(point[5]), 3),
            thermal_share=round(float(point[6]), 2),
            ball_count=round(float(point[7]) / 10.0) * 10,
            facade_modules=20 if point[8] < 30.0 else 40,
        )

    def parameters(self) -> SimulationParameters:
        """Return the parameters of the blast model."""
        spacing = sqrt(pi / self.packing_fraction)
        elasticity = sqrt(1.0 - self.loss)
        of_radius_1 = with_overrides(
            SimulationParameters(),
            {
                "air": {
                    "radius_units": 1.0,
                    "spacing_units": spacing,
                    "mass": self.air_density * spacing**2,
                    "elasticity": elasticity,
                },
                "explosive": {
                    "ball_count": self.ball_count,
                    "mass": CHARGE_MASS / self.ball_count,
                    "elasticity": elasticity,
                    "thermal_share": self.thermal_share,
                    "charge_scaling": "hopkinson_cranz",
                },
                "contact": {
                    "module_restitution": self.module_restitution,
                    "air_shrink": self.air_shrink,
                },
            },
        )
        return with_resolution(of_radius_1, 1.0 / self.radius_units)


@dataclass(frozen=True)
class Score:
    """What a candidate reaches.

    Attributes:
        mape_percent: Of the power law against Kingery-Bulmash.
        integral_error_percent: Likewise.
        exponent: B of the power law.
        one_corner: Scaled impulse behind one corner over the free field's.
        two_corners: Behind two corners.
        events: Events of a blast in `courtyard` without a barrier.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", allow_inf_nan=False)

    mape_percent: float
    integral_error_percent: float
    exponent: float
    one_corner: float
    two_corners: float
    events: float

    @property
    def distance_error(self) -> float:
        """The largest of its three errors over distance, each over its bound; 1 is just met."""
        return max(
            self.mape_percent / MOST_MAPE_PERCENT,
            self.integral_error_percent / MOST_INTEGRAL_PERCENT,
            abs(self.exponent - 1.0) / MOST_EXPONENT_OFF_ONE,
        )

    @property
    def shielding_error(self) -> float:
        """The larger of its two distances from the experiments, each over its tolerance."""
        found = {"one_corner": self.one_corner, "two_corners": self.two_corners}
        return max(
            abs(found[name] - band.value) / band.tolerance for name, band in EXPERIMENT.items()
        )


def score(parameters: SimulationParameters, facade_modules: int, seeds: tuple[int, ...]) -> Score:
    """Run the blasts that parameters are judged by.

    Args:
        parameters: The parameters.
        facade_modules: Width of the calibration's facade.
        seeds: Seeds of every scene.
    """
    field = _with(free_field(side_modules=facade_modules), parameters)
    study = FreeFieldStudy(field, DISTANCES_M, seeds, "event")
    i_sim = impulse_by_seed(study.run(), "transferred_impulse").mean(axis=0)
    reference = kingery_bulmash("reflected_impulse", np.array(DISTANCES_M), 100.0)
    law = fit_power_law(i_sim, reference)
    metrics = fit_metrics(DISTANCES_M, law(i_sim), reference)
    shielding = ShieldingStudy(parameters, seeds, time_limit_s=1.0).run()
    return Score(
        mape_percent=metrics.mape_percent,
        integral_error_percent=abs(metrics.integral_error_percent),
        exponent=law.B,
        one_corner=shielding.one_corner.value**law.B,
        two_corners=shielding.two_corners.value**law.B,
        events=float(np.mean([_events(parameters, seed) for seed in seeds])),
    )


def _with(scenario: Scenario, parameters: SimulationParameters) -> Scenario:
    overrides = parameters.model_dump()
    overrides["stepping"]["time_limit_s"] = 1.0
    return scenario.with_simulation(overrides=overrides)


def _events(parameters: SimulationParameters, seed: int) -> int:
    run = EventEngine().start(build_scene(_with(load_scenario("courtyard"), parameters), (), seed))
    run.advance(np.inf)
    return run.steps + run.crossings + run.outdated


def _score_candidate(seeds: tuple[int, ...], candidate: Candidate) -> Score:
    return score(candidate.parameters(), candidate.facade_modules, seeds)


@dataclass(frozen=True)
class ScoredCandidate:
    """A line of the file of a search."""

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    candidate: Candidate
    score: Score


class Store:
    """Scores on disk, one a line, so that a search can go on.

    Raises:
        BlastEnvError: If the file is anything else.
    """

    def __init__(self, path: Path, seeds: tuple[int, ...], processes: int) -> None:
        self._journal = Journal(path, ScoredCandidate)
        self._seeds, self._processes = seeds, processes
        self.scores = {each.candidate: each.score for each in self._journal.read()}

    def score_all(self, candidates: Iterable[Candidate]) -> list[Score]:
        """Return the scores of candidates, running those that are new."""
        wanted = list(candidates)
        new = [each for each in dict.fromkeys(wanted) if each not in self.scores]
        found = in_order(partial(_score_candidate, self._seeds), new, self._processes)
        for candidate, its_score in zip(new, found, strict=True):
            self.scores[candidate] = its_score
            self._journal.add(ScoredCandidate(candidate, its_score))
        return [self.scores[each] for each in wanted]


def candidate_table(scores: dict[Candidate, Score]) -> pd.DataFrame:
    """Return one row a candidate: its values, its scores, and its two errors."""
    rows = [
        asdict(candidate)
        | asdict(its)
        | {"distance_error": its.distance_error, "shielding_error": its.shielding_error}
        for candidate, its in scores.items()
    ]
    return pd.DataFrame(rows)


def front(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows that no other one beats in all three objectives, cheapest first."""
    objectives = table[["distance_error", "shielding_error", "events"]].to_numpy()
    no_worse = (objectives[:, None] <= objectives[None]).all(axis=2)
    better = (objectives[:, None] < objectives[None]).any(axis=2)
    unbeaten = np.flatnonzero(~(no_worse & better).any(axis=0))
    return table.iloc[unbeaten].sort_values(by="events")


SHOWN: Final = {
    "collisional": ("#D55E00", "*"),
    "collisional_fine": ("#0072B2", "P"),
}
"""The presets in the figure, with colour and marker."""

FACADE_MODULES: Final = 20
"""Width of the facade that the presets are calibrated on."""

_ERRORS: Final = {
    "distance_error": "error over distance / its bound",
    "shielding_error": "error of shielding / its bound",
}
_EVENT_TICKS: Final = (30_000, 100_000, 300_000, 1_000_000)
HIGHEST_DRAWN: Final = 3.0  # worse candidates are drawn at the upper edge


def preset_table(names: tuple[str, ...], seeds: tuple[int, ...]) -> pd.DataFrame:
    """Return the scores of presets, a row each, as in `candidate_table`."""
    rows = []
    for name in names:
        its = score(preset(name), FACADE_MODULES, seeds)
        errors = {"distance_error": its.distance_error, "shielding_error": its.shielding_error}
        rows.append({"preset": name} | asdict(its) | errors)
    return pd.DataFrame(rows)


def front_figure(candidates: pd.DataFrame, presets: pd.DataFrame, subtitle: str) -> Figure:
    """Return both errors over the events of a blast, and against each other.

    Args:
        candidates: Of `candidate_table`, with `on_front`.
        presets: Of `preset_table`.
        subtitle: What was run.
    """
    figure = Figure(figsize=(15.0, 5.6), layout="constrained")
    panels = figure.subplots(1, 3)
    for axes, (column, label) in zip(panels[:2], _ERRORS.items(), strict=True):
        _draw_points(axes, candidates, presets, "events", column)
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(FixedLocator(_EVENT_TICKS))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set(xlabel="events of a blast in courtyard", ylabel=label, ylim=(0.0, HIGHEST_DRAWN))
    _draw_points(panels[2], candidates, presets, *_ERRORS)
    panels[2].set(xlabel=_ERRORS["distance_error"], ylabel=_ERRORS["shielding_error"])
    panels[2].set(xlim=(0.0, HIGHEST_DRAWN), ylim=(0.0, HIGHEST_DRAWN))
    panels[2].axvline(1.0, color="#000000", lw=1.0, ls=":")
    panels[0].legend(loc="upper right")
    write_heading(figure, "Search for dense air: errors against the cost of a blast", subtitle)
    return figure


def _draw_points(
    axes: Axes, candidates: pd.DataFrame, presets: pd.DataFrame, x: str, y: str
) -> None:
    for on_front, colour, size, label in (
        (False, "#9AA3AE", 18.0, "candidate"),
        (True, "#009E73", 44.0, "on the front of all three"),
    ):
        chosen = candidates[candidates.on_front == on_front]
        horizontal = chosen[x] if x == "events" else chosen[x].clip(upper=HIGHEST_DRAWN)
        vertical = chosen[y].clip(upper=HIGHEST_DRAWN)
        axes.scatter(horizontal, vertical, s=size, color=colour, label=label, clip_on=False)
    for row in presets.to_dict("records"):
        colour, marker = SHOWN[row["preset"]]
        axes.scatter(
            row[x],
            row[y],
            color=colour,
            marker=marker,
            s=190,
            edgecolors="#FFFFFF",
            zorder=3,
            label=row["preset"],
        )
    axes.axhline(1.0, color="#000000", lw=1.0, ls=":", label="bound")
    axes.grid(color="#E3E6EA")
    axes.set_axisbelow(True)
