"""A window that shows frames, for `render_mode="human"`."""

import os

from blast_env.errors import BlastEnvError
from blast_env.plots.canvas import Frame
from blast_env.plots.style import render_extra

with render_extra():
    import pygame

_SHARE_OF_SCREEN = 0.9


class Window:
    """Shows frames on the screen, at a limited rate.

    The window opens with the first frame. When the user closes it, it stays closed, and the
    program continues without it.

    Args:
        title: Title of the window.
        frames_per_s: Most frames per second of `show`.
    """

    def __init__(self, title: str = "blast_env", frames_per_s: float = 25.0) -> None:
        self._title = title
        self._frames_per_s = frames_per_s
        self._screen: pygame.Surface | None = None
        self._clock = pygame.time.Clock()
        self._closed = False

    @property
    def closed(self) -> bool:
        """Whether the user or `close` has closed the window."""
        return self._closed

    def show(self, frame: Frame) -> bool:
        """Show a frame, and wait to keep the frame rate; return whether the window is still open.

        Args:
            frame: uint8 (height, width, 3).

        Raises:
            BlastEnvError: If there is no screen to open a window on.
        """
        if self._closed:
            return False
        height, width, _ = frame.shape
        image = pygame.image.frombuffer(frame.tobytes(), (width, height), "RGB")
        screen = self._open((width, height))
        if screen.get_size() != (width, height):
            image = pygame.transform.smoothscale(image.convert(24), screen.get_size())
        screen.blit(image, (0, 0))
        pygame.display.flip()
        self._clock.tick(self._frames_per_s)
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
        return not self._closed

    def close(self) -> None:
        """Close the window, if it is open."""
        self._closed = True
        if self._screen is not None:
            self._screen = None
            pygame.display.quit()

    def _open(self, size_px: tuple[int, int]) -> pygame.Surface:
        """Return the screen, opened or resized for frames of this size."""
        try:
            pygame.display.init()
            # Without a screen SDL silently falls back to a driver without output.
            if pygame.display.get_driver() == "offscreen" and "SDL_VIDEODRIVER" not in os.environ:
                raise pygame.error("there is no screen")
            fitting = fit(size_px, pygame.display.get_desktop_sizes()[0])
            if self._screen is None or self._screen.get_size() != fitting:
                pygame.display.set_caption(self._title)
                self._screen = pygame.display.set_mode(fitting)
        except pygame.error as error:
            raise BlastEnvError(
                f'no window can be opened ({error}): use render_mode="rgb_array" or write a film'
            ) from error
        return self._screen


def fit(size_px: tuple[int, int], screen_px: tuple[int, int]) -> tuple[int, int]:
    """Return the size of the window: that of the frame, or smaller to fit the screen."""
    factors = (_SHARE_OF_SCREEN * on / of for on, of in zip(screen_px, size_px, strict=True))
    factor = min(1.0, *factors)
    return round(factor * size_px[0]), round(factor * size_px[1])
