from collections.abc import Iterator

import numpy as np
import pygame
import pytest

from blast_env.errors import BlastEnvError
from blast_env.plots.window import Window

FRAME = np.full((120, 200, 3), 77, dtype=np.uint8)


@pytest.fixture
def window() -> Iterator[Window]:
    window = Window(frames_per_s=1000.0)
    yield window
    window.close()


def test_a_frame_is_shown(window: Window) -> None:
    assert window.show(FRAME)
    screen = pygame.display.get_surface()
    assert screen is not None
    assert screen.get_size() == (200, 120)
    assert tuple(screen.get_at((5, 5)))[:3] == (77, 77, 77)


def test_closing_by_the_user_is_no_error(window: Window) -> None:
    window.show(FRAME)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    assert not window.show(FRAME)
    assert window.closed
    assert not window.show(FRAME)
    assert not pygame.display.get_init()


def test_close_may_be_called_again_and_before_any_frame(window: Window) -> None:
    window.close()
    window.close()
    assert not window.show(FRAME)


def test_without_a_screen_the_error_names_another_way(
    window: Window, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "no-such-driver")
    pygame.display.quit()
    with pytest.raises(BlastEnvError, match='render_mode="rgb_array"'):
        window.show(FRAME)
