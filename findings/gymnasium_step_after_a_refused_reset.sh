#!/usr/bin/env bash
# An environment refuses an option of `reset`: a charge without a mass. The reset is called again
# with a mass, and an episode begins. One would guess that its steps are like those of any other
# episode. By default `gymnasium.make` wraps an environment in a checker, which keeps what the first
# reset returned to compare it with the first steps. After a refused one it has nothing, and keeps
# nothing of later ones: every step of the environment ends in a TypeError about unpacking, in this
# episode and in all that follow.
# The steps have been made all the same: three walls stand, and no observation and no reward came
# back. A loop that catches errors and tries the action again makes it twice. With
# `disable_env_checker=True`, or a new environment, all is right.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq gymnasium==1.4.0 numpy==2.4.6
cat > refused.py <<'PYTHON'
import sys

import gymnasium
import numpy as np


class Street(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(0.0, 9.0, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        if (options or {}).get("tnt_kg") == 0:
            raise ValueError("tnt_kg is 0, must be above 0")
        self.walls = 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.walls += 1
        return np.full(1, self.walls, np.float32), 1.0, False, False, {}


def played(**arguments):
    env = gymnasium.make("Street-v0", **arguments)
    try:
        env.reset(seed=0, options={"tnt_kg": 0})
    except ValueError:
        env.reset(seed=0, options={"tnt_kg": 100})
    returned = 0.0
    for _ in range(3):
        try:
            returned += env.step(0)[1]
        except TypeError as error:
            print("seen, a step:", error)
    return returned, env.unwrapped.walls


gymnasium.register("Street-v0", entry_point=Street)
print("gymnasium", gymnasium.__version__)
print("expected: three rewards of 1 for three walls, (3.0, 3)")
checked = played()
print("seen, by default:", checked)
print("seen, disable_env_checker=True:", played(disable_env_checker=True))
sys.exit(0 if checked == (0.0, 3) else "changed")
PYTHON
venv/bin/python -W ignore refused.py
