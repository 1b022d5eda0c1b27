#!/usr/bin/env bash
# A wall is 1, 2 or 3 modules high. In SMT's design space that is an IntegerVariable or, as these
# are the sizes on sale, an OrdinalVariable with three values. One would guess that a Latin
# hypercube has each size equally often. It has with integers. Of ordered values the first and the
# last are half as often as the others: they are drawn as a number from 0 to 2 that is rounded.
# Of four sizes the ends are a sixth each, of two they are a half. What a surrogate says of the
# lowest and the highest wall, where it matters most, rests on half the runs of those between.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq smt==2.15.0 numpy==2.4.6 scipy==1.17.1
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys

import numpy as np
from smt.applications.mixed_integer import MixedIntegerSamplingMethod
from smt.design_space import DesignSpace, IntegerVariable, OrdinalVariable
from smt.sampling_methods import LHS

RUNS = 1200


def shares(variable):
    """Return which share of the runs each value has."""
    drawn = MixedIntegerSamplingMethod(LHS, DesignSpace([variable]), seed=0)(RUNS)
    counts = np.unique(drawn, return_counts=True)[1]
    return [round(float(count) / RUNS, 2) for count in counts]


integers, ordered = {}, {}
for many in (2, 3, 4):
    integers[many] = shares(IntegerVariable(1, many))
    ordered[many] = shares(OrdinalVariable([str(size) for size in range(1, many + 1)]))
print("smt", importlib.metadata.version("smt"))
print("expected: shares of 0.5, 0.33 and 0.25 of 2, 3 and 4 sizes")
print("seen, integers:", *integers.values())
print("seen, ordered:", *ordered.values())
as_found = list(integers.values()) == [[0.5] * 2, [0.33] * 3, [0.25] * 4]
as_found = as_found and ordered[2] == [0.5, 0.5] and ordered[3] == [0.25, 0.5, 0.25]
as_found = as_found and ordered[4] == [0.17, 0.33, 0.33, 0.17]
sys.exit(0 if as_found else "changed")
PYTHON
