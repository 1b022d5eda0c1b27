"""Text for frames, in the same typeface on every machine."""

from dataclasses import dataclass
from pathlib import Path

from blast_env.physics.structure import Colour
from blast_env.rendering.extra import render_extra
from blast_env.rendering.style import INK

with render_extra():
    import matplotlib
    import pygame


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
