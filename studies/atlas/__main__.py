"""The atlas of shielding: runs, laws, tables and pictures of docs/engineers/atlas.md."""

import sys
from pathlib import Path
from shlex import join
from time import monotonic
from typing import Annotated, Final

import pandas as pd
import typer

from blast_env.answers.terminal import print_line
from blast_env.atlas import Laws, packaged_laws
from blast_env.cli.output import progress_bar, user_errors
from blast_env.errors import UnknownNameError
from blast_env.files import make_folder, write_text
from blast_env.parquet import read_frame, write_table
from blast_env.provenance import versions
from blast_env.tables import markdown_table
from blast_env.units import MODULE_SIDE_M
from studies.atlas import findings
from studies.atlas.families import FAMILIES
from studies.atlas.fitting import RECIPES, fit_all
from studies.atlas.runs import (
    COARSE,
    COLUMNS,
    FINE,
    OF_A_ROUND,
    groups_in,
    groups_of,
    restore,
    rounds,
    run_group,
    table_of_runs,
)
from studies.atlas.samples import Bays, Group, scenes_with_loads
from studies.atlas.scenes import CUBE_ROOT, scaled_impulse
from studies.atlas.sites import LARGE, SITES, on_site

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)

DATA: Final = Path("docs/data/atlas_blasts.parquet")
Runs = Annotated[Path, typer.Option(help="Folder of the runs.")]
Data = Annotated[Path, typer.Option(help="Table of the blasts.")]

_FACTORS: Final = ("5 %", "half", "95 %")


@app.command()
def run(
    family: Annotated[list[str] | None, typer.Option(help="Families; default: all.")] = None,
    out: Runs = Path("out/atlas"),
    groups: Annotated[int, typer.Option(min=1, help="Groups of each family.")] = 40,
    minutes: Annotated[float, typer.Option(help="End after this time.")] = 1e6,
    data: Annotated[Path, typer.Option(help="Table whose blasts are not run again.")] = DATA,
) -> None:
    """Run the blasts of families in turn; those in the folder or the table are not run again."""
    with user_errors():
        if data.exists():
            restore(_read(data), out)
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
def scaling(
    family: Annotated[list[str] | None, typer.Option(help="Families; default: four.")] = None,
) -> None:
    """Print mean impulses of the same scenes for 216 kg and for 1,728 kg, on scaled cells."""
    with user_errors():
        rows = []
        for name in family or ("wall", "posts", "opposite", "court"):
            scene = FAMILIES[name].group(1)[1]
            whole = scaled_impulse(scene, 0.5 * MODULE_SIDE_M, CUBE_ROOT)
            double = scaled_impulse(scene, MODULE_SIDE_M, 2.0 * CUBE_ROOT)
            ratio = f"{double / whole:.4f}"
            rows.append((FAMILIES[name].title, f"{whole:.1f}", f"{double:.1f}", ratio))
        headers = ("family", "216 kg, Pa s/kg^(1/3)", "1,728 kg", "ratio")
        print_line(markdown_table(headers, rows))


@app.command()
def table(out: Runs = Path("out/atlas"), data: Data = DATA) -> None:
    """Write the blasts of a folder as one table."""
    with user_errors():
        frame, count = table_of_runs(out)
        make_folder(data.parent)
        write_table(frame, COLUMNS, {"blasts": count, **versions(COARSE.version)}, data)
        print_line(f"{count:,} blasts; wrote {data}")


@app.command()
def fit(
    data: Data = DATA,
    out: Annotated[Path, typer.Option(help="The laws, .json.")] = Path("out/atlas_laws.json"),
) -> None:
    """Fit the laws, judge them on groups left out, and print their errors."""
    with user_errors():
        frame = _read(data)
        about = {
            "command": join(("python", "-m", "studies.atlas", *sys.argv[1:])),
            "blasts": str(int((frame["cell_m"] == COARSE.cell_m).sum())),
            **versions(COARSE.version, ("numpy", "scipy")),
        }
        found = fit_all(_groups(frame), about)
        make_folder(out.parent)
        write_text(out, found.model_dump_json(indent=1) + "\n")
        _print_errors(found)
        print_line(f"\n{about['blasts']} blasts; wrote {out}")


@app.command()
def errors() -> None:
    """Print the errors of the packaged laws on groups left out of their fit."""
    _print_errors(packaged_laws())


@app.command()
def spread(data: Data = DATA) -> None:
    """Print what the families do to impulses and peaks, over all their designs."""
    with user_errors():
        frame = _read(data)
        headers = ("family", "blasts", *(f"impulse, {share}" for share in _FACTORS))
        more = tuple(f"peak, {share}" for share in _FACTORS)
        print_line(markdown_table((*headers, *more), findings.spread_rows(_scenes(frame))))
        raised = ("height, m/kg^(1/3)", "sites", "impulse, mean", "from, to", "peak, mean")
        rows = findings.raised_rows(groups_of(frame, COARSE.cell_m))
        print_line("\n" + markdown_table(raised, rows))


@app.command()
def cells(data: Data = DATA) -> None:
    """Print factors on halved cells over those on the cells of the atlas."""
    with user_errors():
        frame = _read(data)
        both = (groups_of(frame, engine.cell_m) for engine in (COARSE, FINE))
        headers = ("family", "blasts", "impulse, mean", "peak, mean")
        more = ("impulse, spread of ln", "peak, spread of ln")
        print_line(markdown_table((*headers, *more), findings.cell_rows(*both)))


@app.command()
def check(
    family: Annotated[list[str] | None, typer.Option(help="Families; default: with a law.")] = None,
    first: Annotated[int, typer.Option(min=0, help="Number of the first group.")] = 1000,
    groups: Annotated[int, typer.Option(min=1, help="Groups of each family.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("out/atlas_check"),
) -> None:
    """Run designs that no law was fitted to; print how many bays lie in the intervals."""
    with user_errors():
        known = dict.fromkeys(name for recipe in RECIPES.values() for name in recipe.families)
        names = family or [*known]
        for name in names:
            if name not in known:
                raise UnknownNameError("family", name, known)
        asked = [
            (name, first + number)
            for name in names
            for number in range(groups * OF_A_ROUND.get(name, 1))
        ]
        with progress_bar("blasts") as progress:
            for done, (name, number) in enumerate(asked):
                run_group(name, number, False, out)
                progress((done + 1) / len(asked))
        rows = findings.inside_rows([*groups_in(out)], packaged_laws(), names)
        headers = ("family", "blasts", "bays in range", "impulse, error of ln", "peak, error of ln")
        more = ("impulses inside", "peaks inside", "impulses too low", "peaks too low")
        print_line(markdown_table((*headers, *more), rows))


@app.command()
def rules(data: Data = DATA) -> None:
    """Print the errors of rules for two rows of obstacles, one behind the other."""
    with user_errors():
        rows = findings.rule_rows(_scenes(_read(data)), packaged_laws())
        headers = ("factor", "blasts", "impulse, error of ln", "peak, error of ln")
        print_line(markdown_table((*headers, "impulse, mean", "peak, mean"), rows))


@app.command()
def cases(
    cell: Annotated[float, typer.Option(help="Side of the cells of gas dynamics, m.")] = 0.25,
) -> None:
    """Print what is left of a facade's impulse behind walls, by the law and by gas dynamics."""
    with user_errors():
        by_gas = findings.cases_by_gas(cell)
        headers = ("100 kg, facade 12 x 6 m at 10 m", "law", "interval of 90 %", "gas dynamics")
        print_line(markdown_table(headers, findings.case_rows(packaged_laws(), by_gas)))
        street = ("street", *(f"{along} m along" for along in (5, 10, 15, 20)))
        print_line("\n" + markdown_table(street, findings.street_rows(packaged_laws())))


@app.command()
def sites(
    name: Annotated[list[str] | None, typer.Argument(help="Bundled sites.")] = None,
    out: Annotated[Path, typer.Option(help="Folder of the blasts.")] = Path("out/atlas_sites"),
) -> None:
    """Compare screening without and with the atlas with gas dynamics, bay by bay."""
    with user_errors():
        found = [
            own
            for site in name or (*SITES, *LARGE)
            for has_layout in (False, True)
            for own in on_site(site, has_layout, packaged_laws(), out)
        ]
        headers = ("site", "layout", "bays", "estimate of impulse, error of ln", "peak")
        more = ("impulse", "peak", "gas over screening, impulse", "peak")
        print_line(markdown_table((*headers, *more), findings.site_rows(found)))


@app.command()
def unseen(
    sites: Annotated[int, typer.Option(min=1, help="Sites of each of four kinds.")] = 52,
    out: Annotated[Path, typer.Option(help="Folder of the blasts.")] = Path("out/atlas_unseen"),
) -> None:
    """Compare screening without and with the atlas with gas dynamics, on unseen sites."""
    from studies.atlas.unseen import rows as unseen_rows
    from studies.atlas.unseen import unseen_bays

    with user_errors():
        bays = [bay for seed in range(sites) for bay in unseen_bays(seed, out)]
        headers = ("bays", "number", "gas over 1.15 of screening, impulse", "peak")
        print_line(markdown_table((*headers, "largest, impulse", "peak"), unseen_rows(bays)))


@app.command()
def thumb(
    name: Annotated[list[str] | None, typer.Argument(help="Bundled sites.")] = None,
) -> None:
    """Compare rules of thumb by the atlas with gas dynamics; print which have the word."""
    from studies.atlas.thumb import SITES as WITH_RULES
    from studies.atlas.thumb import rows as thumb_rows

    with user_errors():
        rows = [row for site in name or WITH_RULES for row in thumb_rows(site)]
        headers = ("site", "rule", "left by the atlas", "left by gas dynamics", "word")
        print_line(markdown_table(headers, rows))


@app.command()
def cities(
    cell: Annotated[float, typer.Option(help="Side of the cells of gas dynamics, m.")] = 0.5,
    most: Annotated[float, typer.Option(help="Farthest place along the street, m.")] = 36.0,
) -> None:
    """Compare peaks along streets of cities of equal blocks with those that others computed."""
    from studies.atlas.cities import rows as city_rows

    with user_errors():
        headers = ("city", "charge", "streets", "peak over open ground, theirs", "gas dynamics")
        print_line(markdown_table((*headers, "ratio"), city_rows(cell, most)))


@app.command()
def pictures(
    family: Annotated[list[str] | None, typer.Option(help="Families; default: all.")] = None,
    data: Data = DATA,
    out: Annotated[Path, typer.Option(help="Folder of the pictures.")] = Path("out"),
) -> None:
    """Draw one picture per family: the blasts by design, and the law beside them."""
    from studies.atlas.pictures import SHOWN, family_picture

    with user_errors():
        make_folder(out)
        groups = _groups(_read(data))
        for name in family or SHOWN:
            if name not in SHOWN:
                raise UnknownNameError("family", name, SHOWN)
            file = out / f"atlas_{name}.png"
            family_picture(name, groups, packaged_laws()).savefig(file, dpi=80)
            print_line(f"wrote {file}")


def _read(data: Path) -> pd.DataFrame:
    return read_frame(data, COLUMNS)


def _groups(frame: pd.DataFrame) -> list[Group]:
    return [*groups_of(frame, COARSE.cell_m)]


def _scenes(frame: pd.DataFrame) -> list[Bays]:
    return [*scenes_with_loads(_groups(frame))]


def _print_errors(found: Laws) -> None:
    headers = ("law", "family", "blasts", "bays", "impulse, spread of ln -> error")
    more = ("peak", "impulses inside", "peaks inside")
    print_line(markdown_table((*headers, *more), findings.error_rows(found)))


if __name__ == "__main__":
    app()
