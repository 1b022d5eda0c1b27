#!/usr/bin/env bash
# Environments for image policies show planes as bytes, of as many channels as they have: here five.
# One would guess that Minari, which records any Box, stores them as an array, as it does for the
# same planes as float32. It takes arrays of bytes with three axes and 32 rows or more for pictures,
# of one, three or four channels: recording ends in a TypeError of Pillow.
# Who records such an environment finds out after the first episode is played.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq "minari[create,hdf5]==0.5.4" pillow==13.0.0 gymnasium==1.4.0
MINARI_DATASETS_PATH="$folder/data" venv/bin/python -W ignore - <<'PYTHON'
import sys

import gymnasium as gym
import minari
import numpy as np


class Planes(gym.Env):
    action_space = gym.spaces.Discrete(2)

    def __init__(self, kind):
        high = 255 if kind == np.uint8 else 1.0
        self.observation_space = gym.spaces.Box(0, high, (40, 40, 5), kind)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.ones(self.observation_space.shape, self.observation_space.dtype), {}

    def step(self, action):
        return self.reset()[0], 0.0, True, False, {}


def recorded(kind):
    collector = minari.DataCollector(Planes(kind))
    try:
        collector.reset(seed=0)
        collector.step(0)
        collector.create_dataset(f"planes/{np.dtype(kind).name}-v0")
        return "recorded"
    except TypeError as error:
        return f"TypeError: {error}"


of_bytes, of_floats = recorded(np.uint8), recorded(np.float32)
print("minari", minari.__version__)
print("expected: both recorded")
print("seen: bytes:", of_bytes, "; float32:", of_floats)
as_found = of_bytes.startswith("TypeError: Cannot handle this data type") and of_floats == "recorded"
sys.exit(0 if as_found else "changed")
PYTHON
