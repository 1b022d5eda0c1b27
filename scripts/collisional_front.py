"""The front of `scripts.search_collisional`: errors against the cost of a blast, with the presets.

Reads the candidates of the search, runs the presets on the same seeds, writes all of them as a
table, prints the front, and draws the figure of docs/validity.md.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Final

import pandas as pd
import typer

from blast_env.cli.output import print_line, user_errors
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.physics.presets import preset
from blast_env.rendering.figures import save_figure
from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import render_extra
from scripts.search_collisional import Store, candidate_table, front, score

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

SHOWN: Final = {
    "collisional": ("#D55E00", "*"),
    "collisional_fine": ("#0072B2", "P"),
}
"""The presets in the figure, with colour and marker."""

FACADE_MODULES: Final = 20
"""Width of the facade that the presets are calibrated on."""

_ERRORS: Final = {
    "distance_error": "error over distance / its bound",
    "shielding_error": "error of shielding / its bound",
}
_EVENT_TICKS: Final = (30_000, 100_000, 300_000, 1_000_000)
_HIGHEST: Final = 3.0  # worse candidates are drawn at the upper edge
_COLUMNS: Final = ("events", "mape_percent", "integral_error_percent", "exponent")
_CORNERS: Final = ("one_corner", "two_corners", "distance_error", "shielding_error")


def preset_table(names: tuple[str, ...], seeds: tuple[int, ...]) -> pd.DataFrame:
    """Return the scores of presets, a row each, as in `candidate_table`."""
    rows = []
    for name in names:
        its = score(preset(name), FACADE_MODULES, seeds)
        errors = {"distance_error": its.distance_error, "shielding_error": its.shielding_error}
        rows.append({"preset": name} | asdict(its) | errors)
    return pd.DataFrame(rows)


def front_figure(candidates: pd.DataFrame, presets: pd.DataFrame, subtitle: str) -> Figure:
    """Return both errors over the events of a blast, and against each other.

    Args:
        candidates: Of `candidate_table`, with `on_front`.
        presets: Of `preset_table`.
        subtitle: What was run.
    """
    figure = Figure(figsize=(15.0, 5.6), layout="constrained")
    panels = figure.subplots(1, 3)
    for axes, (column, label) in zip(panels[:2], _ERRORS.items(), strict=True):
        _draw_points(axes, candidates, presets, "events", column)
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(FixedLocator(_EVENT_TICKS))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set(xlabel="events of a blast in courtyard", ylabel=label, ylim=(0.0, _HIGHEST))
    _draw_points(panels[2], candidates, presets, *_ERRORS)
    panels[2].set(xlabel=_ERRORS["distance_error"], ylabel=_ERRORS["shielding_error"])
    panels[2].set(xlim=(0.0, _HIGHEST), ylim=(0.0, _HIGHEST))
    panels[2].axvline(1.0, color="#000000", lw=1.0, ls=":")
    panels[0].legend(loc="upper right")
    write_heading(figure, "Search for dense air: errors against the cost of a blast", subtitle)
    return figure


def _draw_points(
    axes: Axes, candidates: pd.DataFrame, presets: pd.DataFrame, x: str, y: str
) -> None:
    for on_front, colour, size, label in (
        (False, "#9AA3AE", 18.0, "candidate"),
        (True, "#009E73", 44.0, "on the front of all three"),
    ):
        chosen = candidates[candidates.on_front == on_front]
        horizontal = chosen[x] if x == "events" else chosen[x].clip(upper=_HIGHEST)
        vertical = chosen[y].clip(upper=_HIGHEST)
        axes.scatter(horizontal, vertical, s=size, color=colour, label=label, clip_on=False)
    for row in presets.to_dict("records"):
        colour, marker = SHOWN[row["preset"]]
        axes.scatter(
            row[x],
            row[y],
            color=colour,
            marker=marker,
            s=190,
            edgecolors="#FFFFFF",
            zorder=3,
            label=row["preset"],
        )
    axes.axhline(1.0, color="#000000", lw=1.0, ls=":", label="bound")
    axes.grid(color="#E3E6EA")
    axes.set_axisbelow(True)


def main(
    search: Annotated[Path, typer.Option(help="Folder of the search.")] = Path(
        "out/search_collisional"
    ),
    seeds: Annotated[int, typer.Option(min=2, help="Seeds of the search.")] = 3,
    table: Path = Path("docs/data/collisional_candidates.csv"),
    figure: Path = Path("docs/pictures/collisional_front.png"),
) -> None:
    """Print the front, write the table of all candidates and the figure."""
    with user_errors():
        store = Store(search / "candidates.jsonl", tuple(range(seeds)), processes=1)
        if not store.scores:
            raise BlastEnvError(f"{search}: has no candidates: run scripts.search_collisional")
        candidates = candidate_table(store.scores)
        unbeaten = front(candidates)
        candidates["on_front"] = candidates.index.isin(unbeaten.index)
        presets = preset_table(tuple(SHOWN), tuple(range(seeds)))
        for path in (table, figure):
            path.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(table) as temporary:
            pd.concat([presets, candidates]).to_csv(temporary, index=False, float_format="%.6g")
        subtitle = (
            f"{len(candidates)} candidates, {len(unbeaten)} on the front; event engine, {seeds} "
            "seeds; errors above {_HIGHEST:g} are drawn at {_HIGHEST:g}"
        )
        save_figure(front_figure(candidates, presets, subtitle), figure)
    columns = [*_COLUMNS, *_CORNERS]
    print_line(presets[["preset", *columns]].round(3).to_string(index=False))
    print_line(unbeaten[columns].round(3).to_string(index=False))


if __name__ == "__main__":
    typer.run(main)
