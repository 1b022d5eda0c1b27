"""Frames of a blast after the paper's Figure 4, drawn in memory: no display is needed."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.calibration import LoadUnit
from blast_env.engines import Blast
from blast_env.physics.engine import BallStates
from blast_env.physics.particles import CollisionType
from blast_env.physics.scene import Scene
from blast_env.physics.structure import ModularObstacle
from blast_env.plan import (
    BARRIER,
    BORDER,
    EXPLOSIVE,
    PROTECTED,
    STANDING,
    STRUCTURE,
    Kinds,
    blast_features,
    without,
)
from blast_env.rendering.canvas import (
    Frame,
    FrameView,
    Sheet,
    Sign,
    ball_sign,
    colour_bar,
    disc,
    draw_destroyed,
    draw_features,
    draw_grid,
    draw_obstacle,
    legend,
    module_sign,
    names_layer,
    pixels_of,
    scale_bar,
    signs_of,
)
from blast_env.rendering.style import (
    AIR,
    blast_title,
    free_flight_impulse,
    nice_ceiling,
    render_extra,
)
from blast_env.units import MS_PER_S, UNITS_PER_M

with render_extra():
    import pygame

_SHARE_OF_CLOCK: Final = 0.45  # of the width
_SMALLEST_RADIUS_PX = 2.0

SIMULATION_UNITS: Final = LoadUnit()
"""Loads without a calibration."""

ONE_SEED: Final = "one draw of fan and air of many: judge by the mean over seeds"
"""What a film of one seed does not say."""


class FramePainter:
    """Draws the states of one blast, all on the same ground and with the same colour scale.

    Args:
        blast: The blast; its site, structures and charge are drawn.
        title: Heading of every frame; the scenario's name unless given.
        subtitle: Line under the heading; charge, layout and seed unless given.
        width_px: Width of the frames, 320 to 4096; the height follows from the site and is even.
        height_px: Height of the frames where the site needs less; even.
        full_impulse: Impulse of a module, simulation units, that has the last colour of the
            scale. Without it a bound from the scene alone is used, so that all layouts of one
            scenario and charge have the same scale.
        unit: In what loads are shown.
        remark: A third line, quiet as the second.

    Raises:
        BlastEnvError: If the width is out of bounds.
    """

    def __init__(
        self,
        blast: Blast,
        *,
        title: str | None = None,
        subtitle: str | None = None,
        width_px: int = 960,
        height_px: int = 0,
        full_impulse: float | None = None,
        unit: LoadUnit = SIMULATION_UNITS,
        remark: str = ONE_SEED,
    ) -> None:
        scene = blast.scene
        if full_impulse is None or full_impulse <= 0.0:
            full_impulse = nice_ceiling(free_flight_impulse(scene))
        self.full_impulse = full_impulse
        self._unit = unit
        self._scene = scene
        self._sheet = Sheet(scene.site_m, width_px)
        features = blast_features(blast.scenario, blast.layout, scene.charge)
        self._on_ground = without(features, Kinds.SITE, *STANDING)
        signs = self._signs()
        self._size_px = (width_px, max(self._sheet.height_px(signs), height_px))
        usual_title, usual_subtitle = blast_title(blast)
        lines = (
            usual_title if title is None else title,
            usual_subtitle if subtitle is None else subtitle,
            remark,
        )
        self._ground = self._sheet.ground(lines, signs, self._size_px[1])
        for feature in self._on_ground:
            if feature.kind is Kinds.BUILD_ZONE:
                draw_grid(self._ground, self.view, feature.bounds_m)
        draw_features(self._ground, self.view, self._on_ground)
        self._names = names_layer(self._sheet.small, self.view, features, self._size_px)
        self._discs: dict[tuple[int, int], pygame.Surface] = {}

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the frames."""
        return self._size_px

    @property
    def view(self) -> FrameView:
        """The site in the frames."""
        return self._sheet.view

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
        surface.blit(self._names, (0, 0))
        pygame.draw.rect(surface, BORDER, self._sheet.border, 3)
        lines = (f"{time_s * MS_PER_S:.2f} ms", note, self._so_far(obstacles))
        self._sheet.write(surface, lines, _SHARE_OF_CLOCK, right=True)
        return pixels_of(surface)

    def _so_far(self, obstacles: Sequence[ModularObstacle]) -> str:
        """Return the loads on what is protected at this moment."""
        protected = [each for each in obstacles if each.protected]
        loads = [f"{each.name} {self._unit.of_structure(each)}" for each in protected]
        return f"so far: {', '.join(loads)}" if loads else ""

    def _signs(self) -> list[pygame.Surface]:
        """Return what explains the frames: the scale, the signs, the colours of the loads."""
        sheet, room_px = self._sheet, self._sheet.room_px
        return [
            scale_bar(sheet.small, self.view.pixels_per_m, round(0.14 * sheet.width_px)),
            legend(sheet.small, self._legend_signs(), round(0.55 * sheet.width_px)),
            colour_bar(
                sheet.small,
                self.full_impulse,
                min(round(0.24 * sheet.width_px), room_px),
                self._unit,
            ),
        ]

    def _legend_signs(self) -> list[Sign]:
        """Return what the signs of the frames mean."""
        scene = self._scene
        signs: list[Sign] = [("explosive ball", ball_sign(EXPLOSIVE))]
        if scene.parameters.air.spacing_units > 0.0:
            signs.append(("air ball", ball_sign(AIR)))
        for each in scene.structures:
            if each.cells is not None:
                signs.append(("barrier module", module_sign(BARRIER, 2)))
            elif each.protected:
                signs.append((Kinds.PROTECTED_STRUCTURE.words, module_sign(PROTECTED, 3)))
            else:
                signs.append((Kinds.STRUCTURE.words, module_sign(STRUCTURE, 2)))
        if any(each.capacity is not None for each in scene.structures):
            signs.append(("destroyed module", draw_destroyed))
        ground = signs_of(self._on_ground)
        return [*dict(signs).items(), *ground]

    def _draw_balls(self, surface: pygame.Surface, balls: BallStates) -> None:
        """Draw the air, and the explosive balls over it."""
        centres = self.view.pixels(balls.position / UNITS_PER_M)
        radius_px = np.maximum(
            balls.radius / UNITS_PER_M * self.view.pixels_per_m, _SMALLEST_RADIUS_PX
        )
        quarters = np.rint(4.0 * radius_px).astype(np.int64)
        surface.set_clip(self.view.rectangle(self.view.site_m))
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
