#!/usr/bin/env bash
# Environments say in `info` which share of the windows a blast has broken: 0.35, or 0 where there
# was nothing to break. A vector makes one array of what its environments say. One would guess that
# it has 0 and 0.35, as `np.array([0, 0.35])` would. Gymnasium's `SyncVectorEnv` and
# `AsyncVectorEnv` take the type of the first environment for all: 0 is a whole number, and 0.35
# becomes 0. If the first says True, 0.35 becomes True. The other way round all is right.
# Whether a share is lost hangs on what the first environment says at that step, and one environment
# alone never loses any. Means of logged measures are then too low by chance, with nothing raised. A
# `float(...)` around each value keeps them.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq gymnasium==1.4.0 numpy==2.4.6
cat > shares.py <<'PYTHON'
import sys

import gymnasium
import numpy as np
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv


class Street(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, broken):
        self.broken = broken

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        return np.zeros(1, np.float32), 0.0, False, False, {"broken": self.broken}


def told(kind, shares):
    envs = kind([lambda share=share: Street(share) for share in shares])
    envs.reset(seed=0)
    broken = envs.step(np.zeros(len(shares), int))[-1]["broken"]
    envs.close()
    return broken.tolist()


if __name__ == "__main__":
    asked = [(0, 0.35), (0.35, 0), (True, 0.35), (0.0, 0.35)]
    seen = {kind.__name__: [told(kind, one) for one in asked]
            for kind in (SyncVectorEnv, AsyncVectorEnv)}
    print("gymnasium", gymnasium.__version__)
    print("expected: shares as they were told,", *asked)
    for name, found in seen.items():
        print("seen,", name, *found)
    wrong = [[0, 0], [0.35, 0.0], [True, True], [0.0, 0.35]]
    sys.exit(0 if all(found == wrong for found in seen.values()) else "changed")
PYTHON
venv/bin/python -W ignore shares.py
