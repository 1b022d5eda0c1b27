"""An episode of `BlastBarrier-v0`: random places for barriers, then the blast."""

import gymnasium as gym

import blast_env  # noqa: F401  # registers the environments

env = gym.make("BlastBarrier-v0", scenario="courtyard")
observation, info = env.reset(seed=0)
env.action_space.seed(0)
reward, ended = 0.0, False
while not ended:
    action = env.action_space.sample()  # item, row and column; the nearest legal cell is taken
    observation, reward, terminated, truncated, info = env.step(action)
    ended = terminated or truncated

print(f"{info['placed']} modules take off {info['reduction']:.1%} of the impulse")
print(f"{info['impulse_pa_s']:.0f} Pa s on the building, reward {reward:.4f}")
