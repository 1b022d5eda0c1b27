#!/usr/bin/env bash
# A heading is a number from -2 to 2, and `DiscretizeAction` of Gymnasium 1.4 makes ten choices of it.
# A policy chooses, the choice is played and kept for the data set of the expert. `predict` of
# stable-baselines3 gives a choice as an array without a dimension, `np.array(7)`. One would guess that
# a step only reads it. It plays the 7, and leaves 0 in the array: each choice that is kept, printed or
# counted after its step is 0. With plain numbers, or with `multidiscrete=True`, choices stay. No
# warning, and the rewards are right, so that imitation learns 0 everywhere from a good expert.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq gymnasium==1.4.0 numpy==2.4.6
venv/bin/python -W error - <<'PYTHON'
import sys

import gymnasium
import numpy as np
from gymnasium.wrappers import DiscretizeAction

CHOICES = (7, 2, 9, 4)


def played(make, of_many):
    env = DiscretizeAction(gymnasium.make("Pendulum-v1"), bins=10, multidiscrete=of_many)
    env.reset(seed=0)
    kept, rewards = [], []
    for choice in CHOICES:
        action = make([choice] if of_many else choice)
        rewards.append(round(float(env.step(action)[1]), 6))
        kept.append(int(np.ravel(action)[0]))
    return kept, rewards


plain, arrays, of_many = played(lambda own: own, False), played(np.array, False), played(np.array, True)
print("gymnasium", gymnasium.__version__, "numpy", np.__version__)
print("expected: the choices that were played by each:", [*CHOICES])
print("seen: plain numbers", plain[0], "- arrays of many", of_many[0], "- arrays", arrays[0])
print("the same rewards:", plain[1] == arrays[1] == of_many[1])
same = plain[1] == arrays[1] == of_many[1] and plain[0] == of_many[0] == [*CHOICES]
sys.exit(0 if same and arrays[0] == [0, 0, 0, 0] else "changed")
PYTHON
