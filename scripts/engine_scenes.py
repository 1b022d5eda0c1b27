"""The scenes on which the engines are compared, and what is kept of their blasts."""

import re
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from blast_env import load_scenario, simulate
from blast_env.files import write_atomically
from blast_env.geometry import Cell
from blast_env.physics.collisions import incidence_angle_rad
from blast_env.physics.engines import find_engine
from blast_env.physics.scene import Charge
from blast_env.scenario import Scenario
from blast_env.studies.benchmark.engines import dense_courtyard

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
    layout: tuple[Cell, ...] = ()
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
        names = [o.name for o in result.obstacles for _ in o.parts]
        table = pd.DataFrame(
            {
                "seed": np.full(len(log), seed, dtype=np.int32),
                "structure": pd.Categorical(np.array(names)[log["module"]]),
                "time_ms": 1000.0 * log["time_s"],
                "angle_deg": np.degrees(incidence_angle_rad(log)),
                "impulse": log["impulse"],
                "transferred": log["transferred_impulse"],
            }
        )
        return table[table.structure.isin(self.scene.structures)]

    def path(self, folder: Path) -> Path:
        """Return the file of the finished set; another set has another one."""
        version = find_engine(self.engine).version
        content = (self.stepped_scenario.content_hash, self.scene.layout, self.seeds, version)
        digest = sha256(repr(content).encode()).hexdigest()[:12]
        words = "_".join(re.findall(r"\w+", self.scene.name))
        return folder / f"{words}_{self.engine}_{self.step_radii or 0:g}_{digest}.parquet"


def write_collisions(tables: list[pd.DataFrame], path: Path) -> None:
    """Write the collisions of a set, complete or not at all."""
    with write_atomically(path) as temporary:
        pd.concat(tables, ignore_index=True).to_parquet(temporary)
