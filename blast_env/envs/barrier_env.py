"""The environment `BlastBarrier-v0`: placing barriers to protect a structure."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.arrays import IntArray
from blast_env.envs.actions import ACTIONS, SUGGESTION, Actions
from blast_env.envs.arguments import (
    PlainSpec,
    ResetOptions,
    check_names,
    checked_keywords,
    strategy,
)
from blast_env.envs.episode import INVALID_ACTIONS, Episode, Episodes, IllegalActions, Task
from blast_env.envs.observable import MASK, Observable, Observation, one_of
from blast_env.envs.observations import OBSERVATIONS
from blast_env.envs.strategies import (
    REWARDS,
    EndReward,
    Reward,
    ScenarioSource,
    ThreatModel,
    find_realisations,
    find_risk,
    find_threat_model,
    scenario_source,
)
from blast_env.evaluation.engines import Engine, default_engine, find_engine
from blast_env.evaluation.evaluator import BlastStore
from blast_env.geometry import Element
from blast_env.layout import LayoutState
from blast_env.site import AnyScenario
from blast_env.site.objective import Risk
from blast_env.statistics import CVAR_LEVEL
from blast_env.values import real_number, whole_number

if TYPE_CHECKING:
    from blast_env.envs.display import Display


class BlastBarrierEnv(PlainSpec, gym.Env[Any, Any]):
    """Barriers are placed one by one, then a charge goes off, by default in the paper's model.

    ## Description
    Each action puts a barrier module, or a piece of a catalogue, on a cell of the build zone. Then
    the charge goes off. The smaller the impulse on the protected structures, the better the layout.

    ## Action space
    `MultiDiscrete([variants, rows + 1, columns])`: the variant, and row and column of its lower
    left cell. A variant is an item of the catalogue in one orientation, or a module of 0.5 m. Rows
    count from the lower edge of the build zone; the last one finishes, as `finish` does. An illegal
    action places the same item on the nearest legal cell, across the line of sight if there is one
    (`invalid_action="nearest"`): what is repeated becomes a wall.
    `action_masks()` and `info["action_mask"]` have the values that some legal placement has,
    dimension after dimension. `explain(element)` says why a placement is not legal.

    `action="place"` numbers the same placements, variant by variant and row by row, and last the
    end: `Discrete(variants * rows * columns + 1)`, with the mask of the legal ones. Other spaces
    are `Discrete`, too. `"row"` has few actions: a variant and a row across the line of sight,
    whose legal place nearest to the line is taken. With `"item_then_place"` or `"item_then_block"`
    the variant comes before the cell.

    `action="suggestion"` has few actions on any site, `Discrete(2 * rules + 1)`: at `reset` each
    rule of thumb proposes a layout against the charge that is shown, or against all places of a
    hidden one. An action places the next piece of a rule's layout that is legal, or, as many
    actions further on, all its pieces that are left and legal in their turn; the last one finishes.
    By turns they mix what rules propose. A rule that has nothing more to place is masked, and
    finishes.

    ## Observation space
    `observation="image"`: `Box(0, 255, (height, width, planes), uint8)`, planes over the site, for
    image policies. `"grid"`: the same as `Box(0, 1, (planes, rows, columns), float32)`, for
    custom networks. `"features"`: a flat vector. `"dict"`: image, vector and mask.
    `blast_env.envs.observations` lists all values.

    ## Rewards
    The rewards of an episode add up to minus the weighted impulse on the protected structures, as
    a share of that without a barrier, and the cost of illegal actions. `info["impulse_psi_s"]` has
    it in the paper's unit, `info["reward_terms"]` the terms. With `reward="terminal"` the first
    step pays -1, the impulse without a barrier; when the charge goes off, what the layout takes off
    comes back. So truncation pays as much as no barrier. With `"incremental"` each module pays its
    reduction at once. With `"relative"` there is no -1: the end pays `info["reduction"]`.

    ## Starting state
    The build zone is empty. `threat="visible"` draws one charge and shows it; `"hidden"` draws
    `threats` charges and shows their possible places. A vehicle brings its charge to the worst
    place that the layout allows. The seed of `reset` determines everything. Options of `reset`:
    `charge_position_m`, `tnt_kg`, `charge_height_m`, `layout`, `blast_seed`.

    ## Episode end
    Terminated when the agent finishes, nothing more can be placed, an illegal action that changed
    nothing is repeated at once, or after `invalid_action_limit` of them. At the end `info` has the
    impulses with and without the barrier, `reduction`, `layout`, charges and seeds of the blasts.

    ## Arguments
    See `__init__`.

    >>> import gymnasium as gym, blast_env
    >>> env = gym.make("BlastBarrier-v0", threat="visible", realisations=2)
    >>> observation, info = env.reset(seed=0, options={"charge_position_m": (5.0, 15.0)})
    >>> observation.shape, env.action_space
    ((60, 80, 9), MultiDiscrete([ 1 41 16]))
    >>> env.unwrapped.explain((18, 3))
    'cell (18, 3) must stay empty: the path from the road to the door must stay open'
    >>> for row in (10, 12, 14, 16, 22, 24, 26, 28):
    ...     for cell in ((row, 0), (row + 1, 0)):
    ...         observation, reward, ended, _, info = env.step((0, *cell))
    >>> ended, info["reward_terms"]["impulse"] == info["reduction"] > 0.0
    (True, True)

    ## Version history
    - v0: first version. Since 2026-11: `invalid_action`; before, as `"penalty"`.

    ## Notes
    The validity of a result depends on the engine. The particle model has no heights, overrates
    walls and is noisy; `"gas"` is three-dimensional and the basis for statements about protection.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (Gymnasium's declaration)
        "render_modes": ["human", "rgb_array", "ansi"],
        "render_fps": 25,
    }

    @checked_keywords
    def __init__(
        self,
        scenario: AnyScenario | ScenarioSource = "courtyard",
        reward: str | Reward | EndReward = "terminal",
        observation: str | Observation = "image",
        action: str | Actions = "dimensions",
        threat: str | ThreatModel = "visible",
        threats: int | None = None,
        realisations: int | None = None,
        risk: str | Risk | None = None,
        cvar_level: float = CVAR_LEVEL,
        invalid_action: str = "nearest",
        invalid_action_cost: float = 0.001,
        invalid_action_limit: int = 100,
        engine: str | Engine | None = None,
        cell_m: float | None = None,
        cache: str | Path | BlastStore | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Make an environment from the keywords of `gymnasium.make`.

        Args:
            scenario: Bundled name, path of a scenario file, a `Scenario` or its plain data; or
                `"sites"`, which draws a generated site at every `reset`, or any `ScenarioSource`.
            reward: `"terminal"`, `"incremental"`, `"relative"`, or a `Reward` or `EndReward`.
            observation: `"image"`, `"grid"`, `"features"`, `"dict"`, or an `Observation`.
            action: `"dimensions"`, `"place"`, `"row"`, `"item_then_place"`, `"item_then_block"`,
                `"suggestion"`, or `Actions`.
            threat: `"visible"`, `"hidden"`, or a `ThreatModel`.
            threats: Number of hidden charges per episode; default 16.
            realisations: Number of blasts per charge; default 2 for a visible charge, 1 for
                hidden ones, which differ anyway. It is always 1 for engines without noise.
            risk: `"mean"`, `"cvar"`, `"worst"`, or a `Risk`, which gets loads in SI units; by
                default that of the scenario's objective.
            cvar_level: The CVaR is the mean over the worst share 1 - `cvar_level` of the charges.
            invalid_action: `"nearest"` or `"penalty"`: whether the nearest legal place of the same
                item takes the place of an illegal one.
            invalid_action_cost: Cost of an illegal action without effect, in the unit of the
                reward: 0.001 is a thousandth of the impulse without a barrier.
            invalid_action_limit: Number of illegal actions without effect that ends the episode.
            engine: Name of an engine, or an engine; by default `"event"`, the paper's model, and
                `"gas"` for sites that state heights. `"event"` and `"pymunk"` are for studying that
                model, for cheap tests of learning methods, for a first look. `"gas"` is the basis
                for decisions: no calibration, one realisation per charge, a second or more per
                blast; there is no `impulse_sim`. `"surrogate"` approximates gas dynamics.
            cell_m: Side of the cells of gas dynamics; default 0.5 m.
            cache: Folder of a store of blasts, which other processes and later runs may use too,
                or a `BlastStore`; by default blasts are only in memory.
            render_mode: `None`, `"human"`, `"rgb_array"` or `"ansi"`.

        Raises:
            BlastEnvError: If an argument is invalid; the message names it and its bounds.
        """
        source = scenario_source(scenario)
        representative = source.representative
        found = find_engine(engine or default_engine("BlastBarrier-v0", representative), cell_m)
        if render_mode is not None:
            check_names("render mode", [render_mode], self.metadata["render_modes"])
        self.render_mode = render_mode
        check_names("invalid_action", [invalid_action], INVALID_ACTIONS)
        self.task = Task(
            source=source,
            threat_model=find_threat_model(threat, threats),
            realisations=find_realisations(realisations, threat, found),
            risk=find_risk(risk, cvar_level),
            observation=strategy("observation", observation, OBSERVATIONS),
            actions=strategy("action", action, ACTIONS),
            reward=strategy("reward", reward, REWARDS, (Reward, EndReward)),
            illegal=IllegalActions(
                invalid_action == "nearest",
                real_number("invalid_action_cost", invalid_action_cost, 0.0, 1e6),
                whole_number("invalid_action_limit", invalid_action_limit, 1, 1_000_000),
            ),
            engine=found,
            store=BlastStore.of(cache),
        )
        self.episodes = Episodes(self.task, 1)
        self.action_space = self.episodes.code.space
        self.observation_space = self.task.observation.space(representative)
        if isinstance(self.observation_space, spaces.Dict):
            mask = spaces.MultiBinary(spaces.flatdim(self.action_space))
            self.observation_space = spaces.Dict({**self.observation_space, MASK: mask})
        elif self.task.shows_suggestions:
            count = len(self.task.rules) * len(SUGGESTION)
            self.observation_space = _longer(self.observation_space, count)
        self._display: Display | None = None
        if render_mode is not None:
            self._display = _display(render_mode, self.metadata["render_fps"])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Draw scenario and charges and clear the build zone; see the class for the options.

        Raises:
            UnknownNameError: If there is no such option; the message has the nearest one.
            LayoutError: If the layout of the options does not fit the build zone.
            BlastEnvError: If another option is invalid, or the size of the drawn scenario differs
                from that of the representative one.
        """
        super().reset(seed=seed)
        self.episodes.begin([0], [self.np_random], [ResetOptions.from_mapping(options)])
        self._show()
        return self._observation(), self.episodes.information(0)

    def step(
        self, action: np.int64 | int | Sequence[int] | IntArray
    ) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Make a choice, place a module or a piece, or finish; see the class.

        Raises:
            gymnasium.error.InvalidAction: If the action is not in the action space.
            gymnasium.error.ResetNeeded: If `reset` has not been called, or the episode has ended.
        """
        self._check(action)
        self.episodes.place([0], self.episodes.code.numbers(np.array([action])))
        self.episodes.blast()
        observation = self._observation()
        reward = float(self.episodes.rewards([0])[0])
        terminated = self._episode.ended
        info = self.episodes.information(0)
        self._show()
        return observation, reward, terminated, False, info

    def _check(self, action: np.int64 | int | Sequence[int] | IntArray) -> None:
        if not self.action_space.contains(action):
            raise gym.error.InvalidAction(f"action is {action!r}, must be in {self.action_space}")
        if self._episode.ended:
            raise gym.error.ResetNeeded("the episode has ended: call reset")

    def _observation(self) -> Any:
        return one_of(self.episodes.observe([0], self.observation_space), 0)

    @property
    def finish(self) -> Any:
        """The action that finishes."""
        return self.episodes.code.finish

    @property
    def suggestions(self) -> tuple[str, ...]:
        """What the actions of `"suggestion"` place, in their order; nothing of other spaces.

        The title of a rule stands for its next piece; behind all of them come their rests.
        """
        rules = self.task.rules
        return (*rules, *(f"{title}: all the rest" for title in rules))

    def action_masks(self) -> NDArray[np.bool_]:
        """Return the mask of actions that are legal now, (length,); see `ActionCode.masks`.

        Raises:
            gymnasium.error.ResetNeeded: If `reset` has not been called.
        """
        self._episode  # noqa: B018  # refuses a call before `reset`
        mask: NDArray[np.bool_] = self.episodes.masks([0])[0].astype(np.bool_)
        return mask

    def explain(self, element: Element) -> str | None:
        """Return a sentence with the reason why an element cannot be placed, `None` if it can.

        Args:
            element: (row, column) of the build zone; with a catalogue, a piece.

        Raises:
            LayoutError: If it is neither.
        """
        return self.placement.explain(element)

    def explain_vehicles(self) -> tuple[str, ...]:
        """Return a sentence per vehicle with its present stand-off, way and speed.

        Raises:
            gymnasium.error.ResetNeeded: If `reset` has not been called.
        """
        return self.placement.explain_vehicles()

    @property
    def placement(self) -> LayoutState:
        """The modules or pieces placed so far."""
        self._episode  # noqa: B018  # refuses a call before `reset`
        return self.episodes.layouts.state(0)

    @property
    def observable(self) -> Observable:
        """The observable part of the episode before the charge goes off."""
        return self._episode.shown.observable

    def render(self) -> Any:
        """Return a frame (`"rgb_array"`) or text (`"ansi"`), or show a frame (`"human"`)."""
        if self._display is None or not self.episodes.running:
            return None
        return self._display.render(self._episode, self.placement)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._display is not None:
            self._display.close()

    def _show(self) -> None:
        if self._display is not None and self.render_mode == "human":
            self._display.show(self._episode, self.placement)

    @property
    def _episode(self) -> Episode:
        if not self.episodes.running:
            raise gym.error.ResetNeeded("there is no episode yet: call reset")
        return self.episodes.running[0]


def _longer(vectors: spaces.Space[Any], count: int) -> spaces.Box:
    """Return the space of vectors that go on with some more values from 0 to 1."""
    assert vectors.shape is not None
    return spaces.Box(0.0, 1.0, (vectors.shape[0] + count,), np.float32)


def _display(render_mode: str, frames_per_s: int) -> "Display":
    from blast_env.envs.display import Display  # only where somebody looks

    return Display(render_mode, frames_per_s)
