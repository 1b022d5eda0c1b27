"""The site in pixels: view, lettering, strips and the layer that does not move."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from blast_env.calibration import LoadUnit
from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.labels import Label, labels_of, settled_labels
from blast_env.physics.structure import Colour, ModularObstacle, ModularPart, load_colour
from blast_env.plan import (
    BARRIER,
    EXPLOSIVE,
    FAINT,
    INK,
    PAGE,
    PROTECTED,
    QUIET_INK,
    SITE,
    STRUCTURE,
    Feature,
    Kinds,
    Look,
)
from blast_env.rendering.style import nice_floor, render_extra, short_number
from blast_env.units import MODULE_SIDE_M

with render_extra():
    import matplotlib
    import pygame


@dataclass(frozen=True)
class FrameView:
    """The site to scale, y upwards, in a frame whose y points down.

    Attributes:
        site_m: The simulated area.
        left_px: Left border of the site in the frame.
        top_px: Upper border of the site in the frame.
        pixels_per_m: Scale.
    """

    site_m: Rectangle
    left_px: int
    top_px: int
    pixels_per_m: float

    def pixels(self, places_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pixel coordinates (n, 2), x and y, of places (n, 2)."""
        origin_m = np.array([self.site_m.left, self.site_m.top])
        scale = np.array([self.pixels_per_m, -self.pixels_per_m])
        pixels: NDArray[np.float64] = (places_m - origin_m) * scale + (self.left_px, self.top_px)
        return pixels

    def pixel(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Return the pixel, x and y, that shows a place."""
        across, down = np.floor(self.pixels(np.array([[x_m, y_m]])))[0].tolist()
        return int(across), int(down)

    def rectangle(self, rectangle_m: Rectangle) -> pygame.Rect:
        """Return the pixels that show a rectangle; neighbours share no pixel."""
        left_m, bottom_m, right_m, top_m = rectangle_m
        corners_m = np.array([[left_m, top_m], [right_m, bottom_m]])
        (left, top), (right, bottom) = np.rint(self.pixels(corners_m)).astype(int).tolist()
        return pygame.Rect(left, top, max(right - left, 1), max(bottom - top, 1))


@dataclass(frozen=True)
class Lettering:
    """Writes text of one size.

    Attributes:
        size_px: Height of a line, about.
    """

    size_px: int

    def write(self, text: str, colour: Colour = INK, bold: bool = False) -> pygame.Surface:
        """Return a line of text on a transparent ground."""
        # Loaded anew for every text: pygame's fonts die with any `pygame.quit()`, and another
        # environment in this process may call it.
        pygame.font.init()
        name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
        folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        return pygame.font.Font(folder / name, self.size_px).render(text, True, colour)

    def write_within(
        self, text: str, width_px: int, colour: Colour = INK, bold: bool = False
    ) -> pygame.Surface:
        """Return a line of text, cut short with an ellipsis if it is wider than `width_px`."""
        line = self.write(text, colour, bold)
        while line.get_width() > width_px and text:
            text = text[:-1]
            line = self.write(text.rstrip(" ,") + "…", colour, bold)
        return line


Point = tuple[int, int]
Frame = NDArray[np.uint8]
"""A picture: rows from above, pixels, red, green and blue."""

_NARROWEST_PX, _WIDEST_PX = 320, 4096
_MOST_HIGH = 0.8  # of the width: what a site takes at most
_HEADING_SHARE = 0.55  # of the width: what lines at the left may take

_SMOOTHING = 4


_SMALLEST_RIMMED_PX = 3.5


def empty_surface(width: int, height: int) -> pygame.Surface:
    """Return a transparent surface."""
    return pygame.Surface((max(width, 1), max(height, 1)), pygame.SRCALPHA, 32)


def disc(radius_px: float, colour: Colour) -> pygame.Surface:
    """Return a ball: a filled circle with a smooth edge and, if it is not tiny, a darker rim."""
    side = 2 * int(radius_px + 1.5)
    large = pygame.Surface((side * _SMOOTHING, side * _SMOOTHING), pygame.SRCALPHA, 32)
    # The clear ground has the colour too, or the edge would turn dark when it is scaled down.
    large.fill((*colour, 0))
    centre = side * _SMOOTHING / 2
    pygame.draw.circle(large, colour, (centre, centre), radius_px * _SMOOTHING)
    if radius_px >= _SMALLEST_RIMMED_PX:
        rim = tuple(round(0.72 * channel) for channel in colour)
        pygame.draw.circle(large, rim, (centre, centre), radius_px * _SMOOTHING, _SMOOTHING)
    return pygame.transform.smoothscale(large, (side, side))


def dashed_rectangle(
    surface: pygame.Surface, rectangle: pygame.Rect, colour: Colour, dash_px: int = 6
) -> None:
    """Draw the outline of a rectangle as a dashed line of one pixel."""
    right, bottom = rectangle.right - 1, rectangle.bottom - 1
    for x in range(rectangle.left, right, 2 * dash_px):
        for y in (rectangle.top, bottom):
            pygame.draw.line(surface, colour, (x, y), (min(x + dash_px - 1, right), y))
    for y in range(rectangle.top, bottom, 2 * dash_px):
        for x in (rectangle.left, right):
            pygame.draw.line(surface, colour, (x, y), (x, min(y + dash_px - 1, bottom)))


def hatch(surface: pygame.Surface, rectangle: pygame.Rect, colour: Colour) -> None:
    """Fill a rectangle with slanted lines."""
    clip = surface.get_clip()
    surface.set_clip(rectangle.clip(clip))
    for shift in range(0, rectangle.width + rectangle.height, 6):
        start = (rectangle.left + shift, rectangle.top)
        end = (rectangle.left + shift - rectangle.height, rectangle.bottom)
        pygame.draw.line(surface, colour, start, end)
    surface.set_clip(clip)
    pygame.draw.rect(surface, colour, rectangle, 1)


def scale_bar(lettering: Lettering, pixels_per_m: float, longest_px: int) -> pygame.Surface:
    """Return a bar of a round number of metres, with the number."""
    length_m = nice_floor(longest_px / pixels_per_m)
    length = round(length_m * pixels_per_m)
    text = lettering.write(f"{length_m:g} m")
    gap, tick = lettering.size_px // 3, lettering.size_px // 2
    surface = empty_surface(max(length + 2, text.get_width()), text.get_height() + gap + tick)
    surface.blit(text, ((surface.get_width() - text.get_width()) // 2, 0))
    left = (surface.get_width() - length) // 2
    y = text.get_height() + gap + tick // 2
    pygame.draw.line(surface, INK, (left, y), (left + length, y), 2)
    for x in (left, left + length - 1):
        pygame.draw.line(surface, INK, (x, y - tick // 2), (x, y + tick // 2), 2)
    return surface


_WIDEST_LOAD = "≥ 0.0888"


def colour_bar(
    lettering: Lettering, full_impulse: float, length: int, unit: LoadUnit
) -> pygame.Surface:
    """Return the colours from no load to the full load, with three numbers and the unit."""
    line, thickness = lettering.write(unit.label), lettering.size_px
    full = unit.factor * full_impulse
    texts = ("0", short_number(full / 2.0, 3), f"≥ {short_number(full, 3)}")
    numbers = [lettering.write(text) for text in texts]
    # Room for any number: frames of an episode have one size whatever their loads are.
    margin = lettering.write(_WIDEST_LOAD).get_width() // 2 + 1
    width = max(line.get_width(), length + 2 * margin)
    height = 2 * line.get_height() + thickness + lettering.size_px // 2
    surface = empty_surface(width, height)
    surface.blit(line, ((width - line.get_width()) // 2, 0))
    left, top = (width - length) // 2, line.get_height() + lettering.size_px // 5
    for x in range(length):
        colour = load_colour(x / (length - 1))
        pygame.draw.line(surface, colour, (left + x, top), (left + x, top + thickness))
    pygame.draw.rect(surface, QUIET_INK, (left - 1, top - 1, length + 2, thickness + 3), 1)
    for share, number in zip((0.0, 0.5, 1.0), numbers, strict=True):
        x = left + round(share * (length - 1))
        pygame.draw.line(surface, QUIET_INK, (x, top + thickness), (x, top + thickness + 4))
        surface.blit(number, (x - number.get_width() // 2, top + thickness + 4))
    return surface


Draw = Callable[[pygame.Surface, pygame.Rect], object]
"""Draws a sign into a place."""

Sign = tuple[str, Draw]
"""A sign with what it means."""

_LEGEND_ROWS = 5


def legend(lettering: Lettering, signs: Sequence[Sign], widest_px: int) -> pygame.Surface:
    """Return what signs mean, in as many columns as `widest_px` allows."""
    texts = [lettering.write(text) for text, _ in signs]
    side, gap = lettering.size_px, lettering.size_px // 2
    cell_width = side + gap + max(text.get_width() for text in texts) + 2 * gap
    columns = max(1, min((widest_px + 2 * gap) // cell_width, -(-len(signs) // _LEGEND_ROWS)))
    rows, pitch = -(-len(signs) // columns), round(1.45 * lettering.size_px)
    surface = empty_surface(columns * cell_width - 2 * gap, rows * pitch)
    for index, (text, (_, draw)) in enumerate(zip(texts, signs, strict=True)):
        left, top = (index // rows) * cell_width, (index % rows) * pitch
        draw(surface, pygame.Rect(left, top + (pitch - side) // 2, side, side))
        surface.blit(text, (left + side + gap, top + (pitch - text.get_height()) // 2))
    return surface


def signs_of(features: Iterable[Feature]) -> list[Sign]:
    """Return a sign for everything that differs among features, what is on top first."""
    shown = {(each.title, min(len(each.places_m), 3)): each for each in features}
    ordered = sorted(shown.values(), key=lambda each: -each.kind.level)
    return [(each.title, partial(_draw_sign, each)) for each in ordered]


def _draw_sign(feature: Feature, surface: pygame.Surface, place: pygame.Rect) -> None:
    if len(feature.places_m) > 2:
        _draw_area(surface, place, feature)
    elif len(feature.places_m) == 2:
        _draw_line(surface, place.midleft, place.midright, feature.look)
    else:
        _draw_place(surface, place.center, feature.look, 0.5 * place.width)


def draw_features(surface: pygame.Surface, view: FrameView, features: Iterable[Feature]) -> None:
    """Draw features by their geometry and their look, in their order."""
    for feature in features:
        if len(feature.places_m) > 2:
            _draw_area(surface, view.rectangle(feature.bounds_m), feature)
            continue
        places = [view.pixel(*place) for place in feature.places_m]
        if len(places) == 2:
            _draw_line(surface, places[0], places[1], feature.look)
        else:
            _draw_place(surface, places[0], feature.look, _SIGN_PX)


def _draw_area(surface: pygame.Surface, place: pygame.Rect, feature: Feature) -> None:
    look = feature.look
    if feature.colour is not None:
        veil = empty_surface(*place.size)
        veil.fill((*feature.colour, round(255 * look.opacity)))
        surface.blit(veil, place)
    if look.hatched:
        hatch(surface, place, look.line or _HATCH)
    elif look.dashed:
        dashed_rectangle(surface, place, look.line or INK, min(6, place.width // 5))
    elif look.line is not None:
        pygame.draw.rect(surface, look.line, place, max(round(look.width), 1))


def _draw_line(surface: pygame.Surface, start: Point, end: Point, look: Look) -> None:
    colour, width = look.line or INK, max(round(look.width), 1)
    along = np.subtract(end, start)
    length = float(np.hypot(*along))
    if not look.dashed or length == 0.0:
        pygame.draw.line(surface, colour, start, end, width)
    else:
        for begin in np.arange(0.0, length, 2 * _DASH_PX):
            shares = (begin / length, min((begin + _DASH_PX) / length, 1.0))
            first, last = ((np.array(start) + share * along).tolist() for share in shares)
            pygame.draw.line(surface, colour, first, last, width)
    if look.arrows and length > 0.0:
        for tip, way in ((start, along / length), (end, -along / length)):
            across = np.array([-way[1], way[0]])
            wings = [np.array(tip) + 0.5 * _DASH_PX * (2.0 * way + k * across) for k in (-1, 1)]
            pygame.draw.polygon(surface, colour, [tip, *(wing.tolist() for wing in wings)])


def _draw_place(surface: pygame.Surface, centre: Point, look: Look, radius_px: float) -> None:
    if look.sign == "star":
        draw_star(surface, centre, radius_px)
        return
    pygame.draw.circle(surface, PAGE, centre, 0.6 * radius_px)
    pygame.draw.circle(surface, look.line or INK, centre, 0.6 * radius_px, 2)


def draw_destroyed(surface: pygame.Surface, place: pygame.Rect) -> None:
    """Draw a crossed square: a module that the blast has removed."""
    right, bottom = place.right - 1, place.bottom - 1
    pygame.draw.rect(surface, SITE, place)
    pygame.draw.line(surface, INK, place.topleft, (right, bottom))
    pygame.draw.line(surface, INK, (right, place.top), (place.left, bottom))


def ball_sign(colour: Colour) -> Draw:
    """Return the sign of balls of a colour."""

    def draw(surface: pygame.Surface, place: pygame.Rect) -> None:
        ball = disc(place.width * 0.36, colour)
        surface.blit(ball, ball.get_rect(center=place.center))

    return draw


def module_sign(outline: Colour, width: int) -> Draw:
    """Return the sign of modules that no load is on, with an outline."""

    def draw(surface: pygame.Surface, place: pygame.Rect) -> None:
        pygame.draw.rect(surface, load_colour(0.0), place)
        pygame.draw.rect(surface, outline, place, width)

    return draw


def flow(
    blocks: Sequence[pygame.Surface], width: int, gap: int
) -> tuple[list[tuple[pygame.Surface, Point]], int]:
    """Put blocks side by side, in as many rows as the width needs.

    Returns:
        The blocks with the places of their upper left corners, and the height of all rows.
    """
    rows: list[list[pygame.Surface]] = [[]]
    for block in blocks:
        used = sum(other.get_width() + gap for other in rows[-1])
        if rows[-1] and used + block.get_width() > width:
            rows.append([])
        rows[-1].append(block)
    placed: list[tuple[pygame.Surface, Point]] = []
    top = 0
    for row in rows:
        height = max(block.get_height() for block in row)
        free = width - sum(block.get_width() for block in row)
        between = free // (len(row) - 1) if len(row) > 1 else 0
        left = 0 if len(row) > 1 else free // 2
        for block in row:
            placed.append((block, (left, top + (height - block.get_height()) // 2)))
            left += block.get_width() + between
        top += height + gap
    return placed, top - gap


_FOOTER_LINES = 8.7
"""Lines of small letters that the signs below a site have room for, whatever the site has."""


class Sheet:
    """The page of a frame: lines of text, below them a site to scale, below that its signs.

    Args:
        site: The simulated area, units.
        width_px: Width of the frame, 320 to 4096.

    Attributes:
        view: The site on the page.
        width_px: Width of the page.
        small: Lettering of everything but the heading.
        large: Lettering of the heading.
        margin_px: What stays free around.
        line_tops_px: Where the three lines over the site begin.
        border: The border lines, just outside of the site.

    Raises:
        BlastEnvError: If the width is out of bounds.
    """

    def __init__(self, site_m: Rectangle, width_px: int) -> None:
        if not _NARROWEST_PX <= width_px <= _WIDEST_PX:
            raise BlastEnvError(f"width_px is {width_px}, must be {_NARROWEST_PX} to {_WIDEST_PX}")
        self.width_px = width_px
        self.small = Lettering(max(round(width_px / 68), 10))
        self.large = Lettering(max(round(width_px / 52), 13))
        self.margin_px = max(round(width_px / 48), 8)
        first = self.margin_px // 2
        second = first + round(1.3 * self.large.size_px)
        third = second + round(1.4 * self.small.size_px)
        self.line_tops_px = (first, second, third)
        header_px = third + round(1.6 * self.small.size_px) + self.margin_px // 3
        width, height = site_m.right - site_m.left, site_m.top - site_m.bottom
        # Neither width nor height gets out of hand.
        scale = min(self.room_px / width, _MOST_HIGH * width_px / height)
        self.view = FrameView(site_m, (width_px - round(scale * width)) // 2, header_px, scale)
        self._footer_top_px = header_px + round(scale * height) + round(0.8 * self.margin_px)
        self.border = self.view.rectangle(site_m).inflate(6, 6)

    @property
    def room_px(self) -> int:
        """Width between the margins."""
        return self.width_px - 2 * self.margin_px

    def height_px(self, signs: Sequence[pygame.Surface]) -> int:
        """Return the height of a page with some signs below the site; it is even."""
        least_px = round(_FOOTER_LINES * self.small.size_px)
        footer_px = max(flow(signs, self.room_px, self.margin_px)[1], least_px)
        height_px = self._footer_top_px + footer_px + self.margin_px // 2
        return height_px + height_px % 2

    def ground(
        self, lines: Sequence[str], signs: Sequence[pygame.Surface], height_px: int
    ) -> pygame.Surface:
        """Return the page with the empty site.

        Args:
            lines: At most three lines of text, the first one as a heading.
            signs: What stands below the site.
            height_px: Height of the page, at least that of `height_px(signs)`.
        """
        ground = pygame.Surface((self.width_px, height_px), 0, 32)
        ground.fill(PAGE)
        for block, (left, top) in flow(signs, self.room_px, self.margin_px)[0]:
            ground.blit(block, (self.margin_px + left, self._footer_top_px + top))
        self.write(ground, lines, _HEADING_SHARE)
        ground.fill(SITE, self.view.rectangle(self.view.site_m))
        return ground

    def write(
        self, surface: pygame.Surface, lines: Sequence[str], share: float, *, right: bool = False
    ) -> None:
        """Write the lines over the site, the first one as a heading.

        Args:
            surface: The page.
            lines: At most three lines of text.
            share: Of the width between the margins, which longer lines are cut to.
            right: Whether they end at the right margin rather than begin at the left one.
        """
        for number, (text, top) in enumerate(zip(lines, self.line_tops_px, strict=False)):
            lettering, colour = (self.small, QUIET_INK) if number else (self.large, INK)
            line = lettering.write_within(text, round(share * self.room_px), colour, not number)
            left = self.width_px - self.margin_px - line.get_width() if right else self.margin_px
            surface.blit(line, (left, top))


def pixels_of(surface: pygame.Surface) -> Frame:
    """Return a picture as an array, uint8 (height, width, 3)."""
    width, height = surface.get_size()
    pixels = np.frombuffer(pygame.image.tobytes(surface, "RGB"), dtype=np.uint8)
    return pixels.reshape(height, width, 3).copy()


_SMALLEST_GRID_PX = 6
_STAR_INNER = 0.38  # of the radius; as matplotlib's star


def draw_obstacle(
    surface: pygame.Surface, view: FrameView, obstacle: ModularObstacle, full_impulse: float
) -> None:
    """Draw the modules in the colours of their loads, and the outline that tells the role."""
    is_barrier = obstacle.cells is not None
    grid = not is_barrier and view.pixels_per_m * MODULE_SIDE_M >= _SMALLEST_GRID_PX
    for part in obstacle.parts:
        _draw_module(surface, view, part, full_impulse, grid)
    if is_barrier:
        for rectangle in _wholes(obstacle):
            place = view.rectangle(rectangle)
            pygame.draw.rect(surface, BARRIER, place, 2 if min(place.size) >= 7 else 1)
        return
    width = 3 if obstacle.protected else 2
    around = view.rectangle(obstacle.rectangle_m).inflate(2 * width - 2, 2 * width - 2)
    pygame.draw.rect(surface, PROTECTED if obstacle.protected else STRUCTURE, around, width)


def _wholes(barrier: ModularObstacle) -> list[Rectangle]:
    """Return the rectangles of the pieces of a barrier, or of its modules if it has none."""
    wholes: dict[str, Rectangle] = {}
    for part in barrier.parts:
        name = part.piece or part.module_id
        left, bottom, right, top = part.rectangle_m
        known = wholes.get(name, part.rectangle_m)
        wholes[name] = Rectangle(
            min(left, known.left),
            min(bottom, known.bottom),
            max(right, known.right),
            max(top, known.top),
        )
    return list(wholes.values())


def _draw_module(
    surface: pygame.Surface, view: FrameView, part: ModularPart, full_impulse: float, grid: bool
) -> None:
    place = view.rectangle(part.rectangle_m)
    if part.destroyed:
        draw_destroyed(surface, place)
        return
    colour = part.colour(full_impulse)
    pygame.draw.rect(surface, colour, place)
    if grid:
        red, green, blue = (round(0.8 * channel) for channel in colour)
        pygame.draw.line(surface, (red, green, blue), place.topleft, (place.right - 1, place.top))
        pygame.draw.line(surface, (red, green, blue), place.topleft, (place.left, place.bottom - 1))


_SIGN_PX = 9.0
_HATCH: Colour = (158, 164, 174)
_DASH_PX = 6.0
_NAME_GAP_PX = 6.0


def draw_grid(surface: pygame.Surface, view: FrameView, zone_m: Rectangle) -> None:
    """Draw the cells of a build zone where they are large enough to be told apart."""
    whole, side_px = view.rectangle(zone_m), view.pixels_per_m * MODULE_SIDE_M
    if side_px < _SMALLEST_GRID_PX:
        return
    for x in np.rint(np.arange(whole.left, whole.right, side_px)).astype(int).tolist():
        pygame.draw.line(surface, FAINT, (x, whole.top), (x, whole.bottom - 1))
    for y in np.rint(np.arange(whole.bottom, whole.top, -side_px)).astype(int).tolist():
        pygame.draw.line(surface, FAINT, (whole.left, y), (whole.right - 1, y))


def draw_star(surface: pygame.Surface, centre: Point, radius_px: float) -> None:
    """Draw the star of a charge."""
    turns = np.pi * np.arange(10) / 5.0
    lengths = radius_px * np.where(np.arange(10) % 2, _STAR_INNER, 1.0)
    points = [
        (centre[0] + length * float(np.sin(turn)), centre[1] - length * float(np.cos(turn)))
        for turn, length in zip(turns, lengths, strict=True)
    ]
    pygame.draw.polygon(surface, EXPLOSIVE, points)
    pygame.draw.aalines(surface, INK, True, points)


def names_layer(
    lettering: Lettering, view: FrameView, features: Sequence[Feature], size_px: tuple[int, int]
) -> pygame.Surface:
    """Return the labels of features on a transparent ground, none of which covers another.

    Args:
        lettering: What writes them.
        view: The site in the frame.
        features: What is on the site, with everything that is not to be covered.
        size_px: Width and height of the frame.
    """

    def box(feature: Feature) -> Rectangle:  # y upwards
        place = view.rectangle(feature.bounds_m)
        grown = _SIGN_PX if len(feature.places_m) == 1 else 0.0
        return Rectangle(place.left, -place.bottom, place.right, -place.top).grown(grown)

    labels = labels_of(features)[::-1]
    plates = [_plate(lettering, label) for label in labels]
    # The outer modules alone bear loads: a name on the inner ones hides nothing.
    ring = MODULE_SIDE_M * view.pixels_per_m
    site = view.rectangle(view.site_m)
    within = Rectangle(site.left, -site.bottom, site.right, -site.top).grown(-_NAME_GAP_PX)
    settled = settled_labels(
        features,
        labels,
        [plate.get_size() for plate in plates],
        box,
        lambda each: box(each).grown(-ring),
        within,
        gap=_NAME_GAP_PX,
        far=2.0 * _NAME_GAP_PX,
    )
    layer = empty_surface(*size_px)
    for each in settled:
        if each.leader is not None:
            (x0, y0), (x1, y1) = each.leader
            colour = each.label.feature.look.line or INK
            pygame.draw.aaline(layer, colour, (x0, -y0), (x1, -y1))
    for plate, each in zip(plates, settled, strict=True):
        layer.blit(plate, (round(each.place.left), round(-each.place.top)))
    return layer


def _plate(lettering: Lettering, label: Label) -> pygame.Surface:
    kind = label.feature.kind
    colour = INK if kind is Kinds.STRUCTURE else kind.look.line or INK
    bold = kind is Kinds.PROTECTED_STRUCTURE
    lines = [lettering.write(line, colour, bold) for line in label.text.split("\n")]
    pitch = lines[0].get_height()
    width = max(line.get_width() for line in lines)
    plate = empty_surface(width + 8, pitch * len(lines) + 2)
    plate.fill((*SITE, 225))
    for number, line in enumerate(lines):
        plate.blit(line, (4 + (width - line.get_width()) // 2, 1 + pitch * number))
    return plate
