"""The signs of a site while modules are being placed, and their legend."""

from collections.abc import Callable, Sequence
from typing import Final

from blast_env.geometry import Rectangle
from blast_env.physics.structure import Colour, load_colour
from blast_env.rendering.extra import render_extra
from blast_env.rendering.lettering import Lettering
from blast_env.rendering.strips import dashed_rectangle, empty_surface
from blast_env.rendering.style import (
    BARRIER,
    EXPLOSIVE,
    FAINT,
    PROTECTED,
    QUIET_INK,
    STRUCTURE,
)
from blast_env.rendering.view import View
from blast_env.scenario import AnySource, PointSource, RectangleSource
from blast_env.units import UNITS_PER_M

with render_extra():
    import pygame

Draw = Callable[[pygame.Surface, pygame.Rect], None]
Sign = tuple[str, Draw]

FREE: Final[Colour] = (214, 238, 219)
UNAVAILABLE: Final[Colour] = (226, 228, 232)
_HATCH: Final[Colour] = (158, 164, 174)
_HATCH_STEP_PX: Final = 6
_MAYBE_ALPHA: Final = 110
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
    start, end = (view.pixel(x_m * UNITS_PER_M, y_m * UNITS_PER_M) for x_m, y_m in source.segment_m)
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
