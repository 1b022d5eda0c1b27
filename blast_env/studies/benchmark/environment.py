"""How fast the environment is beside the physics, and its parts."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from statistics import median
from time import process_time
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.calibration.model import calibrated_engines
from blast_env.engines import Blast, ParticleEngine
from blast_env.engines.particles import find_particle_engine
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.physics.collisions import CollisionLog
from blast_env.physics.engine import BallStates, BlastRun, EndReason
from blast_env.physics.scene import Scene
from blast_env.physics.structure import ModularObstacle
from blast_env.scenario import Placement, Scenario
from blast_env.scenario.build_scene import build_scene
from blast_env.units import MS_PER_S

FRAME_BALLS: Final = 2000
"""Balls of the frame that is timed."""


@dataclass
class TimedEngine(ParticleEngine):
    """An engine that adds up the processor time that it takes.

    Attributes:
        engine: The engine that does the work.
        seconds: Processor time in it so far.
    """

    engine: ParticleEngine
    seconds: float = 0.0

    def __post_init__(self) -> None:
        """Go by the name of the engine that does the work."""
        self.name, self.version = self.engine.name, self.engine.version

    def start(self, scene: Scene) -> BlastRun:
        """Return a run of the scene at time 0."""
        return _TimedRun(self, self.timed(partial(self.engine.start, scene)))

    def timed(self, call: Callable[[], Any]) -> Any:
        """Return what a call returns, and count its time."""
        start = process_time()
        result = call()
        self.seconds += process_time() - start
        return result


class _TimedRun:
    """A run that is timed; see `BlastRun` for the attributes."""

    def __init__(self, engine: TimedEngine, run: BlastRun) -> None:
        self._engine = engine
        self._run = run
        self.scene: Scene = run.scene
        self.obstacles: tuple[ModularObstacle, ...] = run.obstacles
        self.log: CollisionLog = run.log
        self._read()

    def _read(self) -> None:
        self.time_s: float = self._run.time_s
        self.steps: int = self._run.steps
        self.end_reason: EndReason | None = self._run.end_reason

    def advance(self, until_s: float) -> None:
        """Go on until the simulated time is at least `until_s`, or the run has ended."""
        self._engine.timed(partial(self._run.advance, until_s))
        self._read()

    def balls(self) -> BallStates:
        """Return the balls that are still there."""
        states: BallStates = self._engine.timed(self._run.balls)
        return states


@dataclass(frozen=True)
class EnvironmentFigures:
    """Processor time of the environment in one process; medians over repeats.

    Attributes:
        engine: Name of the engine.
        episode_ms: An episode of random legal placements, until the stock is used up.
        outside_engine: Share of an episode that is not spent in the engine.
        outside_physics: The same without the time in which the blasts' scenes are laid out: what
            masks, observations, rewards and the conversion of loads take.
        reset_ms: `reset` with a new charge.
        mask_ms: The action mask after a placement.
        observation_ms: The observation after a placement.
    """

    engine: str
    episode_ms: float
    outside_engine: float
    outside_physics: float
    reset_ms: float
    mask_ms: float
    observation_ms: float


def measure_environment(scenario: Scenario, repeats: int) -> EnvironmentFigures:
    """Time the environment and its parts, with the engine of `benchmark_engine`.

    Args:
        scenario: The scenario; it needs a build zone and a calibration.
        repeats: Number of episodes.

    Raises:
        BlastEnvError: If the scenario has no build zone or no calibration.
    """
    engine = TimedEngine(find_particle_engine(benchmark_engine(scenario)))
    env = BlastBarrierEnv(scenario=scenario, engine=engine)
    rng = np.random.default_rng(0)
    _play_episode(env, rng, 0)  # compiles, where nothing is on disk yet
    episodes_s, outside_engine, outside_physics = [], [], []
    for seed in range(1, repeats + 1):
        engine.seconds = 0.0
        start = process_time()
        info = _play_episode(env, rng, seed)
        episode_s = process_time() - start
        episodes_s.append(episode_s)
        outside_engine.append(1.0 - engine.seconds / episode_s)
        scenes_s = _timed(partial(_lay_out_scenes, scenario, info))
        outside_physics.append(outside_engine[-1] - scenes_s / episode_s)
    resets, masks, observations = zip(
        *(_time_parts(env, rng, seed) for seed in range(10 * repeats)), strict=True
    )
    return EnvironmentFigures(
        engine=engine.name,
        episode_ms=MS_PER_S * median(episodes_s),
        outside_engine=median(outside_engine),
        outside_physics=median(outside_physics),
        reset_ms=MS_PER_S * median(resets),
        mask_ms=MS_PER_S * median(masks),
        observation_ms=MS_PER_S * median(observations),
    )


def benchmark_engine(scenario: Scenario) -> str:
    """Return the fastest engine that the scenario's calibration allows."""
    engines = calibrated_engines(scenario.calibration or "")
    return "event" if "event" in engines or not engines else engines[0]


def _play_episode(env: BlastBarrierEnv, rng: np.random.Generator, seed: int) -> dict[str, Any]:
    """Place modules on random cells until the charge goes off; return the final information."""
    info = env.reset(seed=seed)[1]
    ended = False
    while not ended:
        _, _, ended, _, info = env.step(random_action(info["action_mask"], rng))
    return info


def _lay_out_scenes(scenario: Scenario, info: Mapping[str, Any]) -> None:
    """Lay out the scenes of an episode's blasts again, with and without the barrier."""
    for charge, seeds in zip(info["charges"], info["blast_seeds"], strict=True):
        for seed in seeds:
            for layout in (info["layout"], ()):
                build_scene(scenario, layout, seed, charge)


def random_action(mask: NDArray[np.bool_], rng: np.random.Generator) -> int:
    """Return a cell that is free, or to finish if there is none."""
    cells = np.flatnonzero(mask[:-1])
    return int(rng.choice(cells)) if len(cells) else len(mask) - 1


def _time_parts(
    env: BlastBarrierEnv, rng: np.random.Generator, seed: int
) -> tuple[float, float, float]:
    """Return the times of a reset, and of mask and observation half-way through an episode, s."""
    reset_s = _timed(partial(env.reset, seed=seed))
    for _ in range(env.placement.stock_left // 2):
        if not env.placement.is_full:
            env.step(random_action(env.action_masks(), rng))
    observation = env.task.observation.episode(env.observable)
    # A placement remembers its free cells: a fresh one has to work them out.
    placement = Placement.of(env.observable.scenario, env.placement.layout)
    mask_s = _timed(lambda: np.append(placement.legal.ravel(), True))
    return reset_s, mask_s, _timed(partial(observation.observe, placement))


def _timed(call: Callable[[], object]) -> float:
    """Return the processor time that a call takes: whatever else runs here counts little."""
    start = process_time()
    call()
    return process_time() - start


def measure_frame_ms(scenario: Scenario, repeats: int) -> float:
    """Return the least processor time of painting a frame with `FRAME_BALLS` balls, ms."""
    from blast_env.rendering.frames import FramePainter  # an extra

    blast = Blast(scenario, engine="event")
    balls, site = blast.start().balls(), blast.scene.site
    rng = np.random.default_rng(0)
    some = rng.integers(len(balls), size=FRAME_BALLS)
    position = rng.uniform((site.left, site.bottom), (site.right, site.top), (FRAME_BALLS, 2))
    many = BallStates(
        index=np.arange(FRAME_BALLS),
        kind=balls.kind[some],
        position=position,
        velocity=balls.velocity[some],
        mass=balls.mass[some],
        radius=balls.radius[some],
    )
    painter, obstacles = FramePainter(blast), blast.scene.obstacles()
    paint = partial(painter.paint, many, obstacles, 0.0)
    return MS_PER_S * min(_timed(paint) for _ in range(repeats + 1))
