"""`blast-env assess --screen`: levels of protection and stand-offs before any blast."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from blast_env.cli.output import (
    print_cost,
    print_line,
    print_table,
    print_written,
    progress_bar,
    save_figures,
)
from blast_env.evaluation.consequences import Consequences, consequences
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.screening import (
    LEFT_OUT,
    STAND_OFF_HEADERS,
    THREAT_HEADERS,
    Screening,
    screen,
)
from blast_env.geometry import Layout, layout_counts
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import Scenario
from blast_env.site.presets import EQUIVALENTS_SOURCE, PRESETS_SOURCE, NamedMass

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def print_screening(
    scenario: Scenario,
    layout: Layout,
    masses: Sequence[str],
    required: Sequence[Requirement],
    engine: Engine | None,
    picture: Path | None,
) -> None:
    """Print the level of protection of each facade, and the stand-off that each level needs."""
    level = scenario.objective.level or LevelOfProtection.LOW
    required = required or [Requirement.of_level(level)]
    named = [NamedMass.parsed(each) for each in masses]
    found = screen(scenario, layout, named)
    beside = {} if engine is None else _by_gas(scenario, layout, found, engine)
    print_line(f"required: {'; '.join(each.words for each in required)}")
    title = layout_counts(layout, "barrier") if layout else "no barrier"
    _print_threats(f"{scenario.name}, {title}: worst place by damage", found, required, beside)
    for each in found.threats:
        title = (
            f"stand-off (m) from which a component allows a level, {each.name},"
            f" {each.charge.tnt_kg:g} kg TNT (* on this site)"
        )
        print_table(title, STAND_OFF_HEADERS, found.stand_off_rows(each))
    if named:
        print_line(f"presets: {PRESETS_SOURCE}")
    if any("," in each for each in masses):
        print_line(f"TNT equivalents: {EQUIVALENTS_SOURCE}")
    print_line(LEFT_OUT)
    if engine is None:
        print_line("--gas shows by how much that matters at each worst place")

    def rings() -> "Figure":
        from blast_env.plots.screening import screening_picture

        return screening_picture(scenario, layout, found)

    print_written(save_figures((picture, rings)))


def _by_gas(
    scenario: Scenario, layout: Layout, found: Screening, engine: Engine
) -> dict[str, Consequences]:
    """Return the consequences of each worst place by gas dynamics."""
    print_line(engine.describe([scenario]))
    print_cost((engine, scenario, each.charge) for each in found.threats)
    result = {}
    with progress_bar(f"{len(found.threats)} blasts") as progress:
        for number, each in enumerate(found.threats, start=1):
            result[each.name] = consequences(scenario, layout, [each.charge], engine)
            progress(number / len(found.threats))
    return result


def _print_threats(
    title: str,
    found: Screening,
    required: Sequence[Requirement],
    beside: Mapping[str, Consequences],
) -> None:
    rows = []
    for each in found.threats:
        rows.append(found.threat_row(each, required))
        if each.name in beside:
            rows.append(("  by gas", *[""] * 4, *_gas_row(beside[each.name])))
    print_table(title, THREAT_HEADERS, rows, text_columns=2)


def _gas_row(found: Consequences) -> tuple[str, ...]:
    facades = [each.facade for each in found.responses]
    return (
        min(each.level_of_protection for each in facades).label,
        f"{sum(each.broken_panes for each in facades):.1f}",
        max(each.worst_condition for each in facades).words,
        max(each.worst_damage for each in facades).name.lower(),
        "flagged" if found.is_flagged else "",
    )
