"""`blast-env report`: the report of an engineer to a client."""

from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blast_env.app.cost import ReportCost
from blast_env.cli.command import argument, option
from blast_env.cli.options import (
    CHARGE,
    MASS_ERROR_HELP,
    SCENARIO_HELP,
    TARGET_HELP,
    CacheOptions,
    ProcessOptions,
)
from blast_env.cli.options import (
    GivenChargeNumbers as GivenCharge,
)
from blast_env.cli.output import (
    InterruptedCommandError,
    message_console,
    print_line,
    print_written,
    progress_bar,
)
from blast_env.errors import BlastEnvError, value_text
from blast_env.gas.settings import CELLS, UNIFORM, Cells
from blast_env.layout import check_layout, load_layout
from blast_env.response.buildings import LevelOfProtection
from blast_env.site import Scenario, load_scenario
from blast_env.site.scene import Charge
from blast_env.values import plain_number

if TYPE_CHECKING:
    from blast_env.report import StudyOptions


@dataclass(frozen=True, kw_only=True)
class ReportCommand(ProcessOptions, CacheOptions):
    """Report on a layout by gas dynamics, as one self-contained HTML page and as PDF.

    The verdict comes first, then the assumptions: site and threats, bill of quantities, loads with
    two sizes of cells, damage, film stills, the worth of each item, other masses and places, the
    source of every number, and everything to repeat it. If it is stopped (Ctrl-C) after the loads
    with the coarser cells, the command writes the parts finished so far.
    """

    scenario: str = argument(SCENARIO_HELP)
    layout: Path = option(..., "JSON file of the layout.")
    out: Path = option(..., "The page to write: .html.", writes=(".html", ".htm"))
    pdf: Path | None = option(None, "The same as PDF: .pdf.", writes=(".pdf",))
    charges: tuple[GivenCharge, ...] = option(
        (),
        "A threat, site metres and kg TNT; may be given again.",
        flag="--charge",
        metavar=CHARGE,
        show_default="of each charge source the worst of its places with the layout",
    )
    most_threats: int = option(2, "How many of those, 1 to 6.", flag="--threats")
    cells: tuple[str, str] | None = option(
        None,
        "Sides of the cells of gas dynamics, m, or coarse fine, which grow; the same twice is one "
        "size, without the error of the cells.",
        metavar="COARSE FINE",
        show_default="0.5 0.25; coarse fine on sites wider than 40 m",
    )
    limits: tuple[str, ...] = option(
        (),
        "Largest permissible load of a building, in the units of the report; one may be left out.",
        flag="--limit",
        metavar="NAME=IMPULSE,PEAK",
    )
    target: str | None = option(None, TARGET_HELP.format("low"))
    units: str = option("si", "si (Pa s, kPa) or psi (psi ms, psi).")
    front: Path | None = option(None, "front.csv of `blast-env search --method nsga2`.")
    places: int = option(5, "Other places of each charge source.")
    items: bool = option(True, "Rank the contribution of each module or piece.")
    stills: int = option(4, "Moments of the film, 0 to 12.")
    mass_error: float = option(0.1, MASS_ERROR_HELP, min=0.0, max=0.3)
    details: Path | None = option(
        None, "TOML file with project, client, author, checker, revision and marking."
    )
    project: str = option("", "Project, on the first page.")
    client: str = option("", "Client.")
    author: str = option("", "Author.")
    checker: str = option("", "Person who has checked the report.")
    revision: str = option("", "Revision.")
    marking: str = option("", "Marking of every page, as for confidentiality.")

    def __call__(self) -> None:
        """Run the blasts and write the report."""
        scenario = load_scenario(self.scenario)
        layout = load_layout(self.layout, scenario)
        # Here, because reports need extras, and Numba half a second.
        from blast_env.report import run_study, write_report
        from blast_env.report.page import check_targets

        check_targets(self.out, self.pdf)
        options = self._study_options(scenario)
        check_layout(scenario, layout)
        cost = ReportCost.of(scenario, layout, options)
        message_console().print(cost.words)
        with progress_bar(f"report on {scenario.name}") as progress:

            def tell(label: str, part: float) -> None:
                share = cost.share(label, part)
                if share is not None:
                    progress(share)

            study = run_study(scenario, layout, options, tell)
        print_line(" and ".join((options.coarse.describe(), options.words[1])))
        print_written(write_report(study, self.out, self.pdf))
        if study.stopped:
            raise InterruptedCommandError(
                f"{self.out} has the parts finished before: {study.stopped}", self.how_to_resume()
            )

    def how_to_resume(self) -> str:
        """Return the way to resume after an interruption: from the cached loads, if any."""
        kept = super().how_to_resume()
        return kept if self.cache is None else f"{kept}, and draws the threats again"

    def _study_options(self, scenario: Scenario) -> "StudyOptions":
        from blast_env.report import Limit, StudyOptions, UnitSystem, final_cells
        from blast_env.report.details import DETAILS, read_details

        units = UnitSystem.named(self.units)
        given: dict[str, Any] = {
            each.name: getattr(self, each.name) for each in fields(StudyOptions)
        }
        given["details"] = read_details(
            self.details, {name: getattr(self, name) for name in DETAILS}
        )
        given["charges"] = tuple(_charge(each, scenario) for each in self.charges)
        given["limits"] = tuple(Limit.parsed(text, units) for text in self.limits)
        given["units"] = units
        given["cells"] = final_cells(scenario)
        if self.cells is not None:
            given["cells"] = tuple(_cells(each) for each in self.cells)
        given["target"] = None if self.target is None else LevelOfProtection.named(self.target)
        return StudyOptions(**given)


def _charge(given: GivenCharge, scenario: Scenario) -> Charge:
    """Return the charge of an option.

    Raises:
        BlastEnvError: If it has no mass, and the scenario's sources have different ones.
    """
    masses_kg = sorted({source.tnt_kg for source in scenario.charge})
    x_m, y_m, *own_kg = given
    if not own_kg and len(masses_kg) > 1:
        known = ", ".join(f"{each:g}" for each in masses_kg)
        raise BlastEnvError(
            f"--charge is {x_m:g},{y_m:g} without a mass, but the scenario has charges of {known} "
            "kg: say X,Y,KG"
        )
    return Charge((x_m, y_m), (own_kg or masses_kg)[0])


def _cells(text: str) -> Cells:
    """Return the cells of a text: a side, m, or the name of growing cells.

    Raises:
        BlastEnvError: If it is neither.
    """
    with suppress(BlastEnvError):
        return plain_number("--cells", text)
    growing = [each for each in CELLS if each != UNIFORM]
    if text not in growing:
        known = ", ".join(growing)
        raise BlastEnvError(f"--cells is {value_text(text)}, must be a length in m, or {known}")
    return text
