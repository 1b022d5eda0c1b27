"""Frames of a site on which barrier modules are being placed."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.rendering.extra import render_extra
from blast_env.rendering.frames import Frame, FramePainter
from blast_env.rendering.lettering import Lettering
from blast_env.rendering.placing_signs import (
    FREE,
    cell_rectangle,
    draw_charges,
    hatched_surface,
    legend_of,
    placing_signs,
)
from blast_env.rendering.site_layer import draw_obstacle, name_plates
from blast_env.rendering.strips import dashed_rectangle, flow, scale_bar
from blast_env.rendering.style import BORDER, FAINT, INK, PAGE, QUIET_INK, SITE
from blast_env.rendering.view import View
from blast_env.scenario import AnySource, BuildZone, Charge, Placement, PointSource, Scenario
from blast_env.scene import Scene, build_scene

with render_extra():
    import pygame

_LEGEND_COLUMNS: Final = 2


class PlacingPainter:
    """Draws the layouts of one episode, all on the same ground.

    The frames are of the same size, and the site in the same place, as those of `FramePainter`
    padded by `padded`: both fit into one film.

    Args:
        scenario: The scenario; it has a build zone.
        sources: Where the charge is, when it is a single point, or may be.
        width_px: Width of the frames, as for `FramePainter`.
    """

    def __init__(
        self, scenario: Scenario, sources: Sequence[AnySource], width_px: int = 960
    ) -> None:
        self._scenario = scenario
        self._sources = sources
        self._small = Lettering(max(round(width_px / 68), 10))
        self._large = Lettering(max(round(width_px / 52), 13))
        self._margin = max(round(width_px / 48), 8)
        blast_painter = FramePainter(_fullest_scene(scenario), width_px=width_px)
        self._view = blast_painter.view
        self._ground = self._draw_ground(*blast_painter.size_px)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the frames."""
        width, height = self._ground.get_size()
        return width, height

    def paint(self, placement: Placement, lines: Sequence[str] = ()) -> Frame:
        """Return a frame, uint8 (height, width, 3).

        Args:
            placement: The modules placed so far.
            lines: At most two lines of text for the upper right corner.
        """
        surface = self._ground.copy()
        if self._scenario.build_zone is not None:
            self._draw_cells(surface, self._scenario.build_zone, placement)
        scene = build_scene(self._scenario, placement.cells)
        for obstacle in scene.obstacles():
            draw_obstacle(surface, self._view, obstacle, full_impulse=1.0)
        draw_charges(surface, self._view, self._sources, self._scenario.charge_radius_m)
        for plate, place in name_plates(self._small, self._view, scene.structures):
            surface.blit(plate, place)
        pygame.draw.rect(surface, BORDER, _border(self._view), 3)
        right = self.size_px[0] - self._margin
        for line, top, lettering, colour in zip(
            lines, self._line_tops, (self._large, self._small), (INK, QUIET_INK), strict=False
        ):
            text = lettering.write(line, colour, bold=lettering is self._large)
            surface.blit(text, text.get_rect(topright=(right, top)))
        width, height = self.size_px
        pixels = np.frombuffer(pygame.image.tobytes(surface, "RGB"), dtype=np.uint8)
        return pixels.reshape(height, width, 3).copy()

    def padded(self, frame: Frame) -> Frame:
        """Return a frame of the blast with the height of the frames drawn here."""
        missing = self.size_px[1] - len(frame)
        return np.pad(frame, ((0, max(missing, 0)), (0, 0), (0, 0)), constant_values=PAGE[0])

    @property
    def _line_tops(self) -> tuple[int, int]:
        """Where the two lines over the site begin."""
        first = self._margin // 2
        return first, first + round(1.3 * self._large.size_px)

    def _draw_ground(self, width_px: int, least_height_px: int) -> pygame.Surface:
        """Draw everything that is the same in all frames."""
        others = any(not structure.protected for structure in self._scenario.structures)
        signs = placing_signs(self._sources, others)
        blocks = [
            scale_bar(self._small, self._view.pixels_per_m, round(0.16 * width_px)),
            legend_of(self._small, signs, _LEGEND_COLUMNS),
        ]
        room_px = width_px - 2 * self._margin
        placed, footer_px = flow(blocks, room_px, self._margin)
        footer_top_px = _border(self._view).bottom + round(0.8 * self._margin)
        height_px = max(footer_top_px + footer_px + self._margin // 2, least_height_px)
        ground = pygame.Surface((width_px, height_px + height_px % 2), 0, 32)
        ground.fill(PAGE)
        for block, (left, top) in placed:
            ground.blit(block, (self._margin + left, footer_top_px + top))
        title = self._large.write_within(self._scenario.name, round(0.6 * room_px), bold=True)
        known = sources_text(self._sources)
        subtitle = self._small.write_within(known, round(0.7 * room_px), QUIET_INK)
        for text, top in zip((title, subtitle), self._line_tops, strict=True):
            ground.blit(text, (self._margin, top))
        ground.fill(SITE, self._view.rectangle(self._view.site))
        return ground

    def _draw_cells(self, surface: pygame.Surface, zone: BuildZone, placement: Placement) -> None:
        """Draw which cells are free and which are not."""
        whole = cell_rectangle(self._view, zone.rectangle_m)
        surface.blit(hatched_surface(whole.size), whole)
        for row, column in zip(*np.nonzero(placement.free), strict=True):
            cell_m = zone.cell_rectangle_m((int(row), int(column)))
            place = cell_rectangle(self._view, cell_m)
            pygame.draw.rect(surface, FREE, place)
            pygame.draw.line(surface, FAINT, place.topleft, (place.right - 1, place.top))
            pygame.draw.line(surface, FAINT, place.topleft, (place.left, place.bottom - 1))
        dashed_rectangle(surface, whole, QUIET_INK)


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
    return f"hidden charge of {' to '.join(f'{mass:g}' for mass in bounds)} kg TNT"


def _border(view: View) -> pygame.Rect:
    """Return the border lines, just outside of the site."""
    return view.rectangle(view.site).inflate(6, 6)


def _fullest_scene(scenario: Scenario) -> Scene:
    """Return a scene with everything that a blast of the scenario may show: it needs most room."""
    free = np.argwhere(Placement.empty(scenario).free)
    return build_scene(scenario, [(int(row), int(column)) for row, column in free[:1]])
