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
    from torchrl.envs import (
        ActionMask,
        Compose,
        DTypeCastTransform,
        GymEnv,
        TransformedEnv,
        default_info_dict_reader,
    )

    env = GymEnv("BlastBarrier-v0", realisations=1)
    length = env.action_spec.shape[-1]  # of one-hot vectors of variant, row and column, in one
    mask = Binary(length, shape=(length,), dtype=torch.int8)
    env.set_info_dict_reader(default_info_dict_reader(["action_mask"], spec=[mask]))
    as_bool = DTypeCastTransform(torch.int8, torch.bool, in_keys=["action_mask"])
    steps = TransformedEnv(env, Compose(as_bool, ActionMask())).rollout(50)
    taken = steps["action"].bool()
    assert steps["action_mask"][taken].all()
    assert steps["next", "terminated"][-1]
    assert len(steps) > 4
