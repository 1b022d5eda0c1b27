"""Pictures of an episode of placing, and of the blast at its end."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import floor
from typing import Final

import numpy as np

from blast_env.engines import Blast, BlastResult
from blast_env.geometry import Cell, Element
from blast_env.physics.scene import Charge
from blast_env.physics.structure import Colour
from blast_env.plan import (
    BORDER,
    EXPLOSIVE,
    FAINT,
    PROTECTED,
    Feature,
    Kinds,
    barrier_features,
    rectangles_of,
    site_features,
    source_features,
    vehicle_features,
    without,
    without_counts,
)
from blast_env.rendering.canvas import (
    Frame,
    Sheet,
    Sign,
    draw_features,
    draw_grid,
    hatch,
    legend,
    names_layer,
    pixels_of,
    scale_bar,
    signs_of,
)
from blast_env.rendering.film import paint_at, plan_film
from blast_env.rendering.frames import FramePainter
from blast_env.rendering.style import nice_ceiling, render_extra
from blast_env.scenario import AnySource, BuildZone, Placement, PointSource, Scenario, VehicleSource
from blast_env.scenario.build_scene import build_site
from blast_env.units import MODULE_SIDE_M

with render_extra():
    import pygame

FREE: Final[Colour] = (214, 238, 219)
_UNAVAILABLE: Final[Colour] = (226, 228, 232)
_HATCH: Final[Colour] = (158, 164, 174)
_LEGEND_SHARE: Final = 0.83  # of the width
_SHARE_OF_LINES: Final = 0.6  # of the width


def _draw_free(surface: pygame.Surface, place: pygame.Rect) -> None:
    pygame.draw.rect(surface, FREE, place)
    pygame.draw.rect(surface, FAINT, place, 1)


def _draw_unavailable(surface: pygame.Surface, place: pygame.Rect) -> None:
    surface.fill(_UNAVAILABLE, place)
    hatch(surface, place, _HATCH)


_CELLS: Final[tuple[Sign, ...]] = (
    ("free cell", _draw_free),
    ("cell not available", _draw_unavailable),
)


class PlacingPainter:
    """Draws the layouts of one episode, all on the same ground.

    The site is in the same place as in the frames of `FramePainter`, and with this height in
    those, all are of the same size: both fit into one film.

    Args:
        scenario: The scenario; it has a build zone.
        sources: Where the charge is, when it is a single point, or may be.
        width_px: Width of the frames, as for `FramePainter`.
    """

    def __init__(
        self, scenario: Scenario, sources: Sequence[AnySource], width_px: int = 960
    ) -> None:
        self._scenario = scenario
        self._has_vehicles = any(isinstance(source, VehicleSource) for source in sources)
        self._sheet = Sheet(build_site(scenario).site_m, width_px)
        self._view = self._sheet.view
        given = without(site_features(scenario), Kinds.SITE, Kinds.CHARGE_PLACE)
        self._features = (*given, *source_features(sources))
        signs = self._signs()
        blast_px = FramePainter(_fullest_blast(scenario), width_px=width_px).size_px[1]
        height_px = max(self._sheet.height_px(signs), blast_px)
        lines = (scenario.name, sources_text(sources))
        self._ground = self._sheet.ground(lines, signs, height_px)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the frames."""
        width, height = self._ground.get_size()
        return width, height

    def paint(
        self, placement: Placement, lines: Sequence[str] = (), marked: Element | None = None
    ) -> Frame:
        """Return a frame, uint8 (height, width, 3).

        Args:
            placement: The modules placed so far.
            lines: At most two lines of text for the upper right corner.
            marked: What may be placed next, outlined; in another colour where it may not be.
        """
        surface = self._ground.copy()
        if self._scenario.build_zone is not None:
            self._draw_cells(surface, self._scenario.build_zone, placement)
        features = self._of(placement)
        draw_features(surface, self._view, features)
        names = names_layer(self._sheet.small, self._view, features, self.size_px)
        surface.blit(names, (0, 0))
        if marked is not None:
            self._mark(surface, placement, marked)
        pygame.draw.rect(surface, BORDER, self._sheet.border, 3)
        self._sheet.write(surface, lines, _SHARE_OF_LINES, right=True)
        return pixels_of(surface)

    def _of(self, placement: Placement) -> tuple[Feature, ...]:
        """Return everything that a frame shows."""
        scenario, layout = placement.scenario, placement.layout
        vehicles = vehicle_features(scenario, layout) if self._has_vehicles else ()
        below = [each for each in vehicles if each.kind is Kinds.REACHED]
        zone = scenario.build_zone
        barrier = () if zone is None else barrier_features(zone, layout)
        return (*below, *self._features, *barrier, *without(vehicles, Kinds.REACHED))

    def cell_at(self, place_px: tuple[int, int]) -> Cell | None:
        """Return the cell of the build zone at a pixel (x, y) of a frame, if there is one."""
        zone = self._scenario.build_zone
        if zone is None:
            return None
        left_px, bottom_px = self._view.rectangle(zone.rectangle_m).bottomleft
        side_px = MODULE_SIDE_M * self._view.pixels_per_m
        cell = floor((bottom_px - place_px[1]) / side_px), floor((place_px[0] - left_px) / side_px)
        return cell if _is_in(zone, cell) else None

    def _mark(self, surface: pygame.Surface, placement: Placement, element: Element) -> None:
        """Outline what may be placed next."""
        zone = placement.scenario.zone
        colour = PROTECTED if placement.explain(element) is None else EXPLOSIVE
        inside = [cell for cell in placement.catalogue.cells(element) if _is_in(zone, cell)]
        places = [self._view.rectangle(zone.cell_rectangle_m(cell)) for cell in inside]
        if places:
            around = places[0].unionall(places[1:]).inflate(4, 4)
            pygame.draw.rect(surface, colour, around, 3)

    def _signs(self) -> list[pygame.Surface]:
        """Return what explains the frames: the scale and the signs."""
        placement, width_px = Placement.empty(self._scenario), self._sheet.width_px
        zone = self._scenario.zone
        # One of each item: they differ in colour.
        catalogue = placement.catalogue
        numbers = {each.name: number for number, each in enumerate(catalogue.variants)}
        one_each = [catalogue.element_at(number, 0, 0) for number in numbers.values()]
        shown = without_counts((*self._of(placement), *barrier_features(zone, one_each)))
        return [
            scale_bar(self._sheet.small, self._view.pixels_per_m, round(0.14 * width_px)),
            legend(
                self._sheet.small,
                [*signs_of(shown), *_CELLS],
                round(_LEGEND_SHARE * self._sheet.room_px),
            ),
        ]

    def _draw_cells(self, surface: pygame.Surface, zone: BuildZone, placement: Placement) -> None:
        """Draw which cells are free and which are not."""
        whole = self._view.rectangle(zone.rectangle_m)
        _draw_unavailable(surface, whole)
        for free_m in rectangles_of(placement.open_ground, zone.corner_m):
            surface.fill(FREE, self._view.rectangle(free_m))
        draw_grid(surface, self._view, zone.rectangle_m)


def _is_in(zone: BuildZone, cell: Cell) -> bool:
    return 0 <= cell[0] < zone.rows and 0 <= cell[1] < zone.columns


def charge_text(charge: Charge) -> str:
    """Return mass and place of a charge, in words."""
    x_m, y_m = charge.position_m
    return f"charge {charge.tnt_kg:g} kg TNT at ({x_m:.1f} m, {y_m:.1f} m)"


def sources_text(sources: Sequence[AnySource]) -> str:
    """Return what is known of a charge, in words."""
    first = sources[0]
    if len(sources) == 1 and isinstance(first, PointSource):
        return charge_text(Charge(first.position_m, first.tnt_kg))
    masses = sorted({source.tnt_kg for source in sources})
    bounds = dict.fromkeys((masses[0], masses[-1]))
    vehicles = all(isinstance(source, VehicleSource) for source in sources)
    what = "vehicle with" if vehicles else "hidden charge of"
    return f"{what} {' to '.join(f'{mass:g}' for mass in bounds)} kg TNT"


def _fullest_blast(scenario: Scenario) -> Blast:
    """Return a blast with everything that one of the scenario may show: it needs most room."""
    empty = Placement.empty(scenario)
    legal = np.flatnonzero(empty.legal)
    return Blast(scenario, [empty.catalogue.element(int(action)) for action in legal[:1]])


_LEAST_FULL_IMPULSE: Final = 1e-9


@dataclass(frozen=True, eq=False)
class BlastScreening:
    """Shows one blast, with a text about what came of it.

    The blast is simulated again, since assessments of layouts keep only its loads.

    Attributes:
        blast: The blast.
        outcome: What came of it; in every frame.
        remark: About which blast is shown; after the scenario's name.
        size_px: Width and least height of the frames, as for `FramePainter`.
    """

    blast: Blast
    outcome: str
    remark: str = ""
    size_px: tuple[int, int] = (960, 0)

    def last_frame(self) -> Frame:
        """Return the state at the end, uint8 (height, width, 3)."""
        result = self.blast.run()
        painter = self._painter(result)
        balls, obstacles = result.final_balls, result.obstacles
        return painter.paint(balls, obstacles, result.time_s, self.outcome)

    def frames(self, frames_per_s: float) -> Iterator[Frame]:
        """Yield the frames of a film of 8 to 12 s, as `write_film` plans it.

        Args:
            frames_per_s: Frames in a second of the film.
        """
        result = self.blast.run()
        plan = plan_film(result, frames_per_s)
        painter = self._painter(result)
        note = f"{self.outcome}; {plan.real_time_factor}"
        run = self.blast.start()
        for frame in range(plan.frame_count):
            time_s = plan.time_s(frame)
            yield paint_at(run, painter, time_s, note)

    def _painter(self, result: BlastResult) -> FramePainter:
        loads = [part.impulse for each in result.obstacles if each.protected for part in each.parts]
        return FramePainter(
            self.blast,
            title=f"{self.blast.scenario.name}{self.remark}",
            subtitle=charge_text(self.blast.scene.charge),
            width_px=self.size_px[0],
            height_px=self.size_px[1],
            full_impulse=nice_ceiling(max(*loads, _LEAST_FULL_IMPULSE)),
            remark="",
        )
