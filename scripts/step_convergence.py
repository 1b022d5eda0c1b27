"""How the load on a building depends on the time step, for docs/model.md.

Prints a Markdown table: mean over seeds of m |v| and of the transferred impulse, by the distance
that the fastest ball covers in a step.
"""

from statistics import fmean

from blast_env import load_scenario
from blast_env.cli.output import print_line, progress_bar
from blast_env.scenario import Scenario
from blast_env.simulation import simulate

STEPS_RADII = (0.5, 0.25, 0.1, 0.05)
SEEDS = range(4)


def main() -> None:
    """Run the study."""
    free_field = load_scenario("free_field")
    scenarios = {
        "courtyard": load_scenario("courtyard").with_simulation("ballistic"),
        "free_field, 15 m": free_field.at_stand_off(15.0),
        "free_field, 60 m": free_field.at_stand_off(60.0),
    }
    print_line(f"| {' | '.join(['scenario', *(f'{s:g} radii' for s in STEPS_RADII)])} |")
    print_line("|---" * (1 + len(STEPS_RADII)) + "|")
    with progress_bar("blasts") as progress:
        for number, (name, scenario) in enumerate(scenarios.items()):
            cells = []
            for count, step_radii in enumerate(STEPS_RADII):
                progress((number + count / len(STEPS_RADII)) / len(scenarios))
                impulse, transferred = mean_load(scenario, step_radii)
                cells.append(f"{impulse:,.0f} ({transferred:,.0f})")
            print_line(f"| {name} | {' | '.join(cells)} |")


def mean_load(scenario: Scenario, step_radii: float) -> tuple[float, float]:
    """Return the mean m |v| and transferred impulse on the building, simulation units."""
    stepped = scenario.with_simulation(overrides={"stepping": {"step_radii": step_radii}})
    loads = [simulate(stepped, seed=seed).obstacle("building") for seed in SEEDS]
    return fmean(o.impulse for o in loads), fmean(o.transferred_impulse for o in loads)


if __name__ == "__main__":
    main()
