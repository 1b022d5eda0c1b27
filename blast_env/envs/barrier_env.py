"""The environment `BlastBarrier-v0`: placing barriers to protect a structure."""

from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.engines import Engine, find_engine
from blast_env.envs.arguments import (
    ResetOptions,
    check_names,
    checked_keywords,
    strategy,
)
from blast_env.envs.display import Display
from blast_env.envs.episode import (
    Episode,
    IllegalActions,
    Task,
    find_realisations,
    find_risk,
    find_threat_model,
    total,
)
from blast_env.envs.observations import OBSERVATIONS, Array, Observable, Observation
from blast_env.envs.spec import PlainSpec
from blast_env.envs.strategies import (
    REWARDS,
    Reward,
    ScenarioSource,
    ThreatModel,
    scenario_source,
)
from blast_env.errors import BlastEnvError, value_text
from blast_env.evaluation.evaluator import BlastAsked, Evaluators
from blast_env.evaluation.store import BlastCache
from blast_env.geometry import Cell, Element
from blast_env.scenario import AnyScenario, Placement
from blast_env.statistics import CVAR_LEVEL, Risk
from blast_env.values import real_number, whole_number


class BlastBarrierEnv(PlainSpec, gym.Env[Array, np.int64]):
    """Barriers are placed one by one to shield a structure; then a charge goes off.

    ## Description
    A site has structures, some of them protected, places where a charge may be, and a build zone
    with a stock of barrier modules. One module after the other is put on a cell of the zone. When
    the stock is used up, or the agent has enough, the charge goes off, and the less impulse the
    protected structures take, the better the layout was. The zone's conditions (keep-outs,
    clearance, budget, an access way that must stay open) are those of the scenario file. Where the
    zone has a catalogue, pieces of its items are placed instead of single modules: walls of a
    length, a height and a price, turned or not.

    ## Action space
    `Discrete(rows * columns + 1)`: action `row * columns + column` places a module on that cell
    of the build zone (row 0 at the bottom, column 0 on the left); the last action finishes.
    Which actions are legal (to finish always is) say `info["action_mask"]`, int8 as
    `action_space.sample(mask=...)` wants it, and `action_masks()`, bool as MaskablePPO does.
    `explain(cell)` says in a sentence why a cell is not available.

    With a catalogue, `Discrete(variants * rows * columns + 1)`: a variant is an item in one
    orientation, item by item, not turned before turned, and its lower left cell is what the
    action names. `placement.catalogue` translates: `element(action)`, `action(piece)`,
    `variants`. `explain` takes a piece (`blast_env.scenario.Piece`).

    ## Observation space
    By the argument `observation`:

    - `"grid"`: `Box(0, 1, (9, rows, columns), float32)`, planes over the site with one square a
      module of 0.5 m; channel by channel in `blast_env.envs.observations.GridObservation`;
    - `"image"`: `Box(0, 255, (height, width, 9), uint8)`, the same planes as an image, 255 for 1,
      large enough for image policies such as stable-baselines3's `CnnPolicy`
      (`ImageObservation`);
    - `"grid_with_load"`: a tenth plane, the load on each module of the structures without a
      barrier (`GridWithLoadObservation`), for four more blasts a charge;
    - `"features"`: `Box(0, 1, (features,), float32)`, a flat vector, value by value in
      `blast_env.envs.observations.FeaturesObservation`.

    With a catalogue each of them shows more: heights, the items with what is left of them, and
    which piece may be placed where. Those planes and values come last.

    ## Rewards
    The rewards of an episode add up to minus the impulse on the protected structures, -I, and the
    cost of illegal actions. A step's reward is the sum of terms, all in psi s and in
    `info["reward_terms"]`:

    - `impulse`: over an episode, minus the calibrated impulse per area of the protected
      structures, times their weights, added up. Where the scenario's objective counts peaks, the
      term is `peak` (psi), and where it counts both, `load` (no unit). `reward="terminal"` pays it
      when the charge goes off. With `"incremental"` the first step pays -I(no barrier) (with the
      option `layout`, of that layout), and a module earns I(before) - I(after) at once; the sum
      over an episode is the same (not if it is discounted), for a set of blasts a module.
    - `deposit`, with `"terminal"`: the first step pays -2 I(no barrier), which comes back when
      the charge goes off.
    - `illegal_actions`: an illegal action changes nothing, is counted in
      `info["illegal_actions"]`, and costs `illegal_action_cost`.

    A time limit (`gymnasium.make(..., max_episode_steps=)`, `TimeLimit`) may cut an episode off
    before the charge goes off. That never pays better than to finish with the same modules: with
    `"incremental"` it pays the same, with `"terminal"` the deposit is lost.

    ## Starting state
    No module stands. The scenario's distribution gives position and mass of the charge:
    `threat="visible"` draws one, which the observation shows; `threat="hidden"` draws `threats` of
    them, the observation shows only where charges may be, and the impulse is that of one layout
    against all, as their mean, CVaR or worst (`risk`). Each charge goes off `realisations` times,
    with other seeds of fan and air; the impulse is the mean. Charges and seeds follow from the seed
    of `reset` alone, so that with one seed all layouts meet the same blasts.

    The charge of a vehicle is the exception: it goes off at the worst place that the layout lets
    the vehicle reach, without a barrier at the worst place of the empty site; of several threats of
    one vehicle the second is at its second worst place, and so on. Nothing is drawn, and nothing is
    hidden but what the layout decides. With `"charge_position_m"` no vehicle brings the charge.

    Options of `reset`: `"charge_position_m"`, (x, y) of every charge; `"tnt_kg"`, the mass of
    every charge; `"charge_height_m"`, the height of its centre above the ground (the particle
    engines know no height); `"layout"`, cells that hold a module, or pieces, from the start;
    `"blast_seed"`, the seed of the first blast, the others have the following ones.

    ## Episode end
    Terminated when the agent finishes, when nothing more can be placed, or after
    `illegal_action_limit` illegal actions. Never truncated by itself.

    ## Information
    Always `action_mask` and `illegal_actions`; after a step `reward_terms`; at the end
    `impulse_psi_s`, `impulse_pa_s` and `impulse_sim` (simulation units), as the reward counts
    them; `unprotected_impulse_pa_s`, the same blasts without a barrier; with gas dynamics `peak_pa`
    and `unprotected_peak_pa`, the largest overpressures; `reduction`, the share
    that the layout takes off what counts (NaN if nothing arrives without a barrier); `layout`,
    `scenario_hash`, `charges` (position, kg TNT, height; a vehicle's where the layout let it come)
    and `blast_seeds` (a tuple a charge) to repeat the blasts; `calibration` and
    `calibration_in_range`; `blasts`, `cache_hits` (loads that needed no blast) and
    `cache_hit_rate`, their share, counted since the environment was made.

    ## Arguments
    - `scenario`: bundled name, path of a scenario file, a `Scenario` or its plain data; or
      `"sites"`, which draws a generated site at every `reset`, or any other `ScenarioSource`
      (`blast_env.envs.strategies`).
    - `reward`: `"terminal"`, `"incremental"`, or a `Reward` (`blast_env.envs.strategies`).
    - `observation`: see above, or an `Observation` (`blast_env.envs.observations`).
    - `threat`: `"visible"`, `"hidden"`, or a `ThreatModel` (`blast_env.envs.strategies`).
    - `threats`: how many charges are drawn when they are hidden; 16 unless given.
    - `realisations`: blasts for each charge; 2 unless given, and 1 where charges are hidden, since
      these differ anyway.
    - `risk`: `"mean"`, `"cvar"`, `"worst"`, or a `Risk` (`blast_env.statistics`); as the scenario's
      objective says unless given.
    - `cvar_level`: the worst share 1 - `cvar_level` of the charges makes the CVaR.
    - `illegal_action_cost`: in the unit of the reward; 0.001 (psi s: 6.9 Pa s) unless given.
    - `illegal_action_limit`: illegal actions that end the episode; 100 unless given.
    - `engine`: name of an engine, or an engine. `"event"` and `"pymunk"` run the particle model:
      for studying it, for learning methods cheaply, for a first look. `"gas"` (id
      `BlastBarrierGas-v0`) is what a decision can rest on: three dimensions, loads without a
      calibration, one realisation a charge since there is no noise, a second or more a blast;
      `impulse_sim` is NaN there.
    - `cell_m`: side of the cells of gas dynamics; 0.5 m unless given.
    - `cache`: where blasts are remembered beside the memory of the environment: a folder, which
      other processes and later runs may use too, or a cache (`blast_env.evaluation.store`).
    - `render_mode`: `None`, `"human"`, `"rgb_array"` or `"ansi"`.
    - `show_blast`: whether an episode goes on after the charge has gone off, for as many steps as
      the film of the blast has frames (some 250), whatever the actions: for a window, and for
      `gymnasium.wrappers.RecordVideo`. The reward is paid before.

    >>> import gymnasium as gym, blast_env
    >>> env = gym.make("BlastBarrier-v0", threat="visible", realisations=2)
    >>> observation, info = env.reset(seed=0, options={"charge_position_m": (5.0, 15.0)})
    >>> observation.shape, env.action_space
    ((9, 60, 80), Discrete(641))
    >>> env.unwrapped.explain((18, 3))
    'cell (18, 3) must stay empty: the path from the road to the door must stay open'
    >>> for row in (10, 12, 14, 16, 22, 24, 26, 28):
    ...     for cell in ((row, 0), (row + 1, 0)):
    ...         observation, reward, ended, _, info = env.step(cell[0] * 16 + cell[1])
    >>> ended, info["reward_terms"]["impulse"] == -info["impulse_psi_s"]
    (True, True)
    >>> 0.0 < info["reduction"] < 1.0
    True

    ## Version history
    - v0: first version.

    ## Notes
    From seed to seed the impulse with one layout scatters by 8 to 11 % of that without a barrier,
    and the reduction by 6 to 7 percentage points; hidden charges differ much more. The spread
    between random layouts of scattered modules (in brackets: of straight walls) over the scatter
    of comparisons on the same blasts, by the number of blasts averaged, each of another charge
    where charges are hidden:

    | scenario, charge | 1 | 2 | 4 | 8 | 16 |
    |---|---|---|---|---|---|
    | courtyard, visible | 2.7 (3.5) | 3.8 (5.0) | 5.3 (7.0) | 7.5 (10) | 11 (14) |
    | perimeter_gate, visible | 3.4 (3.6) | 4.8 (5.2) | 6.7 (7.3) | 9.5 (10) | 13 (15) |
    | street_junction, visible | 2.9 (3.9) | 4.0 (5.5) | 5.7 (7.7) | 8.1 (11) | 11 (15) |
    | courtyard, hidden | 0.9 (1.0) | 1.3 (1.4) | 1.9 (2.0) | 2.6 (2.9) | 3.7 (4.0) |
    | perimeter_gate, hidden | 0.8 (1.1) | 1.2 (1.6) | 1.7 (2.2) | 2.4 (3.1) | 3.3 (4.4) |
    | street_junction, hidden | 0.7 (0.6) | 1.0 (0.9) | 1.4 (1.2) | 1.9 (1.8) | 2.8 (2.5) |

    (`python -m studies.noise reward --layouts 12 --charges 12 --seeds 4`.) Hence 2 realisations
    of a visible charge and 16 hidden charges: the spread is then twice the scatter or more.

    An episode costs `threats * realisations` blasts, and as many without a barrier.

    The largest impulse with any of 144 random layouts, whole and unfinished, was 1.37 times that
    without a barrier, blast by blast (`python -m studies.noise deposit`): hence the deposit.

    Two-dimensional: nothing flies over a wall. The calibration holds for the distances and the
    charge mass that it was made for (`calibration_in_range`) and for a facade in the open; how far
    behind a barrier it can be believed, docs/engineers/validity.md says. The sum of impulses
    over several protected structures is a score, not a load.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (Gymnasium's declaration)
        "render_modes": ["human", "rgb_array", "ansi"],
        "render_fps": 25,
    }

    @checked_keywords
    def __init__(
        self,
        scenario: AnyScenario | ScenarioSource = "courtyard",
        reward: str | Reward = "terminal",
        observation: str | Observation = "grid",
        threat: str | ThreatModel = "visible",
        threats: int | None = None,
        realisations: int | None = None,
        risk: str | Risk | None = None,
        cvar_level: float = CVAR_LEVEL,
        illegal_action_cost: float = 0.001,
        illegal_action_limit: int = 100,
        engine: str | Engine = "event",
        cell_m: float | None = None,
        cache: str | Path | BlastCache | None = None,
        render_mode: str | None = None,
        show_blast: bool = False,
    ) -> None:
        found = find_engine(engine, cell_m)
        if render_mode is not None:
            check_names("render mode", [render_mode], self.metadata["render_modes"])
        self.render_mode = render_mode
        self.reward_strategy = strategy("reward", reward, REWARDS)
        self.illegal = IllegalActions(
            real_number("illegal_action_cost", illegal_action_cost, 0.0, 1e6),
            whole_number("illegal_action_limit", illegal_action_limit, 1, 1_000_000),
        )
        self.task = Task(
            source=scenario_source(scenario),
            threat_model=find_threat_model(threat, threats),
            realisations=find_realisations(realisations, threat, found),
            risk=find_risk(risk, cvar_level),
            observation=strategy("observation", observation, OBSERVATIONS),
            evaluators=Evaluators(found, cache),
        )
        representative = self.task.source.representative
        self.task.evaluators.of(representative)  # so that a wrong engine fails here, not later
        self.action_space = spaces.Discrete(representative.zone.catalogue.finish + 1)
        self.observation_space = self.task.observation.space(representative)
        self.show_blast = show_blast
        if show_blast and render_mode not in ("human", "rgb_array"):
            raise BlastEnvError(
                f"show_blast is True, but render_mode {render_mode!r} shows nothing:"
                " must be 'human' or 'rgb_array'"
            )
        self._display = Display(render_mode, self.metadata["render_fps"])
        self._begun: Episode | None = None
        self._film_info: dict[str, Any] | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Draw scenario and charges and clear the build zone; see the class for the options.

        Raises:
            UnknownNameError: If there is no such option; the message names the nearest one.
            LayoutError: If the layout of the options does not fit the build zone.
            BlastEnvError: If another option is of no use, or the scenario that was drawn is of
                another size than the first.
        """
        super().reset(seed=seed)
        self._display.stop_film()
        self._film_info = None
        episode = self.task.start(self.np_random, ResetOptions.from_mapping(options))
        self._begun = episode
        if self.render_mode == "human":
            self._display.show(episode)
        return episode.observe(), episode.information()

    def step(self, action: np.int64 | int) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Place a module, or finish; see the class.

        Raises:
            gymnasium.error.InvalidAction: If the action is not in the action space.
            gymnasium.error.ResetNeeded: If `reset` has not been called, or the episode has ended.
        """
        if not self.action_space.contains(action):
            raise gym.error.InvalidAction(
                f"action is {value_text(action)}, must be in {self.action_space}"
            )
        episode = self._episode
        if episode.ended:
            return self._show_blast()
        terms = episode.act(int(action), self.reward_strategy, self.illegal)
        info = episode.information() | {"reward_terms": terms}
        if episode.ended:
            info |= episode.final_information(self.task.evaluators)
        self._film_info = info if episode.ended and self.show_blast else None
        if self._film_info is not None:
            self._display.begin_film(episode)
        if self.render_mode == "human":
            self._display.show(episode)
        ended = episode.ended and self._film_info is None
        return episode.observe(), total(terms), ended, False, info

    def _show_blast(self) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Go on to the next frame of the film, which pays nothing more."""
        if self._film_info is None:
            raise gym.error.ResetNeeded("the episode has ended: call reset")
        terms = dict.fromkeys(self._film_info["reward_terms"], 0.0)
        info = deepcopy(self._film_info) | {"reward_terms": terms}
        ended = not self._display.go_on_with_film()
        if ended:
            self._film_info = None
        if self.render_mode == "human":
            self._display.show(self._episode)
        return self._episode.observe(), 0.0, ended, False, info

    def blasts_due(self, action: np.int64 | int) -> tuple[BlastAsked, ...]:
        """Return the blasts that `step` asks for if this action ends the episode; else none.

        So whoever steps many environments can run the blasts of all of them together, and leave
        the loads in the `cache` that they share (`Evaluators.run_ahead`). What an observation asks
        for, or a reward before the end, is not among them.

        Args:
            action: As for `step`, which is still to be called.

        Raises:
            gymnasium.error.ResetNeeded: If `reset` has not been called.
        """
        return self._episode.blasts_due(int(action), self.illegal)

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which actions are legal now, (actions,).

        Raises:
            gymnasium.error.ResetNeeded: If `reset` has not been called.
        """
        return self._episode.action_mask()

    def explain(self, element: Element) -> str | None:
        """Return a sentence that says why something cannot be placed, or `None` if it can.

        Args:
            element: (row, column) of the build zone; with a catalogue, a piece.

        Raises:
            LayoutError: If it is neither.
            gymnasium.error.ResetNeeded: If `reset` has not been called.
        """
        return self.placement.explain(element)

    @property
    def placement(self) -> Placement:
        """The modules or pieces placed so far."""
        return self._episode.placement

    @property
    def observable(self) -> Observable:
        """What may be observed of the episode before the charge goes off."""
        return self._episode.observable

    def render(self) -> Any:
        """Return a frame (`"rgb_array"`) or text (`"ansi"`), or show a frame (`"human"`)."""
        return None if self._begun is None else self._display.render(self._begun)

    def blast_frames(self) -> Iterator[NDArray[np.uint8]]:
        """Return the film of the blast that ended the episode, uint8 (height, width, 3) each.

        The frames are as large as those of `render`. Of several charges, it is the worst one.

        Raises:
            gymnasium.error.ResetNeeded: If there is no episode that has ended.
        """
        if not self._episode.ended:
            raise gym.error.ResetNeeded("the charge has not gone off: finish the episode first")
        return self._display.blast_frames(self._episode)

    def get_keys_to_action(self) -> dict[tuple[int, ...], int]:
        """Tell those who call `gymnasium.utils.play` what has keys: an action a cell has none.

        Raises:
            BlastEnvError: Always; the message names the wrapper.
        """
        raise BlastEnvError(
            "every cell is an action, which is too many for a keyboard: "
            "from blast_env.envs.play import CursorControl; play(CursorControl(env))"
        )

    @property
    def charge_has_gone_off(self) -> bool:
        """Whether nothing more can be placed, and the layout has been assessed."""
        return self._episode.ended

    def mark(self, action: int | None) -> None:
        """Outline in the frames of `render` what an action would place, or nothing.

        A sentence beside it says why it may not be placed, if that is so.

        Args:
            action: The action; one that finishes is not shown.

        Raises:
            gymnasium.error.InvalidAction: If the action is not in the action space.
        """
        if action is not None and not self.action_space.contains(action):
            raise gym.error.InvalidAction(
                f"action is {value_text(action)}, must be in {self.action_space}"
            )
        self._display.marked = action

    def cell_at(self, place_px: tuple[int, int]) -> Cell | None:
        """Return the cell of the build zone at a pixel (x, y) of a frame, if there is one.

        Raises:
            gymnasium.error.ResetNeeded: If `reset` has not been called.
        """
        return self._display.cell_at(self._episode, place_px)

    def close(self) -> None:
        """Close the window, if there is one."""
        self._display.close()

    @property
    def _episode(self) -> Episode:
        if self._begun is None:
            raise gym.error.ResetNeeded("there is no episode yet: call reset")
        return self._begun
