#!/usr/bin/env bash
# `NormalizeReward` divides rewards by the deviation of the discounted return, which it sums step by
# step. One would guess that the sum begins at zero in each episode, as it does in vectors that
# reset in the same step. In a single environment, and in vectors that reset in the next step, the
# step that ends an episode strikes the sum of that episode but keeps its own reward, and the next
# episode goes on from there. Where the reward comes at the end, as with a layout that is blasted
# once, the sum hardly varies any more.
# The same reward is 3.3 at each end of 200 episodes in one mode, and grows to 14 in the other. What
# was tuned with one (rates, clipping, weight of the entropy) is off with the other.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq gymnasium==1.4.0
venv/bin/python -W ignore - <<'PYTHON'
import sys

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import NormalizeReward as OfOne
from gymnasium.wrappers.vector import NormalizeReward as OfMany

EPISODES = 200


class Layout(gym.Env):
    """Ten steps, of which the last one has a reward of 1."""

    observation_space = gym.spaces.Box(0.0, 1.0, (1,))
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = 10
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.left -= 1
        return np.zeros(1, np.float32), float(self.left == 0), self.left == 0, False, {}


def last_rewards(env, action):
    """Return the normalised rewards at the ends of episodes."""
    found = []
    env.reset()
    while len(found) < EPISODES:
        _, reward, ends, _, _ = env.step(action)
        if np.all(ends):
            found.append(round(float(np.squeeze(reward)), 2))
            if not isinstance(env, OfMany):
                env.reset()
    return found


seen = {"single": last_rewards(OfOne(Layout()), 0)}
for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
    envs = OfMany(SyncVectorEnv([Layout], autoreset_mode=mode))
    seen[mode.name] = last_rewards(envs, np.array([0]))
print("gymnasium", gym.__version__)
print("expected: 3.33 throughout, for returns of nine zeros and a one deviate by 0.3")
print("seen, first and last:", {name: (found[0], found[-1]) for name, found in seen.items()})
as_found = all(found[0] == 3.33 for found in seen.values()) and set(seen["SAME_STEP"]) == {3.33}
as_found = as_found and all(14.0 < seen[name][-1] < 15.0 for name in ("single", "NEXT_STEP"))
sys.exit(0 if as_found else "changed")
PYTHON
