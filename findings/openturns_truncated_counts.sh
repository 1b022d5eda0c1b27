#!/usr/bin/env bash
# Four lorries a day pass a gate on average (Poisson), and the days with two to seven count:
# `TruncatedDistribution(Poisson(4), 2, 7)`. One would guess that its distribution function is the
# sum of its probabilities. OpenTURNS gives 17.1 per cent for two lorries, and 0 for two or fewer.
# The chance at the lower limit is missing from the function everywhere below the upper limit, and
# is given back there, all at once: six or fewer have 76.0 instead of 93.0 per cent. Quantiles are
# those of this function, and so is the complement; draws, probabilities and moments are right.
# With a limit between two numbers (1.5 for 2) all is right, and for continuous distributions too.
# The sum of the probabilities was wrong once and was mended (issue 2076).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq openturns==1.27.post1 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import openturns as ot

FIRST, LAST = 2, 7
numbers = [float(count) for count in range(FIRST, LAST + 1)]
parts = {}
for lower in (2.0, 1.5):
    lorries = ot.TruncatedDistribution(ot.Poisson(4.0), lower, float(LAST))
    ot.RandomGenerator.SetSeed(0)
    draws = np.array(lorries.getSample(100_000)).ravel()
    chances = np.array([lorries.computePDF([count]) for count in numbers])
    parts[lower] = {
        "chances": chances,
        "their sums": chances.cumsum(),
        "shares of draws": np.array([np.mean(draws <= count) for count in numbers]),
        "distribution function": np.array([lorries.computeCDF([count]) for count in numbers]),
        "tenth": lorries.computeQuantile(0.1)[0],
        "nine tenths": lorries.computeQuantile(0.9)[0],
    }
print("OpenTURNS", ot.__version__)
for lower, found in parts.items():
    print(f"seen with a lower limit of {lower}, for {FIRST} to {LAST} lorries:")
    for name, values in found.items():
        print(f"  {name}: {np.round(values, 3).tolist()}")
print("expected: the distribution function as the sums, a tenth at 2, nine tenths at 6")
at_two, between = parts[2.0], parts[1.5]
missing = at_two["chances"][0] * (np.array(numbers) < LAST)
as_found = np.allclose(at_two["distribution function"], at_two["their sums"] - missing)
as_found = as_found and at_two["distribution function"][0] == 0.0 < 0.17 < missing[0]
as_found = as_found and at_two["tenth"] == 3.0
as_found = as_found and np.allclose(between["distribution function"], between["their sums"])
as_found = as_found and (between["tenth"], between["nine tenths"]) == (2.0, 6.0)
for found in parts.values():
    as_found = as_found and np.allclose(found["shares of draws"], found["their sums"], atol=0.01)
sys.exit(0 if as_found else "changed")
PYTHON
