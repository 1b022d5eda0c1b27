"""Pictures of an episode of placing."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import floor
from typing import Final

import numpy as np

from blast_env.engines import Blast, BlastResult
from blast_env.geometry import Cell, Element, Rectangle
from blast_env.physics.scene import Charge, Scene
from blast_env.physics.structure import Colour, load_colour
from blast_env.rendering.canvas import (
    Frame,
    Lettering,
    Sheet,
    View,
    dashed_rectangle,
    draw_obstacle,
    empty_surface,
    name_plates,
    pixels_of,
    scale_bar,
)
from blast_env.rendering.film import plan_film
from blast_env.rendering.frames import FramePainter
from blast_env.rendering.style import (
    BARRIER,
    BORDER,
    EXPLOSIVE,
    FAINT,
    PROTECTED,
    QUIET_INK,
    STRUCTURE,
    nice_ceiling,
    render_extra,
)
from blast_env.scenario import (
    AnySource,
    BuildZone,
    Placement,
    PointSource,
    RectangleSource,
    Scenario,
    VehicleSource,
)
from blast_env.scenario.build_scene import build_scene, build_site, vehicle_reach
from blast_env.scenario.vehicles import squares_of
from blast_env.units import MODULE_SIDE_M, UNITS_PER_M

with render_extra():
    import pygame


Draw = Callable[[pygame.Surface, pygame.Rect], None]


Sign = tuple[str, Draw]


FREE: Final[Colour] = (214, 238, 219)


UNAVAILABLE: Final[Colour] = (226, 228, 232)


_HATCH: Final[Colour] = (158, 164, 174)


_HATCH_STEP_PX: Final = 6


_MAYBE_ALPHA: Final = 110


_REACH_ALPHA: Final = 40


_SMALLEST_CHARGE_PX: Final = 5


def hatched_surface(size_px: tuple[int, int]) -> pygame.Surface:
    """Return a surface that looks like cells that are not available."""
    width, height = size_px
    surface = pygame.Surface(size_px, 0, 32)
    surface.fill(UNAVAILABLE)
    for shift in range(0, width + height, _HATCH_STEP_PX):
        pygame.draw.line(surface, _HATCH, (shift, 0), (shift - height, height))
    return surface


def draw_charges(
    surface: pygame.Surface, view: View, sources: Sequence[AnySource], radius_m: float
) -> None:
    """Draw a disc where the charge is, or a veil where it may be.

    Args:
        surface: The frame.
        view: The site in the frame.
        sources: Where the charge is, when it is a single point, or may be.
        radius_m: Radius of the charge.
    """
    radius_px = max(round(radius_m * view.pixels_per_m), _SMALLEST_CHARGE_PX)
    alpha = 255 if is_known(sources) else _MAYBE_ALPHA
    veil = empty_surface(*surface.get_size())
    for source in sources:
        _draw_source(veil, view, source, radius_px)
    veil.set_alpha(alpha)
    surface.blit(veil, (0, 0))


def is_known(sources: Sequence[AnySource]) -> bool:
    """Whether these places leave no doubt where the charge is."""
    return len(sources) == 1 and isinstance(sources[0], PointSource)


def _draw_source(surface: pygame.Surface, view: View, source: AnySource, radius_px: int) -> None:
    if isinstance(source, RectangleSource):
        area = view.rectangle(source.rectangle_m.scaled(UNITS_PER_M))
        around = area.inflate(2 * radius_px, 2 * radius_px)
        pygame.draw.rect(surface, EXPLOSIVE, around, border_radius=radius_px)
        return
    for line_m in source.lines_m:
        start, end = (view.pixel(x_m * UNITS_PER_M, y_m * UNITS_PER_M) for x_m, y_m in line_m)
        pygame.draw.line(surface, EXPLOSIVE, start, end, 2 * radius_px)
        for centre in (start, end):
            pygame.draw.circle(surface, EXPLOSIVE, centre, radius_px)


def placing_signs(sources: Sequence[AnySource], has_others: bool) -> list[Sign]:
    """Return the legend's texts with their signs.

    Args:
        sources: Where the charge is or may be.
        has_others: Whether there are structures that are not protected.
    """
    known = is_known(sources)
    signs: list[Sign] = [
        ("charge" if known else "charge may be here", _charge_sign(known)),
        ("protected structure", _outlined(load_colour(0.0), PROTECTED, 3)),
        ("barrier module", _outlined(load_colour(0.0), BARRIER, 2)),
        ("free cell", _outlined(FREE, FAINT, 1)),
        ("cell not available", lambda s, r: s.blit(hatched_surface(r.size), r) and None),
        ("build zone", lambda s, r: dashed_rectangle(s, r, QUIET_INK, 3)),
    ]
    if any(isinstance(source, VehicleSource) for source in sources):
        signs[0] = ("vehicle enters, or charge may be", _charge_sign(known))
        signs.append(("ground that it reaches", _reach_sign))
    if has_others:
        signs.insert(2, ("other structure", _outlined(load_colour(0.0), STRUCTURE, 2)))
    return signs


def legend_of(lettering: Lettering, signs: Sequence[Sign], columns: int) -> pygame.Surface:
    """Return the signs with their texts, column by column."""
    texts = [lettering.write(text) for text, _ in signs]
    side, gap = lettering.size_px, lettering.size_px // 2
    pitch = round(1.45 * lettering.size_px)
    cell_width = side + gap + max(text.get_width() for text in texts) + 2 * gap
    rows = -(-len(signs) // columns)
    surface = empty_surface(columns * cell_width - 2 * gap, rows * pitch)
    for index, (text, (_, draw)) in enumerate(zip(texts, signs, strict=True)):
        left, top = (index // rows) * cell_width, (index % rows) * pitch
        draw(surface, pygame.Rect(left, top + (pitch - side) // 2, side, side))
        surface.blit(text, (left + side + gap, top + (pitch - text.get_height()) // 2))
    return surface


def _reach_sign(surface: pygame.Surface, place: pygame.Rect) -> None:
    sign = empty_surface(*place.size)
    sign.fill(EXPLOSIVE)
    sign.set_alpha(_REACH_ALPHA)
    surface.blit(sign, place)


def _charge_sign(known: bool) -> Draw:
    def draw(surface: pygame.Surface, place: pygame.Rect) -> None:
        sign = empty_surface(*place.size)
        pygame.draw.circle(sign, EXPLOSIVE, sign.get_rect().center, place.width // 2)
        sign.set_alpha(255 if known else _MAYBE_ALPHA)
        surface.blit(sign, place)

    return draw


def _outlined(fill: Colour, outline: Colour, width: int) -> Draw:
    def draw(surface: pygame.Surface, place: pygame.Rect) -> None:
        pygame.draw.rect(surface, fill, place)
        pygame.draw.rect(surface, outline, place, width)

    return draw


def cell_rectangle(view: View, rectangle_m: Rectangle) -> pygame.Rect:
    """Return the pixels of a rectangle in metres."""
    return view.rectangle(rectangle_m.scaled(UNITS_PER_M))


_LEGEND_COLUMNS: Final = 2


_SHARE_OF_LINES: Final = 0.6  # of the width


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
        self._sources = sources
        self._sheet = Sheet(build_site(scenario).site, width_px)
        self._view = self._sheet.view
        signs = self._signs()
        zone, fullest = scenario.build_zone, _fullest_scene(scenario)
        blast_px = FramePainter(fullest, width_px=width_px, build_zone=zone).size_px[1]
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
        for source in self._vehicles:
            self._draw_reach(surface, source, placement)
        scene = build_site(self._scenario, placement.layout)
        for obstacle in scene.obstacles():
            draw_obstacle(surface, self._view, obstacle, full_impulse=1.0)
        draw_charges(surface, self._view, self._sources, self._scenario.charge_radius_m)
        for plate, place in name_plates(self._sheet.small, self._view, scene.structures):
            surface.blit(plate, place)
        if marked is not None:
            self._mark(surface, placement, marked)
        pygame.draw.rect(surface, BORDER, self._sheet.border, 3)
        self._sheet.write(surface, lines, _SHARE_OF_LINES, right=True)
        return pixels_of(surface)

    def cell_at(self, place_px: tuple[int, int]) -> Cell | None:
        """Return the cell of the build zone at a pixel (x, y) of a frame, if there is one."""
        zone = self._scenario.build_zone
        if zone is None:
            return None
        left_px, bottom_px = cell_rectangle(self._view, zone.rectangle_m).bottomleft
        side_px = MODULE_SIDE_M * self._view.pixels_per_m
        cell = floor((bottom_px - place_px[1]) / side_px), floor((place_px[0] - left_px) / side_px)
        return cell if _is_in(zone, cell) else None

    def _mark(self, surface: pygame.Surface, placement: Placement, element: Element) -> None:
        """Outline what may be placed next."""
        zone = placement.scenario.zone
        colour = PROTECTED if placement.explain(element) is None else EXPLOSIVE
        inside = [cell for cell in placement.catalogue.cells(element) if _is_in(zone, cell)]
        places = [cell_rectangle(self._view, zone.cell_rectangle_m(cell)) for cell in inside]
        if places:
            around = places[0].unionall(places[1:]).inflate(4, 4)
            pygame.draw.rect(surface, colour, around, 3)

    def _signs(self) -> list[pygame.Surface]:
        """Return what explains the frames: the scale and the signs."""
        others = any(not structure.protected for structure in self._scenario.structures)
        signs, width_px = placing_signs(self._sources, others), self._sheet.width_px
        return [
            scale_bar(self._sheet.small, self._view.pixels_per_m, round(0.16 * width_px)),
            legend_of(self._sheet.small, signs, _LEGEND_COLUMNS),
        ]

    @property
    def _vehicles(self) -> list[VehicleSource]:
        """The vehicles that may bring the charge."""
        return [source for source in self._sources if isinstance(source, VehicleSource)]

    def _draw_reach(
        self, surface: pygame.Surface, source: VehicleSource, placement: Placement
    ) -> None:
        """Draw the ground that a vehicle gets to."""
        rows, columns = squares_of(self._scenario.site)
        ground = vehicle_reach(self._scenario, source, placement.layout).ground(rows, columns)
        veil = empty_surface(*surface.get_size())
        for row, column in zip(*np.nonzero(ground), strict=True):
            corner_m = (column * MODULE_SIDE_M, row * MODULE_SIDE_M)
            square_m = Rectangle.from_corner(corner_m, (MODULE_SIDE_M, MODULE_SIDE_M))
            veil.fill(EXPLOSIVE, cell_rectangle(self._view, square_m))
        veil.set_alpha(_REACH_ALPHA)
        surface.blit(veil, (0, 0))

    def _draw_cells(self, surface: pygame.Surface, zone: BuildZone, placement: Placement) -> None:
        """Draw which cells are free and which are not."""
        whole = cell_rectangle(self._view, zone.rectangle_m)
        surface.blit(hatched_surface(whole.size), whole)
        for row, column in zip(*np.nonzero(placement.open_ground), strict=True):
            cell_m = zone.cell_rectangle_m((int(row), int(column)))
            place = cell_rectangle(self._view, cell_m)
            pygame.draw.rect(surface, FREE, place)
            pygame.draw.line(surface, FAINT, place.topleft, (place.right - 1, place.top))
            pygame.draw.line(surface, FAINT, place.topleft, (place.left, place.bottom - 1))
        dashed_rectangle(surface, whole, QUIET_INK)


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


def _fullest_scene(scenario: Scenario) -> Scene:
    """Return a scene with everything that a blast of the scenario may show: it needs most room."""
    empty = Placement.empty(scenario)
    legal = np.flatnonzero(empty.legal)
    return build_scene(scenario, [empty.catalogue.element(int(action)) for action in legal[:1]])


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
            run.advance(time_s)
            balls = run.balls()
            # The engine's steps do not end at the frames: in between, balls fly on straight.
            moved = balls.position + (time_s - run.time_s) * balls.velocity
            yield painter.paint(replace(balls, position=moved), run.obstacles, time_s, note)

    def _painter(self, result: BlastResult) -> FramePainter:
        loads = [part.impulse for each in result.obstacles if each.protected for part in each.parts]
        return FramePainter(
            self.blast.scene,
            title=f"{self.blast.scenario.name}{self.remark}",
            subtitle=charge_text(self.blast.scene.charge),
            width_px=self.size_px[0],
            height_px=self.size_px[1],
            full_impulse=nice_ceiling(max(*loads, _LEAST_FULL_IMPULSE)),
            build_zone=self.blast.scenario.build_zone,
        )
