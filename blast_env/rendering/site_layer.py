"""What stands on the site in a frame: modules, outlines, names, build zone."""

from collections.abc import Sequence

from blast_env.physics.structure import ModularObstacle, ModularPart
from blast_env.rendering.extra import render_extra
from blast_env.rendering.lettering import Lettering
from blast_env.rendering.strips import Point, dashed_rectangle, draw_destroyed, empty_surface, hatch
from blast_env.rendering.style import (
    BARRIER,
    FAINT,
    INK,
    PROTECTED,
    QUIET_INK,
    SITE,
    STRUCTURE,
)
from blast_env.rendering.view import View
from blast_env.scenario.models import BuildZone
from blast_env.scene import Scene, StructureOutline
from blast_env.units import MODULE_SIDE_UNITS, UNITS_PER_M

with render_extra():
    import pygame

_SMALLEST_GRID_PX = 6


def draw_obstacle(
    surface: pygame.Surface, view: View, obstacle: ModularObstacle, full_impulse: float
) -> None:
    """Draw the modules in the colours of their loads, and the outline that tells the role."""
    is_barrier = obstacle.cells is not None
    grid = not is_barrier and view.pixels_per_unit * MODULE_SIDE_UNITS >= _SMALLEST_GRID_PX
    for part in obstacle.parts:
        _draw_module(surface, view, part, full_impulse, grid)
    if is_barrier:
        for part in obstacle.parts:
            place = view.rectangle(part.rectangle)
            pygame.draw.rect(surface, BARRIER, place, 2 if place.width >= 7 else 1)
        return
    width = 3 if obstacle.protected else 2
    around = view.rectangle(obstacle.rectangle).inflate(2 * width - 2, 2 * width - 2)
    pygame.draw.rect(surface, PROTECTED if obstacle.protected else STRUCTURE, around, width)


def _draw_module(
    surface: pygame.Surface, view: View, part: ModularPart, full_impulse: float, grid: bool
) -> None:
    place = view.rectangle(part.rectangle)
    if part.destroyed:
        draw_destroyed(surface, place)
        return
    colour = part.colour(full_impulse)
    pygame.draw.rect(surface, colour, place)
    if grid:
        red, green, blue = (round(0.8 * channel) for channel in colour)
        pygame.draw.line(surface, (red, green, blue), place.topleft, (place.right - 1, place.top))
        pygame.draw.line(surface, (red, green, blue), place.topleft, (place.left, place.bottom - 1))


def draw_build_zone(surface: pygame.Surface, view: View, zone: BuildZone) -> None:
    """Draw where modules may stand, with the grid where it is legible, and the keep-outs."""
    whole = view.rectangle(zone.rectangle_m.scaled(UNITS_PER_M))
    if view.pixels_per_unit * MODULE_SIDE_UNITS >= _SMALLEST_GRID_PX:
        for cell in zone.cells():
            place = view.rectangle(zone.cell_rectangle_m(cell).scaled(UNITS_PER_M))
            pygame.draw.line(surface, FAINT, place.topleft, place.topright)
            pygame.draw.line(surface, FAINT, place.topleft, place.bottomleft)
    for keep_out in zone.keep_outs:
        hatch(surface, view.rectangle(keep_out.rectangle_m.scaled(UNITS_PER_M)), FAINT)
    dashed_rectangle(surface, whole, QUIET_INK)


def draw_charge_mark(surface: pygame.Surface, view: View, scene: Scene) -> None:
    """Draw a cross where the charge is."""
    x, y = view.pixel(*scene.charge_centre)
    for slope in (-1, 1):
        pygame.draw.line(surface, QUIET_INK, (x - 6, y - 6 * slope), (x + 6, y + 6 * slope), 2)


def name_plates(
    lettering: Lettering, view: View, outlines: Sequence[StructureOutline]
) -> list[tuple[pygame.Surface, Point]]:
    """Return the names of the structures, each with a place where it covers no other one."""
    site = view.rectangle(view.site)
    named = [outline for outline in outlines if outline.cells is None]
    taken = [view.rectangle(outline.rectangle) for outline in outlines]
    plates: list[tuple[pygame.Surface, Point]] = []
    for outline in sorted(named, key=lambda outline: not outline.protected):
        plate = _plate(lettering, outline)
        own = view.rectangle(outline.rectangle)
        # The outer modules alone bear loads: a name on the inner ones hides nothing.
        ring = 2 * round(MODULE_SIDE_UNITS * view.pixels_per_unit)
        place = _free_place(plate.get_rect(), own, own.inflate(-ring, -ring), taken, site)
        if place is not None:
            taken.append(place)
            plates.append((plate, place.topleft))
    return plates


def _plate(lettering: Lettering, outline: StructureOutline) -> pygame.Surface:
    colour = PROTECTED if outline.protected else INK
    text = lettering.write(outline.name, colour, bold=outline.protected)
    plate = empty_surface(text.get_width() + 8, text.get_height() + 2)
    plate.fill((*SITE, 225))
    plate.blit(text, (4, 1))
    return plate


def _free_place(
    plate: pygame.Rect,
    own: pygame.Rect,
    inner: pygame.Rect,
    taken: list[pygame.Rect],
    site: pygame.Rect,
) -> pygame.Rect | None:
    """Return a place inside the structure or beside it that nothing else takes, if any."""
    inside = plate.copy()
    inside.center = own.center
    if inner.contains(inside):
        return inside
    gap = 6
    for corner, place in (
        ("midbottom", (own.centerx, own.top - gap)),
        ("midtop", (own.centerx, own.bottom + gap)),
        ("midleft", (own.right + gap, own.centery)),
        ("midright", (own.left - gap, own.centery)),
    ):
        beside = plate.copy()
        setattr(beside, corner, place)
        beside.clamp_ip(site.inflate(-2 * gap, -2 * gap))
        if beside.collidelist(taken) == -1:
            return beside
    return None
