"""Sites whose facades count: the criterion they were chosen by, and what impulse says of response.

python -m studies.response_sites criterion
python -m studies.response_sites compare
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from blast_agents.search import LayoutProblem, find_proposer
from blast_agents.search.advice import MeasureKind, advise
from blast_agents.search.registry import layouts_by_rule

from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.engines.contract import Engine, find_engine
from blast_env.evaluation import BlastEvaluator, Case, Threat, draw_threats
from blast_env.evaluation.cases import one_of_each_charge
from blast_env.evaluation.consequences import consequences
from blast_env.geometry import Layout, layout_words
from blast_env.response.buildings import LevelOfProtection
from blast_env.scenario import AnyCharge, Placement, Scenario, load_layout, load_scenario
from blast_env.scenario.versions import SCHEMA_VERSION
from blast_env.scenario.zone import distance_m
from blast_env.tables import markdown_table

SITES: Final = ("clinic_front", "guard_post", "school_wing", "ministry_kerb")
OLDER: Final = ("visitor_entrance", "control_room", "school_and_clinic")
FOUND: Final = Path(__file__).parent.parent / "docs" / "data" / "best_found"

_DRAWS: Final = 16
_SEARCH: Final = "annealing_from_rules"
_FACADE: Final = {"glazing": "window_laminated_12", "wall": "concrete_150"}
"""What the older sites get: strong enough for a small charge behind the right barrier."""

Row = tuple[str, ...]
SomeSites = Annotated[list[str] | None, typer.Argument(help="All of them unless given.")]

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def criterion(
    sites: SomeSites = None,
    cell: Annotated[float, typer.Option(help="Side of the cells, m.")] = 0.25,
) -> None:
    """Print whether the empty site fails, every rule fails, and what a search found passes."""
    headers = ("site", "charge", "wanted", "no layout", "rules that pass", "found", "cost")
    with user_errors():
        rows = []
        with progress_bar("criterion") as progress:
            for number, name in enumerate(sites or SITES, start=1):
                rows.append(criterion_row(load_scenario(name), cell))
                progress(number / len(sites or SITES))
        print_line(f"cells of {cell:g} m")
        print_line(markdown_table((*headers, "level", "with sharp peaks"), rows))


def criterion_row(scenario: Scenario, cell_m: float) -> Row:
    """Return what the criterion says of a site; the last four cells are of what was found."""
    engine, target = find_engine("gas", cell_m), _target(scenario)
    charges = site_charges(scenario)
    rules = layouts_by_rule(scenario)
    passing = [name for name, each in rules.items() if reaches(scenario, each, charges, engine)]
    found = load_layout(FOUND / f"{scenario.name}.json", scenario)
    bare, judged = (consequences(scenario, each, charges, engine) for each in ((), found))
    source, (structure, *_) = scenario.charge[0], scenario.structures
    return (
        f"`{scenario.name}`",
        f"{source.tnt_kg:g} kg, {distance_m(source, structure.rectangle_m):.0f} m",
        target.label,
        min(bare.level(each) for each in bare.buildings).label,
        ", ".join(passing) or f"none of {len(rules)}",
        layout_words(found),
        f"{Placement(scenario, found).cost:g} of {scenario.zone.budget:g}",
        min(judged.level(each) for each in judged.buildings).label,
        "passes" if judged.stands_up(target) else "fails",
    )


def reaches(
    scenario: Scenario, layout: Layout, charges: Sequence[AnyCharge], engine: Engine
) -> bool:
    """Return whether a layout reaches the target; one that fails meets no further charge."""
    target = _target(scenario)
    return all(consequences(scenario, layout, [each], engine).passes(target) for each in charges)


@dataclass(frozen=True)
class Rival:
    """A site with two layouts: the best for impulse, and the best for the response.

    Attributes:
        scenario: The site.
        by_impulse: The layout that takes off most impulse.
        by_response: The cheapest layout that reaches the level, or is nearest to it.
    """

    scenario: Scenario
    by_impulse: Layout
    by_response: Layout

    @classmethod
    def of(cls, name: str, budget: int, tnt_kg: float) -> "Rival":
        """Return the rival layouts of a bundled site; an older one gets a facade and a charge."""
        older = name in OLDER
        scenario = glazed(name, tnt_kg) if older else load_scenario(name)
        zone = scenario.zone.model_dump(mode="json", exclude={"stock"}, exclude_none=True)
        zone["hardening"] = []  # no measure changes an impulse
        bare = _changed(scenario, objective={}, build_zone=zone)
        problem = LayoutProblem(BlastEvaluator(bare, "gas"), Case(bare, _threats(bare)))
        by_impulse = find_proposer(_SEARCH).propose(problem, budget).layout
        if not older:
            return cls(scenario, by_impulse, load_layout(FOUND / f"{name}.json", scenario))
        problem = LayoutProblem(BlastEvaluator(scenario, "gas"), Case(scenario, _threats(scenario)))
        return cls(scenario, by_impulse, advise(problem, MeasureKind.SHIELD, budget).layout)

    def rows(self) -> Iterator[Row]:
        """Yield a row a layout: its cost, what it takes off, what becomes of the facade."""
        scenario, threats = self.scenario, _threats(self.scenario)
        evaluator = BlastEvaluator(scenario, "gas")
        bare_pa_s = _impulse_pa_s(evaluator, (), threats)
        for by, layout in (
            ("-", ()),
            ("impulse", self.by_impulse),
            ("response", self.by_response),
        ):
            loads = [evaluator.loads(layout, each) for each in threats]
            level = min(each.level for each in loads)
            taken_off = 1.0 - _impulse_pa_s(evaluator, layout, threats) / bare_pa_s
            yield (
                f"`{scenario.name}`",
                by,
                layout_words(layout),
                f"{Placement(scenario, layout).cost:g}",
                f"{100.0 * taken_off:.1f} %",
                f"{max(load.worst_damage or 0.0 for each in loads for load in each.protected):.2f}",
                f"{level.label}{'' if level < _target(scenario) else ', passes'}",
            )


@app.command()
def compare(
    sites: SomeSites = None,
    budget: Annotated[int, typer.Option(min=4, help="Blasts of a search.")] = 60,
    tnt_kg: Annotated[float, typer.Option(help="Charge of the older sites, kg.")] = 10.0,
) -> None:
    """Print what the layout that is best for impulse does for the response, and the reverse."""
    headers = ("site", "best by", "layout", "cost", "impulse off", "worst damage", "level")
    with user_errors():
        rows: list[Row] = []
        every = sites or [*SITES, *OLDER]
        with progress_bar("searches") as progress:
            for number, name in enumerate(every, start=1):
                rows += Rival.of(name, budget, tnt_kg).rows()
                progress(number / len(every))
        print_line(markdown_table(headers, rows))


def glazed(name: str, tnt_kg: float) -> Scenario:
    """Return an older site with a facade on what it protects, and other charges."""
    scenario = load_scenario(name)
    document = scenario.model_dump(mode="json", exclude_none=True)
    for structure in document["structures"]:
        if structure["protected"]:
            structure["facade"] = _FACADE
    charges = [each | {"tnt_kg": tnt_kg} for each in document["charge"]]
    objective = {"kind": "response", "target": "medium"}
    changes = {"structures": document["structures"], "charge": charges, "objective": objective}
    return _changed(scenario, **changes)


def _changed(scenario: Scenario, **sections: Any) -> Scenario:
    document = scenario.model_dump(mode="json", exclude_none=True)
    changed = document | {"schema_version": SCHEMA_VERSION} | sections
    return Scenario.from_document(changed, scenario.name)


def site_charges(scenario: Scenario) -> list[AnyCharge]:
    """Return every charge that a site is judged under."""
    return [each.charge for each in _threats(scenario)]


def _threats(scenario: Scenario) -> tuple[Threat, ...]:
    return one_of_each_charge(draw_threats(scenario, range(_DRAWS)))


def _target(scenario: Scenario) -> LevelOfProtection:
    target = scenario.objective.level
    assert target is not None
    return target


def _impulse_pa_s(evaluator: BlastEvaluator, layout: Layout, threats: tuple[Threat, ...]) -> float:
    return sum(evaluator.loads(layout, each).protected_impulse_pa_s for each in threats)


if __name__ == "__main__":
    app()
