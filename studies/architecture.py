"""The picture of the package's rooms: `python -m studies.architecture docs/pictures/rooms.png`.

Layers come from the contract that `make lint` checks (pyproject.toml), titles from the first lines
of the rooms' docstrings.
"""

import ast
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import typer
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from blast_env.answers.terminal import print_line
from blast_env.cli.output import user_errors
from blast_env.errors import BlastEnvError, shortened
from blast_env.plots import save_figure

ROOT: Final = Path(__file__).parents[1]
PACKAGE: Final = ROOT / "blast_env"
_MOST_LETTERS: Final = 96
_ROW_IN: Final = 0.34
"""Height of the row of a room, inches."""


@dataclass(frozen=True)
class Room:
    """A package of `blast_env`.

    Attributes:
        name: Its name.
        title: First line of its docstring.
        lines: Lines of its Python files.
    """

    name: str
    title: str
    lines: int


def rooms() -> list[Room]:
    """Return the rooms, the highest first: each imports only those below it.

    Raises:
        BlastEnvError: If there is no checkout, with the contract.
    """
    configuration = ROOT / "pyproject.toml"
    if not configuration.exists():
        raise BlastEnvError(f"{configuration}: does not exist: the picture needs a checkout")
    contracts = tomllib.loads(configuration.read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers = next(each["layers"] for each in contracts["contracts"] if "containers" in each)
    names = [name.strip() for layer in layers for name in layer.split("|")]
    return [_room(name) for name in names if (PACKAGE / name).is_dir()]


def _room(name: str) -> Room:
    files = sorted((PACKAGE / name).rglob("*.py"))
    lines = sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)
    module = ast.parse((PACKAGE / name / "__init__.py").read_text(encoding="utf-8"))
    return Room(name, (ast.get_docstring(module) or "").partition("\n")[0].rstrip("."), lines)


def picture(shown: list[Room]) -> Figure:
    """Return the picture: a row a room, with its name and its title."""
    figure = Figure(figsize=(8.5, _ROW_IN * (len(shown) + 1)))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 100.0), ylim=(len(shown) + 0.5, -0.5))
    axes.axis("off")
    for row, room in enumerate(shown):
        box = FancyBboxPatch(
            (2.0, row - 0.36), 14.0, 0.72, boxstyle="round,pad=0,rounding_size=0.2"
        )
        box.set(facecolor="#e8eef4", edgecolor="#51667a")
        axes.add_patch(box)
        axes.text(9.0, row, room.name, ha="center", va="center", family="monospace", fontsize=9)
        title = shortened(room.title.replace("`", ""), _MOST_LETTERS)
        axes.text(18.0, row, title, ha="left", va="center", fontsize=8.5)
    axes.annotate(
        "",
        (1.0, len(shown) - 0.6),
        (1.0, -0.4),
        arrowprops={"arrowstyle": "-|>", "color": "#51667a"},
    )
    axes.text(2.0, len(shown), "each room imports only rooms below it", va="center", fontsize=8)
    return figure


def main(out: Annotated[Path, typer.Argument(help="The picture: .png, .svg or .pdf.")]) -> None:
    """Draw the rooms of the package."""
    with user_errors():
        shown = rooms()
        save_figure(picture(shown), out)
        print_line(f"{len(shown)} rooms, {sum(room.lines for room in shown):,} lines: {out}")


if __name__ == "__main__":
    typer.run(main)
