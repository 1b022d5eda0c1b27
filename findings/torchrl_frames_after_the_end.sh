#!/usr/bin/env bash
# An action is held for three steps, and an episode ends in its fourth. One would guess that the
# second action ends with the episode, after one step, as it does with `GymWrapper(frame_skip=3)`.
# TorchRL's `FrameSkipTransform(3)` goes on to the sixth: rewards of two steps after the end are
# added to the return, and the last observation is from there. An environment that says "ended" in
# the step of its end alone, as one may that counts a hit, goes on for ever: the word comes in the
# middle of three steps, and only what the last of them says is kept.
# There is no message, and the documentation does not speak of ends.
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
import torchrl
from torchrl.envs import FrameSkipTransform, GymWrapper, TransformedEnv

LAST, HELD = 4, 3


class Steps(gym.Env):
    """Counts steps, has a reward of 1 in each, and ends in step 4."""

    observation_space = gym.spaces.Box(0.0, 100.0, (1,), np.float32)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, keeps_saying):
        self.keeps_saying = keeps_saying
        self.after_the_end = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.count += 1
        self.after_the_end += self.count > LAST
        has_ended = self.count >= LAST if self.keeps_saying else self.count == LAST
        return np.array([self.count], np.float32), 1.0, has_ended, False, {}


def played(kind, keeps_saying):
    """Return observations, rewards and ends of four actions, and steps after the end."""
    steps = Steps(keeps_saying)
    if kind == "GymWrapper":
        env = GymWrapper(steps, frame_skip=HELD)
    else:
        env = TransformedEnv(GymWrapper(steps), FrameSkipTransform(HELD))
    found = env.rollout(4, break_when_any_done=False)["next"]
    names = ("observation", "reward", "terminated")
    return [found[name].flatten().tolist() for name in names] + [steps.after_the_end]


right = [[3.0, 4.0] * 2, [3.0, 1.0] * 2, [False, True] * 2, 0]
print("torchrl", torchrl.__version__, "gymnasium", gym.__version__)
print("expected, steps, rewards, ends and steps after the end:", *right)
seen = {}
for kind in ("GymWrapper", "FrameSkipTransform"):
    for keeps_saying in (True, False):
        seen[kind, keeps_saying] = played(kind, keeps_saying)
        when = "from its end on" if keeps_saying else "once"
        print(f"seen, {kind}, end said {when}:", *seen[kind, keeps_saying])
as_found = seen["GymWrapper", True] == seen["GymWrapper", False] == right
until_six = [[3.0, 6.0] * 2, [3.0] * 4, [False, True] * 2, 4]
endless = [[3.0, 6.0, 9.0, 12.0], [3.0] * 4, [False] * 4, 8]
as_found = as_found and seen["FrameSkipTransform", True] == until_six
as_found = as_found and seen["FrameSkipTransform", False] == endless
sys.exit(0 if as_found else "changed")
PYTHON
