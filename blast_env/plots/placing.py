"""Pictures of an episode of placing, and of the blast at its end."""

from collections.abc import Sequence

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Blast
from blast_env.layout import LayoutState
from blast_env.layout.build_site import build_site
from blast_env.plots.canvas import Frame, SiteSheet
from blast_env.plots.frames import ONE_SEED, FramePainter
from blast_env.plots.heat_map import LoadScale
from blast_env.plots.plan import (
    Feature,
    Kinds,
    barrier_features,
    cell_features,
    in_order,
    site_features,
    source_features,
    vehicle_features,
    without,
    without_counts,
)
from blast_env.plots.site_plan import draw_features, legend_of, write_names
from blast_env.plots.style import charge_text, render_extra
from blast_env.site import AnySource, PointSource, Scenario, VehicleSource
from blast_env.site.blast_site import Charge

with render_extra():
    from matplotlib.artist import Artist


class PlacingPainter:
    """Draws the layouts of one episode, all on the same ground.

    The site has the same position as in the frames of `FramePainter`, and the height is at least
    that of those frames, so that both fit into one film.

    Args:
        scenario: The scenario; it has a build zone.
        sources: The place of the charge, if a single point, or its possible places.
        width_px: Width of the frames, as for `FramePainter`.
    """

    def __init__(
        self, scenario: Scenario, sources: Sequence[AnySource], width_px: int = 960
    ) -> None:
        self._scenario = scenario
        self._has_vehicles = any(isinstance(source, VehicleSource) for source in sources)
        given = without(site_features(scenario), Kinds.SITE, Kinds.CHARGE_PLACE)
        self._features = (*given, *source_features(sources))
        of_blast = _frames_of_blast(scenario, width_px)
        least_px = 0 if of_blast is None else of_blast.size_px[1]
        site_m = build_site(scenario).site_m
        heading = (scenario.name, sources_text(sources), "")
        handles = self._handles()
        self._sheet = SiteSheet(site_m, width_px, handles, heading, least_px=least_px)
        if of_blast is not None and of_blast.size_px == self.size_px:
            self._sheet.axes.set_position(of_blast.sheet.axes.get_position())
        if scenario.build_zone is not None:
            self._sheet.draw_grid(scenario.build_zone.rectangle_m)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the frames."""
        return self._sheet.size_px

    def paint(self, placement: LayoutState, lines: Sequence[str] = ()) -> Frame:
        """Return a frame, uint8 (height, width, 3).

        Args:
            placement: The modules placed so far.
            lines: At most two lines of text for the upper right corner.
        """
        axes, features = self._sheet.axes, self._of(placement)
        moving = [*draw_features(axes, features), *write_names(axes, features)]
        frame = self._sheet.frame(lines, moving)
        for artist in moving:
            artist.remove()
        return frame

    def _of(self, placement: LayoutState) -> tuple[Feature, ...]:
        """Return all features of a frame, the lowest first."""
        scenario, layout = placement.scenario, placement.layout
        found = [*self._features]
        if self._has_vehicles:
            found += vehicle_features(scenario, layout)
        zone = scenario.build_zone
        if zone is not None:
            found += cell_features(zone, placement.open_ground)
            found += barrier_features(scenario, layout)
        return in_order(found)

    def _handles(self) -> list[Artist]:
        """Return the entries of the legend, one per item, since items differ in colour."""
        placement = LayoutState.empty(self._scenario)
        catalogue = placement.catalogue
        numbers = {variant.name: number for number, variant in enumerate(catalogue.variants)}
        pieces = [catalogue.element_at(number, 0, 0) for number in numbers.values()]
        zone = self._scenario.zone
        full = cell_features(zone, np.zeros(zone.shape, dtype=bool))
        barrier = barrier_features(self._scenario, pieces)
        return legend_of(without_counts((*self._of(placement), *full, *barrier)))


def sources_text(sources: Sequence[AnySource]) -> str:
    """Return the known properties of a charge, in words."""
    first = sources[0]
    if len(sources) == 1 and isinstance(first, PointSource):
        return f"charge {charge_text(Charge(first.position_m, first.tnt_kg))}"
    masses = sorted({source.tnt_kg for source in sources})
    bounds = dict.fromkeys((masses[0], masses[-1]))
    vehicles = all(isinstance(source, VehicleSource) for source in sources)
    what = "vehicle with" if vehicles else "hidden charge of"
    return f"{what} {' to '.join(f'{mass:g}' for mass in bounds)} kg TNT"


def _frames_of_blast(scenario: Scenario, width_px: int) -> FramePainter | None:
    """Return the painter of a blast by particles; `None` if they cannot run the scenario."""
    try:
        return FramePainter(_fullest_blast(scenario), width_px=width_px)
    except BlastEnvError:
        return None


def _fullest_blast(scenario: Scenario) -> Blast:
    """Return a blast with all legend entries that the scenario can have: it needs most room."""
    empty = LayoutState.empty(scenario)
    legal = np.flatnonzero(empty.legal)
    return Blast(scenario, [empty.catalogue.element(int(action)) for action in legal[:1]])


def last_frame(blast: Blast, outcome: str, remark: str, size_px: tuple[int, int]) -> Frame:
    """Run a blast and return its end, uint8 (height, width, 3).

    Args:
        outcome: Its outcome in words.
        remark: Remark about the blast, after the scenario's name.
        size_px: Width and least height of the frame, as for `FramePainter`.
    """
    result = blast.run()
    painter = FramePainter(
        blast,
        heading=(
            f"{blast.scenario.name}{remark}",
            f"charge {charge_text(blast.scene.charge)}",
            ONE_SEED,
        ),
        width_px=size_px[0],
        height_px=size_px[1],
        scale=LoadScale.of([result]),
    )
    return painter.paint(result.final_balls, result.obstacles, result.time_s, outcome)
