"""The pictures of the package's rooms, and of the road from a blast to an answer.

    python -m studies.architecture docs/pictures/rooms.png --road docs/pictures/road.png

Layers come from the contract that `make lint` checks (pyproject.toml), titles from the first lines
of docstrings, questions and answers from their folders.
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
    layers = next(
        contract["layers"] for contract in contracts["contracts"] if "containers" in contract
    )
    names = [name.strip() for layer in layers for name in layer.split("|")]
    return [_room(name) for name in names if (PACKAGE / name).is_dir()]


def _room(name: str) -> Room:
    files = sorted((PACKAGE / name).rglob("*.py"))
    lines = sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)
    return Room(name, _title(PACKAGE / name / "__init__.py"), lines)


def _title(path: Path) -> str:
    """Return the first line of the docstring of a file."""
    module = ast.parse(path.read_text(encoding="utf-8"))
    return (ast.get_docstring(module) or "").partition("\n")[0].rstrip(".")


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


ROAD: Final = (
    ("evaluation/campaign.py",),
    ("evaluation/record.py", "evaluation/evaluator.py"),
    ("evaluation/blasts.py",),
    ("evaluation/questions",),
    ("answers",),
    ("answers/terminal.py", "answers/html.py", "answers/page.py"),
)
"""The steps of the road: a file each, or all files of a folder that no other step names."""


def road() -> list[list[tuple[str, str]]]:
    """Return the steps of the road, each with its files and the first lines of their docstrings."""
    named = {name for step in ROAD for name in step}
    steps = []
    for step in ROAD:
        paths = [PACKAGE / name for name in step]
        if paths[0].is_dir():
            own = (*paths[0].glob("*.py"), *paths[0].glob("*/__init__.py"))
            paths = sorted(path for path in own if path != paths[0] / "__init__.py")
        shown = [path.relative_to(PACKAGE).as_posix() for path in paths]
        steps.append(
            [
                (name.removesuffix("/__init__.py").removesuffix(".py"), _title(PACKAGE / name))
                for name in shown
                if paths[0].name in step[0] or name not in named
            ]
        )
    return steps


def road_picture(steps: list[list[tuple[str, str]]]) -> Figure:
    """Return the picture of the road: a box a step, with its files and what they do."""
    heights = [len(step) for step in steps]
    rows = sum(heights) + len(steps) - 1
    figure = Figure(figsize=(8.5, _ROW_IN * 0.9 * rows + 0.3))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 100.0), ylim=(rows + 0.2, -0.7))
    axes.axis("off")
    top = 0.0
    for number, step in enumerate(steps):
        box = FancyBboxPatch(
            (2.0, top - 0.5), 96.0, float(len(step)), boxstyle="round,pad=0,rounding_size=0.2"
        )
        box.set(facecolor="#e8eef4", edgecolor="#51667a")
        axes.add_patch(box)
        for row, (name, title) in enumerate(step):
            axes.text(3.0, top + row, name, va="center", family="monospace", fontsize=8)
            axes.text(36.0, top + row, shortened(title, _MOST_LETTERS), va="center", fontsize=8)
        top += len(step)
        if number < len(steps) - 1:
            arrow = {"arrowstyle": "-|>", "color": "#51667a"}
            axes.annotate("", (50.0, top + 0.5), (50.0, top - 0.5), arrowprops=arrow)
        top += 1.0
    return figure


def main(
    out: Annotated[Path, typer.Argument(help="The picture of the rooms: .png, .svg or .pdf.")],
    road_out: Annotated[Path | None, typer.Option("--road", help="That of the road.")] = None,
) -> None:
    """Draw the rooms of the package, and the road from a blast to an answer."""
    with user_errors():
        shown = rooms()
        save_figure(picture(shown), out)
        print_line(f"{len(shown)} rooms, {sum(room.lines for room in shown):,} lines: {out}")
        if road_out is not None:
            save_figure(road_picture(road()), road_out)
            print_line(f"{len(ROAD)} steps: {road_out}")


if __name__ == "__main__":
    typer.run(main)
