#!/usr/bin/env bash
# A vehicle carries between 0 and 2 t, whatever its distribution says beyond. chaospy truncates any
# distribution: `Trunc(distribution, lower=0, upper=2)`. One would guess that a uniform one over
# -1 to 3 is then uniform over 0 to 2. Between the limits its density is 0.444 instead of 0.5, half
# of all lies below 1.125, and one draw in nine is exactly the upper limit: what lies beyond the
# lower limit is counted twice when the whole is made one again.
# With one limit it is right, also if there are two in a row: `Trunc(Trunc(d, lower=0), upper=2)`.
# Moments (`E`) are right as well: expansions and draws are of two distributions, and loads from
# draws are those of charges that are too large. The more lies below the lower limit, the worse.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq chaospy==4.3.21 numpy==2.4.6 scipy==1.17.1
venv/bin/python -W ignore - <<'PYTHON'
import sys

import chaospy
import numpy as np

LOWER, UPPER = 0.0, 2.0
whole = chaospy.Uniform(-1.0, 3.0)
kinds = {
    "both limits": chaospy.Trunc(whole, lower=LOWER, upper=UPPER),
    "one after the other": chaospy.Trunc(chaospy.Trunc(whole, lower=LOWER), upper=UPPER),
}
seen = {}
for name, mass_t in kinds.items():
    draws = mass_t.sample(9000, rule="halton")
    seen[name] = {
        "density at 1 t": float(mass_t.pdf(1.0)),
        "share below 1 t": float(mass_t.cdf(1.0)),
        "median (t)": float(mass_t.inv(0.5)),
        "mean by E (t)": float(chaospy.E(mass_t)),
        "mean of draws (t)": float(draws.mean()),
        "share of draws at 2 t": float(np.mean(draws == UPPER)),
    }
print("chaospy", chaospy.__version__)
expected = dict(zip(seen["both limits"], (0.5, 0.5, 1.0, 1.0, 1.0, 0.0)))
print("expected:", expected)
for name, numbers in seen.items():
    print(f"seen, {name}:", {key: round(number, 3) for key, number in numbers.items()})
wrong = np.array([4 / 9, 4 / 9, 9 / 8, 1.0, 10 / 9, 1 / 9])
as_found = np.allclose(list(seen["both limits"].values()), wrong, atol=1e-3)
right = list(expected.values())
as_found = as_found and np.allclose(list(seen["one after the other"].values()), right, atol=1e-3)
sys.exit(0 if as_found else "changed")
PYTHON
