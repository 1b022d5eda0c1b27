#!/usr/bin/env bash
# A barrier is compared with three others on the same six sites, and the three p values are
# corrected for their number. On the third comparison the barriers do the same everywhere, for which
# the t test has no p value: SciPy gives NaN. One would guess that the corrected table says NaN
# there, and that nothing is found. statsmodels' `multipletests` says NaN for the value, and True
# for the decision: by Holm's method, and by Holm-Sidak, the one used if none is named, a comparison
# without any difference is significant. NaN is sorted as the largest value, and everything is
# rejected until a value is found that is above its limit, which NaN never is.
# It is so if all the others are significant. By Bonferroni it is False. By Benjamini-Hochberg the
# decisions are right, and all corrected values are NaN. There is no message.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq statsmodels==0.15.0 scipy==1.17.1 pandas==3.1.1 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import statsmodels
from scipy.stats import ttest_rel
from statsmodels.stats.multitest import multipletests

barrier = np.array([31.0, 42.0, 28.0, 35.0, 39.0, 30.0])  # per cent of the impulse taken off
others = [
    barrier - [5.0, 6.0, 4.0, 5.5, 4.5, 6.5],
    barrier - [9.0, 7.0, 8.0, 8.5, 9.5, 7.5],
    barrier.copy(),
]
p_values = [float(ttest_rel(barrier, other).pvalue) for other in others]
seen = {}
for method in ("holm", "holm-sidak", "bonferroni", "fdr_bh"):
    rejected, corrected = multipletests(p_values, method=method)[:2]
    seen[method] = rejected.tolist(), np.isnan(corrected).tolist()
by_default = multipletests(p_values)[0].tolist()
print("statsmodels", statsmodels.__version__)
print("expected: differences found [True, True, False], NaN for the third value alone")
print("seen: p values", p_values)
for method, (rejected, without) in seen.items():
    print(f"seen, {method}: differences {rejected}, corrected value is NaN {without}")
print("seen, no method named: differences", by_default)
right, third = [True, True, False], [False, False, True]
as_found = np.isnan(p_values[2]) and max(p_values[:2]) < 0.001 and all(by_default)
as_found = as_found and seen["holm"] == seen["holm-sidak"] == ([True] * 3, third)
as_found = as_found and seen["bonferroni"] == (right, third)
as_found = as_found and seen["fdr_bh"] == (right, [True] * 3)
sys.exit(0 if as_found else "changed")
PYTHON
