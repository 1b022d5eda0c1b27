"""`blast-env report`: what an engineer hands over."""

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn

from blast_env.cli.options import CacheFolder, Processes
from blast_env.cli.output import (
    engine_text,
    message_console,
    print_line,
    resume_with_cache,
    user_errors,
)
from blast_env.cli.targets import FileTarget, checked_targets
from blast_env.errors import BlastEnvError
from blast_env.physics.engines import GAS, find_engine
from blast_env.physics.scene import Charge
from blast_env.scenario import load_layout, load_scenario


def report(
    scenario: Annotated[str, typer.Argument(help="Bundled name, or a scenario file.")],
    layout: Annotated[Path, typer.Option(help="JSON file of the layout.")],
    out: Annotated[Path, typer.Option(help="The page to write: .html.")],
    pdf: Annotated[Path | None, typer.Option(help="The same as PDF: .pdf.")] = None,
    charge: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y,KG",
            help="A threat, site metres and kg TNT; more than one will do.",
            show_default="of each charge source the place nearest to what is protected",
        ),
    ] = None,
    threats: Annotated[int, typer.Option(help="How many of those, 1 to 6.")] = 2,
    cells: Annotated[
        tuple[float, float],
        typer.Option(metavar="COARSE FINE", help="Sides of the cells of gas dynamics, m."),
    ] = (0.5, 0.25),
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=IMPULSE,PEAK",
            help="What a building may take, in the units of the report; one may be left out.",
        ),
    ] = None,
    units: Annotated[str, typer.Option(help="si (Pa s, kPa) or psi (psi ms, psi).")] = "si",
    front: Annotated[
        Path | None, typer.Option(help="front.csv of `blast-env search --method nsga2`.")
    ] = None,
    places: Annotated[int, typer.Option(help="Other places of each charge source.")] = 5,
    items: Annotated[bool, typer.Option(help="Rank what each module or piece is worth.")] = True,
    stills: Annotated[int, typer.Option(help="Moments of the film, 0 to 12.")] = 4,
    processes: Processes = 1,
    cache: CacheFolder = None,
) -> None:
    """Report on a layout by gas dynamics: HTML that needs nothing else, and PDF.

    Site and threats, bill of quantities, loads with two sizes of cells, facades, film stills, what
    each item is worth, other masses and places, limits, validity, and everything to repeat it.
    """
    files = {"--out": FileTarget(out, (".html", ".htm")), "--pdf": FileTarget(pdf, (".pdf",))}
    with user_errors(lambda: resume_with_cache(cache)), checked_targets(files, {"--cache": cache}):
        # Here, because reports need extras, and Numba half a second.
        from blast_env.reporting import Limit, StudyOptions, UnitSystem, run_study, write_report
        from blast_env.reporting.page import check_targets

        check_targets(out, pdf)
        system = UnitSystem.named(units)
        options = StudyOptions(
            charges=tuple(_charge(text) for text in charge or ()),
            most_threats=threats,
            cells_m=cells,
            limits=tuple(Limit.parsed(text, system) for text in limit or ()),
            units=system,
            front=front,
            places=places,
            items=items,
            stills=stills,
            processes=processes,
            cache=cache,
        )
        chosen = load_scenario(scenario)
        cells_of_layout = load_layout(layout, chosen)
        columns = (TextColumn("{task.description}"), BarColumn())
        with Progress(*columns, console=message_console(), transient=True) as progress:
            task = progress.add_task("report", total=1.0)

            def tell(what: str, share: float) -> None:
                progress.update(task, description=what, completed=share)

            study = run_study(chosen, cells_of_layout, options, tell)
        print_line(f"{engine_text(find_engine(GAS, cells[0]))} and of {cells[1]:g} m")
        for path in write_report(study, out, pdf):
            print_line(f"wrote {path}")


def _charge(text: str) -> Charge:
    """Return a charge from `x,y,kg`."""
    try:
        x_m, y_m, tnt_kg = (float(part) for part in text.split(","))
    except ValueError:
        raise BlastEnvError(f"--charge is {text!r}, must be three numbers as X,Y,KG") from None
    return Charge((x_m, y_m), tnt_kg)
