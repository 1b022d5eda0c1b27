#!/usr/bin/env bash
# Returns over three steps make learning faster. TorchRL's `MultiStep`, and `MultiStepTransform` in
# a replay buffer, add the rewards of three steps, and put the observation after them in the place
# of the next one. Where an episode ends in between, one would guess that a value is the sum to the
# end. The rewards are that sum. But `terminated` is that of the first of the steps, and says False,
# so that TorchRL's own value estimators add the value of the observation after the end.
# Nobody acts there, so that this value is never learnt: it stays what the network says by chance.
# In an episode of four steps, of reward 1 each, a table that starts at 10 has 10 for the second and
# the third step for ever, instead of 2.7 and 1.9. One-step values are right, and so is the last.
# The page of `MultiStepTransform` says that ends are left as they are, not what follows from it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq torchrl==0.14.1 torch==2.13.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import torch
import torchrl
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torchrl.data import LazyTensorStorage, ReplayBuffer
from torchrl.data.postprocs import MultiStep
from torchrl.envs.transforms import MultiStepTransform
from torchrl.objectives.value import TD0Estimator

STEPS, DISCOUNT, START = 4, 0.9, 10.0
place = torch.eye(STEPS + 1)
is_last = torch.arange(STEPS).unsqueeze(-1) == STEPS - 1
after = {"observation": place[1:], "reward": torch.ones(STEPS, 1)}
after |= {"done": is_last, "terminated": is_last}
episode = {"observation": place[:-1], "next": TensorDict(after, [STEPS])}
episode = TensorDict(episode, [STEPS])


def learnt(transitions):
    """Return the values of the four places after 100 rounds of a table."""
    table = torch.nn.Linear(STEPS + 1, 1, bias=False)
    torch.nn.init.constant_(table.weight, START)
    network = TensorDictModule(table, in_keys=["observation"], out_keys=["state_value"])
    estimator = TD0Estimator(gamma=DISCOUNT, value_network=network)
    for _ in range(100):
        targets = estimator.value_estimate(transitions.clone()).flatten()
        with torch.no_grad():
            table.weight[0, : len(targets)] = targets
    return [round(float(value), 2) for value in table.weight[0, :STEPS]]


buffer = ReplayBuffer(
    storage=LazyTensorStorage(100), transform=MultiStepTransform(n_steps=3, gamma=DISCOUNT)
)
buffer.extend(torch.cat([episode, episode]))
three_steps = MultiStep(gamma=DISCOUNT, n_steps=3)(episode.unsqueeze(0))
in_a_buffer = buffer[:STEPS].unsqueeze(0)
true = [round(sum(DISCOUNT**k for k in range(STEPS - i)), 2) for i in range(STEPS)]
seen = {
    "one step": learnt(episode.unsqueeze(0)),
    "three steps, MultiStep": learnt(three_steps),
    "three steps, MultiStepTransform": learnt(in_a_buffer),
}
print("torchrl", torchrl.__version__, "torch", torch.__version__)
print("expected values:", true)
for name, values in seen.items():
    print(f"seen, {name}: {values}")
print("sums of rewards:", [round(float(r), 2) for r in three_steps["next", "reward"].flatten()])
places = three_steps["next", "observation"].argmax(-1).flatten().tolist()
ends = three_steps["next", "terminated"].flatten().tolist()
print("places after them:", places, "- terminated:", ends)
one, *three = seen.values()
as_found = one == true and all(values == [true[0], 10.0, 10.0, 1.0] for values in three)
as_found = as_found and places == [3, 4, 4, 4] and ends == [False, False, False, True]
sys.exit(0 if as_found else "changed")
PYTHON
