"""`blast-env draw`: a site and a layout, before any blast."""

from dataclasses import dataclass
from pathlib import Path

from blast_env.cli.command import Command, argument, option
from blast_env.cli.options import SCENARIO_HELP
from blast_env.cli.output import print_line
from blast_env.cli.targets import PICTURES
from blast_env.layout import Placement, load_layout
from blast_env.site import load_scenario


@dataclass(frozen=True, kw_only=True)
class DrawCommand(Command):
    """Draw the plan and the oblique view of a site, with a layout if one is given.

    Heights are to scale. No blast is run.
    """

    scenario: str = argument(SCENARIO_HELP)
    layout: Path | None = option(None, "Layout file; without it, the empty site.")
    out: Path | None = option(
        None,
        "Picture to write: .png, .svg, .pdf.",
        writes=PICTURES,
        show_default="the scenario's name, .png",
    )
    view: str = option("both", "both, plan or oblique.")
    corner: str | None = option(
        None,
        "Corner of the viewpoint: southwest, southeast, northeast, northwest.",
        flag="--from",
        show_default="on the side of the charges",
    )

    def __call__(self) -> None:
        """Draw the picture."""
        scenario = load_scenario(self.scenario)
        elements = () if self.layout is None else load_layout(self.layout, scenario)
        # Here, because pictures need the extra `render`.
        from blast_env.plots.figures import save_figure
        from blast_env.plots.site_picture import site_picture

        for sentence in Placement.of(scenario, elements).explain_vehicles():
            print_line(sentence)
        figure = site_picture(scenario, elements, self.view, self.corner)
        out = Path(f"{scenario.name}.png") if self.out is None else self.out
        print_line(f"wrote {save_figure(figure, out)}")
