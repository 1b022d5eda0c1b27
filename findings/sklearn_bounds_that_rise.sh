#!/usr/bin/env bash
# A load falls with distance, and a surrogate can be told so: `monotonic_cst=[-1]` in
# scikit-learn's histogram boosting, `monotone_constraints` in XGBoost. For an upper bound it is
# fitted to the quantile of 90 per cent. One would guess that the bound never rises, as the mean
# never does. Both keep the constraint while a tree grows. For quantiles and absolute errors they
# then give the leaves new values, quantiles of what lies in them, and do not look at the
# constraint again. The bound rises with distance at several places, here by up to 5 kPa at once.
# There is no message. LightGBM, which also gives leaves new values, refuses a constraint with
# these two losses.
# The first distance at which the bound is below a limit is no safe distance: the bound can be
# above it farther away.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq scikit-learn==1.9.1 xgboost-cpu==3.2.0 lightgbm==4.7.0 \
    numpy==2.4.6 scipy==1.17.1
OMP_NUM_THREADS=1 venv/bin/python -W ignore - <<'PYTHON'
import sys

import lightgbm
import numpy as np
import sklearn
import xgboost
from sklearn.ensemble import HistGradientBoostingRegressor

LOSSES = {"squared_error": "squarederror", "absolute_error": "absoluteerror"}
LOSSES["quantile"] = "quantileerror"
rng = np.random.default_rng(0)
distances_m = rng.uniform(10.0, 60.0, (2000, 1))
loads_kpa = 2000.0 / distances_m[:, 0] * rng.lognormal(0.0, 0.3, 2000)
asked_m = np.linspace(10.0, 60.0, 1000)[:, None]


def rises(model):
    """Return at how many steps a fitted model rises with distance, and its largest rise (kPa)."""
    steps_kpa = np.diff(model.fit(distances_m, loads_kpa).predict(asked_m).astype(float))
    return int((steps_kpa > 0.0).sum()), round(max(0.0, float(steps_kpa.max())), 1)


def refused(objective):
    model = lightgbm.LGBMRegressor(objective=objective, monotone_constraints=[-1], verbose=-1)
    try:
        model.fit(distances_m, loads_kpa)
    except lightgbm.basic.LightGBMError:
        return True
    return False


seen = {}
for loss, name in LOSSES.items():
    of_sklearn = HistGradientBoostingRegressor(loss=loss, quantile=0.9, monotonic_cst=[-1])
    of_xgboost = xgboost.XGBRegressor(
        objective=f"reg:{name}", quantile_alpha=0.9, monotone_constraints=(-1,)
    )
    seen[loss] = rises(of_sklearn), rises(of_xgboost)
by_lightgbm = [refused(objective) for objective in ("regression", "regression_l1", "quantile")]
print("scikit-learn", sklearn.__version__, "xgboost", xgboost.__version__)
print("lightgbm", lightgbm.__version__, "- refuses the three losses:", by_lightgbm)
print("expected: no rise with distance")
for loss, found in seen.items():
    print(f"seen, {loss}: steps that rise of 999, largest rise (kPa)", *found)
as_found = seen["squared_error"] == ((0, 0.0), (0, 0.0)) and by_lightgbm == [False, True, True]
as_found = as_found and all(
    count > 1 and rise_kpa > 1.0
    for loss in ("absolute_error", "quantile")
    for count, rise_kpa in seen[loss]
)
sys.exit(0 if as_found else "changed")
PYTHON
