"""Verdicts on buildings with facades, from the stored histories of a blast.

Other windows and hardening measures need no new blast: the loads stay the same.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

from blast_env.app.records import BlastRecord
from blast_env.evaluation.answers import AnswerTable, charge_text
from blast_env.evaluation.consequences import (
    BuildingResponse,
    BuildingSummary,
    Consequences,
    Severity,
)
from blast_env.evaluation.probability import Uncertainty, level_probability, probability_text
from blast_env.evaluation.shared import decoded, encoded
from blast_env.files import write_atomically
from blast_env.geometry import Layout
from blast_env.site import AnyCharge, Scenario

_FACADES: Final = "facades.bin"
_HEADERS: Final = (
    *("layout", "threat", "building", "level of protection", "its probability", "panes broken"),
    *("worst pane (GSA, ISO)", "worst wall panel", "standing of the load", "flags"),
)
_DASH: Final = "\N{EN DASH}"
_DPI: Final = 100
_DRAWS: Final = 200  # of the uncertain quantities: the table must come at once


def keep_facades(found: Consequences, folder: Path) -> None:
    """Keep the consequences of a blast, with the histories of the bays.

    Raises:
        BlastEnvError: If they cannot be written.
    """
    with write_atomically(folder / _FACADES) as temporary:
        temporary.write_bytes(encoded(found))


def stored_consequences(
    scenario: Scenario, layout: Layout, charge: AnyCharge, folder: Path
) -> Consequences | None:
    """Return the response of the present facades to a stored blast; `None` without histories.

    Args:
        scenario: The scenario.
        layout: The layout, whose measures fill the bays.
        charge: The charge, or the vehicle that carries it.
        folder: The folder of the blast.
    """
    with suppress(OSError, ValueError):
        return decoded((folder / _FACADES).read_bytes(), scenario, layout, charge)
    return None


class Judged(NamedTuple):
    """The response of a building to a blast, without the histories on its bays.

    Attributes:
        building: Its name.
        summary: Its response.
        severity: Severity of the response.
        likely: Probability of its level or a higher one; a dash below all of them.
        standing: Standing of the load that decides, with its reason.
    """

    building: str
    summary: BuildingSummary
    severity: Severity
    likely: str
    standing: str

    @classmethod
    def of(cls, response: BuildingResponse) -> "Judged":
        """Return the response without histories."""
        alone, level = Consequences((response,)), response.facade.level_of_protection
        draws = level_probability(alone, Uncertainty(), _DRAWS)
        return cls(
            response.building,
            alone.summary(response.building),
            response.severity,
            probability_text(draws.of(level), _DRAWS) if level else _DASH,
            alone.standing(response.building).words,
        )

    def row(self, layout: str, threat: str, title: str, flags: Iterable[str]) -> tuple[str, ...]:
        """Return the row of the table."""
        whole = self.summary
        panes = f"{whole.broken:.1f} of {whole.panes}"
        return (
            *(layout, threat, title, whole.level, self.likely, panes, whole.condition),
            *(whole.damage, self.standing, "; ".join(flags) or _DASH),
        )


def damage_png(building: BuildingResponse) -> bytes:
    """Return the facade of one building in the colours of its damage, as PNG."""
    # Here, because pictures take half a second to import, and tables need none.
    from blast_env.plots.facade import facade_picture
    from blast_env.plots.figures import png_of

    rows = [(charge_text(building.charge), building)]
    return png_of(facade_picture(rows, building.building), _DPI)


def verdict_table(
    scenario: Scenario, records: Sequence[tuple[str, BlastRecord, Sequence[Judged]]]
) -> AnswerTable:
    """Return the table of buildings; with several threats, the worst of them first.

    Args:
        scenario: The site.
        records: Name of the layout, the blast, and the responses to it.
    """
    found: dict[tuple[str, str], list[tuple[str, Judged, tuple[str, ...]]]] = {}
    for name, record, responses in records:
        for each in responses:
            flags = tuple(why for building, why in record.unchecked if building == each.building)
            found.setdefault((name, each.building), []).append((record.threat, each, flags))
    rows = []
    for (name, building), own in found.items():
        title = scenario.title_of(building)
        if len(own) > 1:
            worst = max((each for _, each, _ in own), key=lambda each: each.severity)
            every = dict.fromkeys(flag for *_, flags in own for flag in flags)
            rows.append(worst.row(name, f"worst of {len(own)}", title, every))
        rows += [each.row(name, threat, title, flags) for threat, each, flags in own]
    return AnswerTable.of("", _HEADERS, rows, len(_HEADERS))
