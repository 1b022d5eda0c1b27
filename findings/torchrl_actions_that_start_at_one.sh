#!/usr/bin/env bash
# One to three walls are to be built: `Discrete(3, start=1)`, or `MultiDiscrete` with a `start` for
# several places. One would guess that TorchRL adds the start to the actions of its policies, or
# refuses such a space. It takes the count alone, and the environment gets 0, 1 and 2: an action
# that is not in its space, and never the last one that is.
# `check_env_specs` says that the check succeeded, and so does Gymnasium's `check_env`, which plays
# the environment without TorchRL. Where nothing refuses a zero, every layout has one wall too few,
# and three walls are never tried.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq torchrl==0.14.1 torch==2.13.0 gymnasium==1.4.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import gymnasium as gym
import numpy as np
import torch
import torchrl
from gymnasium.utils.env_checker import check_env
from torchrl.envs import GymWrapper, check_env_specs


class Walls(gym.Env):
    """Notes the actions that it gets."""

    observation_space = gym.spaces.Box(0.0, 1.0, (1,), np.float32)

    def __init__(self, action_space):
        self.action_space = action_space
        self.got = set()
        self.foreign = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.got |= set(np.ravel(action).tolist())
        self.foreign += action not in self.action_space
        return np.zeros(1, np.float32), 0.0, False, False, {}


spaces = {
    "Discrete": gym.spaces.Discrete(3, start=1),
    "MultiDiscrete": gym.spaces.MultiDiscrete([3, 3], start=[1, 1]),
}
torch.manual_seed(0)
seen = {}
for name, space in spaces.items():
    check_env(Walls(space), skip_render_check=True)
    for encoding, is_categorical in (("one-hot", False), ("categorical", True)):
        env = Walls(space)
        wrapped = GymWrapper(env, categorical_action_encoding=is_categorical)
        check_env_specs(wrapped)
        wrapped.rollout(100)
        seen[name, encoding] = sorted(env.got), env.foreign > 0
print("torchrl", torchrl.__version__, "gymnasium", gym.__version__)
print("expected: actions 1, 2 and 3, none outside the space")
for (name, encoding), (got, has_foreign) in seen.items():
    print(f"seen, {name}, {encoding}:", got, "some outside" if has_foreign else "none outside")
sys.exit(0 if all(found == ([0, 1, 2], True) for found in seen.values()) else "changed")
PYTHON
