#!/usr/bin/env bash
# A Gaussian process has learnt peak loads from 800 runs, which have no noise to speak of. One would
# guess that run 801 makes it a little surer. With GPyTorch its deviation grows sixfold, and its
# largest error doubles: above 800 runs it goes over from an exact solution to an iteration that
# stops early. There is no warning.
# Less still would one guess that an import which nobody uses takes that back. `import botorch`
# turns the iteration off for GPyTorch too, in the whole process.
# A notebook that has BoTorch somewhere and a script that has not give other predictions by the same
# model, the same runs and the same seed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq botorch==0.18.1 gpytorch==1.15.2 linear_operator==0.6.1 torch==2.13.0 numpy==2.4.6
cat > predict.py <<'PYTHON'
import sys

import torch

if "botorch" in sys.argv:
    import botorch
import gpytorch
from gpytorch.kernels import MaternKernel, ScaleKernel


class Loads(gpytorch.models.ExactGP):
    def __init__(self, places, loads, likelihood):
        super().__init__(places, loads, likelihood)
        self.mean = gpytorch.means.ConstantMean()
        self.kernel = ScaleKernel(MaternKernel(nu=2.5))

    def forward(self, places):
        return gpytorch.distributions.MultivariateNormal(self.mean(places), self.kernel(places))


def load(places):
    return torch.sin(6.0 * places[:, 0]) * torch.exp(-places[:, 1])


torch.manual_seed(0)
places = torch.rand(801, 2, dtype=torch.double)
others = torch.rand(200, 2, dtype=torch.double)
for runs in (800, 801):
    likelihood = gpytorch.likelihoods.GaussianLikelihood().double()
    likelihood.noise = 1e-4
    model = Loads(places[:runs], load(places[:runs]), likelihood).double().eval()
    model.kernel.base_kernel.lengthscale = 0.5
    with torch.no_grad():
        found = model(others)
    error = (found.mean - load(others)).abs().max()
    print(runs, f"{float(found.stddev.mean()):.4f} {float(error):.4f}")
PYTHON
venv/bin/python predict.py >without.txt
venv/bin/python predict.py botorch >with.txt
venv/bin/python - <<'PYTHON'
import sys
from importlib.metadata import version


def read(name):
    """Return mean deviation and largest error by runs."""
    with open(name) as lines:
        rows = [[float(word) for word in line.split()] for line in lines]
    return {int(runs): (deviation, error) for runs, deviation, error in rows}


without, with_it = read("without.txt"), read("with.txt")
print("gpytorch", version("gpytorch"), "botorch", version("botorch"))
print("expected: deviation and error of 801 runs as those of 800, whatever is imported")
print("seen:", without)
print("seen after an import of botorch:", with_it)
same = [without[800], with_it[800], with_it[801]]
as_found = all(0.005 < deviation < 0.007 and error < 0.03 for deviation, error in same)
as_found = as_found and without[801][0] > 0.03 and without[801][1] > 0.04
sys.exit(0 if as_found else "changed")
PYTHON
