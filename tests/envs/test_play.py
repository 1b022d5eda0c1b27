"""Placing by hand: keys, mouse, and the keys of `gymnasium.utils.play`."""

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import gymnasium as gym
import numpy as np
import pygame
import pytest
from typer.testing import CliRunner

from blast_env.cli import app
from blast_env.envs.play import CursorControl, Key, Played, play
from blast_env.errors import BlastEnvError
from blast_env.rendering.window import fit
from tests.envs.small import make, same

pytestmark = pytest.mark.slow

ROWS, COLUMNS = 8, 5
FINISH = ROWS * COLUMNS


@pytest.fixture
def control() -> CursorControl:
    env = CursorControl(make(render_mode="rgb_array"))
    env.reset(seed=1)
    return env


def inner(env: gym.Env) -> Any:
    return env.unwrapped


def tapped(env: CursorControl, *keys: Key) -> tuple:
    """Press keys one after the other, each for one step."""
    for key in keys:
        result = env.step(np.int64(key))
        if not result[2]:
            env.step(np.int64(Key.NOTHING))
    return result


def test_the_cursor_begins_in_the_middle_and_places_where_it_stands(control: CursorControl) -> None:
    tapped(control, Key.UP, Key.LEFT, Key.PLACE)
    assert inner(control).placement.cells == ((5, 1),)
    tapped(control, Key.RIGHT, Key.PLACE, Key.DOWN, Key.DOWN, Key.PLACE)
    assert inner(control).placement.cells[1:] == ((5, 2), (3, 2))


def test_the_cursor_stays_in_the_zone(control: CursorControl) -> None:
    tapped(control, *[Key.DOWN] * 20, *[Key.RIGHT] * 20, Key.PLACE)
    assert inner(control).placement.cells == ((0, 4),)


def test_a_key_that_is_held_counts_once_and_then_again_after_a_while(
    control: CursorControl,
) -> None:
    for _ in range(12):
        control.step(np.int64(Key.DOWN))
    tapped(control, Key.PLACE)
    assert inner(control).placement.cells == ((1, 2),)  # 4 - 1 at once - 2 after eight steps
    for _ in range(12):  # a held key for placing places once
        control.step(np.int64(Key.PLACE))
    assert len(inner(control).placement.cells) == 1


def test_what_moves_pays_nothing_and_what_is_not_legal_is_not_done(control: CursorControl) -> None:
    result = tapped(control, Key.LEFT, Key.LEFT)  # the hydrant, which is kept out
    assert result[1:4] == (0.0, False, False)
    assert not result[4]["action_mask"][Key.PLACE]
    result = tapped(control, Key.PLACE)
    assert result[1] == 0.0
    assert inner(control).placement.cells == ()
    assert result[4]["illegal_actions"] == 0


def test_finishing_pays_what_the_environment_pays(control: CursorControl) -> None:
    tapped(control, Key.PLACE)
    _, reward, ended, _, info = control.step(np.int64(Key.FINISH))
    env = make()
    env.reset(seed=1)
    env.step(4 * COLUMNS + 2)
    _, expected, _, _, told = env.step(FINISH)
    assert ended
    assert reward == expected
    assert info["reduction"] == told["reduction"]


def test_the_cursor_is_drawn_and_says_why_nothing_may_be_placed(control: CursorControl) -> None:
    plain = make(render_mode="rgb_array")
    plain.reset(seed=1)
    frames: list[Any] = [plain.render(), control.render()]
    tapped(control, Key.LEFT, Key.LEFT)
    frames.append(np.asarray(control.render()))
    for first, second in ((0, 1), (1, 2), (0, 2)):
        assert (frames[first] != frames[second]).any()
    inner(control).mark(None)
    assert np.array_equal(np.asarray(control.render()), frames[0])
    with pytest.raises(gym.error.InvalidAction):
        inner(control).mark(FINISH + 1)


def test_it_is_an_environment_like_others(control: CursorControl) -> None:
    control.action_space.seed(0)
    observation, _ = control.reset(seed=3)
    ended = False
    while not ended:
        observation, reward, ended, _, info = control.step(control.action_space.sample())
        assert observation in control.observation_space
        assert info["action_mask"].dtype == np.int8
        assert isinstance(reward, float)
    assert same(control.reset(seed=3)[0], make().reset(seed=3)[0])


def test_other_environments_are_refused() -> None:
    with pytest.raises(BlastEnvError, match='render_mode is None, must be "rgb_array"'):
        CursorControl(make())
    with pytest.raises(BlastEnvError, match="must be a BlastBarrier environment"):
        CursorControl(gym.make("BlastSimulator-v0", render_mode="rgb_array"))


def test_gymnasium_s_play_has_its_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    """A person taps Up, Space and Return; then the window is closed."""
    monkeypatch.setattr("matplotlib.use", lambda *_: None)  # it asks for a window of its own
    from gymnasium.utils import play as gymnasium_play

    env = CursorControl(make(render_mode="rgb_array"))
    script = [
        *_tap(pygame.K_UP),
        *_tap(pygame.K_SPACE),
        *_tap(pygame.K_RETURN),
        [pygame.event.Event(pygame.QUIT)],
    ]
    frames = iter(script)
    monkeypatch.setattr(pygame.event, "get", lambda: next(frames))
    told: list[tuple] = []
    gymnasium_play.play(env, fps=1000, seed=1, callback=lambda *step: told.append(step))
    finals = [step[6] for step in told if step[4]]
    assert [final["layout"] for final in finals] == [((5, 2),)]


def test_without_the_cursor_it_is_told_what_has_keys() -> None:
    with pytest.raises(BlastEnvError, match=r"play\(CursorControl\(env\)\)"):
        make(render_mode="rgb_array").get_keys_to_action()
    simulator = gym.make("BlastSimulator-v0")
    assert simulator.get_wrapper_attr("get_keys_to_action")() == {(pygame.K_SPACE,): 0}


def _tap(key: int) -> list[list[pygame.event.Event]]:
    return [
        [pygame.event.Event(pygame.KEYDOWN, key=key)],
        [pygame.event.Event(pygame.KEYUP, key=key)],
        [],
    ]


def person(monkeypatch: pytest.MonkeyPatch, *frames: list[tuple[int, dict[str, Any]]]) -> None:
    """Let a person do things, frame by frame; then the window is closed."""
    last: list[tuple[int, dict[str, Any]]] = [(pygame.QUIT, {})]
    left = iter([*frames, last])

    def events() -> list[pygame.event.Event]:
        return [pygame.event.Event(kind, values) for kind, values in next(left)]

    monkeypatch.setattr("blast_env.rendering.window.pygame.event.get", events)


def key(number: int) -> list[tuple[int, dict[str, Any]]]:
    return [(pygame.KEYDOWN, {"key": number})]


def click(env: gym.Env, cell: tuple[int, int], button: int = 1) -> list[tuple[int, dict[str, Any]]]:
    """Return a click on the middle of a cell, found by asking where cells are."""
    height, width, _ = np.asarray(env.render()).shape
    places = [
        (x, y)
        for x in range(0, width, 5)
        for y in range(0, height, 5)
        if inner(env).cell_at((x, y)) == cell
    ]
    pygame.display.init()
    shown_width, _ = fit((width, height), pygame.display.get_desktop_sizes()[0])
    x, y = (round(place * shown_width / width) for place in places[len(places) // 2])
    return [(pygame.MOUSEBUTTONDOWN, {"button": button, "pos": (x, y)})]


@pytest.fixture
def env() -> Iterator[gym.Env]:
    made = make(render_mode="rgb_array")
    made.reset(seed=1)
    yield made
    made.close()


def test_cells_are_found_by_their_pixels(env: gym.Env) -> None:
    height, width, _ = np.asarray(env.render()).shape
    found = {inner(env).cell_at((x, y)) for x in range(0, width, 5) for y in range(0, height, 5)}
    assert found == {None, *((row, column) for row in range(ROWS) for column in range(COLUMNS))}
    upper, lower = (click(env, (row, 0))[0][1]["pos"] for row in (ROWS - 1, 0))
    assert upper[1] < lower[1]


def test_a_person_places_with_the_mouse(env: gym.Env, monkeypatch: pytest.MonkeyPatch) -> None:
    person(
        monkeypatch,
        click(env, (2, 3)),
        click(env, (6, 0)),
        key(pygame.K_RETURN),
        [],
    )
    (played,) = play(env, seed=1)
    assert played.layout == ((2, 3), (6, 0))
    assert played.impulse_pa_s > 0.0
    assert played.seed == 1


def test_a_person_places_with_the_keys_and_takes_back(
    env: gym.Env, monkeypatch: pytest.MonkeyPatch
) -> None:
    person(
        monkeypatch,
        key(pygame.K_UP) + key(pygame.K_SPACE),
        key(pygame.K_w) + key(pygame.K_d) + key(pygame.K_SPACE),
        key(pygame.K_BACKSPACE),
        key(pygame.K_RETURN),
        [],
    )
    assert [played.layout for played in play(env, seed=4)] == [((5, 2),)]


def test_return_goes_on_to_the_next_episode_and_escape_ends(
    env: gym.Env, monkeypatch: pytest.MonkeyPatch
) -> None:
    finish = key(pygame.K_RETURN)
    person(monkeypatch, finish, finish, finish, key(pygame.K_ESCAPE), finish)
    assert [played.seed for played in play(env, seed=6)] == [6, 7]


def test_the_window_closed_before_the_end_is_no_episode(
    env: gym.Env, monkeypatch: pytest.MonkeyPatch
) -> None:
    person(monkeypatch, click(env, (2, 3)))
    assert list(play(env)) == []


def test_the_film_goes_on_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    env = make(render_mode="rgb_array", show_blast=True)
    person(monkeypatch, key(pygame.K_RETURN), *[[]] * 4)
    shown: list[np.ndarray] = []
    render: Callable[[], Any] = env.render

    def watched() -> np.ndarray:
        shown.append(render())
        return shown[-1]

    monkeypatch.setattr(env, "render", watched)
    assert len(list(play(env, seed=1))) == 1
    assert len(shown) >= 5
    assert (shown[-1] != shown[-3]).any()


def test_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    def played(env: gym.Env, seed: int) -> Iterator[Played]:
        assert env.render_mode == "rgb_array"
        yield Played(seed, ((1, 2),), 0.25, 1234.5)

    monkeypatch.setattr(import_module("blast_env.envs.play"), "play", played)
    result = CliRunner().invoke(app, ["play", "courtyard", "--seed", "3"])
    assert result.exit_code == 0, result.output
    assert "seed 3, 1 barrier module: 1,234 Pa s, reduction 25.0%" in result.output
    assert "left click: place" in result.output
    assert CliRunner().invoke(app, ["play", "free_field"]).exit_code == 2
