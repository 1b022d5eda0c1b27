"""Frames of blasts and of a site on which modules are placed, and the window that shows them."""

import os
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pygame
import pytest

from blast_env.calibration import LoadUnit
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Blast
from blast_env.geometry import Rectangle
from blast_env.layout import LayoutState
from blast_env.particles import CollisionType, load_colour
from blast_env.plots import (
    AIR,
    BARRIER,
    EXPLOSIVE,
    FREE_CELL,
    PROTECTED,
    Frame,
    FramePainter,
    LoadScale,
    PlacingPainter,
    Window,
    sources_text,
)
from blast_env.site import RectangleSource, SegmentSource
from blast_env.units import UNITS_PER_M
from tests.plots.scenes import LAYOUT, balls_at_start, small_scenario


def pixel_at(painter: FramePainter, frame: Frame, x: float, y: float) -> tuple[int, ...]:
    across, down = painter.sheet.pixel(x / UNITS_PER_M, y / UNITS_PER_M)
    return tuple(int(channel) for channel in frame[down, across])


def start_frame(painter: FramePainter, blast: Blast) -> Frame:
    return painter.paint(balls_at_start(blast.scene), blast.scene.obstacles(), 0.0)


@pytest.mark.parametrize("width_px", [320, 1921])
def test_frames_have_the_width_asked_for_and_an_even_height(blast: Blast, width_px: int) -> None:
    painter = FramePainter(blast, width_px=width_px)
    frame = start_frame(painter, blast)
    assert frame.shape == (painter.size_px[1], width_px, 3)
    assert frame.dtype == np.uint8
    assert frame.shape[0] % 2 == 0
    assert frame.flags.writeable


@pytest.mark.parametrize("width_px", [319, 4097])
def test_width_out_of_bounds_is_refused(blast: Blast, width_px: int) -> None:
    with pytest.raises(BlastEnvError, match=f"width_px is {width_px}, must be 320 to 4096"):
        FramePainter(blast, width_px=width_px)


def test_balls_are_where_they_should_be_in_the_papers_colours(blast: Blast) -> None:
    run = blast.start()
    run.advance(0.004)
    balls = run.balls()
    painter = FramePainter(blast)
    frame = painter.paint(balls, run.obstacles, run.time_s)
    # In a corner where nothing but balls is drawn.
    in_corner = (balls.position < 32.0).all(axis=1)
    for kind, colour in ((CollisionType.ExplosionBall, EXPLOSIVE), (CollisionType.AirBall, AIR)):
        positions = balls.position[in_corner & (balls.kind == kind)]
        assert len(positions) >= 5
        for x, y in positions.tolist():
            # The dark rim of a neighbour may cover a centre.
            seen = np.array(pixel_at(painter, frame, x, y))
            assert np.abs(seen / seen.max() - np.array(colour) / max(colour)).max() < 0.1


def test_the_size_of_frames_does_not_depend_on_the_loads(blast: Blast) -> None:
    loads = (1e-3, 0.0888, 7.0, 888.0, 8.88e4, 3e9)
    painters = [FramePainter(blast, scale=LoadScale(load, LoadUnit())) for load in loads]
    assert len({painter.size_px for painter in painters}) == 1


def test_y_points_up_and_scales_are_equal(blast: Blast) -> None:
    sheet = FramePainter(blast).sheet
    left, low = sheet.pixel(0.0, 0.0)
    right, high = sheet.pixel(20.0, 20.0)
    assert high < low
    assert right - left == pytest.approx(low - high, abs=1)
    assert right - left == pytest.approx(20.0 * sheet.pixels_per_m, abs=1)


def nearest(frame: Frame, colour: tuple[int, int, int], across: int, down: int) -> float:
    """Return how far the colour is from that of the pixel around here that has it most."""
    around = frame[down - 2 : down + 3, across - 2 : across + 3].astype(float)
    return float(np.abs(around - colour).max(axis=2).min())


def edge_of(painter: FramePainter, rectangle_m: Rectangle) -> list[tuple[int, int]]:
    """Return pixels on the four sides of a rectangle."""
    left, bottom, right, top = rectangle_m
    x_m, y_m = rectangle_m.centre
    sides = ((left, y_m), (right, y_m), (x_m, bottom), (x_m, top))
    return [painter.sheet.pixel(*place) for place in sides]


def test_a_modules_colour_follows_its_load(blast: Blast) -> None:
    painter = FramePainter(blast, scale=LoadScale(100.0, LoadUnit()))
    obstacles = blast.scene.obstacles()
    part = obstacles[0].parts[0]
    seen = []
    for load in (0.0, 0.1, 50.0, 100.0, 1000.0):
        part.impulse, part.hits = load, int(load > 0.0)
        frame = painter.paint(balls_at_start(blast.scene), obstacles, 0.0)
        seen.append(pixel_at(painter, frame, part.x, part.y))
    shares = (0.0, 0.5, 1.0, 1.0)
    for colour, share in zip(seen[1:], shares, strict=True):
        assert colour == pytest.approx(load_colour(share), abs=2)
    assert seen[0] == (255, 255, 255)  # not hit
    assert len(set(seen)) == 4


def test_protected_structures_and_barrier_modules_have_their_outlines(barrier_blast: Blast) -> None:
    painter = FramePainter(barrier_blast)
    frame = start_frame(painter, barrier_blast)
    shelter, _, barrier = barrier_blast.scene.obstacles()
    for place in edge_of(painter, shelter.rectangle_m):
        assert nearest(frame, PROTECTED, *place) < 60.0
    for part in barrier.parts:
        for place in edge_of(painter, part.rectangle_m):
            assert nearest(frame, BARRIER, *place) < 60.0


def test_a_destroyed_module_looks_different(blast: Blast) -> None:
    painter = FramePainter(blast)
    obstacles = blast.scene.obstacles()
    part = obstacles[0].parts[0]
    part.impulse, part.hits = 1.0, 1
    whole = painter.paint(balls_at_start(blast.scene), obstacles, 0.0)
    part.capacity = 0.5
    broken = painter.paint(balls_at_start(blast.scene), obstacles, 0.0)
    changed = np.argwhere((whole != broken).any(axis=2))
    left, bottom, right, top = part.rectangle_m
    low, high = painter.sheet.pixel(left, top), painter.sheet.pixel(right, bottom)
    assert len(changed) > 0.05 * (high[0] - low[0]) * (high[1] - low[1])
    assert (changed.min(axis=0)[::-1] >= np.subtract(low, 2)).all()
    assert (changed.max(axis=0)[::-1] <= np.add(high, 2)).all()


def test_the_scale_of_all_layouts_of_a_scenario_is_the_same(
    blast: Blast, barrier_blast: Blast
) -> None:
    one, other = (FramePainter(case).scale.full for case in (blast, barrier_blast))
    assert one == other > 0.0


def test_frames_need_no_display() -> None:
    code = (
        "import sys\n"
        "from blast_env.plots.frames import FramePainter\n"
        "from tests.plots.scenes import balls_at_start, small_blast\n"
        "blast = small_blast()\n"
        "painter = FramePainter(blast)\n"
        "frame = painter.paint(balls_at_start(blast.scene), blast.scene.obstacles(), 0.0)\n"
        "assert 'pygame' not in sys.modules\n"
        "print(frame.shape)\n"
    )
    hidden = ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY")
    environment = {key: value for key, value in os.environ.items() if key not in hidden}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("(")
    assert done.stderr == ""


# --- Frames of a site on which modules are being placed.


SCENARIO = small_scenario()
ROAD = SegmentSource(kind="segment", start_m=(2.0, 5.0), end_m=(2.0, 15.0), tnt_kg=50.0)
FREE = FREE_CELL.look.fill or EXPLOSIVE
PARK = RectangleSource(kind="rectangle", corner_m=(2.0, 2.0), size_m=(4.0, 3.0), tnt_kg=5.0)


def pixels_of(frame: np.ndarray, colour: tuple[int, int, int]) -> int:
    return int((frame == colour).all(axis=2).sum())


def test_free_cells_are_told_from_cells_that_are_not() -> None:
    painter = PlacingPainter(SCENARIO, SCENARIO.charge)
    empty = pixels_of(painter.paint(LayoutState.empty(SCENARIO)), FREE)
    one = pixels_of(painter.paint(LayoutState.of(SCENARIO, LAYOUT[:1])), FREE)
    full = pixels_of(
        painter.paint(LayoutState.of(SCENARIO, [(r, 0) for r in range(10)][:10])), FREE
    )
    assert empty > one > full > 0


@pytest.mark.parametrize("width_px", [400, 640, 961])
def test_frames_of_the_blast_have_the_same_size(width_px: int) -> None:
    painter = PlacingPainter(SCENARIO, SCENARIO.charge, width_px=width_px)
    width, height = painter.size_px
    assert painter.paint(LayoutState.empty(SCENARIO)).shape == (height, width, 3)
    for layout in ((), LAYOUT):
        blast = Blast(SCENARIO, layout)
        frames = FramePainter(blast, width_px=width_px, height_px=height)
        assert frames.size_px == (width, height)


def test_a_known_charge_is_a_star_and_a_hidden_one_a_line_or_a_veil() -> None:
    placement = LayoutState.empty(SCENARIO)
    known = PlacingPainter(SCENARIO, SCENARIO.charge).paint(placement)
    road = PlacingPainter(SCENARIO, (ROAD,)).paint(placement)
    park = PlacingPainter(SCENARIO, (PARK,)).paint(placement)
    assert 50 < pixels_of(known, EXPLOSIVE) < 400
    assert pixels_of(road, EXPLOSIVE) > 2 * pixels_of(known, EXPLOSIVE)
    red, green, blue = (park[..., channel].astype(int) for channel in range(3))
    reddish = (red - green > 60) & (red - blue > 60)
    assert reddish.sum() > 10_000


@pytest.mark.parametrize(
    ("sources", "words"),
    [
        (SCENARIO.charge, "charge 100 kg TNT at (6.0 m, 10.0 m)"),
        ((ROAD,), "hidden charge of 50 kg TNT"),
        ((ROAD, PARK), "hidden charge of 5 to 50 kg TNT"),
    ],
)
def test_what_is_known_of_the_charge_in_words(sources: tuple, words: str) -> None:
    assert sources_text(sources) == words


# ---


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
