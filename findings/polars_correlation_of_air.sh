#!/usr/bin/env bash
# Two gauges record 101,325 Pa and a wave of 20 Pa, in single precision, whose steps are 0.008 Pa
# there. How the waves go together from moment to moment is `rolling_corr` of Polars over ten values.
# One would guess that it is what `corr` gives of the same ten values, 0.53 to 0.97 here, and that
# no correlation is above one. Most are 0, one is 12.3 and another one 18.7. `rolling_cov` is 0 as
# well, or 1,138 Pa2 where 77 is right.
# Both take a product of two means from a mean of products, each of the size of the square of the
# pressures, and lose all digits of the waves. `corr` takes the means off first, and is right.
# In double precision it is the same with seconds since 1970: a straight line in time has correlations
# of 0.9988 to 1.0012. What is lost goes with the square of the mean over that of the deviation, so
# that pressures without the air are right. There is no message. That some correlations are above
# one is known to the developers (issue 21491).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq polars==2.1.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import polars as pl

AIR_PA, WINDOW, COUNT = 101_325.0, 10, 40


def rolling(first, second, kind):
    """Return correlations over windows: rolling, of each by itself, and of NumPy in double."""
    frame = pl.DataFrame({"a": first, "b": second}, schema={"a": kind, "b": kind})
    at_once = frame.select(pl.rolling_corr("a", "b", window_size=WINDOW))["a"].drop_nulls()
    parts = [frame[start : start + WINDOW] for start in range(COUNT - WINDOW + 1)]
    alone = [part.select(pl.corr("a", "b")).item() for part in parts]
    exact = [np.corrcoef(part["a"].cast(float), part["b"].cast(float))[0, 1] for part in parts]
    return at_once.to_numpy(), np.array(alone), np.array(exact)


print("Polars", pl.__version__)
steps = np.arange(COUNT)
waves = 20.0 * np.sin(steps / 3.0), 20.0 * np.sin(steps / 3.0 + 0.5)
cases = {
    "air and waves, single": (*(AIR_PA + wave for wave in waves), pl.Float32),
    "air and waves, double": (*(AIR_PA + wave for wave in waves), pl.Float64),
    "waves alone, single": (*waves, pl.Float32),
    "a line over seconds since 1970": (1.79e9 + steps / 1000.0, 3.0 * steps, pl.Float64),
}
off = {}
for name, case in cases.items():
    at_once, alone, exact = rolling(*case)
    off[name] = [float(np.abs(found - exact).max()) for found in (at_once, alone)]
    print(f"{name}: expected {exact[:4].round(3)}, seen {at_once[:4].round(3)}, in all", end=" ")
    print(f"{at_once.min():.4f} to {at_once.max():.4f}; off by {off[name][0]:.1g}", end=" ")
    print(f"rolling, and by {off[name][1]:.1g} where each window is by itself")
at_once, _, _ = rolling(*cases["air and waves, single"])
print("zeros:", int((at_once == 0.0).sum()), "of", len(at_once))
as_found = at_once.max() > 18.0 and (at_once == 0.0).sum() > len(at_once) / 2
as_found = as_found and all(alone < 1e-6 for _, alone in off.values())
as_found = as_found and off["waves alone, single"][0] < 1e-5 and off["air and waves, double"][0] < 1e-5
sys.exit(0 if as_found and off["a line over seconds since 1970"][0] > 1e-4 else "changed")
PYTHON
