"""`blast-env propose`: a layout from what comes with the package, weights or a surrogate."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Annotated, Final

import typer
from blast_agents.proposal import LayoutAgent
from blast_agents.rules import expected_charge
from blast_agents.search.by_rule import layouts_by_rule
from blast_agents.surrogate import SurrogateAgent, packaged_surrogate

from blast_env.cli.options import ChargePlace, Processes, TntMass
from blast_env.cli.output import (
    make_table,
    print_line,
    progress_bar,
    result_console,
    save_pictures,
    user_errors,
)
from blast_env.cli.pictures import save_layout_picture
from blast_env.cli.targets import FileTarget, checked_targets
from blast_env.engines import JUDGE
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation import BlastEvaluator, Case, SeedRange, Threat, draw_threats
from blast_env.evaluation.cases import one_of_each_charge
from blast_env.geometry import Layout, layout_counts
from blast_env.physics.scene import Charge
from blast_env.provenance import command, versions
from blast_env.scenario import (
    LayoutFile,
    Placement,
    PointSource,
    Scenario,
    load_scenario,
)
from blast_env.scenario.zone import source_bounds_m
from blast_env.sites import FAMILIES
from blast_env.statistics import reductions
from blast_env.units import MS_PER_S

_HIDDEN_THREATS: Final = 8
"""Threats that layouts meet where the charge is not known."""

_PROPOSAL: Final = "this proposal"
_NOTHING: Final = "no barrier"


def propose(
    scenario: Annotated[str, typer.Argument(help="Bundled name, or a scenario file.")],
    charge: ChargePlace = None,
    tnt_kg: TntMass = None,
    verify: Annotated[
        bool,
        typer.Option("--verify", help="Judge it by gas dynamics, beside no barrier and all rules."),
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="JSON file for the layout; its picture is drawn beside it.")
    ] = None,
    processes: Processes = 1,
) -> None:
    """Propose a layout for any site in a second or a few; no blast is run for it.

    It comes from weights that were trained for the very scenario, if some come with the package; if
    not, from the surrogate of gas dynamics, which was fitted to other sites. Where there is no
    catalogue, of which the surrogate knows nothing, it is the best rule's layout, which takes a
    blast of gas dynamics for each rule and threat. Without --charge it is for all places where the
    charge may be.
    """
    with user_errors(), checked_targets({"--out": FileTarget(out, (".json",))}):
        chosen = load_scenario(scenario)
        chosen.zone  # noqa: B018  # refuses a scenario without one
        told = _charge(chosen, charge, tnt_kg)
        case = _case(chosen, told)
        evaluator = BlastEvaluator(chosen, JUDGE)
        proposal = (
            _by_weights(chosen, told)
            or _by_surrogate(chosen, told)
            or _by_best_rule(evaluator, case, processes)
        )
        layout = proposal.layout
        placement = Placement.of(chosen, layout)
        cost = "" if chosen.zone.budget is None else f", cost {placement.cost:g}"
        print_line(f"{chosen.name}: {layout_counts(layout)}{cost}, by {proposal.how}")
        if verify:
            rules = layouts_by_rule(chosen, told)
            loads = _loads(evaluator, case, {_NOTHING: (), **rules, _PROPOSAL: layout}, processes)
            _print_verdict(loads, case)
        if verify or evaluator.blasts:
            print_line(evaluator.engine.describe())
        if out is not None:
            provenance = {**proposal.provenance, "command": command(), "versions": versions()}
            written = [LayoutFile.of(chosen, layout, provenance).save(out)]
            picture = out.with_suffix(".png")
            written += save_pictures(lambda: [save_layout_picture(chosen, layout, picture)])
            for path in written:
                print_line(f"wrote {path}")


def _charge(
    scenario: Scenario, place_m: tuple[float, float] | None, tnt_kg: float | None
) -> Charge | None:
    """Return the charge if it is known: given, or the only place where the scenario has one."""
    if place_m is None:
        if tnt_kg is not None:
            raise BlastEnvError("--tnt-kg is given without --charge: where is it?")
        only = scenario.charge[0]
        if len(scenario.charge) > 1 or not isinstance(only, PointSource):
            return None
        return Charge(only.position_m, only.tnt_kg, only.height_m)
    middle = expected_charge(scenario.charge)
    charge = Charge(place_m, middle.tnt_kg if tnt_kg is None else tnt_kg, middle.height_m)
    scenario.with_possible_charges((charge,))  # refuses one that is not clear, or out of bounds
    bounds = [source_bounds_m(source) for source in scenario.charge]
    if not any(
        each.left <= place_m[0] <= each.right and each.bottom <= place_m[1] <= each.top
        for each in bounds
    ):
        print_line(
            f"note: {scenario.name} never has a charge at ({place_m[0]:g}, {place_m[1]:g}) m: "
            "--verify the proposal"
        )
    return charge


def _case(scenario: Scenario, charge: Charge | None) -> Case:
    """Return what layouts are judged on: the charge, or threats that no training has met."""
    first = SeedRange.JUDGEMENT.value.start
    if charge is not None:
        return Case(scenario, (Threat(charge, first),), charge=charge)
    threats = draw_threats(scenario, range(first, first + _HIDDEN_THREATS))
    return Case(scenario, one_of_each_charge(threats))


@dataclass(frozen=True)
class _Proposal:
    """A layout, and where it comes from: for people, and for the layout's file."""

    layout: Layout
    how: str
    provenance: Mapping[str, object]


def _by_weights(scenario: Scenario, charge: Charge | None) -> _Proposal | None:
    """Return what the weights that come with the package propose, if there are some."""
    # Here, because torch takes seconds to start, and is an extra.
    with import_extra("agents", "proposals by trained weights"):
        from blast_agents.training.packaged import packaged_agent

    found = packaged_agent(scenario, "hidden" if charge is None else "visible")
    if found is None or found[1].scenario in FAMILIES:  # there the surrogate's are better
        return None
    agent, record = found
    return _timed(
        agent,
        scenario,
        charge,
        f"the weights of {record.scenario}",
        {"weights": record.configuration.scenario_hash[:12]},
    )


def _by_surrogate(scenario: Scenario, charge: Charge | None) -> _Proposal | None:
    """Return what the surrogate proposes that comes with the package, if it can."""
    if not scenario.zone.items:
        print_line(
            "note: single modules are placed, of which the surrogate knows nothing; the best rule "
            "is proposed"
        )
        return None
    surrogate = packaged_surrogate()
    return _timed(
        SurrogateAgent(surrogate),
        scenario,
        charge,
        "guesses of gas dynamics (--verify says what it is worth)",
        {"surrogate": surrogate.digest},
    )


def _timed(
    agent: LayoutAgent,
    scenario: Scenario,
    charge: Charge | None,
    how: str,
    provenance: Mapping[str, object],
) -> _Proposal:
    began_s = perf_counter()
    layout = tuple(sorted(agent.propose(scenario, charge)))
    ms = MS_PER_S * (perf_counter() - began_s)
    return _Proposal(layout, f"{how}, in {ms:,.0f} ms", provenance)


def _by_best_rule(evaluator: BlastEvaluator, case: Case, processes: int) -> _Proposal:
    rules = layouts_by_rule(case.scenario, case.charge)
    loads = _loads(evaluator, case, {_NOTHING: (), **rules}, processes)
    name = min(rules, key=lambda rule: loads[rule])
    return _Proposal(rules[name], f"the best rule by gas dynamics: {name}", {"rule": name})


def _loads(
    evaluator: BlastEvaluator, case: Case, layouts: Mapping[str, Layout], processes: int
) -> dict[str, float]:
    """Return the load that counts with each layout, by gas dynamics, in the objective's unit."""
    objective = case.scenario.objective
    pairs = [(layout, threat) for layout in layouts.values() for threat in case.threats]
    with progress_bar(f"{len(set(pairs))} blasts of gas dynamics") as progress:
        loads = iter(evaluator.loads_of_many(pairs, processes, progress))
    return {
        name: case.counted([next(loads).load(objective) for _ in case.threats], layout)
        for name, layout in layouts.items()
    }


def _print_verdict(loads: Mapping[str, float], case: Case) -> None:
    """Print a row a layout, the best last but for the proposal."""
    charges = f"{len(case.threats)} charges" if case.charge is None else "this charge"
    objective = case.scenario.objective
    headers = ("layout", f"load ({objective.unit})", "reduction")
    table = make_table(f"{case.scenario.name}: judged by gas dynamics on {charges}", headers)
    rules = sorted(loads.keys() - {_NOTHING, _PROPOSAL}, key=lambda name: -loads[name])
    for name in (_NOTHING, *rules, _PROPOSAL):
        share = reductions(loads[name], loads[_NOTHING]).item()
        table.add_row(name, f"{loads[name]:,.1f}", f"{share:.1%}")
    result_console().print(table)
    if rules and loads[rules[-1]] < loads[_PROPOSAL]:
        print_line(f"note: {rules[-1]} does better here than the proposal")
