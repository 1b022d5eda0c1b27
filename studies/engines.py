"""Differences of pymunk's loads from the event engine's, at decreasing steps.

For a seed, both engines have the same charge and air. Each difference is the mean of the paired
differences over the event engine's mean, with its 95 % interval.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Final

import numpy as np
import typer

from blast_env.answers.terminal import print_line
from blast_env.arrays import FloatArray
from blast_env.cli.options import ClusterAddress, running_on
from blast_env.cli.output import progress_bar, user_errors
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import simulate
from blast_env.runner import run_all
from blast_env.site import Scenario, load_scenario
from blast_env.statistics import Estimate, mean_estimate
from blast_env.tables import markdown_table

STEPS_RADII: Final = (0.5, 0.25, 0.1, 0.05)
"""Distance of the fastest ball in one step, in radii of the smallest; the default is 0.5."""

DENSE_AIR: Final = {
    "air": {"spacing_units": 3.0, "mass": 0.1, "elasticity": 1.0},
    "explosive": {"elasticity": 1.0},
}
"""Light, elastic air, three radii apart."""

CLOSE: Final = 0.05
"""The engines agree if the whole interval lies within this share."""

HEADERS: Final = ("load on the building of", "step (radii)", "m|v|", "transferred impulse", "")


def engine_scenes() -> Mapping[str, Scenario]:
    """Return the scenes by name: two distances in the open, the courtyard, and dense air."""
    free_field, courtyard = load_scenario("free_field"), load_scenario("courtyard")
    return {
        "free_field, 15 m": free_field.at_stand_off(15.0),
        "free_field, 60 m": free_field.at_stand_off(60.0),
        "courtyard": courtyard.with_simulation("ballistic"),
        "dense courtyard": courtyard.with_simulation("ballistic", DENSE_AIR),
    }


@dataclass(frozen=True)
class Agreement:
    """Pymunk at one step against the event engine on one scene.

    Attributes:
        scene: Name of the scene.
        step_radii: The step, in radii of the smallest ball.
        impulse: Difference of the mean m |v|, as a share of the event engine's.
        transferred: The same for the momentum actually transferred.
    """

    scene: str
    step_radii: float
    impulse: Estimate
    transferred: Estimate

    @property
    def is_close(self) -> bool:
        """Whether both intervals lie within `CLOSE`."""
        both = (self.impulse, self.transferred)
        return all(max(-estimate.low, estimate.high) < CLOSE for estimate in both)

    def cells(self) -> tuple[str, ...]:
        """Return the row of the table; see `HEADERS`."""
        shares = (column.scaled(100.0) for column in (self.impulse, self.transferred))
        differences = (f"{s.value:+.1f} % ({s.low:+.1f} to {s.high:+.1f})" for s in shares)
        close = "within 5 %" if self.is_close else ""
        return self.scene, f"{self.step_radii:g}", *differences, close


def relative_difference(pymunk: FloatArray, event: FloatArray) -> Estimate:
    """Return the mean of the paired differences (n,) over the event engine's mean."""
    return mean_estimate((pymunk - event) / float(event.mean()))


def agreements(
    scenes: Mapping[str, Scenario], seeds: int, processes: int, steps_radii: Iterable[float]
) -> Iterator[Agreement]:
    """Yield the agreement at each step on each scene.

    Args:
        scenes: The scenes by name.
        seeds: Blasts of each; the seeds count from 0.
        processes: Worker processes.
        steps_radii: Steps of pymunk, in radii of the smallest ball.
    """
    for name, scenario in scenes.items():
        event = _loads(scenario, "event", seeds, processes, f"{name}: event")
        for step_radii in steps_radii:
            stepped = scenario.with_simulation(overrides={"stepping": {"step_radii": step_radii}})
            label = f"{name}: pymunk, {step_radii:g} radii"
            pymunk = _loads(stepped, "pymunk", seeds, processes, label)
            columns = (relative_difference(*item) for item in zip(pymunk.T, event.T, strict=True))
            yield Agreement(name, step_radii, *columns)


def _loads(scenario: Scenario, engine: str, seeds: int, processes: int, label: str) -> FloatArray:
    """Return m |v| and the transferred impulse on the building (seeds, 2)."""
    with progress_bar(label) as progress:
        found = run_all(partial(_load, scenario, engine), range(seeds), processes, progress)
    return np.array(found)


def _load(scenario: Scenario, engine: str, seed: int) -> tuple[float, float]:
    building = simulate(scenario, seed=seed, engine=engine).obstacle("building")
    return building.impulse, building.transferred_impulse


def main(
    seeds: Annotated[int, typer.Option(min=3, help="Blasts on each engine, at each step.")] = 40,
    scene: Annotated[str | None, typer.Option(help="Only this scene.")] = None,
    processes: Annotated[int, typer.Option(min=1)] = 2,
    cluster: ClusterAddress = None,
) -> None:
    """Compare the loads of pymunk, at decreasing steps, with those of the event engine."""
    with user_errors(), running_on(cluster):
        scenes = engine_scenes()
        if scene is not None:
            if scene not in scenes:
                raise BlastEnvError(f"--scene is {scene!r}, must be one of {', '.join(scenes)}")
            scenes = {scene: scenes[scene]}
        found = [
            agreement.cells() for agreement in agreements(scenes, seeds, processes, STEPS_RADII)
        ]
    print_line(markdown_table(HEADERS, found))


if __name__ == "__main__":
    typer.run(main)
