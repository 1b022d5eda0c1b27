"""The particle model of the paper without an agent: a blast step by step, and its collisions."""

import gymnasium as gym

import blast_env

WALL = [(12, 0), (13, 0)]
env = gym.make("BlastSimulator-v0", scenario="courtyard", layout=WALL, engine="event")
observation, info = env.reset(seed=0)
ended = False
while not ended:
    observation, _, terminated, truncated, info = env.step(env.action_space.sample())
    ended = terminated or truncated
print({key: value for key, value in info.items() if isinstance(value, int | float)})

result = blast_env.simulate("courtyard", layout=WALL, engine="event")  # the same in one call
print(result.collisions.head())
unprotected = blast_env.simulate("courtyard", engine="event")
walled_pa_s, bare_pa_s = (outcome.impulse("building").pa_s for outcome in (result, unprotected))
print(f"two modules take {1.0 - walled_pa_s / bare_pa_s:.1%} off {bare_pa_s:.0f} Pa s")
