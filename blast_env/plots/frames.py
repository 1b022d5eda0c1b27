"""Frames of a blast after the paper's Figure 4, drawn in memory: no display is needed."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from blast_env.calibration import LoadUnit
from blast_env.evaluation.engines import Blast
from blast_env.particles.objects import CollisionType, ModularObstacle
from blast_env.particles.run import BallStates, Scene
from blast_env.plots.canvas import Frame, SiteSheet
from blast_env.plots.heat_map import LoadScale
from blast_env.plots.plan import EXPLOSIVE, STANDING, Kinds, blast_features, without
from blast_env.plots.site_plan import (
    draw_features,
    draw_loads,
    draw_outlines,
    legend_of_loads,
    load_colours,
    show_loads,
    write_names,
)
from blast_env.plots.style import (
    AIR,
    blast_title,
    free_flight_impulse,
    nice_ceiling,
    render_extra,
    unit_interval,
)
from blast_env.units import MS_PER_S, UNITS_PER_M

with render_extra():
    from matplotlib.artist import Artist
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.lines import Line2D

_SMALLEST_RADIUS_PX: Final = 2.0
_SMALLEST_RIMMED_PX: Final = 3.5
_RIM: Final = 0.72  # of the brightness of a ball
_POINTS_PER_IN: Final = 72.0

NO_LOADS: Final = LoadScale(0.0, LoadUnit())
"""A scale in simulation units, without any load."""

ONE_SEED: Final = "one draw of fan and air of many: judge by the mean over seeds"
"""Caveat in the film of one seed."""


class FramePainter:
    """Draws the states of one blast, all on the same ground and with the same colour scale.

    Args:
        blast: The blast; its site, structures and charge are drawn.
        heading: Title of every frame, and two lines under it; by default the scenario's name, the
            charge with layout and seed, and the caveat of one seed.
        width_px: Width of the frames, 320 to 4096; the height follows from the site and is even.
        height_px: Least height of the frames; even.
        scale: The colour scale. Without one, or one without any load, it ends at a bound from the
            scene alone, so that all layouts of one scenario and charge have the same scale.

    Attributes:
        sheet: The page of the frames.
        scale: The colour scale.

    Raises:
        BlastEnvError: If the width is out of bounds.
    """

    def __init__(
        self,
        blast: Blast,
        *,
        heading: tuple[str, str, str] | None = None,
        width_px: int = 960,
        height_px: int = 0,
        scale: LoadScale = NO_LOADS,
    ) -> None:
        scene, unit = blast.scene, scale.unit
        if scale.full == 0.0:
            scale = LoadScale(unit.factor * nice_ceiling(free_flight_impulse(scene)), unit)
        self.scale = scale
        features = blast_features(blast.scenario, blast.layout, scene.charge)
        on_ground = without(features, Kinds.SITE, *STANDING)
        destructible = any(structure.capacity is not None for structure in scene.structures)
        shown = without(features, Kinds.SITE)
        handles = [*_signs(scene), *legend_of_loads(shown, destructible=destructible)]
        colours = ScalarMappable(scale.norm, load_colours())
        self.sheet = SiteSheet(
            scene.site_m,
            width_px,
            handles,
            heading or (*blast_title(blast), ONE_SEED),
            (colours, f"{unit.label}; white: not hit"),
            height_px,
        )
        for feature in on_ground:
            if feature.kind is Kinds.BUILD_ZONE:
                self.sheet.draw_grid(feature.bounds_m)
        draw_features(self.sheet.axes, on_ground)
        self.sheet.let_move(write_names(self.sheet.axes, features, inside=False))
        self._balls: dict[tuple[int, int], Line2D] = {}
        self._loads: dict[str, tuple[PolyCollection, LineCollection]] = {}
        self._outlines: list[Artist] = []

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the frames."""
        return self.sheet.size_px

    def paint(
        self,
        balls: BallStates,
        obstacles: Sequence[ModularObstacle],
        time_s: float,
        note: str = "",
    ) -> Frame:
        """Return a frame, uint8 (height, width, 3).

        Args:
            balls: The remaining balls.
            obstacles: The structures with the hits so far.
            time_s: Simulated time.
            note: A remark under the time, e.g. the real-time factor of a film.
        """
        lines = (f"{time_s * MS_PER_S:.2f} ms", note, self._so_far(obstacles))
        loads = [artist for obstacle in obstacles for artist in self._loads_on(obstacle)]
        if not self._outlines:
            self._outlines = draw_outlines(self.sheet.axes, obstacles)
        return self.sheet.frame(lines, (*self._flying(balls), *loads, *self._outlines))

    def _so_far(self, obstacles: Sequence[ModularObstacle]) -> str:
        """Return the present loads on the protected structures, in words."""
        protected = [obstacle for obstacle in obstacles if obstacle.protected]
        loads = [
            f"{structure.name} {self.scale.unit.of_structure(structure)}" for structure in protected
        ]
        return f"so far: {', '.join(loads)}" if loads else ""

    def _loads_on(self, obstacle: ModularObstacle) -> tuple[Artist, Artist]:
        """Return the modules coloured by load, and the crosses on destroyed ones."""
        known = self._loads.get(obstacle.name)
        if known is None:
            known = draw_loads(self.sheet.axes, obstacle, self.scale.norm, 0.3)
            self._loads[obstacle.name] = known
        show_loads(known, obstacle, self.scale.unit.factor)
        return known

    def _flying(self, balls: BallStates) -> Iterator[Artist]:
        """Yield the air balls, then the explosive balls above them."""
        centres_m = balls.position / UNITS_PER_M
        radius_px = balls.radius / UNITS_PER_M * self.sheet.pixels_per_m
        quarters = np.rint(4.0 * np.maximum(radius_px, _SMALLEST_RADIUS_PX)).astype(np.int64)
        for kind in (CollisionType.AirBall, CollisionType.ExplosionBall):
            of_kind = balls.kind == kind
            for size in np.unique(quarters[of_kind]).tolist():
                markers = self._markers(kind, size)
                markers.set_data(*centres_m[of_kind & (quarters == size)].T)
                yield markers

    def _markers(self, kind: CollisionType, quarters: int) -> Line2D:
        """Return the markers of the balls of a kind and a radius, given in quarters of a pixel."""
        key = (int(kind), quarters)
        if key not in self._balls:
            markers = _ball(kind)
            pt_per_px = _POINTS_PER_IN / self.sheet.figure.dpi
            rim_pt = pt_per_px if quarters / 4.0 >= _SMALLEST_RIMMED_PX else 0.0
            markers.set(markersize=quarters / 2.0 * pt_per_px - rim_pt, markeredgewidth=rim_pt)
            self._balls[key] = self.sheet.axes.add_line(markers)
            markers.set_animated(True)
        return self._balls[key]


def _ball(kind: CollisionType) -> Line2D:
    colour = unit_interval(EXPLOSIVE if kind == CollisionType.ExplosionBall else AIR)
    red, green, blue = (_RIM * channel for channel in colour)
    return Line2D(
        [], [], marker="o", linestyle="", color=colour, markeredgecolor=(red, green, blue)
    )


def _signs(scene: Scene) -> list[Artist]:
    """Return the legend entries of the balls."""
    kinds = {"explosive ball": CollisionType.ExplosionBall}
    if scene.parameters.air.spacing_units > 0.0:
        kinds["air ball"] = CollisionType.AirBall
    signs: list[Artist] = []
    for label, kind in kinds.items():
        signs.append(_ball(kind))
        signs[-1].set_label(label)
    return signs
