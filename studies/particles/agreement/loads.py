"""How far the loads of pymunk are from those of the event engine, at ever shorter steps.

Finished sets of blasts are kept, so that an interrupted run goes on where it was.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import stdtrit
from scipy.stats import ks_2samp

from blast_env.arrays import FloatArray
from blast_env.files import write_atomically
from blast_env.geometry import Layout
from blast_env.physics.collisions import incidence_angle_rad
from blast_env.physics.engines import find_engine
from blast_env.physics.scene import Charge
from blast_env.recording.parquet import read_frame
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import render_extra
from blast_env.runner import run_all
from blast_env.scenario import Scenario, load_scenario
from blast_env.simulation import simulate
from blast_env.studies.benchmark.engines import dense_courtyard

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

_WALL: Final = tuple((row, 0) for row in range(2, 18))
_BEHIND_THE_WALL: Final = Charge((5.0, 8.0), 100.0)
_USUAL_STEPS: Final = (0.5, 0.25, 0.1, 0.05)
_FINER_STEPS: Final = (*_USUAL_STEPS, 0.02)
"""For scenes near the charge and in dense air, which need them."""


@dataclass(frozen=True)
class EngineScene:
    """A scene that both engines run.

    Attributes:
        name: Name in tables and figures.
        scenario: The scenario.
        structures: The structures whose loads are compared; the figure shows the first.
        layout: Cells of the build zone that hold a module.
        steps_radii: Steps of pymunk, in radii of the smallest ball.
    """

    name: str
    scenario: Scenario
    structures: tuple[str, ...] = ("building",)
    layout: Layout = ()
    steps_radii: tuple[float, ...] = _USUAL_STEPS


def engine_scenes() -> tuple[EngineScene, ...]:
    """Return the scenes: three distances in the open, the courtyard, a wall, and dense air."""
    free_field = load_scenario("free_field")
    courtyard = load_scenario("courtyard").with_simulation("ballistic")
    return (
        EngineScene("free_field, 15 m", free_field.at_stand_off(15.0), steps_radii=_FINER_STEPS),
        EngineScene("free_field, 60 m", free_field.at_stand_off(60.0)),
        EngineScene("free_field, 120 m", free_field.at_stand_off(120.0)),
        EngineScene("courtyard", courtyard),
        EngineScene(
            "courtyard, wall",
            courtyard.with_charge(_BEHIND_THE_WALL),
            ("barrier", "building"),
            _WALL,
            _FINER_STEPS,
        ),
        EngineScene("dense courtyard", dense_courtyard(), steps_radii=_FINER_STEPS),
    )


@dataclass(frozen=True)
class BlastSet:
    """Blasts of one scene with many seeds on one engine.

    Attributes:
        scene: The scene.
        engine: Name of the engine.
        seeds: Number of blasts; the seeds are 0 and up.
        step_radii: Step of pymunk; None for the event engine, which has none.
    """

    scene: EngineScene
    engine: str
    seeds: int
    step_radii: float | None = None

    @property
    def label(self) -> str:
        """What to call it while it runs."""
        step = "" if self.step_radii is None else f", {self.step_radii:g} radii"
        return f"{self.scene.name}: {self.engine}{step}"

    @property
    def stepped_scenario(self) -> Scenario:
        """The scenario with the step."""
        if self.step_radii is None:
            return self.scene.scenario
        overrides = {"stepping": {"step_radii": self.step_radii}}
        return self.scene.scenario.with_simulation(overrides=overrides)

    def collisions(self, seed: int) -> pd.DataFrame:
        """Run one blast; return its collisions with the structures of the scene."""
        result = simulate(self.stepped_scenario, self.scene.layout, seed, self.engine)
        log = result.collision_array
        time_s: FloatArray = log["time_s"]
        names = [o.name for o in result.obstacles for _ in o.parts]
        module: Any = log["module"]  # as what it is, it takes mypy seconds to index with
        columns: dict[str, Any] = {
            "seed": np.full(len(log), seed, dtype=np.int32),
            "structure": pd.Categorical(np.array(names)[module]),
            "time_ms": 1000.0 * time_s,
            "angle_deg": np.degrees(incidence_angle_rad(log)),
            "impulse": log["impulse"],
            "transferred": log["transferred_impulse"],
        }
        table = pd.DataFrame(columns)
        return table[table.structure.isin(self.scene.structures)]

    def path(self, folder: Path) -> Path:
        """Return the file of the finished set; another set has another one."""
        version = find_engine(self.engine).version
        content = (self.stepped_scenario.content_hash, self.scene.layout, self.seeds, version)
        digest = sha256(repr(content).encode()).hexdigest()[:12]
        words = "_".join(re.findall(r"\w+", self.scene.name))
        return folder / f"{words}_{self.engine}_{self.step_radii or 0:g}_{digest}.parquet"


QUANTITIES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "impulse": "impulse m|v|",
        "transferred": "transferred impulse",
        "hits": "hits",
        "arrival_ms": "first arrival",
        "angle_deg": "angle of incidence",
    }
)
"""What is compared, one value a blast: column of `totals` and words."""

CLOSE: Final = 0.05
"""The engines count as agreeing when they differ by less than this share."""


class Difference(NamedTuple):
    """A relative difference of two means with its 95 % interval.

    Attributes:
        value: Share of the event engine's mean.
        half_width: Half of the interval.
    """

    value: float
    half_width: float

    @property
    def is_close(self) -> bool:
        """Whether the whole interval lies within `CLOSE`."""
        return abs(self.value) + self.half_width < CLOSE

    def __str__(self) -> str:
        """Return both in percent."""
        return f"{100.0 * self.value:+.1f} ± {100.0 * self.half_width:.1f}"


def totals(collisions: pd.DataFrame, structure: str, seeds: int) -> pd.DataFrame:
    """Return one row a blast.

    Args:
        collisions: As `BlastSet.collisions` returns them.
        structure: The structure.
        seeds: Number of blasts; those without a hit have no collision.

    Returns:
        `impulse`, `transferred` and `hits`; `arrival_ms`, the time of the first hit, and
        `angle_deg`, the angle of incidence weighted by m |v|, which are NaN without a hit.
    """
    of_structure = collisions[collisions.structure == structure]
    weighted = of_structure.assign(angle=of_structure.angle_deg * of_structure.impulse)
    groups = weighted.groupby("seed")
    table = groups[["impulse", "transferred", "angle"]].sum()
    table["hits"] = groups.size()
    table = table.reindex(range(seeds), fill_value=0.0)
    table["arrival_ms"] = groups.time_ms.min()
    table["angle_deg"] = table.angle / table.impulse.where(table.impulse > 0.0)
    return table[list(QUANTITIES)]


def relative_difference(values: FloatArray, event: FloatArray) -> Difference:
    """Return how far the mean of blasts on pymunk is from that on the event engine.

    The engines share charge and air of a seed, so their loads are correlated, though weakly: paths
    are chaotic. The regression of the one on the other uses as much of that as there is, and the
    event engine's mean is known from more seeds (double sampling, Cochran's regression estimator).

    Args:
        values: From pymunk, for the seeds 0 to n - 1 (n,); NaN where there is none.
        event: From the event engine, for these seeds and more (m,); likewise.
    """
    first = event[: len(values)]
    paired = ~np.isnan(values) & ~np.isnan(first)
    values, first, event = values[paired], first[paired], event[~np.isnan(event)]
    covariance = np.cov(values, first)
    slope = float(covariance[0, 1] / covariance[1, 1])
    mean = float(values.mean() - slope * (first.mean() - event.mean()))
    ratio = mean / float(event.mean())
    residual = values - values.mean() - slope * (first - first.mean())
    count = len(values)
    variance = float(residual @ residual) / (count - 2) / count
    variance += (slope - ratio) ** 2 * float(event.var(ddof=1)) / len(event)
    half_width = float(stdtrit(count - 2, 0.975)) * variance**0.5 / abs(float(event.mean()))
    return Difference(ratio - 1.0, half_width)


@dataclass(frozen=True)
class Comparison:
    """Pymunk at one step against the event engine, on one structure of one scene.

    Attributes:
        scene: Name of the scene.
        structure: Name of the structure.
        step_radii: The step.
        seeds: Blasts on pymunk.
        differences: By quantity.
        distances: Kolmogorov-Smirnov distance of the distributions over the blasts, by quantity.
        p_values: The probability of such a distance between equal distributions.
        pooled: Of the distributions over all collisions, weighted by the transferred impulse:
            of `time_ms` and `angle_deg`.
        pooled_floor: The same between two lots of blasts on the event engine, as many and as
            different in their seeds: what chance does.
    """

    scene: str
    structure: str
    step_radii: float
    seeds: int
    differences: Mapping[str, Difference]
    distances: Mapping[str, float]
    p_values: Mapping[str, float]
    pooled: Mapping[str, float]
    pooled_floor: Mapping[str, float]

    @property
    def load(self) -> str:
        """Scene and structure."""
        return f"{self.scene}: {self.structure}"

    @property
    def is_close(self) -> bool:
        """Whether m |v| and the transferred impulse agree; see `Difference.is_close`."""
        return self.differences["impulse"].is_close and self.differences["transferred"].is_close

    @property
    def is_near(self) -> bool:
        """Whether the estimates themselves are within `CLOSE`, whatever their intervals."""
        both = (self.differences["impulse"], self.differences["transferred"])
        return all(abs(difference.value) < CLOSE for difference in both)


def longest_close_step(comparisons: list[Comparison]) -> float | None:
    """Return the step at which pymunk is within 5 % of the event engine; None if at none.

    That is the longest one for which the 95 % intervals of both m |v| and the transferred impulse
    lie within 5 %, and from which on no shorter step has an estimate outside.

    Args:
        comparisons: Of one structure of one scene.
    """
    found = None
    for comparison in sorted(comparisons, key=lambda each: each.step_radii):
        if not comparison.is_near:
            break
        if comparison.is_close:
            found = comparison.step_radii
    return found


def compare(
    pymunk: pd.DataFrame,
    event: pd.DataFrame,
    seeds: tuple[int, int],
    scene: str,
    structure: str,
    step_radii: float,
) -> Comparison:
    """Compare the collisions of blasts on pymunk with those on the event engine.

    Args:
        pymunk: Collisions of blasts with the seeds 0 and up.
        event: Likewise, of more blasts.
        seeds: How many blasts each has.
        scene: Name of the scene.
        structure: Name of the structure.
        step_radii: The step.
    """
    ours = totals(pymunk, structure, seeds[0])
    theirs = totals(event, structure, seeds[1])
    tests = {
        name: ks_2samp(ours[name].dropna(), theirs[name][seeds[0] :].dropna())
        for name in QUANTITIES
    }
    pymunk = pymunk[pymunk.structure == structure]
    event = event[event.structure == structure]
    same, others = event[event.seed < seeds[0]], event[event.seed >= seeds[0]]
    return Comparison(
        scene=scene,
        structure=structure,
        step_radii=step_radii,
        seeds=seeds[0],
        differences={
            name: relative_difference(ours[name].to_numpy(), theirs[name].to_numpy())
            for name in QUANTITIES
        },
        distances={name: float(test.statistic) for name, test in tests.items()},
        p_values={name: float(test.pvalue) for name, test in tests.items()},
        pooled={name: weighted_distance(pymunk, others, name) for name in _POOLED},
        pooled_floor={name: weighted_distance(same, others, name) for name in _POOLED},
    )


COLLISIONS: Final = ("seed", "structure", "time_ms", "angle_deg", "impulse", "transferred")
"""Columns of what `BlastSet.collisions` returns."""

_POOLED: Final = ("time_ms", "angle_deg")


def weighted_distance(one: pd.DataFrame, other: pd.DataFrame, column: str) -> float:
    """Return the largest difference of two distributions of the transferred impulse.

    Weighted, so that it does not matter whether a push counts as one collision or as two.

    Args:
        one: Collisions.
        other: Collisions.
        column: Over what the impulse is distributed.
    """
    places = np.union1d(one[column], other[column])
    shares = []
    for collisions in (one, other):
        ordered = collisions.sort_values(column)
        passed = np.concatenate(([0.0], np.cumsum(ordered.transferred.to_numpy(dtype=np.float64))))
        upto = np.searchsorted(ordered[column].to_numpy(), places, side="right")
        shares.append(passed[upto] / passed[-1])
    return float(np.abs(shares[0] - shares[1]).max())


_SHARES: Final = {0.5: 1.0, 0.25: 0.8, 0.1: 0.4, 0.05: 0.25, 0.02: 0.25}
"""Of the seeds, by the step: short steps take long."""


def compare_scenes(
    scenes: Iterable[EngineScene],
    seeds: tuple[int, int],
    collisions: Callable[[BlastSet], pd.DataFrame],
) -> Iterable[Comparison]:
    """Compare the engines on scenes.

    Args:
        scenes: The scenes.
        seeds: Blasts on pymunk at its default step, and on the event engine.
        collisions: Gives the collisions of a set of blasts, such as `collisions_of`.
    """
    for scene in scenes:
        event = collisions(BlastSet(scene, "event", seeds[1]))
        for step_radii in scene.steps_radii:
            count = round(_SHARES[step_radii] * seeds[0])
            pymunk = collisions(BlastSet(scene, "pymunk", count, step_radii))
            for structure in scene.structures:
                yield compare(pymunk, event, (count, seeds[1]), scene.name, structure, step_radii)


def collisions_of(
    blasts: BlastSet,
    processes: int,
    folder: Path,
    progress: Callable[[float], None] | None = None,
) -> pd.DataFrame:
    """Return the collisions of a set of blasts, from its file if it has one already.

    Raises:
        BlastEnvError: If the file cannot be written, or is damaged.
    """
    path = blasts.path(folder)
    if not path.exists():
        tables = run_all(blasts.collisions, range(blasts.seeds), processes, progress)
        with write_atomically(path) as temporary:
            pd.concat(tables, ignore_index=True).to_parquet(temporary)
    return read_frame(path, COLLISIONS)


# Okabe and Ito's colours, which people with any colour vision can tell apart.
_LOOKS: Final = (
    ("#0072B2", "o"),
    ("#56B4E9", "s"),
    ("#009E73", "^"),
    ("#E69F00", "D"),
    ("#000000", "v"),
    ("#D55E00", "X"),
)
_SPREAD: Final = 0.012
"""Lines are shifted sideways by this share of the axis, so that their intervals lie apart."""
_LOADS: Final = ("impulse", "transferred", "hits")
_MOST_SHOWN_PERCENT: Final = 45.0


def convergence_figure(comparisons: Sequence[Comparison], event_seeds: int) -> Figure:
    """Return one panel a quantity, one line a scene.

    Args:
        comparisons: Of one structure of each scene, at several steps.
        event_seeds: Blasts of each scene on the event engine.
    """
    figure = Figure(figsize=(13.0, 8.2), layout="constrained")
    panels = figure.subplots(2, 3)
    steps = sorted({comparison.step_radii for comparison in comparisons}, reverse=True)
    for axes, (name, words) in zip(panels.flat, QUANTITIES.items(), strict=False):
        _draw_quantity(axes, comparisons, name)
        axes.set_title(words[0].upper() + words[1:])
        _set_axes(axes, steps)
        if name in _LOADS:
            axes.axhspan(-100.0 * CLOSE, 100.0 * CLOSE, color="#000000", alpha=0.07, lw=0)
    _write_legend(panels.flat[-1], panels.flat[0])
    write_heading(
        figure,
        "pymunk against the event engine, by the length of pymunk's step",
        f"difference of the means over the seeds with 95 % intervals; event engine: {event_seeds} "
        "seeds a scene; grey: within 5 %",
    )
    return figure


def _draw_quantity(axes: Axes, comparisons: Sequence[Comparison], name: str) -> None:
    scenes = dict.fromkeys(each.scene for each in comparisons)
    lowest, highest = -8.0, 8.0
    for number, (scene, (colour, marker)) in enumerate(zip(scenes, _LOOKS, strict=False)):
        own = [each for each in comparisons if each.scene == scene]
        differences = [each.differences[name] for each in own]
        value = 100.0 * np.array([difference.value for difference in differences])
        half_width = 100.0 * np.array([difference.half_width for difference in differences])
        shift = np.exp(_SPREAD * (number - len(scenes) / 2.0) * np.log(50.0))
        axes.errorbar(
            shift * np.array([each.step_radii for each in own]),
            value,
            yerr=half_width,
            color=colour,
            marker=marker,
            ms=5.0,
            lw=1.3,
            capsize=2.5,
            label=f"{scene}: {own[0].structure}",
        )
        lowest = min(lowest, float((value - half_width).min()))
        highest = max(highest, float((value + half_width).max()))
    axes.set_ylim(
        max(1.08 * lowest, -_MOST_SHOWN_PERCENT), min(1.08 * highest, _MOST_SHOWN_PERCENT)
    )


def _set_axes(axes: Axes, steps: Sequence[float]) -> None:
    axes.axhline(0.0, color="#000000", lw=0.8)
    axes.set_xscale("log")
    axes.invert_xaxis()
    axes.xaxis.set_major_locator(FixedLocator(list(steps)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_xlabel("step of pymunk (radii)")
    axes.set_ylabel("pymunk / event - 1 (%)")
    axes.grid(alpha=0.3)


def _write_legend(axes: Axes, source: Axes) -> None:
    axes.axis("off")
    axes.legend(*source.get_legend_handles_labels(), loc="center", fontsize=11, frameon=False)


DIFFERENCE_HEADERS: Final = ("load on", "step (radii)", "seeds", *QUANTITIES.values())
DISTANCE_HEADERS: Final = (
    "load on",
    "step (radii)",
    "m|v| (p)",
    "transferred (p)",
    "time of the impulse (chance)",
    "its angle (chance)",
)
STEP_HEADERS: Final = ("load on", "step within 5 % (radii)")


def difference_rows(comparisons: Sequence[Comparison]) -> Iterable[Sequence[str]]:
    """Yield the differences in percent, with 95 % intervals."""
    for each in comparisons:
        differences = (str(each.differences[name]) for name in QUANTITIES)
        yield each.load, f"{each.step_radii:g}", f"{each.seeds}", *differences


def distance_rows(comparisons: Sequence[Comparison]) -> Iterable[Sequence[str]]:
    """Yield the Kolmogorov-Smirnov distances."""
    for each in comparisons:
        tested = ("impulse", "transferred")
        yield (
            each.load,
            f"{each.step_radii:g}",
            *(f"{each.distances[name]:.2f} ({each.p_values[name]:.2g})" for name in tested),
            *(f"{each.pooled[n]:.3f} ({each.pooled_floor[n]:.3f})" for n in each.pooled),
        )


def step_rows(comparisons: Sequence[Comparison]) -> Iterable[Sequence[str]]:
    """Yield the steps at which pymunk is within 5 %."""
    for load in dict.fromkeys(each.load for each in comparisons):
        step = longest_close_step([each for each in comparisons if each.load == load])
        yield load, "none of them" if step is None else f"{step:g}"
