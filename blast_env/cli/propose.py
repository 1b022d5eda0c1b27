"""`blast-env propose`: a layout from the weights that come with the package."""

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Final

import typer
from blast_agents.rules import expected_charge
from blast_agents.search.by_rule import layouts_by_rule

from blast_env.cli.options import ChargePlace, Processes, TntMass
from blast_env.cli.output import (
    engine_text,
    make_table,
    print_line,
    progress_bar,
    result_console,
    save_pictures,
    user_errors,
)
from blast_env.cli.pictures import save_layout_picture
from blast_env.cli.targets import FileTarget, checked_targets
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation import BlastEvaluator, Case, SeedRange, Threat, draw_threats
from blast_env.geometry import Layout, layout_counts
from blast_env.physics.engines import GAS
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
from blast_env.statistics import reductions
from blast_env.units import MS_PER_S

if TYPE_CHECKING:
    from blast_agents.training.packaged import Record

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
    """Propose a layout with trained weights that come with the package; no blast is run for it.

    Where there are no weights for the scenario, it is the best rule's layout, which takes a blast
    of gas dynamics for each rule and threat. Without --charge it is for all places where the charge
    may be.
    """
    with user_errors(), checked_targets({"--out": FileTarget(out, (".json",))}):
        chosen = load_scenario(scenario)
        chosen.zone  # noqa: B018  # refuses a scenario without one
        told = _charge(chosen, charge, tnt_kg)
        case = _case(chosen, told)
        evaluator = BlastEvaluator(chosen, GAS)
        rules = layouts_by_rule(chosen, told)
        began_s = perf_counter()
        found = _by_agent(chosen, told)
        if found is None:
            loads = _loads(evaluator, case, {_NOTHING: (), **rules}, processes)
            name = min(rules, key=lambda rule: loads[rule])
            layout, how = rules[name], f"the best rule by gas dynamics: {name}"
            provenance: dict[str, object] = {"rule": name}
            print_line(f"note: {_why_not(chosen, told)}; the best rule is proposed instead")
        else:
            layout, record = found
            seconds = perf_counter() - began_s
            how = f"the weights of {record.scenario}, in {MS_PER_S * seconds:,.0f} ms"
            provenance = {"weights": record.configuration.scenario_hash[:12]}
        placement = Placement.of(chosen, layout)
        cost = "" if chosen.zone.budget is None else f", cost {placement.cost:g}"
        print_line(f"{chosen.name}: {layout_counts(layout)}{cost}, by {how}")
        if verify:
            loads = _loads(evaluator, case, {_NOTHING: (), **rules, _PROPOSAL: layout}, processes)
            _print_verdict(loads, case)
        if verify or found is None:
            print_line(engine_text(evaluator.engine))
        if out is not None:
            provenance |= {"command": command(), "versions": versions()}
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
            f"note: {scenario.name} never has a charge at ({place_m[0]:g}, {place_m[1]:g}) m: the "
            "weights were not trained for that, so --verify the proposal"
        )
    return charge


def _case(scenario: Scenario, charge: Charge | None) -> Case:
    """Return what layouts are judged on: the charge, or threats that no training has met."""
    first = SeedRange.JUDGEMENT.value.start
    if charge is not None:
        return Case(scenario, (Threat(charge, first),), charge=charge)
    threats = draw_threats(scenario, range(first, first + _HIDDEN_THREATS))
    distinct = {threat.charge: threat for threat in threats}
    return Case(scenario, tuple(distinct.values()))


def _by_agent(scenario: Scenario, charge: Charge | None) -> "tuple[Layout, Record] | None":
    """Return what the weights that come with the package propose, if there are some."""
    # Here, because torch takes seconds to start, and is an extra.
    with import_extra("agents", "proposals by trained weights"):
        from blast_agents.training.packaged import packaged_agent

    found = packaged_agent(scenario, "hidden" if charge is None else "visible")
    if found is None:
        return None
    agent, record = found
    return tuple(sorted(agent.propose(scenario, charge))), record


def _why_not(scenario: Scenario, charge: Charge | None) -> str:
    from blast_agents.training.packaged import records

    known = [record for _, record in records() if record.scenario == scenario.name]
    told = "a charge that is not known" if charge is None else "a known charge"
    if any(each.configuration.scenario_hash == scenario.content_hash for each in known):
        other = "give --charge for a known one" if charge is None else "leave --charge out"
        return f"the weights for {scenario.name} are not for {told} ({other})"
    if known:
        return (
            f"the weights for {scenario.name} are for another state of it (scenario hash "
            f"{known[0].configuration.scenario_hash[:12]}, here {scenario.content_hash[:12]})"
        )
    return f"no weights come with the package for {scenario.name}"


def _loads(
    evaluator: BlastEvaluator, case: Case, layouts: Mapping[str, Layout], processes: int
) -> dict[str, float]:
    """Return the load that counts with each layout, by gas dynamics, in the objective's unit."""
    objective = case.scenario.objective
    pairs = [(layout, threat) for layout in layouts.values() for threat in case.threats]
    with progress_bar(f"{len(set(pairs))} blasts of gas dynamics") as progress:
        loads = iter(evaluator.loads_of_many(pairs, processes, progress))
    return {
        name: case.combined([next(loads).load(objective) for _ in case.threats]) for name in layouts
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
