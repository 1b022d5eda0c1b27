"""What the gas engine's charge could be: sources against Kingery and Bulmash, and the trade-off.

No source meets the incident and the reflected impulse at once: what lifts the one lifts the other.
Prints a Markdown table of sources and draws the ranges of both, 100 kg on the ground.
"""

from pathlib import Path
from typing import Annotated

import matplotlib.pyplot as plt
import typer
from matplotlib.patches import Rectangle

from blast_env.cli.output import print_line, user_errors
from blast_env.physics.gas.source import TNT, Explosive
from blast_env.rendering.figures import save_figure
from scripts.validate_gas_source import Ratio, free_field, wide_wall

CHARGE_KG = 100.0
Z_M_KG = (1.7, 2.15, 2.7, 4.3)
REFLECTED_BAND = 0.06
INCIDENT_BAND = 0.10

SOURCES = {
    "4.18 MJ/kg": Explosive(1630.0, 4.184e6, 0.0, 1.0, 2.0),
    "4.52 MJ/kg": Explosive(1630.0, 4.52e6, 0.0, 1.0, 2.0),
    "5.4 MJ/kg": Explosive(1630.0, 5.4e6, 0.0, 1.0, 2.0),
    "4.52 MJ/kg, as light as 10 kg/m3": Explosive(10.0, 4.52e6, 0.0, 1.0, 2.0),
    "4.18 + 5.8 MJ/kg in 8 ms": Explosive(1630.0, 4.184e6, 5.8e6, 8e-3, 1.8),
    "4.18 + 3 MJ/kg in 2.5 ms": Explosive(1630.0, 4.184e6, 3.0e6, 2.5e-3, 1.8),
    "3.5 + 3.2 MJ/kg in 1.5 ms": Explosive(1630.0, 3.5e6, 3.2e6, 1.5e-3, 1.8),
    "2.6 + 3.9 MJ/kg in 2 ms": Explosive(1630.0, 2.6e6, 3.9e6, 2e-3, 1.8),
    "2.8 + 2 MJ/kg in 1 ms": Explosive(1630.0, 2.8e6, 2.0e6, 1e-3, 1.8),
    "chosen": TNT,
    "2.8 + 3.5 MJ/kg in 1 ms": Explosive(1630.0, 2.8e6, 3.5e6, 1e-3, 1.8),
}
"""Energy at once, energy by burning and its time constant for 1 kg in free air."""


def main(
    cell: Annotated[float, typer.Option(help="m.")] = 0.5,
    out: Path = Path("out/gas_source.png"),
) -> None:
    """Run the sources, print the table, draw the figure."""
    with user_errors():
        out.parent.mkdir(parents=True, exist_ok=True)
        print_line("| source | Z (m/kg^(1/3)) | reflected | incident | arrival at the wall |")
        print_line("|---|---|---|---|---|")
        rows = {}
        for name, explosive in SOURCES.items():
            unit = CHARGE_KG ** (1 / 3)
            walls = [wide_wall(CHARGE_KG, z * unit, cell, explosive) for z in Z_M_KG]
            free = free_field(CHARGE_KG, list(Z_M_KG), cell, explosive)
            rows[name] = walls, free
            print_line(
                f"| {name} | {', '.join(f'{wall.z_m_kg:.2f}' for wall in walls)} | "
                f"{', '.join(f'{wall.impulse:.3f}' for wall in walls)} | "
                f"{', '.join(f'{wave.impulse:.3f}' for wave in free)} | "
                f"{', '.join(f'{wall.arrival:.3f}' for wall in walls)} |"
            )
        draw(rows, cell, out)
    print_line(f"wrote {out}")


def draw(rows: dict[str, tuple[list[Ratio], list[Ratio]]], cell_m: float, out: Path) -> None:
    """Draw the range of both impulses for each source, and where both are as wanted."""
    figure, axes = plt.subplots(figsize=(9.0, 6.5), layout="constrained")
    corner = (1.0 - REFLECTED_BAND, 1.0 - INCIDENT_BAND)
    size = (2.0 * REFLECTED_BAND, 2.0 * INCIDENT_BAND)
    axes.add_patch(Rectangle(corner, *size, color="0.9", label="wanted"))
    for k, (name, (walls, free)) in enumerate(rows.items()):
        reflected = [wall.impulse for wall in walls]
        incident = [wave.impulse for wave in free]
        axes.plot(
            reflected,
            incident,
            color="black" if name == "chosen" else plt.get_cmap("tab10")(k % 10),
            linewidth=2.5 if name == "chosen" else 1.2,
            marker="osD^vP"[k % 6],
            label=name,
        )
        axes.annotate(
            f"{walls[0].z_m_kg:.1f}",
            (reflected[0], incident[0]),
            textcoords="offset points",
            xytext=(4, -9),
            fontsize=7,
        )
    axes.set_xlabel("normally reflected impulse over Kingery-Bulmash")
    axes.set_ylabel("incident impulse over Kingery-Bulmash")
    axes.set_title(
        f"{CHARGE_KG:g} kg on the ground, cells of {cell_m:g} m; each line from Z = {Z_M_KG[0]:g} "
        f"to {Z_M_KG[-1]:g} m/kg$^{{1/3}}$"
    )
    axes.legend(fontsize=8, loc="lower right")
    axes.grid(alpha=0.3)
    save_figure(figure, out)


if __name__ == "__main__":
    typer.run(main)
