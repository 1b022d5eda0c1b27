"""The sites whose facades count: do rules pass, does what a search found, by finer cells?

python -m studies.response_sites judge clinic_front
python -m studies.response_sites speed
"""

import time
from pathlib import Path
from typing import Final

import typer
from blast_agents.search.registry import layouts_by_rule

from blast_env.cli.output import print_line
from blast_env.engines.contract import find_engine
from blast_env.evaluation import BlastEvaluator, draw_threats
from blast_env.evaluation.cases import one_of_each_charge
from blast_env.geometry import Layout, layout_text
from blast_env.response.buildings import LevelOfProtection
from blast_env.scenario import Placement, Scenario, load_layout, load_scenario
from blast_env.tables import markdown_table

SITES: Final = ("clinic_front", "guard_post", "school_wing", "ministry_kerb")
FOUND: Final = Path(__file__).parent.parent / "docs" / "data" / "best_found"

app = typer.Typer()


@app.command()
def judge(site: str, cell: float = 0.25) -> None:
    """Judge the empty site, the rules and what `blast-env advise` found, the worst of all charges.

    A rule that fails under the first charge meets no other one.
    """
    scenario = load_scenario(site)
    evaluator = BlastEvaluator(scenario, find_engine("gas", cell))
    layouts: dict[str, Layout] = {"nothing": (), **layouts_by_rule(scenario)}
    layouts["found by search"] = load_layout(FOUND / f"{site}.json", scenario)
    rows = []
    for name, layout in layouts.items():
        level = _level(evaluator, layout)
        cost = Placement(scenario, layout).cost
        rows.append((name, f"{cost:g}", level.label, layout_text(layout) if level else ""))
    target = scenario.objective.target
    print_line(f"{site}, cells of {cell:g} m, level {target!r} wanted")
    print_line(markdown_table(("layout", "cost", "level", "pieces"), rows))


def _level(evaluator: BlastEvaluator, layout: Layout) -> LevelOfProtection:
    target = evaluator.scenario.objective.level
    assert target is not None
    reached = LevelOfProtection.HIGH
    for threat in one_of_each_charge(draw_threats(evaluator.scenario, range(16))):
        reached = min(reached, evaluator.loads(layout, threat).level)
        if reached < target:
            break
    return reached


@app.command()
def speed(repeats: int = 6) -> None:
    """Time a blast on the empty guard post with the response of its facade, and without."""
    scenario = load_scenario("guard_post")
    document = scenario.model_dump() | {"objective": {}}
    del document["structures"][0]["facade"]
    del document["build_zone"]["hardening"], document["build_zone"]["stock"]
    sites = {"with": scenario, "without": Scenario.from_document(document, "without a facade")}
    threat = draw_threats(scenario, [0])[0]
    seconds: dict[str, list[float]] = {name: [] for name in sites}
    for _ in range(repeats + 1):  # the first one compiles
        for name, each in sites.items():
            evaluator = BlastEvaluator(each, "gas")
            begin = time.process_time()
            evaluator.loads((), threat)
            seconds[name].append(time.process_time() - begin)
    least = {name: min(each[1:]) for name, each in seconds.items()}
    more = least["with"] / least["without"] - 1.0
    print_line(f"processor time of a blast with the response: {100.0 * more:+.1f} %")


if __name__ == "__main__":
    app()
