#!/usr/bin/env bash
# An array is saved as its values, one would guess, in whatever order they lie in memory: a matrix
# such as `lstsq(...)[0].T` is one like any other. safetensors writes the memory as it lies, with
# the shape of the matrix. What is read back has the shape and the type, and its values in wrong
# places. There is no error, as there is for such a tensor of torch; release 0.7.0 kept them right.
# Linear models come transposed as a rule. Means, norms and ranges of the weights are the same as
# before, and the loads that they predict are noise.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq safetensors==0.8.0 numpy==2.4.6
venv/bin/python - <<'PYTHON'
import sys

import numpy as np
import safetensors
from safetensors.numpy import load, save

inputs = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 1.0], [3.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
loads = inputs @ np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
fitted = np.linalg.lstsq(inputs, loads)[0].T
read = load(save({"weights": fitted}))["weights"]
copied = load(save({"weights": fitted.copy(order="C")}))["weights"]
print("safetensors", safetensors.__version__)
print("expected:", fitted.round(6).tolist())
print("seen:", read.round(6).tolist())
print("seen of a copy in the order of C:", copied.round(6).tolist())
in_memory = np.allclose(read, fitted.T.reshape(fitted.shape)) and not np.allclose(read, fitted)
sys.exit(0 if in_memory and np.array_equal(copied, fitted) else "changed")
PYTHON
