#!/usr/bin/env bash
# `MORecordEpisodeStatistics` of MO-Gymnasium adds two returns to the end of each episode: `r`, and
# `dr`, which is discounted. One would guess that both are those of the episode, as with a single
# environment. In a vector of environments `r` is; `dr` is the sum of those of all episodes since
# the reset, for it is not set to zero where an episode ends.
# Whoever compares agents with two objectives by discounted returns sees every agent get better from
# episode to episode, on average along a straight line.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq mo-gymnasium==1.3.2 gymnasium==1.4.0
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys

import gymnasium as gym
import numpy as np
from mo_gymnasium.wrappers import MORecordEpisodeStatistics as OfOne
from mo_gymnasium.wrappers.vector import MORecordEpisodeStatistics as OfMany
from mo_gymnasium.wrappers.vector import MOSyncVectorEnv


class Episodes(gym.Env):
    """Three steps with rewards of (1, 2): 1.75 and 3.5 at a discount of one half."""

    observation_space = gym.spaces.Box(0.0, 1.0, (1,))
    action_space = gym.spaces.Discrete(2)
    reward_space = gym.spaces.Box(-9.0, 9.0, (2,))
    reward_dim = 2

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = 3
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.left -= 1
        rewards = np.array([1.0, 2.0], np.float32)
        return np.zeros(1, np.float32), rewards, self.left == 0, False, {}


one = OfOne(Episodes(), gamma=0.5)
single = []
for _ in range(3):
    one.reset()
    for _ in range(3):
        info = one.step(0)[-1]
    single.append(info["episode"]["dr"].tolist())
many = OfMany(MOSyncVectorEnv([Episodes]), gamma=0.5)
many.reset()
vector, plain = [], []
while len(vector) < 3:
    info = many.step(np.array([0]))[-1]
    if "episode" in info:
        vector.append(info["episode"]["dr"][0].tolist())
        plain.append(info["episode"]["r"][0].tolist())
print("mo-gymnasium", importlib.metadata.version("mo-gymnasium"))
print("expected: dr of [1.75, 3.5] in each of three episodes; r of the vector is", plain)
print("seen: single", single, "- vector", vector)
as_found = single == [[1.75, 3.5]] * 3 and vector == [[1.75, 3.5], [3.5, 7.0], [5.25, 10.5]]
sys.exit(0 if as_found and plain == [[3.0, 6.0]] * 3 else "changed")
PYTHON
