#!/usr/bin/env bash
# `forceinline=True` asks numba to put a function into its callers. One would guess that it is about
# that function alone. What the function calls is compiled with it, and is marked to be put into its
# callers as well, although nobody asked for it. In the kernels of a gas solver small helpers are
# inlined on purpose and long ones are not. The mark travels down from one helper to all that it
# calls, so that the long ones are copied into every place that calls them too.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq numba==0.68.1
venv/bin/python - <<'PYTHON'
import sys

import numba


def long(x):
    total = 0.0
    for k in range(1000):
        total += (x * k) % 3.0
    return total


def is_marked(callee):
    text = callee.inspect_llvm(callee.signatures[0])
    return any("alwaysinline" in line for line in text.splitlines() if "attributes" in line)


def called_by(**options):
    callee = numba.njit(long)
    caller = numba.njit(**options)(lambda x: callee(x) + 1.0)
    numba.njit(lambda x: caller(x))(1.0)
    return is_marked(callee)


seen = called_by(), called_by(forceinline=True)
print("numba", numba.__version__)
print("expected: the callee is not marked alwaysinline, whoever calls it")
print("seen: below a plain caller", seen[0], "- below one with forceinline", seen[1])
sys.exit(0 if seen == (False, True) else "changed")
PYTHON
