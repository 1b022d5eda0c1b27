"""Possible sources for the gas engine's charge against Kingery and Bulmash.

No source matches both the incident and the reflected impulse: a change that raises one also raises
the other.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import cbrt
from types import MappingProxyType
from typing import Final

from blast_env.gas.source import TNT, Explosive
from blast_env.plots.style import render_extra
from studies.gas.reference import Ratio, free_field, wide_wall

with render_extra():
    import matplotlib.pyplot as plt
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

CHARGE_KG: Final = 100.0
Z_M_KG: Final = (1.7, 2.15, 2.7, 4.3)
REFLECTED_BAND: Final = 0.06
INCIDENT_BAND: Final = 0.10
"""Tolerances of reflected and incident impulses, relative to Kingery and Bulmash's."""

CHOSEN: Final = "chosen"
SOURCES: Final[Mapping[str, Explosive]] = MappingProxyType(
    {
        "4.18 MJ/kg": Explosive(1630.0, 4.184e6, 0.0, 1.0, 2.0),
        "4.52 MJ/kg": Explosive(1630.0, 4.52e6, 0.0, 1.0, 2.0),
        "5.4 MJ/kg": Explosive(1630.0, 5.4e6, 0.0, 1.0, 2.0),
        "4.52 MJ/kg, as light as 10 kg/m3": Explosive(10.0, 4.52e6, 0.0, 1.0, 2.0),
        "4.18 + 5.8 MJ/kg in 8 ms": Explosive(1630.0, 4.184e6, 5.8e6, 8e-3, 1.8),
        "4.18 + 3 MJ/kg in 2.5 ms": Explosive(1630.0, 4.184e6, 3.0e6, 2.5e-3, 1.8),
        "3.5 + 3.2 MJ/kg in 1.5 ms": Explosive(1630.0, 3.5e6, 3.2e6, 1.5e-3, 1.8),
        "2.6 + 3.9 MJ/kg in 2 ms": Explosive(1630.0, 2.6e6, 3.9e6, 2e-3, 1.8),
        "2.8 + 2 MJ/kg in 1 ms": Explosive(1630.0, 2.8e6, 2.0e6, 1e-3, 1.8),
        CHOSEN: TNT,
        "2.8 + 3.5 MJ/kg in 1 ms": Explosive(1630.0, 2.8e6, 3.5e6, 1e-3, 1.8),
    }
)
"""Sources by prompt energy, energy of burning and its time constant for 1 kg in free air."""


@dataclass(frozen=True)
class SourceRatios:
    """Both waves of a source over Kingery and Bulmash's.

    Attributes:
        name: Name of the source.
        reflected: Ratios on a wide wall, one per distance.
        incident: Ratios in the free field, one per distance.
    """

    name: str
    reflected: Sequence[Ratio]
    incident: Sequence[Ratio]


def source_ratios(
    sources: Mapping[str, Explosive] = SOURCES,
    z_m_kg: Sequence[float] = Z_M_KG,
    cell_m: float = 0.5,
    progress: Callable[[float], None] | None = None,
) -> list[SourceRatios]:
    """Return both waves of each source, for 100 kg on the ground."""
    found = []
    for name, explosive in sources.items():
        distances_m = [z * cbrt(CHARGE_KG) for z in z_m_kg]
        walls = [wide_wall(CHARGE_KG, distance, cell_m, explosive) for distance in distances_m]
        free = free_field(CHARGE_KG, z_m_kg, cell_m, explosive)
        found.append(SourceRatios(name, walls, free))
        if progress is not None:
            progress(len(found) / len(sources))
    return found


def trade_off_figure(found: Sequence[SourceRatios], cell_m: float) -> Figure:
    """Draw the range of both impulses for each source, and the target region."""
    figure, axes = plt.subplots(figsize=(9.0, 6.5), layout="constrained")
    corner = (1.0 - REFLECTED_BAND, 1.0 - INCIDENT_BAND)
    size = (2.0 * REFLECTED_BAND, 2.0 * INCIDENT_BAND)
    axes.add_patch(Rectangle(corner, *size, color="0.9", label="wanted"))
    for k, source in enumerate(found):
        reflected = [wall.impulse for wall in source.reflected]
        incident = [wave.impulse for wave in source.incident]
        axes.plot(
            reflected,
            incident,
            color="black" if source.name == CHOSEN else plt.get_cmap("tab10")(k % 10),
            linewidth=2.5 if source.name == CHOSEN else 1.2,
            marker="osD^vP"[k % 6],
            label=source.name,
        )
        axes.annotate(
            f"{source.reflected[0].z_m_kg:.1f}",
            (reflected[0], incident[0]),
            textcoords="offset points",
            xytext=(4, -9),
            fontsize=7,
        )
    z_m_kg = [wall.z_m_kg for wall in found[0].reflected]
    axes.set_xlabel("normally reflected impulse over Kingery-Bulmash")
    axes.set_ylabel("incident impulse over Kingery-Bulmash")
    axes.set_title(
        f"{CHARGE_KG:g} kg on the ground, cells of {cell_m:g} m; each line from Z = "
        f"{z_m_kg[0]:.1f} to {z_m_kg[-1]:.1f} m/kg$^{{1/3}}$"
    )
    axes.legend(fontsize=8, loc="lower right")
    axes.grid(alpha=0.3)
    return figure
