"""What a person sees of the barrier environment."""

import re
from itertools import pairwise
from pathlib import Path

import gymnasium as gym
import numpy as np
import pygame
import pytest
from gymnasium.wrappers import HumanRendering, RecordVideo

import blast_env  # noqa: F401  # registers
from tests.envs.small import make, play

pytestmark = pytest.mark.slow
drawn = pytest.mark.usefixtures("drawn")

FINISH = 40


@drawn
def test_frames_are_of_one_size_from_the_first_module_to_the_blast() -> None:
    env = make(render_mode="rgb_array")
    env.reset(seed=1)
    frames = [env.render()]
    for action in (16, 17, 18):
        env.step(action)
        frames.append(env.render())
    assert len({frame.shape for frame in frames}) == 1
    assert all(frame.dtype == np.uint8 for frame in frames)
    for earlier, later in pairwise(frames):
        assert (earlier != later).any()


@pytest.mark.parametrize("family", ["Sites", "ItemSites", "LargeSites"])
def test_every_site_of_a_family_has_frames_of_one_size(family: str) -> None:
    env = gym.make(f"BlastBarrier{family}-v0", render_mode="rgb_array")
    sizes = set()
    for seed in range(2):
        env.reset(seed=seed)
        sizes.add(np.asarray(env.render()).shape)
    assert len(sizes) == 1


def test_gymnasiums_wrappers_record_and_show_the_default_environment(tmp_path: Path) -> None:
    for wrapped in (
        RecordVideo(_finishing(), str(tmp_path / "films"), episode_trigger=lambda _: True),
        HumanRendering(_finishing()),
    ):
        wrapped.reset(seed=1)
        wrapped.step(wrapped.get_wrapper_attr("finish"))
        wrapped.close()  # type: ignore[no-untyped-call]
    assert len(list(tmp_path.rglob("*.mp4"))) == 1


def _finishing() -> gym.Env:
    return gym.make("BlastBarrier-v0", render_mode="rgb_array", realisations=1)


@drawn
def test_the_last_frame_stays_and_does_not_leak_into_the_next_episode() -> None:
    env = make(render_mode="rgb_array")
    env.reset(seed=1)
    first = env.render()
    env.step(FINISH)
    last = env.render()
    assert (last == env.render()).all()
    last[:] = 0
    assert env.render().any()
    env.reset(seed=1)
    assert (env.render() == first).all()


def test_a_map_of_characters_shows_what_stands_where() -> None:
    env = make(render_mode="ansi", invalid_action="penalty")
    assert env.render() is None
    env.reset(seed=1, options={"charge_position_m": (3.0, 9.0)})
    env.step(5 + 3)
    env.step(20)  # the hydrant
    heading, rule, *rows, _, legend = env.render().split("\n")
    rows = [row[1:-1] for row in rows[::-1]]
    assert heading == "small; 2 of 3 modules left; 1 illegal action"
    assert rule == f"+{'-' * 38}+"
    assert (len(rows), len(rows[0])) == (36, 38)
    assert rows[15][14:19] == "...M."
    assert rows[18][14:19] == "xx..."
    assert rows[17][5:7] == rows[18][5:7] == "**"
    assert "".join(rows[row][28:32] for row in range(10, 22)) == 48 * "P"
    assert rows[28][22:26] == "SSSS"
    assert legend == (
        "P protected structure, S other structure, M barrier module, . free cell,"
        " x cell not available, * charge"
    )


def test_the_text_tells_impulse_and_reduction_at_the_end() -> None:
    env = make(render_mode="ansi", threat="hidden", threats=2)
    info = play(env, seed=1)[-1][4]
    assert "~ charge may be here" in env.render()
    outcome = re.search(r"all charges: (\S+) psi s \((\S+) Pa s\), reduction (\S+) %", env.render())
    assert outcome is not None
    values = [float(number) for number in outcome.groups()]
    expected = [info["impulse_psi_s"], info["impulse_pa_s"], 100.0 * info["reduction"]]
    assert values[:2] == pytest.approx(expected[:2], rel=0.01)
    assert values[2] == pytest.approx(expected[2], abs=0.5)


@drawn
def test_the_map_of_a_hidden_charge_does_not_depend_on_the_charges_drawn() -> None:
    for mode in ("ansi", "rgb_array"):
        env = make(render_mode=mode, threat="hidden", threats=2)
        pictures = []
        for seed in (1, 2):
            env.reset(seed=seed)
            pictures.append(np.asarray(env.render()))
        assert (pictures[0] == pictures[1]).all()


@drawn
def test_the_window_shows_placing_and_the_blast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("blast_env.plots.window.pygame.time.Clock", _HurriedClock)
    env = make(render_mode="human")
    env.reset(seed=1)
    screen = pygame.display.get_surface()
    assert screen is not None
    before = pygame.surfarray.array3d(screen)
    env.step(7)
    assert (pygame.surfarray.array3d(screen) != before).any()
    env.step(FINISH)
    assert env.render() is None
    env.close()
    env.close()


class _HurriedClock:
    """A clock that does not wait."""

    def tick(self, _: float) -> int:
        return 0
