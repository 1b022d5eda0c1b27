"""Frames of a blast after the paper's Figure 4, drawn in memory: no display is needed."""

from collections.abc import Sequence
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from blast_env.calibration import LoadUnit
from blast_env.errors import BlastEnvError
from blast_env.physics.engine import BallStates
from blast_env.physics.particles import CollisionType
from blast_env.physics.scene import Scene
from blast_env.physics.structure import ModularObstacle
from blast_env.rendering.canvas import (
    Lettering,
    View,
    colour_bar,
    disc,
    draw_build_zone,
    draw_charge_mark,
    draw_obstacle,
    flow,
    legend,
    name_plates,
    scale_bar,
)
from blast_env.rendering.style import (
    AIR,
    BORDER,
    EXPLOSIVE,
    INK,
    PAGE,
    QUIET_INK,
    SITE,
    blast_title,
    free_flight_impulse,
    nice_ceiling,
    render_extra,
)
from blast_env.scenario.models import BuildZone
from blast_env.simulation import Blast
from blast_env.units import MS_PER_S

with render_extra():
    import pygame

Frame = NDArray[np.uint8]

_NARROWEST_PX = 320
_WIDEST_PX = 4096
_SMALLEST_RADIUS_PX = 2.0

SIMULATION_UNITS: Final = LoadUnit()
"""Loads without a calibration."""

ONE_SEED: Final = "one draw of fan and air of many: judge by the mean over seeds"
"""What a film of one seed does not say."""


class FramePainter:
    """Draws the states of one blast, all on the same ground and with the same colour scale.

    Args:
        scene: The initial state; it has the site, the structures and the charge.
        title: Heading of every frame.
        subtitle: Line under the heading.
        width_px: Width of the frames, 320 to 4096; the height follows from the site and is even.
        full_impulse: Impulse of a module, simulation units, that has the last colour of the
            scale. Without it a bound from the scene alone is used, so that all layouts of one
            scenario and charge have the same scale.
        build_zone: Where barrier modules may stand; drawn as a dashed grid.
        unit: In what loads are shown.
        remark: A third line, quiet as the second.

    Raises:
        BlastEnvError: If the width is out of bounds.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        title: str = "",
        subtitle: str = "",
        width_px: int = 960,
        full_impulse: float | None = None,
        build_zone: BuildZone | None = None,
        unit: LoadUnit = SIMULATION_UNITS,
        remark: str = "",
    ) -> None:
        if not _NARROWEST_PX <= width_px <= _WIDEST_PX:
            raise BlastEnvError(f"width_px is {width_px}, must be {_NARROWEST_PX} to {_WIDEST_PX}")
        if full_impulse is None or full_impulse <= 0.0:
            full_impulse = nice_ceiling(free_flight_impulse(scene))
        self.full_impulse = full_impulse
        self._unit = unit
        self._scene = scene
        self._small = Lettering(max(round(width_px / 68), 10))
        self._large = Lettering(max(round(width_px / 52), 13))
        self._margin = max(round(width_px / 48), 8)
        self.view = self._arrange(width_px)
        self._ground = self._draw_ground(width_px, (title, subtitle, remark), build_zone)
        self._plates = name_plates(self._small, self.view, scene.structures)
        self._discs: dict[tuple[int, int], pygame.Surface] = {}

    @classmethod
    def for_blast(
        cls,
        blast: Blast,
        *,
        width_px: int = 960,
        full_impulse: float | None = None,
        unit: LoadUnit = SIMULATION_UNITS,
    ) -> Self:
        """Return a painter that names scenario, charge, layout and seed in every frame."""
        title, subtitle = blast_title(blast)
        return cls(
            blast.scene,
            title=title,
            subtitle=subtitle,
            width_px=width_px,
            full_impulse=full_impulse,
            build_zone=blast.scenario.build_zone,
            unit=unit,
            remark=ONE_SEED,
        )

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the frames."""
        return self._size_px

    def paint(
        self,
        balls: BallStates,
        obstacles: Sequence[ModularObstacle],
        time_s: float,
        note: str = "",
    ) -> Frame:
        """Return a frame, uint8 (height, width, 3).

        Args:
            balls: The balls that are still there.
            obstacles: The structures with the hits so far.
            time_s: Simulated time.
            note: A remark under the time, e.g. the real-time factor of a film.
        """
        surface = self._ground.copy()
        self._draw_balls(surface, balls)
        for obstacle in obstacles:
            draw_obstacle(surface, self.view, obstacle, self.full_impulse)
        for plate, place in self._plates:
            surface.blit(plate, place)
        pygame.draw.rect(surface, BORDER, self._border, 3)
        clock = self._large.write(f"{time_s * MS_PER_S:.2f} ms", bold=True)
        right = self._size_px[0] - self._margin
        surface.blit(clock, clock.get_rect(topright=(right, self._line_tops[0])))
        for text, top in zip((note, self._so_far(obstacles)), self._line_tops[1:], strict=True):
            remark = self._small.write_within(text, round(0.45 * right), QUIET_INK, bold=False)
            surface.blit(remark, remark.get_rect(topright=(right, top)))
        width, height = self._size_px
        pixels = np.frombuffer(pygame.image.tobytes(surface, "RGB"), dtype=np.uint8)
        return pixels.reshape(height, width, 3).copy()

    def _so_far(self, obstacles: Sequence[ModularObstacle]) -> str:
        """Return the loads on what is protected at this moment."""
        protected = [each for each in obstacles if each.protected]
        loads = [f"{each.name} {self._unit.of_structure(each)}" for each in protected]
        return f"so far: {', '.join(loads)}" if loads else ""

    @property
    def _border(self) -> pygame.Rect:
        """The border lines, just outside of the site."""
        return self.view.rectangle(self.view.site).inflate(6, 6)

    def _arrange(self, width_px: int) -> View:
        """Find the scale, so that neither width nor height gets out of hand."""
        first = self._margin // 2
        second = first + round(1.3 * self._large.size_px)
        third = second + round(1.4 * self._small.size_px)
        self._line_tops = (first, second, third)
        header_px = third + round(1.6 * self._small.size_px) + self._margin // 3
        site = self._scene.site
        width, height = site.right - site.left, site.top - site.bottom
        room_px = width_px - 2 * self._margin
        scale = min(room_px / width, 0.8 * width_px / height)
        left_px = (width_px - round(scale * width)) // 2
        self._footer_top_px = header_px + round(scale * height) + round(0.8 * self._margin)
        return View(site, left_px, header_px, scale)

    def _draw_ground(
        self, width_px: int, lines: tuple[str, str, str], build_zone: BuildZone | None
    ) -> pygame.Surface:
        """Draw everything that is the same in all frames."""
        room_px = width_px - 2 * self._margin
        blocks = [
            scale_bar(self._small, self.view.pixels_per_m, round(0.16 * width_px)),
            legend(self._small, self._scene, build_zone, round(0.55 * width_px)),
            colour_bar(
                self._small, self.full_impulse, min(round(0.28 * width_px), room_px), self._unit
            ),
        ]
        placed, footer_px = flow(blocks, room_px, self._margin)
        height_px = self._footer_top_px + footer_px + self._margin // 2
        self._size_px = (width_px, height_px + height_px % 2)
        ground = pygame.Surface(self._size_px, 0, 32)
        ground.fill(PAGE)
        for block, (left, top) in placed:
            ground.blit(block, (self._margin + left, self._footer_top_px + top))
        letterings = (self._large, self._small, self._small)
        for text, lettering, top, bold in zip(
            lines, letterings, self._line_tops, (True, False, False), strict=True
        ):
            colour = INK if bold else QUIET_INK
            line = lettering.write_within(text, round(0.55 * room_px), colour, bold)
            ground.blit(line, (self._margin, top))
        ground.fill(SITE, self.view.rectangle(self.view.site))
        if build_zone is not None:
            draw_build_zone(ground, self.view, build_zone)
        draw_charge_mark(ground, self.view, self._scene)
        return ground

    def _draw_balls(self, surface: pygame.Surface, balls: BallStates) -> None:
        """Draw the air, and the explosive balls over it."""
        centres = self.view.pixels(balls.position)
        radius_px = np.maximum(balls.radius * self.view.pixels_per_unit, _SMALLEST_RADIUS_PX)
        quarters = np.rint(4.0 * radius_px).astype(np.int64)
        surface.set_clip(self.view.rectangle(self.view.site))
        for kind in (CollisionType.AirBall, CollisionType.ExplosionBall):
            of_kind = balls.kind == kind
            for size in np.unique(quarters[of_kind]).tolist():
                image = self._disc(kind, size)
                half = image.get_width() / 2.0
                corners = np.rint(centres[of_kind & (quarters == size)] - half).astype(int)
                surface.fblits([(image, (x, y)) for x, y in corners.tolist()])
        surface.set_clip(None)

    def _disc(self, kind: CollisionType, quarters: int) -> pygame.Surface:
        """Return the image of a ball; the radius is in quarters of a pixel."""
        key = (int(kind), quarters)
        if key not in self._discs:
            colour = EXPLOSIVE if kind == CollisionType.ExplosionBall else AIR
            self._discs[key] = disc(quarters / 4.0, colour)
        return self._discs[key]


def balls_at_start(scene: Scene) -> BallStates:
    """Return the balls of a scene before anything has moved, to paint it without an engine."""
    balls = scene.balls
    return BallStates(
        index=np.arange(len(balls)),
        kind=balls.kind,
        position=balls.position,
        velocity=balls.velocity,
        mass=balls.mass,
        radius=balls.radius,
    )
