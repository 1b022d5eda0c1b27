"""Verdicts on buildings with facades, from the stored histories of a blast.

Other windows and hardening measures need no new blast: the loads stay the same.
"""

from collections.abc import Iterator, Sequence
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np

from blast_env.app.records import BlastRecord, BuildingVerdict, VerdictRow
from blast_env.evaluation.consequences import BuildingResponse, Consequences, by_building
from blast_env.evaluation.governing import Severity, governing
from blast_env.evaluation.probability import Uncertainty, level_probability, probability_text
from blast_env.files import write_atomically
from blast_env.geometry import Layout
from blast_env.layout.build_scene import build_site
from blast_env.layout.placement import load_relevant
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.facade import peak_factor, respond
from blast_env.site import AnyCharge, Scenario

_BAYS: Final = "bays.npz"
_DASH: Final = "\N{EN DASH}"
_NAME: Final = "damage_{}_{}.png"
_DRAWS: Final = 200  # of the uncertain quantities: the table must come at once
_HASH_DIGITS: Final = 16


def keep_histories(result: Any, folder: Path) -> None:
    """Keep the histories of the bays of a blast by gas dynamics.

    Raises:
        BlastEnvError: If they cannot be written.
    """
    loads = result.bay_loads
    if loads is None or not loads.bays:
        return
    with write_atomically(folder / _BAYS) as temporary:
        np.savez(
            temporary,
            names=np.array([each.bay.name for each in loads.bays]),
            time_s=loads.recorder.time_s,
            pressure_pa=loads.history_pa,
        )


def stored_consequences(
    scenario: Scenario, layout: Layout, charge: AnyCharge, cell_m: float, folder: Path
) -> Consequences | None:
    """Return the response of the facades to a stored blast; `None` without their histories.

    Args:
        scenario: The scenario.
        layout: The layout, whose measures fill the bays.
        charge: The charge, or the vehicle that carries it.
        cell_m: Side of the cells of the blast.
        folder: Its folder.
    """
    try:
        content = BytesIO((folder / _BAYS).read_bytes())  # closes a damaged file, too
        with np.load(content, allow_pickle=False) as kept:
            names, time_s, pressure = (kept[key] for key in ("names", "time_s", "pressure_pa"))
    except (OSError, ValueError, KeyError, BadZipFile):
        return None
    known = {each.bay.name: each for each in scenario.bays_with(layout)}
    rows = [row for row, name in enumerate(names.tolist()) if name in known]
    if not rows:
        return None
    bays = [known[names[row]] for row in rows]
    site = build_site(scenario, load_relevant(layout), 0, charge)
    found = respond(bays, time_s, pressure[rows].astype(np.float64))
    factor = peak_factor(cell_m, site.charge.tnt_kg)
    return Consequences(tuple(by_building(scenario, found, site, factor)))


def verdicts_of(found: Consequences) -> tuple[BuildingVerdict, ...]:
    """Return the verdict on each building, in numbers."""
    return tuple(map(_verdict, found.responses))


def draw_damage(building: BuildingResponse, path: Path) -> None:
    """Draw the facade of one building in the colours of its damage.

    Raises:
        BlastEnvError: If it cannot be written.
    """
    # Here, because pictures take half a second to import, and tables need none.
    from blast_env.plots.facade import facade_picture
    from blast_env.plots.figures import save_figure

    (x_m, y_m), tnt_kg = building.charge.position_m, building.charge.tnt_kg
    words = f"{tnt_kg:g} kg at ({x_m:g}, {y_m:g}) m"
    save_figure(facade_picture([(words, building)], building.building), path)


def facades_digest(scenario: Scenario, layout: Layout) -> str:
    """Return the digest of the contents of all bays, which identifies a verdict on a blast."""
    return sha256(repr(scenario.bays_with(layout)).encode()).hexdigest()[:_HASH_DIGITS]


def picture_name(number: int, digest: str) -> str:
    """Return the name of the picture of a building's damage.

    Args:
        number: Number of the building.
        digest: Digest of the contents of the bays, see `facades_digest`.
    """
    return _NAME.format(number, digest)


def _verdict(building: BuildingResponse) -> BuildingVerdict:
    facade = building.facade
    draws = level_probability(Consequences((building,)), Uncertainty(), _DRAWS)
    return BuildingVerdict(
        building=building.building,
        level=facade.level_of_protection,
        level_on_cells=building.on_cells.level_of_protection,
        panes=facade.panes,
        broken=facade.broken_panes,
        condition=facade.worst_condition.words,
        damage=facade.worst_damage.name.lower() if len(facade.walled) else "",
        total_damage=building.severity.damage,
        impulse_pa_s=building.severity.load,
        likely=draws.of(facade.level_of_protection),
        standing=building.standings[building.deciding_bay].words,
    )


def verdict_rows(
    records: Sequence[tuple[str, BlastRecord, Sequence[BuildingVerdict]]],
) -> Iterator[VerdictRow]:
    """Yield the rows of the buildings; with several threats, the worst of them first.

    Args:
        records: Name of the layout, the blast, and the verdicts on it.
    """
    found: dict[tuple[str, str], list[tuple[str, BuildingVerdict, tuple[str, ...]]]] = {}
    for name, record, verdicts in records:
        for verdict in verdicts:
            flags = tuple(why for building, why in record.unchecked if building == verdict.building)
            key = name, verdict.building
            found.setdefault(key, []).append((record.threat, verdict, flags))
    for (name, _), own in found.items():
        if len(own) > 1:
            worst = governing((each for _, each, _ in own), _severity)
            flags = tuple(dict.fromkeys(flag for *_, each in own for flag in each))
            yield _verdict_row(name, f"worst of {len(own)}", worst, flags)
        yield from (_verdict_row(name, *each) for each in own)


def _severity(verdict: BuildingVerdict) -> Severity:
    return Severity(4 - verdict.level, verdict.total_damage, verdict.impulse_pa_s)


def _verdict_row(
    layout: str, threat: str, verdict: BuildingVerdict, flags: tuple[str, ...]
) -> VerdictRow:
    level = LevelOfProtection(verdict.level).label
    if verdict.level_on_cells > verdict.level:
        level += f"; {LevelOfProtection(verdict.level_on_cells).label} on the cells"
    return VerdictRow(
        layout=layout,
        threat=threat,
        building=verdict.building,
        level=level,
        likely=probability_text(verdict.likely, _DRAWS) if verdict.level else _DASH,
        panes=f"{verdict.broken:.1f} of {verdict.panes}" if verdict.panes else _DASH,
        condition=verdict.condition if verdict.panes else _DASH,
        damage=verdict.damage or _DASH,
        standing=verdict.standing,
        flags="; ".join(flags) or _DASH,
    )
