#!/usr/bin/env bash
# Stable-Baselines3 has a monitor for one environment and another for a vector, and
# `evaluate_policy` takes the returns of either. One would guess that both give the same. `Monitor`
# rounds a return to six decimals, also where it writes no file. `VecMonitor` does not, nor does an
# evaluation without a monitor, which is what it warns against.
# Layouts that spare a wall 0.1 and 0.4 Pa s have rewards of 1e-7 and 4e-7 in MPa s. Under `Monitor`
# both have a return of zero, and no evaluation tells the better policy from the other, though
# learning, which is done with the rewards themselves, works.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq stable-baselines3==2.9.2 gymnasium==1.4.0 torch==2.13.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import gymnasium as gym
import numpy as np
import stable_baselines3
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

REWARDS = (1e-7, 4e-7)


class Layout(gym.Env):
    """One step, of which the action is the layout."""

    observation_space = gym.spaces.Box(0.0, 1.0, (1,))
    action_space = gym.spaces.Discrete(len(REWARDS))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        return np.zeros(1, np.float32), REWARDS[action], True, False, {}


class Always:
    def __init__(self, action):
        self.action = action

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.full(len(observation), self.action), None


def returns(make):
    found = [evaluate_policy(Always(k), make(), n_eval_episodes=2)[0] for k in range(len(REWARDS))]
    return [float(f"{value:.3g}") for value in found]


seen = {
    "Monitor": returns(lambda: DummyVecEnv([lambda: Monitor(Layout())])),
    "VecMonitor": returns(lambda: VecMonitor(DummyVecEnv([Layout]))),
    "none": returns(lambda: DummyVecEnv([Layout])),
}
print("stable-baselines3", stable_baselines3.__version__, "gymnasium", gym.__version__)
print("expected: mean returns of", list(REWARDS), "by each")
print("seen:", seen)
right = list(REWARDS)
wanted = {"Monitor": [0.0, 0.0], "VecMonitor": right, "none": right}
sys.exit(0 if seen == wanted else "changed")
PYTHON
