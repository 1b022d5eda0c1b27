#!/usr/bin/env bash
# Directions in whole degrees, and differences of them, are brought below a full turn by
# `np.fmod(x, 360)`, which keeps the sign: -90 stays -90, and -450 becomes -90. Counts are made one
# by `np.sign`. One would guess that a compiled function does the same. Numba takes the remainder of
# whole numbers as if they had no sign: -90 degrees become 286, which looks like a direction, and is
# 16 degrees off (2**64 is 16 more than a multiple of 360). And it takes the sign of numbers that
# have none as if they had one: of bytes from 128 on it is 255, which is minus one modulo 256.
# With floats both are right, and so is `%`, which has the sign of the divisor. There is no message.
# The remainder is known to the developers since 2022 (issue 8574). We found nothing on the sign.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq numba==0.68.1 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numba
import numpy as np


def below_a_turn(degrees):
    return np.fmod(degrees, 360)


def modulo_a_turn(degrees):
    return degrees % 360


def signs(counts):
    return np.sign(counts)


turns = [-450, -90, 0, 90, 450]
counts = [0, 1, 127, 128, 255]
cases = {
    "fmod of whole degrees": (below_a_turn, np.array(turns)),
    "fmod of degrees in float": (below_a_turn, np.array(turns, float)),
    "modulo of whole degrees": (modulo_a_turn, np.array(turns)),
    "sign of bytes": (signs, np.array(counts, np.uint8)),
    "sign of 16 bits": (signs, np.array([0, 1, 32767, 32768, 65535], np.uint16)),
    "sign of counts with a sign": (signs, np.array(counts, np.int16)),
}
seen = {}
print("numba", numba.__version__, "numpy", np.__version__)
for name, (function, values) in cases.items():
    seen[name] = function(values).tolist(), numba.njit(function)(values).tolist()
    print(f"{name} {values.tolist()}: expected {seen[name][0]}; seen {seen[name][1]}")
wrong = {
    "fmod of whole degrees": ([-90, -90, 0, 90, 90], [286, 286, 0, 90, 90]),
    "sign of bytes": ([0, 1, 1, 1, 1], [0, 1, 1, 255, 255]),
    "sign of 16 bits": ([0, 1, 1, 1, 1], [0, 1, 1, 65535, 65535]),
}
as_found = all(seen[name] == pair for name, pair in wrong.items())
as_found = as_found and all(a == b for name, (a, b) in seen.items() if name not in wrong)
sys.exit(0 if as_found else "changed")
PYTHON
