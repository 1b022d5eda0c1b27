"""The bare simulator as a Gymnasium environment."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.envs.arguments import (
    PlainSpec,
    ResetOptions,
    check_names,
    checked_keywords,
    checked_options,
)
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import PAPER_ENGINES, Blast, BlastResult, Engine, find_engine
from blast_env.geometry import Element
from blast_env.layout import LayoutState, check_layout
from blast_env.layout.build_site import draw_threat
from blast_env.particles.objects import CollisionType
from blast_env.particles.run import BlastRun
from blast_env.results import EndReason
from blast_env.site import AnyScenario, Scenario, find_scenario
from blast_env.site.blast_site import BlastSite
from blast_env.site.structures import BARRIER_NAME
from blast_env.values import real_number

if TYPE_CHECKING:  # drawing is an optional extra, and Numba takes half a second to import
    from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
    from blast_env.gas.engine import GasRun
    from blast_env.plots.frames import FramePainter
    from blast_env.plots.pressure_film import PressureNow
    from blast_env.plots.window import Window

Observation = dict[str, Any]
"""Arrays by name."""

_BALL_KINDS: Final = (CollisionType.ExplosionBall, CollisionType.AirBall)

PLAN_HEIGHT_M: Final = 1.5
"""Height of the observed plan of overpressure, taken from the layer of cells around it."""

# Far beyond possible values; spaces without bounds cause warnings.
_MOST_IMPULSE: Final = 1e9
_MOST_OVERPRESSURE_PA: Final = 1e10
_LEAST_OVERPRESSURE_PA: Final = -101_325.0
_LATEST_S: Final = 60.0


class BlastInProgress(ABC):
    """A blast in progress, by particles or by gas dynamics.

    Attributes:
        blast: The blast.
        run: Its state.
    """

    blast: "Blast | GasBlast"
    run: "BlastRun | GasRun"
    _painter: "FramePainter | PressureNow | None" = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the painter, which does not pickle and is made anew."""
        return {**self.__dict__, "_painter": None}

    @property
    def time_s(self) -> float:
        """Time since the detonation."""
        return self.run.time_s

    @property
    def end_reason(self) -> EndReason | None:
        """The reason for its end; None while it runs."""
        return self.run.end_reason

    @property
    def layout(self) -> Sequence[Element]:
        """The barrier."""
        return self.blast.layout

    @property
    @abstractmethod
    def site(self) -> BlastSite:
        """The site of the blast."""

    @property
    def module_ids(self) -> tuple[str, ...]:
        """Names of the modules of the structures, in the order of the observation."""
        return tuple(
            outline.module_name(row, column)
            for outline in self.site.structures
            if not outline.is_barrier
            for row, column in outline.filled
        )

    @property
    @abstractmethod
    def impulse(self) -> float:
        """Weighted impulse on the protected structures so far, simulation units or Pa s."""

    @property
    def collisions(self) -> tuple[dict[str, Any], ...]:
        """The collisions of the last `advance`; none with gas."""
        return ()

    @abstractmethod
    def information(self) -> dict[str, Any]:
        """Return the information on the loads so far."""

    @abstractmethod
    def advance(self, until_s: float) -> None:
        """Advance to a time, or the end."""

    @abstractmethod
    def observe(self) -> Observation:
        """Return the present observation."""

    @abstractmethod
    def result(self) -> "BlastResult | GasResult":
        """Return the result, at the end.

        Raises:
            ValueError: If the run has not ended.
        """

    @abstractmethod
    def frame(self) -> NDArray[np.uint8]:
        """Return a picture of the present state."""


class ParticlesInProgress(BlastInProgress):
    """A blast by particles in progress.

    Args:
        blast: The blast.
    """

    blast: Blast
    run: BlastRun
    _painter: "FramePainter | None" = None

    def __init__(self, blast: Blast) -> None:
        self.blast = blast
        self.run = blast.start()
        self._recorded = 0

    @property
    def site(self) -> BlastSite:
        """The site of the blast."""
        return self.blast.scene

    @property
    def impulse(self) -> float:
        """Weighted impulse on the protected structures so far, simulation units."""
        return sum(o.weight * o.impulse for o in self.run.obstacles if o.protected)

    @property
    def collisions(self) -> tuple[dict[Any, Any], ...]:
        """The collisions of the last `advance`, with the columns of `COLLISION_COLUMNS`."""
        if len(self.run.log) == self._recorded:
            return ()
        from blast_env.particles.tables import collision_table  # pandas takes long to import

        table = collision_table(self.run.log.to_array(self._recorded), self.run.obstacles)
        return tuple(table.to_dict("records"))

    def information(self) -> dict[str, Any]:
        """Return the number of collisions and the impulse so far."""
        return {"collisions": len(self.run.log), "impulse_sim": self.impulse}

    def advance(self, until_s: float) -> None:
        """Advance to a time, or the end."""
        self._recorded = len(self.run.log)
        self.run.advance(until_s)

    def observe(self) -> Observation:
        """Return impulses, counts of balls and the time."""
        kinds = self.run.balls().kind
        counts = [(kinds == kind).sum() for kind in _BALL_KINDS]
        structures = [obstacle for obstacle in self.run.obstacles if obstacle.name != BARRIER_NAME]
        return {
            "module_impulses": np.array(
                [p.impulse for structure in structures for p in structure.parts]
            ),
            "particle_counts": np.array(counts, dtype=np.int64),
            "time_s": np.array([self.run.time_s]),
        }

    def result(self) -> BlastResult:
        """Return the result, at the end.

        Raises:
            ValueError: If the run has not ended.
        """
        return self.blast.result(self.run)

    def frame(self) -> NDArray[np.uint8]:
        """Return a picture of the balls."""
        from blast_env.plots.frames import FramePainter

        if self._painter is None:
            self._painter = FramePainter(self.blast)
        return self._painter.paint(self.run.balls(), self.run.obstacles, self.run.time_s)

    @staticmethod
    def space(scenario: Scenario, engine: Engine) -> spaces.Dict:  # noqa: ARG004
        """Return the space of the observations."""
        # The heaviest charge has the highest bounds.
        source = max(scenario.charge, key=lambda source: source.tnt_kg)
        heaviest = scenario.model_copy(update={"charge": (source,)})
        scene = Blast(heaviest).scene
        stepping = scene.parameters.stepping
        # A step of the engine can begin just before the time limit.
        latest_s = stepping.time_limit_s + stepping.longest_step_s
        most_impulse = scene.largest_exact_impulse
        air_balls = scene.parameters.air.most_balls(scene.site_m)
        counts = np.array([scene.parameters.explosive.ball_count, air_balls])
        return spaces.Dict(
            {
                "module_impulses": spaces.Box(
                    0.0, most_impulse, (_module_count(scenario),), np.float64
                ),
                "particle_counts": spaces.Box(0, counts, dtype=np.int64),
                "time_s": spaces.Box(0.0, latest_s, (1,), np.float64),
            }
        )


class GasInProgress(BlastInProgress):
    """A blast of gas dynamics in progress.

    Args:
        blast: The blast.
    """

    blast: "GasBlast"
    run: "GasRun"
    _painter: "PressureNow | None" = None

    def __init__(self, blast: "GasBlast") -> None:
        self.blast = blast
        self._result = blast.start()
        self.run = self._result.run
        grid = self.run.grid
        margin = round(-grid.origin_m[0] / grid.cell_m)
        rows, columns = _plan_shape(blast.scenario, grid.cell_m)
        self._plan = (slice(margin, margin + columns), slice(margin, margin + rows))
        self._layer = min(int(PLAN_HEIGHT_M / grid.cell_m), grid.shape[2] - 1)

    @property
    def site(self) -> BlastSite:
        """The site of the blast."""
        return self.run.site

    @property
    def impulse(self) -> float:
        """Impulse on the protected structures so far, by weight, Pa s."""
        return self._result.now().loads().protected_impulse_pa_s

    def information(self) -> dict[str, Any]:
        """Return the impulse so far."""
        return {"impulse_pa_s": self.impulse}

    def advance(self, until_s: float) -> None:
        """Advance to a time, or the end."""
        self.run.advance(until_s)

    def observe(self) -> Observation:
        """Return loads, the plan of overpressure, gauges and the time."""
        so_far = self._result.now()
        solid = self.run.grid.solid[:, :, self._layer]
        plane = np.where(solid, 0.0, self.run.solver.overpressure_in(2, self._layer))
        gauges = self.run.gauges
        return {
            "module_impulses": so_far.module_impulse_n_s,
            "structure_impulses": so_far.structures["impulse_pa_s"].to_numpy(np.float64),
            "overpressure": plane[self._plan].T.astype(np.float32),
            "gauges": np.zeros(0)
            if gauges is None
            else self.run.solver.overpressure_at(gauges.cells).astype(np.float64),
            "time_s": np.array([self.run.time_s]),
        }

    def result(self) -> "GasResult":
        """Return the result, at the end.

        Raises:
            ValueError: If the run has not ended.
        """
        if self.run.end_reason is None:
            raise ValueError(f"the run is at {self.time_s} s and has not ended: advance it first")
        return self._result.now()

    def frame(self) -> NDArray[np.uint8]:
        """Return the overpressure in plan and in a section."""
        from blast_env.plots.pressure_film import PressureNow

        if self._painter is None:
            self._painter = PressureNow(self._result)
        return self._painter.frame()

    @staticmethod
    def space(scenario: Scenario, engine: "GasEngine") -> spaces.Dict:
        """Return the space of the observations."""
        low_pa, high_pa = _LEAST_OVERPRESSURE_PA, _MOST_OVERPRESSURE_PA
        modules, structures = _module_count(scenario), len(scenario.structures)
        return spaces.Dict(
            {
                "module_impulses": spaces.Box(0.0, _MOST_IMPULSE, (modules,), np.float64),
                "structure_impulses": spaces.Box(0.0, _MOST_IMPULSE, (structures,), np.float64),
                "overpressure": spaces.Box(
                    low_pa, high_pa, _plan_shape(scenario, engine.cell_m), np.float32
                ),
                "gauges": spaces.Box(low_pa, high_pa, (len(scenario.gauges),), np.float64),
                "time_s": spaces.Box(0.0, _LATEST_S, (1,), np.float64),
            }
        )


def _unfolding_class(engine: Engine) -> Any:
    """Return the class that runs the blasts of an engine step by step.

    Raises:
        BlastEnvError: If the engine runs no blasts.
    """
    if not engine.medium:
        raise BlastEnvError(f"engine {engine.name!r} runs no blasts: there is none to show")
    return GasInProgress if engine.medium == "gas" else ParticlesInProgress


def _plan_shape(scenario: Scenario, cell_m: float) -> tuple[int, int]:
    """Return the numbers of cells of the site upwards and to the right."""
    site = scenario.site
    rows, columns = (
        int(np.ceil(np.round(length_m / cell_m, 9))) for length_m in (site.height_m, site.width_m)
    )
    return rows, columns


def _module_count(scenario: Scenario) -> int:
    return sum(section.modules for section in scenario.structures)


_OPTIONS: Final = ("layout", "charge_position_m")


class BlastSimulatorEnv(PlainSpec, gym.Env[Observation, np.int64]):
    """A blast that unfolds step by step, to be watched without decisions.

    ## Description
    `reset` sets up a scenario at the moment of the detonation, `step` advances it by a fixed time.
    It serves to study the blast model, to watch it, and as a basis of other tasks.

    ## Action space
    `Discrete(1)`: the only action, 0, continues.

    ## Observation space
    A dictionary. Particles give the first three, gas dynamics all but `particle_counts`:

    | key | shape | dtype | meaning | unit |
    |---|---|---|---|---|
    | `module_impulses` | (modules,) | float64 | on each module so far | simulation units; N s |
    | `particle_counts` | (2,) | int64 | explosive balls and air balls on the site | |
    | `time_s` | (1,) | float64 | time since the detonation | s |
    | `structure_impulses` | (structures,) | float64 | mean over the assessed walls | Pa s |
    | `overpressure` | (rows, columns) | float32 | of the cells 1.5 m above the site | Pa |
    | `gauges` | (gauges,) | float64 | overpressure at the scenario's gauges | Pa |

    The modules are those of all structures, without the barrier's, as in `env.module_ids`.
    The rows of `overpressure` go upwards, and solids have 0.

    ## Rewards
    Minus the weighted impulse on the protected structures in this step, in simulation units, or in
    Pa s with gas. Over an episode it adds up to minus the impulse of `blast_env.simulate`: exactly
    for particles with weights that are powers of two, with gas up to rounding.

    ## Starting state
    `reset(seed=s)` sets up the blast of `simulate(..., seed=s)`; without a seed one is drawn.
    With gas the seed draws the charge alone, and the blast begins when its front is near the first
    solid: loads and gauges include the time before. Options: `"layout"`, and
    `"charge_position_m"`, (x, y) of the charge, whose mass is still drawn.

    ## Episode end
    Terminated when the run has ended; never truncated. `info` always has the same keys: `seed`,
    `scenario_hash`, charge and `layout`; the number of `collisions` and `impulse_sim`, or with gas
    `impulse_pa_s`, so far; `end_reason` and `digest`, empty before the end. `env.collisions` has
    those of the last step (keys of `blast_env.particles.tables.COLLISION_COLUMNS`).

    ## Arguments
    See `__init__`, below.
    >>> import gymnasium as gym, blast_env
    >>> env = gym.make("BlastSimulator-v0", scenario="free_field", step_s=0.01)
    >>> observation, info = env.reset(seed=0)
    >>> ended, total = False, 0.0
    >>> while not ended:
    ...     observation, reward, ended, _, info = env.step(0)
    ...     total += reward
    >>> result = blast_env.simulate("free_field", seed=0, engine="pymunk")
    >>> total == -result.impulse_sim("building") and info["digest"] == result.digest
    True

    ## Version history
    - v0: first version.

    ## Notes
    Particles are two-dimensional and have no negative phase. The engine's last time step, of 2 ms
    at most, is not cut at the end of a `step`: `time_s` runs past a multiple of `step_s`.
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
        engine: str | Engine = PAPER_ENGINES["BlastSimulator-v0"],
        step_s: float = 0.002,
        render_mode: str | None = None,
        cell_m: float | None = None,
    ) -> None:
        """Make an environment from the keywords of `gymnasium.make`.

        Args:
            scenario: Bundled name, path of a scenario file, a `Scenario` or its plain data.
            layout: The default layout.
            engine: Name of an engine, or an engine.
            step_s: Simulated time per step.
            render_mode: `None`, `"rgb_array"` or `"human"`; with gas the overpressure in plan and
                in a vertical section, on a scale up to the free-field peak by Kingery and Bulmash
                at the distance of the nearest structure that counts.
            cell_m: Side of the cells of gas dynamics; default 0.5 m.

        Raises:
            BlastEnvError: If an argument is invalid; the message names it and its bounds.
        """
        if render_mode is not None:
            check_names("render mode", [render_mode], self.metadata["render_modes"])
        self.scenario = find_scenario(scenario)
        self.layout: Sequence[Element] = check_layout(self.scenario, layout)
        self.engine = engine
        self.step_s = real_number("step_s", step_s, 1e-6, 10.0)
        self.cell_m = cell_m
        self.render_mode = render_mode
        self._engine = find_engine(engine, cell_m)
        self.action_space = spaces.Discrete(1)
        unfolding = _unfolding_class(self._engine)
        self.observation_space = unfolding.space(self.scenario, self._engine)
        self._blast: BlastInProgress | None = None
        self._constant: dict[str, Any] = {}
        self._target_s = 0.0
        self._window: Window | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Set up a blast; see the class for the options.

        Raises:
            BlastEnvError: If an option is unknown, or the layout or the charge does not fit.
        """
        super().reset(seed=seed)
        drawn_seed = int(self.np_random.integers(2**31)) if seed is None else seed
        blast = self._lay_out(drawn_seed, checked_options(options, _OPTIONS))
        self._blast, self._target_s = blast, blast.time_s
        layout = check_layout(self.scenario, blast.layout)
        self._constant = {
            "seed": drawn_seed,
            "scenario_hash": self.scenario.content_hash,
            "charge_position_m": blast.site.charge.position_m,
            "charge_tnt_kg": blast.site.charge.tnt_kg,
            "layout": LayoutState(self.scenario, layout).catalogue.table(layout),
        }
        if self.render_mode == "human":
            self.render()
        return blast.observe(), self._information(blast)

    def step(self, action: np.int64 | int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advance the blast by `step_s`; the action is always 0.

        Raises:
            gymnasium.error.InvalidAction: If the action is another one.
            gymnasium.error.ResetNeeded: If `reset` has not been called, or the run has ended.
        """
        if not self.action_space.contains(action):
            raise gym.error.InvalidAction(f"action is {action!r}, must be 0")
        blast = self._blast
        if blast is None or blast.end_reason is not None:
            raise gym.error.ResetNeeded("the blast has not been laid out or has ended: call reset")
        before = blast.impulse
        self._target_s += self.step_s
        blast.advance(self._target_s)
        observation, reward = blast.observe(), before - blast.impulse
        terminated = blast.end_reason is not None
        if self.render_mode == "human":
            self.render()
        return observation, reward, terminated, False, self._information(blast)

    @property
    def module_ids(self) -> tuple[str, ...]:
        """Names of the modules of the structures, in the order of the observation."""
        return self._begun.module_ids

    @property
    def collisions(self) -> tuple[dict[str, Any], ...]:
        """The collisions of the last step; none with gas."""
        return self._begun.collisions

    def result(self) -> "BlastResult | GasResult":
        """Return the result of the ended blast, as `blast_env.simulate` does.

        Raises:
            gymnasium.error.ResetNeeded: If `reset` has not been called.
            ValueError: If the run has not ended.
        """
        return self._begun.result()

    def render(self) -> NDArray[np.uint8] | None:
        """Return the present frame (`"rgb_array"`) or show it in a window (`"human"`)."""
        if self.render_mode is None or self._blast is None:
            return None
        frame = self._blast.frame()
        if self.render_mode == "rgb_array":
            return frame
        from blast_env.plots.window import Window

        if self._window is None:
            self._window = Window("blast-env", self.metadata["render_fps"])
        self._window.show(frame)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the window: a copy opens a new one."""
        return {**self.__dict__, "_window": None}

    @property
    def _begun(self) -> BlastInProgress:
        if self._blast is None:
            raise gym.error.ResetNeeded("there is no blast yet: call reset")
        return self._blast

    def _information(self, blast: BlastInProgress) -> dict[str, Any]:
        """Return the information, whose keys are always the same."""
        ended = blast.end_reason is not None
        return {
            **self._constant,
            "layout": self._constant["layout"].copy(),
            **blast.information(),
            "end_reason": str(blast.end_reason) if ended else "",
            "digest": blast.result().digest if ended else "",
        }

    def _lay_out(self, seed: int, options: Mapping[str, Any]) -> BlastInProgress:
        layout = check_layout(self.scenario, options.get("layout", self.layout))
        position_m = options.get("charge_position_m")
        fixed = ResetOptions.from_mapping({"charge_position_m": position_m})
        charge = fixed.charge(draw_threat(self.scenario, seed))
        blast = self._engine.blast(self.scenario, layout, seed, charge)
        made: BlastInProgress = _unfolding_class(self._engine)(blast)
        return made
