"""What the random part of the charge's initial velocity does, for docs/validity.md.

The preset with several thermal shares, and finer balls beside it: reflected impulse over distance,
side-on load over path length, and the ratio of the two, beside Kingery and Bulmash's.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from blast_env.calibration import kingery_bulmash
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.files import write_atomically
from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.presets import preset as find_preset
from blast_env.physics.presets import with_resolution
from blast_env.studies.shielding.ratios import draw_loads
from blast_env.studies.shielding.reflection import ReflectionReport, ReflectionStudy

SHARES = (0.0, 0.25, 0.5, 0.75, 0.9)
DISTANCES_M = (10.0, 25.0)


@dataclass(frozen=True)
class NearField:
    """What a parameter set does between 10 and 25 m from 100 kg TNT.

    Attributes:
        thermal_share: Share of the charge's energy that is random in direction.
        radius_m: Radius of the balls.
        head_on_slope: d ln i / d ln R of the load on a facade that looks at the charge.
        side_on_slope: Likewise of the load on a wall parallel to the flow.
        ratio_near: Head-on over side-on load at 10 m.
        ratio_far: At 25 m.
    """

    thermal_share: float
    radius_m: float
    head_on_slope: float
    side_on_slope: float
    ratio_near: float
    ratio_far: float


def near_field(parameters: SimulationParameters, report: ReflectionReport) -> NearField:
    """Return what a study found."""
    study = report.study
    distance_m = np.array(study.distances_m)
    drawn = draw_loads(report.head_on[:, 0], distance_m, report.side_on, study.geometry)
    head_on, side_on = drawn.loads[0], drawn.free_field[0]
    return NearField(
        thermal_share=parameters.explosive.thermal_share,
        radius_m=parameters.air.radius_units / 4.0,
        head_on_slope=_slope(distance_m, head_on),
        side_on_slope=_slope(distance_m, side_on),
        ratio_near=float(head_on[0] / side_on[0]),
        ratio_far=float(head_on[-1] / side_on[-1]),
    )


def reference() -> NearField:
    """Return Kingery and Bulmash's, of 100 kg TNT on the ground."""
    distance_m = np.array(DISTANCES_M)
    head_on = kingery_bulmash("reflected_impulse", distance_m, 100.0)
    side_on = kingery_bulmash("incident_impulse", distance_m, 100.0)
    ratio = head_on / side_on
    slopes = _slope(distance_m, head_on), _slope(distance_m, side_on)
    return NearField(np.nan, np.nan, *slopes, float(ratio[0]), float(ratio[-1]))


def _slope(distance_m: np.ndarray, load: np.ndarray) -> float:
    return float(np.log(load[-1] / load[0]) / np.log(distance_m[-1] / distance_m[0]))


def main(
    preset: str = "collisional",
    resolutions: Annotated[str, typer.Option(help="Finer balls beside it.")] = "2,3",
    seeds: Annotated[int, typer.Option(min=2)] = 16,
    first_seed: int = 1000,
    processes: Annotated[int, typer.Option(min=1)] = 2,
    out: Path = Path("out/thermal_share.csv"),
) -> None:
    """Run the studies, print the table and write it."""
    with user_errors():
        base = find_preset(preset)
        cases = [with_overrides(base, {"explosive": {"thermal_share": each}}) for each in SHARES]
        cases += [with_resolution(base, float(each)) for each in resolutions.split(",")]
        numbers = tuple(range(first_seed, first_seed + seeds))
        found = []
        for parameters in cases:
            label = f"thermal share {parameters.explosive.thermal_share:g}"
            study = ReflectionStudy(parameters, numbers, time_limit_s=1.0, distances_m=DISTANCES_M)
            with progress_bar(label) as progress:
                found.append(near_field(parameters, study.run(processes, progress)))
        table = pd.DataFrame([asdict(each) for each in [*found, reference()]])
        out.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(out) as temporary:
            table.to_csv(temporary, index=False)
        print_line(table.round(3).to_string(index=False))
        print_line("last row: Kingery and Bulmash, hemispherical, reflected and incident impulse")


if __name__ == "__main__":
    typer.run(main)
