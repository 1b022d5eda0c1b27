"""From places on the site to pixels of a frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blast_env.geometry import Rectangle
from blast_env.rendering.extra import render_extra
from blast_env.units import UNITS_PER_M

with render_extra():
    import pygame


@dataclass(frozen=True)
class View:
    """The site to scale, y upwards, in a frame whose y points down.

    Attributes:
        site: The simulated area, units.
        left_px: Left border of the site in the frame.
        top_px: Upper border of the site in the frame.
        pixels_per_unit: Scale.
    """

    site: Rectangle
    left_px: int
    top_px: int
    pixels_per_unit: float

    @property
    def pixels_per_m(self) -> float:
        """The scale in pixels per metre."""
        return self.pixels_per_unit * UNITS_PER_M

    def pixels(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pixel coordinates (n, 2), x and y, of places in units (n, 2)."""
        origin = np.array([self.site.left, self.site.top])
        scale = np.array([self.pixels_per_unit, -self.pixels_per_unit])
        pixels: NDArray[np.float64] = (position - origin) * scale + (self.left_px, self.top_px)
        return pixels

    def pixel(self, x: float, y: float) -> tuple[int, int]:
        """Return the pixel, x and y, that shows a place in units."""
        across, down = np.floor(self.pixels(np.array([[x, y]])))[0].tolist()
        return int(across), int(down)

    def rectangle(self, rectangle: Rectangle) -> pygame.Rect:
        """Return the pixels that show a rectangle in units; neighbours share no pixel."""
        corners = np.array([[rectangle.left, rectangle.top], [rectangle.right, rectangle.bottom]])
        (left, top), (right, bottom) = np.rint(self.pixels(corners)).astype(int).tolist()
        return pygame.Rect(left, top, max(right - left, 1), max(bottom - top, 1))
