#!/usr/bin/env bash
# PettingZoo says that the options of `reset` are the environment's own, and `api_test` is the test
# that an environment follows its API. One would guess that an environment may refuse an option that
# it does not have, as a typing error of whoever calls it. `api_test` resets every environment with
# an option named "options", and so fails one that refuses it.
# Who checks options has to let unknown ones pass, or fails the conformance test.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq pettingzoo==1.27.0 gymnasium==1.4.0
venv/bin/python -W ignore - <<'PYTHON'
import sys

import gymnasium as gym
import numpy as np
import pettingzoo
from pettingzoo.test import api_test


class OneMove(pettingzoo.AECEnv):
    metadata = {"name": "one_move_v0", "is_parallelizable": False}
    render_mode = None
    possible_agents = ["player_0"]
    known = {"board"}

    def observation_space(self, agent):
        return self._spaces.setdefault(agent, gym.spaces.Discrete(2))

    def action_space(self, agent):
        return self._spaces.setdefault((agent, "action"), gym.spaces.Discrete(2))

    def __init__(self):
        self._spaces = {}

    def observe(self, agent):
        return np.int64(0)

    def reset(self, seed=None, options=None):
        unknown = {*(options or {})} - self.known
        if unknown:
            raise ValueError(f"no option {sorted(unknown)}, known: {sorted(self.known)}")
        self.agents = [*self.possible_agents]
        self.agent_selection = "player_0"
        for name, value in (("rewards", 0.0), ("_cumulative_rewards", 0.0)):
            setattr(self, name, dict.fromkeys(self.agents, value))
        self.terminations, self.truncations = {"player_0": False}, {"player_0": False}
        self.infos = {"player_0": {}}

    def step(self, action):
        if self.terminations["player_0"]:
            self._was_dead_step(action)
            return
        self.terminations["player_0"] = True


def outcome(known):
    env = OneMove()
    env.known = env.known | known
    try:
        api_test(env, num_cycles=10)
        return "passes"
    except ValueError as error:
        return str(error)


strict, lax = outcome(set()), outcome({"options"})
print("pettingzoo", pettingzoo.__version__)
print("expected: passes")
print("seen:", strict, "; with that option known:", lax)
sys.exit(0 if strict.startswith("no option ['options']") and lax == "passes" else "changed")
PYTHON
