"""Watching the blast: steps that go on after the charge, a window that does not wait, films."""

import pickle
from time import perf_counter
from typing import Any

import gymnasium as gym
import numpy as np
import pygame
import pytest

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import BlastEnvError
from tests.envs.small import make
from tests.gas_sites import WALL, hut

pytestmark = pytest.mark.slow

FINISH = 40


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a frame a second drawn; a second lasts as long."""
    monkeypatch.setitem(BlastBarrierEnv.metadata, "render_fps", 1.0)


def finished(env: gym.Env, seed: int = 1) -> list[Any]:
    """Return the steps from the one that sets the charge off to the end."""
    env.reset(seed=seed)
    env.step(7)
    steps = [env.step(FINISH)]
    while not steps[-1][2]:
        steps.append(env.step(0))
    return steps


@pytest.mark.usefixtures("short")
def test_the_episode_goes_on_for_the_frames_of_the_film() -> None:
    env = make(render_mode="rgb_array", show_blast=True)
    steps = finished(env)
    assert 6 <= len(steps) - 1 == len(list(env.blast_frames())) <= 13
    plain = finished(make())
    assert len(plain) == 1
    assert steps[0][1] == plain[0][1]
    assert not any(step[1] for step in steps[1:])
    final = {name: value for name, value in steps[-1][4].items() if name != "reward_terms"}
    assert {"reduction", "impulse_pa_s", "layout"} <= set(final)
    assert np.flatnonzero(steps[3][4]["action_mask"]).tolist() == [FINISH]
    with pytest.raises(gym.error.ResetNeeded, match="has ended"):
        env.step(FINISH)


@pytest.mark.usefixtures("short")
def test_every_step_shows_the_next_frame_and_the_last_one_what_came_of_it() -> None:
    env = make(render_mode="rgb_array", show_blast=True)
    env.reset(seed=1)
    env.step(FINISH)
    film = list(env.blast_frames())
    shown = [env.render()]
    ended = False
    while not ended:
        ended = env.step(0)[2]
        shown.append(env.render())
    assert len(shown) == len(film) + 1
    assert all((frame == expected).all() for frame, expected in zip(shown, film, strict=False))
    assert (shown[-1] != film[-1]).any()


@pytest.mark.usefixtures("short")
def test_a_reset_leaves_the_film() -> None:
    env = make(render_mode="rgb_array", show_blast=True)
    env.reset(seed=1)
    first = env.render()
    env.step(FINISH)
    env.reset(seed=1)
    assert (env.render() == first).all()
    assert not env.step(7)[2]


@pytest.mark.usefixtures("short")
def test_an_environment_in_the_middle_of_a_film_pickles() -> None:
    env = make(render_mode="rgb_array", show_blast=True)
    env.reset(seed=1)
    env.step(FINISH)
    copy = pickle.loads(pickle.dumps(env))
    assert copy.step(0)[2]  # a film does not pickle: there it is over
    assert not env.step(0)[2]


@pytest.mark.parametrize("mode", [None, "ansi"])
def test_a_blast_that_nothing_shows_is_refused(mode: str | None) -> None:
    with pytest.raises(BlastEnvError, match="show_blast is True, but render_mode"):
        make(render_mode=mode, show_blast=True)


def test_the_window_does_not_wait_for_a_film_unless_it_is_asked_for() -> None:
    env = make(render_mode="human")
    env.reset(seed=1)
    began_s = perf_counter()
    assert env.step(FINISH)[2]
    assert perf_counter() - began_s < 4.0  # the film lasts 8 to 12 s
    env.close()


def test_a_window_shows_the_film_step_by_step() -> None:
    env = make(render_mode="human", show_blast=True)
    env.reset(seed=1, options={"charge_position_m": (3.0, 9.0)})
    env.step(FINISH)
    pictures = []
    for _ in range(12):
        assert not env.step(0)[2]
        screen = pygame.display.get_surface()
        assert screen is not None
        pictures.append(pygame.surfarray.array3d(screen))
    assert (pictures[0] != pictures[-1]).any()
    env.close()


@pytest.mark.usefixtures("short")
def test_a_blast_of_gas_dynamics_is_shown_in_frames_of_the_same_size() -> None:
    env = gym.make("BlastBarrierGas-v0", scenario=hut(), render_mode="rgb_array", show_blast=True)
    env.reset(seed=0, options={"layout": WALL[:-1]})
    frames: list[Any] = [env.render()]
    _, _, ended, _, _ = env.step(WALL[-1][0] * 2 + WALL[-1][1])
    assert not ended
    while not ended:
        frames.append(env.render())
        ended = env.step(0)[2]
    assert len({frame.shape for frame in frames}) == 1
    red = [int((frame[..., 0].astype(int) - frame[..., 2] > 60).sum()) for frame in frames]
    assert max(red[1:]) > 5 * red[0]  # overpressure
