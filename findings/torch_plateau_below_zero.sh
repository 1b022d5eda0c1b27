#!/usr/bin/env bash
# `ReduceLROnPlateau` takes the rate down when a measure has not got better for some time. One would
# guess that a constant measure is a plateau. It is one above zero. Below zero the threshold, a
# share of the best value, is added on the wrong side, so that the same value counts as better each
# time: the rate is never reduced. Measures that get slowly worse count as better too, and the best
# value follows them down.
# Rewards that are damages, and logarithms of likelihoods, are below zero. With the same measure
# plus 200 the rate is reduced.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq torch==2.13.0 numpy==2.4.6
venv/bin/python - <<'PYTHON'
import sys

import torch
from torch.optim.lr_scheduler import ReduceLROnPlateau


def followed(measures):
    """Return the rate after these measures, of which the largest is sought, and the best value."""
    optimiser = torch.optim.SGD([torch.nn.Parameter(torch.zeros(1))], lr=1.0)
    schedule = ReduceLROnPlateau(optimiser, mode="max", patience=5, min_lr=1e-3)
    for measure in measures:
        schedule.step(measure)
    return round(optimiser.param_groups[0]["lr"], 6), round(schedule.best, 6)


constant, worse = [-100.0] * 50, [-100.0 - 0.005 * k for k in range(50)]
seen = {
    "constant": followed(constant),
    "worse": followed(worse),
    "constant, plus 200": followed([each + 200.0 for each in constant]),
    "worse, plus 200": followed([each + 200.0 for each in worse]),
}
print("torch", torch.__version__)
print("expected: a rate of 0.001 at the end, and the first value as the best, of each")
print("seen, rate and best value:", seen)
wanted = {
    "constant": (1.0, -100.0),
    "worse": (1.0, -100.245),
    "constant, plus 200": (0.001, 100.0),
    "worse, plus 200": (0.001, 100.0),
}
sys.exit(0 if seen == wanted else "changed")
PYTHON
