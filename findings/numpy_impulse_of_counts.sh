#!/usr/bin/env bash
# Recorders keep pressures as counts in two bytes, up to 32,767. The impulse is their integral over
# time: `np.trapezoid`, whose result is a double. One would guess that it is the same as that of the
# same counts in doubles, as it is with `np.mean`, `np.gradient` and `np.median`. A pulse of 0, 20,000,
# 20,000 and 0 counts has 7,232 instead of 40,000. Two neighbours are added up before they are made
# doubles, and wrap. The steepest rise of the impulse, between the two peaks, is a fall then, also
# with SciPy's `trapezoid` and `cumulative_trapezoid`; `simpson` is right.
# `np.percentile` subtracts neighbours before it makes doubles of them. Of -30,000, -20,000, 20,000
# and 30,000 counts the median is 32,768 by `percentile(counts, [25, 50, 75])`, more than any of
# them, and 0 by `np.median`. A warning comes only if one percentile alone is asked for.
# Both are right as long as two neighbours together stay in two bytes, so that records of weak blasts
# are right. The developers know of both (issue 24919, which was closed, and 30376).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq numpy==2.4.6 scipy==1.17.1
venv/bin/python - <<'PYTHON'
import sys

import numpy as np
import scipy
from scipy import integrate

print("numpy", np.__version__, "scipy", scipy.__version__)
pulse = np.array([0, 20_000, 20_000, 0], np.int16)
integrals = {
    "np.trapezoid": np.trapezoid,
    "trapezoid": integrate.trapezoid,
    "cumulative_trapezoid": integrate.cumulative_trapezoid,
    "simpson": integrate.simpson,
    "np.gradient": np.gradient,
    "np.mean": np.mean,
}
same = {}
for name, of in integrals.items():
    seen, expected = of(pulse), of(pulse.astype(float))
    same[name] = bool(np.allclose(seen, expected))
    print(f"{name}: expected {expected}, seen {seen}")
weak = (pulse // 2).astype(np.int16)
print("half as strong:", np.trapezoid(weak), "of", np.trapezoid(weak.astype(float)))
swings = np.array([-30_000, -20_000, 20_000, 30_000], np.int16)
quarters = np.percentile(swings, [25, 50, 75]).tolist()
print("quarters: expected", np.percentile(swings.astype(float), [25, 50, 75]), "seen", quarters)
print("median:", np.median(swings))
as_found = [name for name, right in same.items() if right] == ["simpson", "np.gradient", "np.mean"]
as_found = as_found and np.trapezoid(pulse) == 7_232.0 and np.trapezoid(weak) == 20_000.0
as_found = as_found and quarters == [-22_500.0, 32_768.0, 22_500.0] and np.median(swings) == 0.0
sys.exit(0 if as_found else "changed")
PYTHON
