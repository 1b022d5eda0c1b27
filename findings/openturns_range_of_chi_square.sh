#!/usr/bin/env bash
# The sum of squares of ten gauge errors, in units of their deviation, has the chi-square
# distribution of ten degrees of freedom, with a mean of 10. One would guess that OpenTURNS, having
# its density and its distribution function right, has right what it makes of them. It takes the
# distribution to end at 6 (at 60 over the degrees of freedom; as Gamma, which is the same, it ends
# at 88.6), and whatever is integrated numerically stops there: the mean square (`getMoment(2)`) is
# 4 instead of 120, less than the square of the mean; the mean of the root is 0.39 instead of 3.08;
# a quadrature of ten points has a mean of 0.68; truncated to 2 to 30 the mean is 4.6, not 10.0.
# Mean, deviation, quantiles and draws are right, so that a check by draws does not find it. With
# one degree of freedom nothing is wrong, with four the mean square is 6 per cent too small, and the
# more of them there are, the sooner the distribution ends. There is no message.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq openturns==1.27.post1 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import openturns as ot

FREEDOM = 10.0
root = ot.SymbolicFunction("x", "sqrt(x)")


def numbers(errors):
    """Return what is exact of a distribution, and what is integrated."""
    points = ot.GaussProductExperiment(ot.JointDistribution([errors]), [10])
    places, weights = points.generateWithWeights()
    truncated = ot.TruncatedDistribution(errors, 2.0, 30.0)
    return {
        "mean": errors.getMean()[0],
        "deviation": errors.getStandardDeviation()[0],
        "share below 15": errors.computeCDF(15.0),
        "mean square": errors.getMoment(2)[0],
        "mean of the root": ot.CompositeDistribution(root, errors).getMean()[0],
        "mean by a quadrature": float(np.dot(np.array(places).ravel(), weights)),
        "mean between 2 and 30": truncated.getMean()[0],
        "end": errors.getRange().getUpperBound()[0],
    }


ot.RandomGenerator.SetSeed(0)
square, gamma = ot.ChiSquare(FREEDOM), ot.Gamma(FREEDOM / 2.0, 0.5, 0.0)
draws = np.array(square.getSample(200_000)).ravel()
inside = draws[(draws > 2.0) & (draws < 30.0)]
by_draws = [draws.mean(), draws.std(), np.mean(draws < 15.0), np.mean(draws**2)]
by_draws += [np.mean(np.sqrt(draws)), draws.mean(), inside.mean(), draws.max()]
seen, expected = numbers(square), numbers(gamma)
print("OpenTURNS", ot.__version__)
for (name, number), right, drawn in zip(seen.items(), expected.values(), by_draws):
    print(f"{name}: expected {right:.3f} (Gamma), by draws {drawn:.3f}; seen {number:.3f}")
few = [ot.ChiSquare(freedom).getMoment(2)[0] for freedom in (1.0, 4.0, 20.0)]
print("mean squares for 1, 4 and 20 degrees: expected 3, 24, 440; seen", few)
seen, expected = np.array(list(seen.values())), np.array(list(expected.values()))
as_found = np.allclose(seen[:3], expected[:3]) and np.allclose(expected[3:4], 120.0)
as_found = as_found and np.allclose(expected[:-1], by_draws[:-1], rtol=0.02)
as_found = as_found and np.allclose(seen[3:], [3.99, 0.388, 0.676, 4.595, 5.99], rtol=0.01)
as_found = as_found and np.allclose(few, [3.0, 22.568, 0.0], atol=0.001)
sys.exit(0 if as_found else "changed")
PYTHON
