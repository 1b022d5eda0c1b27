"""TorchRL makes every environment by its id, and draws only legal actions where it is told to.

It is imported by the tests themselves: it takes seconds, in each process that looks for tests.
"""

import pytest
import torch

from tests.libraries.ids import IDS, arguments

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", IDS)
def test_every_id_is_made_and_keeps_its_specs(name: str) -> None:
    from torchrl.envs import GymEnv, check_env_specs

    env = GymEnv(name, **arguments(name))
    check_env_specs(env)
    assert env.rollout(2).batch_size[0] >= 1


def test_masked_actions_fill_the_stock() -> None:
    from torchrl.data import Binary
    from torchrl.envs import ActionMask, GymEnv, TransformedEnv, default_info_dict_reader

    env = GymEnv("BlastBarrier-v0", realisations=1)
    actions = env.action_spec.space.n
    mask = Binary(actions, shape=(actions,), dtype=torch.bool)
    env.set_info_dict_reader(default_info_dict_reader(["action_mask"], spec=[mask]))
    steps = TransformedEnv(env, ActionMask()).rollout(50)
    taken = steps["action"].argmax(-1, keepdim=True)
    assert steps["action_mask"].gather(-1, taken).all()
    assert steps["next", "terminated"][-1]
    assert len(set(taken.flatten().tolist())) == len(taken) > 8
