#!/usr/bin/env bash
# A kernel of a simulation takes a named tuple of the charge, and `cache=True` keeps its machine code
# on disk. The next version of the library gives the tuple a better name; the file of the kernel is
# the same. One would guess that numba finds no code for the new type and compiles it. It raises an
# AttributeError at the first call, in every process from then on, until someone deletes the code on
# disk: its list of what is kept names types by where they were defined, and all of it is read before
# anything is compared. Package managers leave that list in place when they install a new version.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq numba==0.68.1
mkdir blasts
touch blasts/__init__.py
cat > blasts/kernels.py <<'PYTHON'
from numba import njit


@njit(cache=True)
def scaled_m(charge):
    return charge.distance_m / charge.tnt_kg ** (1.0 / 3.0)
PYTHON
cat > call.py <<'PYTHON'
from blasts import charges
from blasts.kernels import scaled_m

(tuple_class,) = [own for own in vars(charges).values() if hasattr(own, "_fields")]
try:
    print(scaled_m(tuple_class(10.0, 8.0)))
except AttributeError as error:
    print("AttributeError:", error.args[0].partition(" on ")[0])
PYTHON
for name in Asked Charge; do
    cat > blasts/charges.py <<PYTHON
from typing import NamedTuple


class $name(NamedTuple):
    distance_m: float
    tnt_kg: float


del NamedTuple
PYTHON
    venv/bin/python -B call.py >> seen
done
venv/bin/python -c 'import numba; print("numba", numba.__version__)'
echo "expected: 5.0 by the first version and by the second"
echo "seen:"
cat seen
diff seen - <<'EXPECTED'
5.0
AttributeError: Can't get attribute 'Asked'
EXPECTED
