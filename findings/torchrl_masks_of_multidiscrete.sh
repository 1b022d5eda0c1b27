#!/usr/bin/env bash
# Masks of one form serve both kinds of discrete actions, one would guess: Gymnasium takes masks of
# int8 alone for Discrete and for MultiDiscrete. TorchRL casts such a mask for OneHot, the spec that it
# makes of Discrete, and refuses the same values for MultiOneHot, the spec of MultiDiscrete. So its
# ActionMask, which reads the mask of an environment at each step, works with the one action and is an
# error with the other, until a transform has made the mask a bool.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq torchrl==0.14.1 torch==2.13.0 gymnasium==1.4.0 numpy==2.4.6
venv/bin/python - <<'PYTHON'
import sys

import gymnasium
import numpy as np
import torch
import torchrl
from torchrl.data import MultiOneHot, OneHot

drawn = gymnasium.spaces.Discrete(3, seed=0).sample(mask=np.array([0, 1, 0], dtype=np.int8))
both = gymnasium.spaces.MultiDiscrete([3, 2], seed=0).sample(
    mask=(np.array([0, 1, 0], dtype=np.int8), np.array([1, 0], dtype=np.int8))
)


def outcome(spec, mask):
    try:
        spec.update_mask(mask)
    except ValueError as error:
        return str(error)
    return spec.rand().int().tolist()


flat = outcome(OneHot(3), torch.tensor([0, 1, 0], dtype=torch.int8))
several = outcome(MultiOneHot([3, 2]), torch.tensor([0, 1, 0, 1, 0], dtype=torch.int8))
as_bool = outcome(MultiOneHot([3, 2]), torch.tensor([0, 1, 0, 1, 0], dtype=torch.bool))
print("torchrl", torchrl.__version__, "gymnasium", gymnasium.__version__)
print("gymnasium draws with masks of int8:", int(drawn), both.tolist())
print("expected: OneHot and MultiOneHot take masks of int8 alike")
print("seen, OneHot:", flat)
print("seen, MultiOneHot:", several)
print("seen, MultiOneHot with bool:", as_bool)
is_same = flat == [0, 1, 0] and isinstance(several, str) and as_bool == [0, 1, 0, 1, 0]
sys.exit(0 if is_same else "changed")
PYTHON
