"""The atlas of shielding: runs, laws, tables and pictures of docs/engineers/atlas.md."""

from pathlib import Path
from time import monotonic
from typing import Annotated

import typer

from blast_env.answers.terminal import print_line
from blast_env.cli.output import progress_bar, user_errors
from blast_env.errors import UnknownNameError
from blast_env.tables import markdown_table
from blast_env.units import MODULE_SIDE_M
from studies.atlas.families import FAMILIES
from studies.atlas.runs import rounds, run_group
from studies.atlas.scenes import CUBE_ROOT, scaled_impulse

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)

Folder = Annotated[Path, typer.Option(help="Folder of the runs.")]


@app.command()
def run(
    family: Annotated[list[str] | None, typer.Option(help="Families; default: all.")] = None,
    out: Folder = Path("out/atlas"),
    groups: Annotated[int, typer.Option(min=1, help="Groups of each family.")] = 40,
    minutes: Annotated[float, typer.Option(help="End after this time.")] = 1e6,
) -> None:
    """Run the blasts of families in turn; those in the folder are not run again."""
    with user_errors():
        names = family or [*FAMILIES]
        for name in names:
            if name not in FAMILIES:
                raise UnknownNameError("family", name, FAMILIES)
        asked = [*rounds(names, groups)]
        began_s, blasts = monotonic(), 0
        with progress_bar("blasts") as progress:
            for done, (name, number, fine) in enumerate(asked):
                if monotonic() - began_s > 60.0 * minutes:
                    break
                blasts += run_group(name, number, fine, out)
                progress((done + 1) / len(asked), f"{blasts} blasts")
        print_line(f"{blasts} blasts")


@app.command()
def scaling() -> None:
    """Print mean impulses of the same scenes for 216 kg and for 1,728 kg, on scaled cells."""
    with user_errors():
        rows = []
        for name in ("wall", "posts", "opposite", "court"):
            scene = FAMILIES[name].group(1)[1]
            whole = scaled_impulse(scene, 0.5 * MODULE_SIDE_M, CUBE_ROOT)
            double = scaled_impulse(scene, MODULE_SIDE_M, 2.0 * CUBE_ROOT)
            ratio = f"{double / whole:.4f}"
            rows.append((FAMILIES[name].title, f"{whole:.1f}", f"{double:.1f}", ratio))
        headers = ("family", "216 kg, Pa s/kg^(1/3)", "1,728 kg", "ratio")
        print_line(markdown_table(headers, rows))


if __name__ == "__main__":
    app()
