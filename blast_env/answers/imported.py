"""The answer of `import`: the buildings of an imported site, and what the import did."""

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from blast_env.answers.document import AnyPart, Line, Table, lines, titled

if TYPE_CHECKING:  # maps need the extra `maps`
    from blast_env.io.importing import SiteImport

_HEADERS: Final = (
    *("building", "protected", "parts", "height (m)", "area (m2)", "modules (m2)"),
    *("area off (%)", "outline off (m)"),
)


def import_answer(imported: "SiteImport") -> Iterator[AnyPart]:
    """Yield the table of the buildings of an imported site, the sums of its ledger, and notes."""
    width_m, height_m = imported.site.size_m
    rows = [
        (
            titled(building.name, building.title) + (" (cut)" if building.is_cut else ""),
            "yes" if building.protected else "no",
            f"{len(building.polygons)}",
            "air" if building.height_m is None else f"{building.height_m:g}",
            f"{building.outline.area:,.1f}",
            f"{building.area_m2:,.1f}",
            f"{100.0 * building.deviation.area_share:.1f}",
            f"{building.deviation.outline_m:.2f}",
        )
        for building in imported.buildings
    ]
    size, turned = f"{width_m:g} x {height_m:g} m", imported.site.rotation_deg
    title = f"{imported.scenario.name}: {size}, turned by {turned:.2f} degrees"
    yield Table.of(title, _HEADERS, rows)
    yield Line.of(
        f"places of charges: {len(imported.scenario.charge)}; particle engines use the preset "
        f"{imported.scenario.simulation.preset}"
    )
    sums = Counter(entry.fate for entry in imported.ledger.entries)
    words = ", ".join(f"{fate} {count}" for fate, count in sums.items())
    yield Line.of(f"ledger of {imported.ledger.objects} objects: {words}")
    yield from lines(f"note: {note}" for note in imported.notes)
