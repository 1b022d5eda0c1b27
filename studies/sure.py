"""The exactness of the probability of a level.

python -m studies.sure scaling
python -m studies.sure draws

`scaling` compares histories scaled to another mass with blasts of that mass. `draws` compares draws
of the deciding bays with draws of all bays, and prints the processor time of the former.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from blast_env.arrays import BoolArray, FloatArray
from blast_env.cli.output import print_line, user_errors
from blast_env.evaluation import draw_threats
from blast_env.evaluation.cases import one_of_each_charge
from blast_env.evaluation.consequences import Consequences, consequences
from blast_env.evaluation.engines import find_engine
from blast_env.evaluation.probability import DRAWS, Uncertainty, level_probability
from blast_env.evaluation.scaling import MASS_RANGE, scaled_to
from blast_env.geometry import Layout
from blast_env.layout import load_layout
from blast_env.response.sdof import impulses
from blast_env.site import AnyCharge, Scenario, load_scenario
from blast_env.site.scene import Charge
from blast_env.tables import markdown_table

SITES: Final = ("guard_post", "clinic_front")
MANY_BAYS: Final = "street_front"
FOUND: Final = Path(__file__).parent.parent / "docs" / "data" / "best_found"
_LEAST: Final = 0.1  # of the largest impulse, for a bay to count

SomeSites = Annotated[list[str] | None, typer.Argument(help="All of them unless given.")]
Cell = Annotated[float, typer.Option(help="Side of the cells, m.")]

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def scaling(sites: SomeSites = None, cell: Cell = 0.5) -> None:
    """Compare scaled histories with blasts, at both ends of the range of masses."""
    rows = []
    with user_errors():
        engine = find_engine("gas", cell)
        for scenario, name, layout in _cases(sites or SITES):
            found = consequences(scenario, layout, _charges(scenario)[:1], engine)
            charge = found.responses[0].charge
            for share in (MASS_RANGE, 1.0 / MASS_RANGE):
                other = charge._replace(tnt_kg=share * charge.tnt_kg)
                blast = consequences(scenario, layout, [other], engine)
                rows.append(
                    (scenario.name, name, f"{share:.2f}", *_differences(blast, found, other))
                )
    headers = ("site", "layout", "mass", "bays", "impulse", "peak", "damage", "levels")
    print_line(markdown_table(headers, rows))


@app.command()
def draws(sites: SomeSites = None, cell: Cell = 0.5) -> None:
    """Compare draws of the deciding bays with those of all bays."""
    rows = []
    with user_errors():
        engine = find_engine("gas", cell, cells="coarse")
        for scenario, name, layout in _cases(sites or (*SITES, MANY_BAYS)):
            found = consequences(scenario, layout, _charges(scenario)[:2], engine)
            level_probability(found, Uncertainty(), 2)  # compiles
            begin = time.process_time()
            few = level_probability(found, Uncertainty())
            seconds = time.process_time() - begin
            every = level_probability(found, Uncertainty(), deciding=10**9)
            bays = sum(len(each.facade.bays) for each in found.responses)
            unlike = float((few.levels != every.levels).mean())
            rows.append((scenario.name, name, str(bays), f"{unlike:.1%}", f"{seconds:.1f} s"))
    print_line(
        markdown_table(("site", "layout", "bays", f"of {DRAWS:,} draws differ", "time"), rows)
    )


def _charges(scenario: Scenario) -> list[AnyCharge]:
    return [each.charge for each in one_of_each_charge(draw_threats(scenario, range(16)))]


def _cases(sites: Sequence[str]) -> list[tuple[Scenario, str, Layout]]:
    cases: list[tuple[Scenario, str, Layout]] = []
    for site in sites:
        scenario = load_scenario(site)
        found = tuple(load_layout(FOUND / f"{site}.json", scenario))
        cases += [(scenario, "no barrier", ()), (scenario, "best found", found)]
    return cases


def _differences(blast: Consequences, found: Consequences, charge: Charge) -> tuple[str, ...]:
    """Return the bays that count, the largest deviations on them, and the levels of both."""
    both = blast, scaled_to(found, charge)
    facades = [[each.on_cells for each in one.responses] for one in both]
    of_both = [
        np.concatenate([impulses(each.time_s, each.pressure_pa).max(axis=1) for each in own])
        for own in facades
    ]
    peaks = [np.concatenate([each.pressure_pa.max(axis=1) for each in own]) for own in facades]
    counts = of_both[0] > _LEAST * of_both[0].max()
    damage = [max(each.facade.worst_number for each in one.responses) for one in both]
    levels = [min(map(one.level, one.buildings)).label for one in both]
    off = [_spread(each[1] / each[0], counts) for each in (of_both, peaks)]
    return (
        str(int(counts.sum())),
        *off,
        " / ".join(f"{each:.2f}" for each in damage),
        " / ".join(levels),
    )


def _spread(ratio: FloatArray, counts: BoolArray) -> str:
    own = ratio[counts]
    return f"{own.min():.2f} to {own.max():.2f}"


if __name__ == "__main__":
    app()
