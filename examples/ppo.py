"""PPO of stable-baselines3, as it comes, on guesses of gas dynamics, beside the rules of thumb.

`python examples/ppo.py 20480` trains for a minute of a core, on pieces that the rules suggest.
"""

import sys

import gymnasium as gym
import numpy as np
from stable_baselines3 import PPO

import blast_env  # noqa: F401  # registers the environments
from blast_env.design.search import layouts_by_rule

STEPS = int(sys.argv[1]) if len(sys.argv) > 1 else 20480
HELD_OUT = range(10_000, 10_000 + max(STEPS // 1024, 1))  # seeds of charges to judge on
SITE = "control_room"

settings = {"engine": "surrogate", "observation": "features", "action": "suggestion"}
env = gym.make("BlastBarrier-v0", scenario=SITE, **settings)
agent = PPO("MlpPolicy", env, n_steps=min(2048, STEPS), batch_size=min(64, STEPS), seed=0)
agent.learn(STEPS)

reductions: dict[str, list[float]] = {}
for seed in HELD_OUT:
    observation, info = env.reset(seed=seed)
    ended = False
    while not ended:
        action, _ = agent.predict(observation, deterministic=True)
        observation, _, ended, _, info = env.step(action)
    reductions.setdefault("PPO", []).append(info["reduction"])
    for name, layout in layouts_by_rule(SITE, info["charges"][0]).items():
        env.reset(seed=seed, options={"layout": layout})
        *_, info = env.step(env.unwrapped.finish)
        reductions.setdefault(name, []).append(info["reduction"])

for name, found in reductions.items():
    print(f"{name} takes off {np.mean(found):.1%} of the impulse under {len(found)} new charges")
