"""Compare the gas solver with other codes from the same cells and state: docs/engineers/gas.md."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

import typer

from blast_env.cli.output import print_line, user_errors
from blast_env.files import make_folder
from blast_env.plots.figures import save_figure
from blast_env.tables import markdown_table
from studies.other_codes import openfoam, pyclaw
from studies.other_codes.histories import Histories, histories_figure

OURS: Final = "this project"
app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)


@app.command("openfoam")
def compare_openfoam(
    cases: Annotated[Path, typer.Option(help="New folder for OpenFOAM's cases.")] = Path(
        "out/openfoam"
    ),
    sizes: Annotated[str, typer.Option(help="Sides of cells, m.")] = "0.5,0.25",
    until: Annotated[float, typer.Option(help="Simulated time to end at, s.")] = 0.06,
    out: Path = Path("out/gas_openfoam.png"),
) -> None:
    """Compare with rhoCentralFoam: a wall of finite height before a building.

    Needs OpenFOAM's programs (Debian: `apt install openfoam`). OpenFOAM takes some minutes with
    cells of 0.25 m.
    """
    with user_errors():
        make_folder(out.parent)
        for cell_m in (float(size) for size in sizes.split(",")):
            scene = openfoam.scene(cell_m)
            own = openfoam.ours(scene, until)
            other = openfoam.rho_central_foam(scene, until, cases / f"cells_{cell_m:g}")
            _print(scene.names, cell_m, own, ("rhoCentralFoam", other))
        title = f"20 kg, a wall of 1.5 m, a building of 3 m; cells of {cell_m:g} m"
        figure = histories_figure(title, scene.names, ((OURS, own), ("rhoCentralFoam", other)))
        print_line(f"wrote {save_figure(figure, out)}")


@app.command("pyclaw")
def compare_pyclaw(
    python: Annotated[Path, typer.Option(help="An interpreter that has clawpack.")],
    sizes: Annotated[str, typer.Option(help="Sides of cells, m.")] = "0.25,0.125,0.0625",
    until: Annotated[float, typer.Option(help="Simulated time to end at, s.")] = 0.06,
    out: Path = Path("out/gas_pyclaw.png"),
) -> None:
    """Compare with PyClaw's Euler equations with walls: a plane scene, a wall and a building."""
    names = tuple(pyclaw.GAUGES_M)
    with user_errors():
        make_folder(out.parent)
        for cell_m in (float(size) for size in sizes.split(",")):
            own, other = pyclaw.ours(cell_m, until), pyclaw.by_pyclaw(cell_m, until, python)
            _print(names, cell_m, own, ("PyClaw", other))
        title = f"a cylinder of air at 10 bar, endless walls; cells of {cell_m:g} m"
        figure = histories_figure(title, names, ((OURS, own), ("PyClaw", other)))
        print_line(f"wrote {save_figure(figure, out)}")


def _print(
    names: Sequence[str], cell_m: float, own: Histories, other: tuple[str, Histories]
) -> None:
    """Print the peaks, impulses and rates of cell updates of both codes."""
    code, found = other
    rows = [
        (
            name,
            *(f"{1e-3 * value:.1f}" for value in (own.peak_pa[n], found.peak_pa[n])),
            f"{own.peak_pa[n] / found.peak_pa[n]:.2f}",
            *(f"{value:.1f}" for value in (own.impulse_pa_s[n], found.impulse_pa_s[n])),
            f"{own.impulse_pa_s[n] / found.impulse_pa_s[n]:.2f}",
        )
        for n, name in enumerate(names)
    ]
    headers = ("", "peak (kPa)", code, "ratio", "impulse (Pa s)", code, "ratio")
    print_line(f"cells of {cell_m:g} m\n" + markdown_table(headers, rows))
    rates = [1e-6 * each.cell_updates / each.cpu_s for each in (own, found)]
    print_line(
        f"million cell updates a CPU second: {rates[0]:.1f}, {code} {rates[1]:.2f}: "
        f"{rates[0] / rates[1]:.0f} times\n"
    )


if __name__ == "__main__":
    app()
