#!/usr/bin/env bash
# `MaxAndSkipObservation` repeats an action four times and returns the larger of the last two
# observations, value by value. One would guess that this holds for the last step of an episode
# too, which may have fewer than four repeats. Gymnasium keeps the third and the fourth
# observation alone. If an episode is cut in the first or second repeat, the step returns what the
# step before it has returned already, and zeros where there was none. In the third repeat it
# mixes old and new.
# A time limit that is no multiple of four does this in each episode. What learns takes the value
# of the rest of a cut episode (`truncated`) from a state that it has left. `RepeatAction`, which
# is newer, returns the last observation.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq gymnasium==1.4.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import MaxAndSkipObservation, RepeatAction


class Countdown(gym.Env):
    """Shows 100 - t, until its time is over."""

    observation_space = gym.spaces.Box(0.0, 100.0, (1,))
    action_space = gym.spaces.Discrete(2)

    def __init__(self, limit):
        self.limit = limit

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.time = 0
        return np.array([100.0], np.float32), {}

    def step(self, action):
        self.time += 1
        seen = np.array([100.0 - self.time], np.float32)
        return seen, 0.0, False, self.time == self.limit, {}


def last(wrapper, limit):
    """Return the last observation of an episode that is cut after some steps."""
    env = wrapper(Countdown(limit), 4)
    env.reset()
    while True:
        observation, _, _, truncated, _ = env.step(0)
        if truncated:
            return float(observation[0])


LIMITS = (2, 4, 5, 6, 7, 8)
by_max = {limit: last(MaxAndSkipObservation, limit) for limit in LIMITS}
by_repeat = {limit: last(RepeatAction, limit) for limit in LIMITS}
print("gymnasium", gym.__version__)
print("expected of MaxAndSkipObservation:", {limit: 101.0 - limit for limit in LIMITS})
print("seen of MaxAndSkipObservation:    ", by_max)
print("seen of RepeatAction:             ", by_repeat)
as_found = list(by_max.values()) == [0.0, 97.0, 97.0, 97.0, 96.0, 93.0]
as_found = as_found and by_repeat == {limit: 100.0 - limit for limit in LIMITS}
sys.exit(0 if as_found else "changed")
PYTHON
