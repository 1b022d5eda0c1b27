"""`python -m tests.libraries.run_rllib`: an iteration of RLlib's PPO on every environment.

Ray's RLlib wants another Gymnasium than this package was tested with, so the tests leave it out and
this is run by hand, in an environment of its own: `pip install "ray[rllib]==2.60.0"`.
"""

from typing import Any

import gymnasium as gym
import numpy as np
import ray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.examples.rl_modules.classes.action_masking_rlm import ActionMaskingTorchRLModule

from tests.libraries.ids import BARRIER_IDS, IDS, arguments

_STEPS = 16


class Masked(gym.ObservationWrapper[Any, Any, Any]):
    """Gives the mask with the observation, as RLlib's example of masked actions wants it."""

    def __init__(self, config: dict[str, str]) -> None:
        chosen = {**arguments(config["name"]), "observation": "features", "action": "place"}
        super().__init__(gym.make(config["name"], disable_env_checker=True, **chosen))
        assert isinstance(self.env.action_space, gym.spaces.Discrete)
        mask = gym.spaces.Box(0.0, 1.0, (int(self.env.action_space.n),), np.float32)
        self.observation_space = gym.spaces.Dict(
            {"action_mask": mask, "observations": self.env.observation_space}
        )

    def observation(self, observation: Any) -> dict[str, Any]:
        mask = self.env.unwrapped.action_masks()  # type: ignore[attr-defined]
        return {"action_mask": mask.astype(np.float32), "observations": observation}


class Flat(gym.Wrapper[Any, Any, Any, Any]):
    """The bare simulator, its observations in one vector."""

    def __init__(self, config: dict[str, str]) -> None:
        env = gym.make(config["name"], disable_env_checker=True, **arguments(config["name"]))
        super().__init__(gym.wrappers.FlattenObservation(env))


def run_an_iteration(name: str) -> int:
    """Return the steps that PPO took of an environment in its first iteration."""
    is_masked = name in BARRIER_IDS
    config = (
        PPOConfig()
        .environment(Masked if is_masked else Flat, env_config={"name": name})
        .env_runners(num_env_runners=0)
        .training(train_batch_size=_STEPS, minibatch_size=8, num_epochs=1)
    )
    if is_masked:
        module = RLModuleSpec(module_class=ActionMaskingTorchRLModule)
        config = config.rl_module(rl_module_spec=module)
    algorithm = config.build_algo()
    try:
        return int(algorithm.train()["num_env_steps_sampled_lifetime"])
    finally:
        algorithm.stop()


def main() -> None:
    """Run one iteration of each."""
    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False)
    for name in IDS:
        steps = run_an_iteration(name)
        assert steps >= _STEPS
        print(f"{name}: {steps} steps", flush=True)


if __name__ == "__main__":
    main()
