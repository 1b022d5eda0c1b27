"""Whether the scaled impulse depends on the width of a facade, for docs/validity.md."""

from statistics import fmean, stdev
from typing import Annotated

import joblib
import typer

from blast_env import load_scenario, simulate
from blast_env.cli.output import print_line
from blast_env.scenario import Scenario
from blast_env.units import MODULE_SIDE_M

FACADES_MODULES = (20, 40, 80)
"""The calibrations' reference facade, twice and four times it."""


def main(
    distance_m: float = 40.0,
    seeds: Annotated[int, typer.Option(min=2)] = 16,
    processes: int = 2,
) -> None:
    """Print mean and standard error for the reference facade, twice and four times it."""
    for side_modules in FACADES_MODULES:
        scenario = free_field_with_facade(side_modules).at_stand_off(distance_m)
        jobs = (joblib.delayed(scaled_impulse)(scenario, seed) for seed in range(seeds))
        scaled = joblib.Parallel(n_jobs=processes)(jobs)
        error = stdev(scaled) / seeds**0.5
        width_m = side_modules * MODULE_SIDE_M
        print_line(f"{width_m:3g} m: {fmean(scaled):.4f} +- {error:.4f} psi s")


def free_field_with_facade(side_modules: int) -> Scenario:
    """Return the free field with a facade of another width; the strip behind it stays."""
    document = load_scenario("free_field").model_dump()
    (structure,) = document["structures"]
    middle_m = document["site"]["height_m"] / 2
    document["site"]["width_m"] += (side_modules - structure["side_modules"]) * MODULE_SIDE_M
    structure["corner_m"] = (structure["corner_m"][0], middle_m - side_modules * MODULE_SIDE_M / 2)
    structure["side_modules"] = side_modules
    return Scenario.from_document(document, f"free_field with {side_modules} modules")


def scaled_impulse(scenario: Scenario, seed: int) -> float:
    """Return the scaled impulse on the building, psi*s."""
    return simulate(scenario, seed=seed).impulse("building").psi_s


if __name__ == "__main__":
    typer.run(main)
