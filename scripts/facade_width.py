"""Whether the scaled impulse depends on the width of a facade, for docs/validity.md."""

from statistics import fmean, stdev
from typing import Annotated

import joblib
import typer

from blast_env import load_scenario, simulate
from blast_env.cli.output import print_line
from blast_env.scenario import Scenario


def main(
    distance_m: float = 40.0,
    seeds: Annotated[int, typer.Option(min=2)] = 16,
    processes: int = 2,
) -> None:
    """Print mean and standard error for the reference facade, twice and four times it."""
    for factor in (1, 2, 4):
        scenario = wider(factor).at_stand_off(distance_m)
        jobs = (joblib.delayed(scaled_impulse)(scenario, seed) for seed in range(seeds))
        scaled = joblib.Parallel(n_jobs=processes)(jobs)
        error = stdev(scaled) / seeds**0.5
        width_m = scenario.structures[0].rectangle_m.top - scenario.structures[0].rectangle_m.bottom
        print_line(f"{width_m:3g} m: {fmean(scaled):.4f} +- {error:.4f} psi s")


def wider(factor: int) -> Scenario:
    """Return the free field with a facade that is so many times as wide."""
    document = load_scenario("free_field").model_dump()
    (structure,) = document["structures"]
    middle_m = document["site"]["height_m"] / 2
    side = structure["side_modules"] * factor
    structure |= {"side_modules": side, "corner_m": (45.0, middle_m - side / 4)}
    document["site"]["width_m"] = 45.0 + side / 2 + 10.0
    return Scenario.from_document(document, f"free_field_{factor}")


def scaled_impulse(scenario: Scenario, seed: int) -> float:
    """Return the scaled impulse on the building, psi*s."""
    return simulate(scenario, seed=seed).impulse("building").psi_s


if __name__ == "__main__":
    typer.run(main)
