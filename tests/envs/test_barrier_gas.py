"""The environment on gas dynamics: the same rules, one realisation, no calibration."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation import evaluate_layout
from tests.gas_sites import WALL, hut

HUT = hut()


def make(**options: Any) -> gym.Env:
    return gym.make("BlastBarrierGas-v0", scenario=HUT, disable_env_checker=True, **options)


def test_an_episode_pays_the_loads_of_gas_dynamics() -> None:
    env = make(render_mode="rgb_array")
    env.reset(seed=0, options={"layout": WALL[:-1]})
    zone = HUT.zone
    _, reward, ended, _, info = env.step(WALL[-1][0] * zone.columns + WALL[-1][1])
    assert ended
    expected = evaluate_layout(HUT, WALL, [0], engine="gas", cell_m=0.5)
    assert info["impulse_pa_s"] == pytest.approx(expected.impulse_pa_s.value)
    assert info["reduction"] == pytest.approx(expected.mean_reduction)
    assert reward == pytest.approx(-info["impulse_psi_s"])
    assert info["calibration"] == "none"
    assert "impulse_sim" not in info
    assert info["blasts"] == 2
    picture = env.render()
    assert isinstance(picture, np.ndarray)
    assert picture.ndim == 3


def test_more_realisations_are_refused() -> None:
    with pytest.raises(BlastEnvError, match="realisations is 2, must be 1: gas has no noise"):
        make(realisations=2)
