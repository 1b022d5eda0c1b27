"""Placement by hand, with keyboard and mouse, or with the keys of `gymnasium.utils.play`."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Final

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from blast_env.envs.actions import ACTIONS
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.observations import Array
from blast_env.errors import BlastEnvError
from blast_env.geometry import Cell, Layout
from blast_env.scenario.catalogue import Catalogue

if TYPE_CHECKING:  # a window is an optional extra
    from blast_env.rendering.window import Input, Window

KEYS: Final = (
    "arrow keys or mouse: choose a cell; space or left click: place; Tab or right click: next item"
    " or turn it; Backspace: take the last one back; Return: set the charge off, and after the"
    " blast a new episode; Escape: end"
)
"""Explanation of the keys of `play`."""


class Key(IntEnum):
    """The actions of `CursorControl`."""

    NOTHING = 0
    UP = 1
    DOWN = 2
    LEFT = 3
    RIGHT = 4
    NEXT = 5
    PLACE = 6
    FINISH = 7


_MOVES: Final = {
    Key.UP: (1, 0),
    Key.DOWN: (-1, 0),
    Key.LEFT: (0, -1),
    Key.RIGHT: (0, 1),
}


@dataclass(frozen=True)
class Cursor:
    """The outline of the next placement.

    Attributes:
        catalogue: The catalogue of modules or pieces.
        variant: Index of the variant to place.
        cell: Its lower left cell.
    """

    catalogue: Catalogue
    variant: int = 0
    cell: Cell = (0, 0)

    @classmethod
    def of(cls, env: BlastBarrierEnv) -> "Cursor":
        """Return the cursor for a new episode: in the middle of the zone."""
        catalogue = env.placement.catalogue
        rows, columns = catalogue.shape
        return cls(catalogue, 0, (rows // 2, columns // 2))

    @property
    def action(self) -> int:
        """The action that places it."""
        return self.catalogue.action(self.catalogue.element_at(self.variant, *self.cell))

    def moved(self, up: int, right: int) -> "Cursor":
        """Return the cursor moved by a number of cells, at most to the edge of the zone."""
        rows, columns = self.catalogue.shape
        row, column = self.cell[0] + up, self.cell[1] + right
        return replace(self, cell=(min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)))

    def with_next(self) -> "Cursor":
        """Return the cursor with the next orientation or item."""
        return replace(self, variant=(self.variant + 1) % len(self.catalogue.variants))


def barrier_env(env: gym.Env[Any, Any]) -> BlastBarrierEnv:
    """Return the barrier environment within wrappers.

    Raises:
        BlastEnvError: If it is another environment, or its render mode or action space does not
            suit playing.
    """
    inner = env.unwrapped
    if not isinstance(inner, BlastBarrierEnv):
        raise BlastEnvError(f"env is {env}, must be a BlastBarrier environment: nothing is placed")
    if inner.render_mode != "rgb_array":
        raise BlastEnvError(f'render_mode is {inner.render_mode!r}, must be "rgb_array" to play')
    if inner.task.actions != ACTIONS["place"]:
        raise BlastEnvError(f'action is {inner.task.actions}, must be "place" to play')
    return inner


_FIRST_REPEAT: Final = 8  # steps of a held key before it repeats
_REPEAT_EVERY: Final = 2


class CursorControl(gym.Wrapper[Array, np.int64, Array, np.int64]):
    """Few actions instead of one per cell: they move a cursor and place its outline.

    The actions are those of `Key`. Moves, and illegal placements, are no steps of the environment
    and have a reward of 0. A repeated action is a held key: it counts at once, and a move again
    after eight steps, then in every second step. `get_keys_to_action` has the keys for
    `gymnasium.utils.play`:

        play(CursorControl(gym.make("BlastBarrier-v0", render_mode="rgb_array", show_blast=True)))

    Args:
        env: A barrier environment with `render_mode="rgb_array"` and `action="place"`.

    Raises:
        BlastEnvError: If it is another environment.
    """

    def __init__(self, env: gym.Env[Array, np.int64]) -> None:
        super().__init__(env)
        self._inner = barrier_env(env)
        self.action_space = spaces.Discrete(len(Key))
        self.taken: list[int] = []
        self._last: tuple[Array, dict[str, Any]] | None = None
        self._cursor: Cursor | None = None
        self._held = (Key.NOTHING, 0)

    def get_keys_to_action(self) -> dict[tuple[int, ...], int]:
        """Return the actions of the keys, by their numbers in pygame."""
        from blast_env.rendering.window import KEY_NUMBERS

        return {(KEY_NUMBERS[name],): int(key) for name, key in _PLAY_KEYS.items()}

    def action_masks(self) -> Array:
        """Return the mask of actions with an effect now, (actions,)."""
        masks = np.ones(len(Key), dtype=np.bool_)
        legal = self._inner.action_masks()
        masks[Key.PLACE] = self._cursor is not None and legal[self._cursor.action]
        return masks

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode, with the cursor in the middle of the zone."""
        self._last = self.env.reset(seed=seed, options=options)
        self._held, self.taken = (Key.NOTHING, 0), []
        self.point(Cursor.of(self._inner))
        return self._last[0], self._information(self._last[1])

    def step(self, action: np.int64) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Move the cursor, place its outline, or finish.

        Raises:
            gymnasium.error.InvalidAction: If the action is not in the action space.
            gymnasium.error.ResetNeeded: If `reset` has not been called.
        """
        if not self.action_space.contains(action):
            raise gym.error.InvalidAction(f"action is {action!r}, must be in {self.action_space}")
        film_is_on = self._last is not None and self._inner.charge_has_gone_off
        return self.press(Key.FINISH if film_is_on else self._counted(Key(int(action))))

    @property
    def cursor(self) -> Cursor:
        """The outline of the next placement.

        Raises:
            gymnasium.error.ResetNeeded: If `reset` has not been called.
        """
        if self._cursor is None:
            raise gym.error.ResetNeeded("there is no episode yet: call reset")
        return self._cursor

    def press(self, key: Key) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Apply a key at once, without the delay of held keys; otherwise as `step`."""
        cursor = self.cursor
        assert self._last is not None  # since there is a cursor
        if key == Key.FINISH:
            return self.take(cursor.catalogue.finish)
        if key == Key.PLACE and self._inner.action_masks()[cursor.action]:
            return self.take(cursor.action)
        if key == Key.NEXT:
            self.point(cursor.with_next())
        elif key in _MOVES:
            self.point(cursor.moved(*_MOVES[key]))
        return self._last[0], 0.0, False, False, self._information(self._last[1])

    def _counted(self, key: Key) -> Key:
        """Return the key, or `Key.NOTHING` while it is held and does not repeat."""
        held, steps = self._held
        steps = steps + 1 if key == held else 0
        self._held = (key, steps)
        again = steps >= _FIRST_REPEAT and steps % _REPEAT_EVERY == 0 and key in _MOVES
        return key if steps == 0 or again else Key.NOTHING

    def take(self, action: int) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Take an action of the wrapped environment, and add it to `taken`."""
        self.taken.append(action)
        observation, reward, ended, truncated, info = self.env.step(np.int64(action))
        self._last = observation, info
        return observation, reward, ended, truncated, self._information(info)

    def point(self, cursor: Cursor) -> None:
        """Set the cursor, and mark it in the frames."""
        self._cursor = cursor
        self._inner.mark(cursor.action)

    def _information(self, info: dict[str, Any]) -> dict[str, Any]:
        """Return the information with the action mask of this wrapper."""
        return info | {"action_mask": self.action_masks().astype(np.int8)}


_PLAY_KEYS: Final = {
    "up": Key.UP,
    "w": Key.UP,
    "down": Key.DOWN,
    "s": Key.DOWN,
    "left": Key.LEFT,
    "a": Key.LEFT,
    "right": Key.RIGHT,
    "d": Key.RIGHT,
    "tab": Key.NEXT,
    "space": Key.PLACE,
    "return": Key.FINISH,
}
_GAME_KEYS: Final = _PLAY_KEYS | {"left click": Key.PLACE, "right click": Key.NEXT}


@dataclass(frozen=True)
class Played:
    """An episode played to its end.

    Attributes:
        seed: Its seed.
        layout: The final layout.
        reduction: Its reduction of the load, as a share.
        impulse_pa_s: The impulse with it.
    """

    seed: int
    layout: Layout
    reduction: float
    impulse_pa_s: float


def play(env: gym.Env[Any, Any], seed: int = 0) -> Iterator[Played]:
    """Let a person place barriers with mouse and keyboard; yield the result of each episode.

    A window shows the site until it is closed; `KEYS` explains the keys. The blast is shown if the
    environment has `show_blast=True`.

    Args:
        env: A barrier environment with `render_mode="rgb_array"`.
        seed: Seed of the first episode; the others use the following ones.

    Raises:
        BlastEnvError: If it is another environment, or there is no screen.
    """
    from blast_env.rendering.window import Window

    inner = barrier_env(env)
    window = Window("blast-env", inner.metadata["render_fps"])
    try:
        while not window.closed:
            game = _Game(CursorControl(env), inner, window, seed)
            for info in game.play():
                yield Played(seed, info["layout"], info["reduction"], info["impulse_pa_s"])
            seed += 1
    finally:
        window.close()


class _Game:
    """One episode in a window.

    Args:
        control: The environment, with wrappers.
        inner: The same without wrappers.
        window: Shows the frames and collects the input.
        seed: Seed of the episode.
    """

    def __init__(
        self, control: CursorControl, inner: BlastBarrierEnv, window: "Window", seed: int
    ) -> None:
        self._control, self._inner, self._window, self._seed = control, inner, window, seed
        self._ended = self._wants_next = False
        self._info: dict[str, Any] = {}
        control.reset(seed=seed)

    def play(self) -> Iterator[dict[str, Any]]:
        """Play until the person starts another episode; yield the final information once."""
        told = False
        while not self._wants_next and self._window.show(self._control.render()):  # type: ignore[arg-type]
            if self._inner.charge_has_gone_off and not told:
                told = True
                yield self._info
            for done in self._window.inputs():
                self._react(done)
            if self._inner.charge_has_gone_off and not self._ended:  # the film is on
                self._press(Key.FINISH)

    def _react(self, done: "Input") -> None:
        """Apply an input by key or mouse; the cursor follows the mouse."""
        key = _GAME_KEYS.get(done.name)
        if done.name == "escape":
            self._window.close()
        elif self._inner.charge_has_gone_off:
            self._wants_next |= done.name == "return"
        elif done.name == "backspace":
            self._take_back()
        elif key in (None, Key.PLACE):
            cell = None if done.place_px is None else self._inner.cell_at(done.place_px)
            if cell is not None:
                self._control.point(replace(self._control.cursor, cell=cell))
            if key == Key.PLACE and (cell is not None or done.name != "left click"):
                self._press(key)
        else:
            self._press(key)

    def _take_back(self) -> None:
        """Start the episode again, and repeat all actions but the last."""
        cursor, actions = self._control.cursor, self._control.taken[:-1]
        self._control.reset(seed=self._seed)
        for action in actions:
            self._control.take(action)
        self._control.point(cursor)

    def _press(self, key: Key) -> None:
        _, _, ended, truncated, self._info = self._control.press(key)
        self._ended = ended or truncated
