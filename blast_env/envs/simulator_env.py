"""The bare simulator as a Gymnasium environment."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.envs.arguments import check_names, checked_keywords
from blast_env.envs.spec import PlainSpec
from blast_env.errors import BlastEnvError
from blast_env.geometry import Element
from blast_env.physics.engine import BlastRun, Engine
from blast_env.physics.particles import CollisionType, lattice_capacity
from blast_env.physics.structure import BARRIER_NAME, ModularPart
from blast_env.recording.tables import collision_table
from blast_env.scenario import AnyScenario, check_layout, find_scenario
from blast_env.simulation import Blast, BlastResult

if TYPE_CHECKING:  # drawing is an optional extra
    from blast_env.rendering.frames import FramePainter
    from blast_env.rendering.window import Window

Observation = dict[str, Any]
"""Arrays by name."""

_OPTIONS: Final = ("layout", "charge_position_m")
_BALL_KINDS: Final = (CollisionType.ExplosionBall, CollisionType.AirBall)


class BlastSimulatorEnv(PlainSpec, gym.Env[Observation, np.int64]):
    """A blast that unfolds step by step: nothing is decided, everything can be watched.

    ## Description
    `reset` lays out a scenario at the moment of the detonation, `step` lets a fixed time pass. It
    serves to study the blast model, to watch it, and to build other tasks on.

    ## Action space
    `Discrete(1)`: the only action, 0, is to go on.

    ## Observation space
    A dictionary:

    | key | shape | dtype | meaning | unit |
    |---|---|---|---|---|
    | `module_impulses` | (modules,) | float64 | impulse on each module so far | simulation units |
    | `particle_counts` | (2,) | int64 | explosive balls and air balls on the site | |
    | `time_s` | (1,) | float64 | time since the detonation | s |

    The modules are those of all structures, without the barrier's, in the order of
    `info["module_ids"]`.

    ## Rewards
    Minus the impulse that the protected structures took in this step, times their weights,
    simulation units. Over an episode it adds up to minus the impulse that
    `blast_env.simulate` gives for the same scenario, layout and seed: exactly, when the weights
    are powers of two (they are 1 unless a scenario says otherwise), since recorded impulses are
    multiples of a power of two.

    ## Starting state
    `reset(seed=s)` lays out the blast of the seed `s`, the same as `simulate(..., seed=s)`;
    without a seed one is drawn. Options: `"layout"`, cells of barrier modules;
    `"charge_position_m"`, (x, y) of the charge, whose mass is then drawn as before.

    ## Episode end
    Terminated when the run has ended (`info["end_reason"]` says why); never truncated.

    ## Information
    `reset`: `seed`, `scenario_hash`, `charge_position_m`, `charge_tnt_kg`, `layout`,
    `module_ids`. `step`: `collisions`, this step's collisions, each a dictionary (the keys are
    `blast_env.recording.tables.COLLISION_COLUMNS`), `impulse_sim`, the weighted impulse so far,
    and at the end `end_reason` and `digest`.

    ## Arguments
    - `scenario`: bundled name, path of a scenario file, a `Scenario` or its plain data.
    - `layout`: the default layout.
    - `engine`: name of an engine, or an engine.
    - `step_s`: simulated time per step, s.
    - `render_mode`: `None`, `"rgb_array"` or `"human"`.

    >>> import gymnasium as gym, blast_env
    >>> env = gym.make("BlastSimulator-v0", scenario="free_field", step_s=0.01)
    >>> observation, info = env.reset(seed=0)
    >>> ended, total = False, 0.0
    >>> while not ended:
    ...     observation, reward, ended, _, info = env.step(0)
    ...     total += reward
    >>> result = blast_env.simulate(blast_env.load_scenario("free_field"), seed=0)
    >>> total == -result.impulse_sim("building") and info["digest"] == result.digest
    True

    ## Version history
    - v0: first version.

    ## Notes
    Two-dimensional; no negative phase; impulses are in simulation units until a calibration
    converts them. A time step of the engine is not cut at the end of a `step`, so that `time_s`
    runs past a multiple of `step_s` by less than one of them, which are at most
    `stepping.longest_step_s` (2 ms) long.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (Gymnasium's declaration)
        "render_modes": ["human", "rgb_array"],
        "render_fps": 25,
    }

    @checked_keywords
    def __init__(
        self,
        scenario: AnyScenario = "courtyard",
        layout: Sequence[Element] = (),
        engine: str | Engine = "pymunk",
        step_s: float = 0.002,
        render_mode: str | None = None,
    ) -> None:
        if not 1e-6 <= step_s <= 10.0:
            raise BlastEnvError(f"step_s is {step_s} s, must be between 1e-06 and 10 s")
        if render_mode is not None:
            check_names("render mode", [render_mode], self.metadata["render_modes"])
        self.scenario = find_scenario(scenario)
        self.layout: Sequence[Element] = layout
        self.engine = engine
        self.step_s = step_s
        self.render_mode = render_mode
        self.action_space = spaces.Discrete(1)
        self.observation_space = self._make_observation_space()
        self._blast: Blast | None = None
        self._run: BlastRun | None = None
        self._target_s = 0.0
        self._painter: FramePainter | None = None
        self._window: Window | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Lay out a blast; see the class for the options and the information.

        Raises:
            BlastEnvError: If an option is unknown, or the layout or the charge does not fit.
        """
        super().reset(seed=seed)
        drawn_seed = int(self.np_random.integers(2**31)) if seed is None else seed
        blast = self._lay_out(drawn_seed, options or {})
        self._blast, self._run, self._target_s = blast, blast.start(), 0.0
        self._painter = None
        if self.render_mode == "human":
            self.render()
        parts = _structure_parts(self._run)
        info = {
            "seed": drawn_seed,
            "scenario_hash": self.scenario.content_hash,
            "charge_position_m": blast.scene.charge.position_m,
            "charge_tnt_kg": blast.scene.charge.tnt_kg,
            "layout": blast.layout,
            "module_ids": tuple(part.module_id for part in parts),
        }
        return self._observe(self._run), info

    def step(self, action: np.int64 | int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Let `step_s` pass; the action is always 0.

        Raises:
            gymnasium.error.InvalidAction: If the action is another one.
            gymnasium.error.ResetNeeded: If `reset` has not been called, or the run has ended.
        """
        if not self.action_space.contains(action):
            raise gym.error.InvalidAction(f"action is {action!r}, must be 0")
        if self._run is None or self._run.end_reason is not None:
            raise gym.error.ResetNeeded("the blast has not been laid out or has ended: call reset")
        run, recorded, before = self._run, len(self._run.log), _protected_impulse(self._run)
        self._target_s += self.step_s
        run.advance(self._target_s)
        after = _protected_impulse(run)
        collisions = collision_table(run.log.to_array(recorded), run.obstacles)
        info: dict[str, Any] = {
            "collisions": tuple(collisions.to_dict("records")),
            "impulse_sim": after,
        }
        if run.end_reason is not None:
            result = self.result()
            info |= {"end_reason": str(result.end_reason), "digest": result.digest}
        if self.render_mode == "human":
            self.render()
        return self._observe(run), before - after, run.end_reason is not None, False, info

    def result(self) -> BlastResult:
        """Return the result of the blast that has ended, as `blast_env.simulate` would.

        Raises:
            gymnasium.error.ResetNeeded: If `reset` has not been called.
            ValueError: If the run has not ended.
        """
        if self._blast is None or self._run is None:
            raise gym.error.ResetNeeded("there is no blast yet: call reset")
        return self._blast.result(self._run)

    def render(self) -> NDArray[np.uint8] | None:
        """Return the present frame (`"rgb_array"`) or show it in a window (`"human"`)."""
        if self.render_mode is None or self._run is None or self._blast is None:
            return None
        from blast_env.rendering.frames import FramePainter
        from blast_env.rendering.window import Window

        if self._painter is None:
            self._painter = FramePainter.for_blast(self._blast)
        run = self._run
        frame = self._painter.paint(run.balls(), run.obstacles, run.time_s)
        if self.render_mode == "rgb_array":
            return frame
        if self._window is None:
            self._window = Window("blast-env", self.metadata["render_fps"])
        self._window.show(frame)
        return None

    def get_keys_to_action(self) -> dict[tuple[int, ...], int]:
        """Return the one key for `gymnasium.utils.play`: the space bar goes on, as nothing does."""
        return {(ord(" "),): 0}

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _lay_out(self, seed: int, options: Mapping[str, Any]) -> Blast:
        check_names("option of reset", options, _OPTIONS)
        layout = check_layout(self.scenario, options.get("layout", self.layout))
        blast = Blast(self.scenario, layout, seed, self.engine)
        position_m = options.get("charge_position_m")
        if position_m is None:
            return blast
        return blast.with_charge_at(position_m)

    def _observe(self, run: BlastRun) -> Observation:
        kinds = run.balls().kind
        counts = [(kinds == kind).sum() for kind in _BALL_KINDS]
        return {
            "module_impulses": np.array([part.impulse for part in _structure_parts(run)]),
            "particle_counts": np.array(counts, dtype=np.int64),
            "time_s": np.array([run.time_s]),
        }

    def _make_observation_space(self) -> spaces.Dict:
        # With the heaviest charge every bound is the highest.
        source = max(self.scenario.charge, key=lambda source: source.tnt_kg)
        heaviest = self.scenario.model_copy(update={"charge": (source,)})
        scene = Blast(heaviest).scene
        modules = sum(section.rows * section.columns for section in self.scenario.structures)
        stepping = scene.parameters.stepping
        # A step of the engine can begin just before the time limit.
        latest_s = stepping.time_limit_s + stepping.longest_step_s
        most_impulse = scene.largest_exact_impulse
        air_balls = lattice_capacity(scene.parameters.air, scene.site)
        counts = np.array([scene.parameters.explosive.ball_count, air_balls])
        return spaces.Dict(
            {
                "module_impulses": spaces.Box(0.0, most_impulse, (modules,), np.float64),
                "particle_counts": spaces.Box(0, counts, dtype=np.int64),
                "time_s": spaces.Box(0.0, latest_s, (1,), np.float64),
            }
        )


def _structure_parts(run: BlastRun) -> list[ModularPart]:
    """Return the modules of all structures, without those of the barrier."""
    return [
        part
        for obstacle in run.obstacles
        if obstacle.name != BARRIER_NAME
        for part in obstacle.parts
    ]


def _protected_impulse(run: BlastRun) -> float:
    """Return the weighted impulse on the protected structures so far."""
    return sum(o.weight * o.impulse for o in run.obstacles if o.protected)
