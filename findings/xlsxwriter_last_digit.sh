#!/usr/bin/env bash
# Loads of 10,000 runs are written into a workbook and read again. A workbook has doubles, as text
# in XML, so one would guess that what is read is what was written, as it is in CSV, where Python
# and pandas write as many digits as a number needs. A double may need 17. XlsxWriter and
# openpyxl, the two packages by which pandas writes workbooks, both write 16. Of loads that fill a
# double, 44 per cent come back with another last bit; 0.1 + 0.2 becomes 0.3.
# There is no message. A comparison for equality, a hash of the numbers or a join on them misses
# nearly half of the runs.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq XlsxWriter==3.3.1 openpyxl==3.1.5 pandas==3.1.1 numpy==2.4.6
venv/bin/python -W error - <<'PYTHON'
import sys

import numpy as np
import openpyxl
import pandas as pd
import xlsxwriter

loads_pa_s = np.random.default_rng(0).lognormal(6.0, 1.0, 10_000)
frame = pd.DataFrame({"load": loads_pa_s})


def kept(engine):
    """Return which share of the loads comes back, and the largest relative difference."""
    frame.to_excel("loads.xlsx", engine=engine, index=False)
    back = pd.read_excel("loads.xlsx", engine="openpyxl")["load"].to_numpy()
    differences = np.abs(back / loads_pa_s - 1.0)
    return round(float((back == loads_pa_s).mean()), 2), float(differences.max())


frame.to_csv("loads.csv", index=False)
from_csv = pd.read_csv("loads.csv")["load"].to_numpy()
seen = {engine: kept(engine) for engine in ("xlsxwriter", "openpyxl")}
print("xlsxwriter", xlsxwriter.__version__, "openpyxl", openpyxl.__version__)
print("expected: all loads as they were, as from CSV:", bool((from_csv == loads_pa_s).all()))
print("seen, share that is as it was and largest relative difference:", seen)
as_found = all(share == 0.56 and 0.0 < off < 1e-15 for share, off in seen.values())
sys.exit(0 if as_found else "changed")
PYTHON
