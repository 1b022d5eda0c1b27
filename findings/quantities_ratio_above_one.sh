#!/usr/bin/env bash
# Is the load above what a wall bears? 3 kPa arrive, it bears 0.5 psi (3.4 kPa). The quotient of two
# quantities of the library quantities is 6 kPa/psi, which is 0.87: `simplified` says so, and
# quotient + 1 is 12.9 kPa/psi, which is 1.87: the 1 is converted before it is added. One would guess
# that it is before a comparison, too. It is not: quotient > 1 compares the 6 with the 1, and the wall
# fails, although `load > bears` is False. With a 1 that is a quantity itself, it is right. No warning.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq quantities==0.16.4 numpy==2.4.6
venv/bin/python -W error - <<'PYTHON'
import sys

import numpy as np
import quantities as units

load, bears = np.array(3.0) * units.kPa, np.array(0.5) * units.psi
ratio = load / bears
seen = {
    "load > bears": bool(load > bears),
    "simplified > 1": bool(ratio.simplified > 1.0),
    "ratio + 1, less 1": round(float((ratio + 1.0).simplified) - 1.0, 2),
    "ratio > 1 as a quantity": bool(ratio > 1.0 * units.dimensionless),
    "ratio > 1": bool(ratio > 1.0),
}
print("quantities", units.__version__, "numpy", np.__version__)
print("expected: a ratio of 0.87, and nothing above")
for name, value in seen.items():
    print(f"seen, {name}:", value)
wanted = dict.fromkeys(seen, False) | {"ratio + 1, less 1": 0.87, "ratio > 1": True}
sys.exit(0 if seen == wanted else "changed")
PYTHON
