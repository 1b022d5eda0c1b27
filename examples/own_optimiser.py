"""An optimiser of your own, which `blast-env judge --method own_optimiser:climb` enters."""

import numpy as np

from blast_env.benchmark import BenchmarkProblem, make, play


def climb(problem: BenchmarkProblem, seed: int) -> tuple[()]:
    """Change a fifth of the keys at a time, keep gains; the budget ends it."""
    rng = np.random.default_rng(seed)
    keys = rng.random(problem.space.keys)
    best = problem.evaluate(problem.space.from_keys(keys))
    while True:
        tried = np.where(rng.random(len(keys)) < 0.2, rng.random(len(keys)), keys)
        share = problem.evaluate(problem.space.from_keys(tried))
        if share <= best:
            keys, best = tried, share


if __name__ == "__main__":
    (run,) = play(climb, [(lambda budget: make("control_room-known-v2", budget), 5, 0)])
    print(f"{run.blasts} blasts: {1.0 - run.curve[-1][1]:.1%} of the load taken off")
