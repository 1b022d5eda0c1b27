#!/usr/bin/env bash
# In a vector of environments that do not reset by themselves (`AutoresetMode.DISABLED`), whoever
# steps them resets those that have ended, by a mask in the options. `RecordEpisodeStatistics` knows
# that mask, and one would guess that it goes on counting the others. It does with a vector that
# leaves the options as they are. Gymnasium's own two, `SyncVectorEnv` and `AsyncVectorEnv`, take the
# mask out of them before the wrapper looks for it: it then begins anew for all.
# As one environment ends, returns and lengths of all that are under way are lost: episodes of five
# steps are told as of one, two or three, and nothing is raised. Episodes of one length, which end
# together, are told right, and so are those of the other two modes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq gymnasium==1.4.0 numpy==2.4.6
cat > vectors.py <<'PYTHON'
import sys

import gymnasium as gym
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

STEPS = 30


class Episodes(gym.Env):
    """A reward of 1 in each of so many steps."""

    observation_space = gym.spaces.Box(0.0, 1.0, (1,))
    action_space = gym.spaces.Discrete(2)

    def __init__(self, length):
        self.length = length

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.step_number = 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.step_number += 1
        return np.zeros(1, np.float32), 1.0, self.step_number == self.length, False, {}


class Untouched(SyncVectorEnv):
    """Leaves the options of the caller as they are."""

    def reset(self, *, seed=None, options=None):
        return super().reset(seed=seed, options=None if options is None else dict(options))


def told(kind, mode, lengths):
    """Return the lengths that are told of the episodes of the second environment."""
    envs = kind([lambda n=n: Episodes(n) for n in lengths], autoreset_mode=mode)
    envs = RecordEpisodeStatistics(envs)
    envs.reset(seed=0)
    found = set()
    for _ in range(STEPS):
        *_, ended, _, infos = envs.step(np.zeros(2, int))
        if ended[1]:
            found.add((float(infos["episode"]["r"][1]), int(infos["episode"]["l"][1])))
        if mode == AutoresetMode.DISABLED and ended.any():
            envs.reset(options={"reset_mask": ended})
    envs.close()
    return sorted(found)


if __name__ == "__main__":
    whole, parts = [(5.0, 5)], [(1.0, 1), (2.0, 2), (3.0, 3)]
    seen = {
        (kind.__name__, mode.name, lengths): told(kind, mode, lengths)
        for kind in (SyncVectorEnv, AsyncVectorEnv, Untouched)
        for mode in AutoresetMode
        for lengths in ((5, 5), (3, 5))
    }
    print("gymnasium", gym.__version__)
    print("expected: return 5 and length 5 throughout")
    as_found = True
    for (kind, mode, lengths), found in seen.items():
        print("seen:", kind, mode, "lengths", lengths, "-", found)
        is_lost = mode == "DISABLED" and lengths == (3, 5) and kind != "Untouched"
        as_found = as_found and (set(found) <= set(parts) if is_lost else found == whole)
    sys.exit(0 if as_found else "changed")
PYTHON
venv/bin/python -W ignore vectors.py
