import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from blast_env.engines import Blast
from blast_env.errors import BlastEnvError
from blast_env.physics.particles import CollisionType
from blast_env.physics.structure import load_colour
from blast_env.plan import BARRIER, BORDER, EXPLOSIVE, PROTECTED
from blast_env.rendering.canvas import Frame
from blast_env.rendering.frames import FramePainter, balls_at_start
from blast_env.rendering.style import AIR
from blast_env.units import MODULE_SIDE_UNITS, UNITS_PER_M


def pixel_at(painter: FramePainter, frame: Frame, x: float, y: float) -> tuple[int, ...]:
    across, down = painter.view.pixel(x / UNITS_PER_M, y / UNITS_PER_M)
    return tuple(int(channel) for channel in frame[down, across])


def start_frame(painter: FramePainter, blast: Blast) -> Frame:
    return painter.paint(balls_at_start(blast.scene), blast.scene.obstacles(), 0.0)


@pytest.mark.parametrize("width_px", [320, 480, 960, 1921])
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
    painters = [FramePainter(blast, full_impulse=load) for load in loads]
    assert len({painter.size_px for painter in painters}) == 1


def test_small_balls_stay_visible(blast: Blast) -> None:
    balls = balls_at_start(blast.scene)
    balls = replace(balls, radius=np.full(len(balls), 0.01))
    painter = FramePainter(blast, width_px=320)
    frame = painter.paint(balls, blast.scene.obstacles(), 0.0)
    x, y = balls.position[0].tolist()
    assert pixel_at(painter, frame, x, y) == AIR


def test_y_points_up_and_scales_are_equal(blast: Blast) -> None:
    view = FramePainter(blast).view
    left, low = view.pixel(0.0, 0.0)
    right, high = view.pixel(20.0, 20.0)
    assert high < low
    assert right - left == pytest.approx(low - high, abs=1)
    assert right - left == pytest.approx(20.0 * view.pixels_per_m, abs=1)


def test_the_border_is_red_all_around(blast: Blast) -> None:
    painter = FramePainter(blast)
    frame = start_frame(painter, blast)
    ring = painter.view.rectangle(blast.scene.site_m).inflate(2, 2)
    for edge in (
        frame[ring.top, ring.left : ring.right],
        frame[ring.bottom - 1, ring.left : ring.right],
        frame[ring.top : ring.bottom, ring.left],
        frame[ring.top : ring.bottom, ring.right - 1],
    ):
        assert (edge == BORDER).all()


def test_a_modules_colour_follows_its_load(blast: Blast) -> None:
    painter = FramePainter(blast, full_impulse=100.0)
    obstacles = blast.scene.obstacles()
    part = obstacles[0].parts[0]
    seen = []
    for load in (0.0, 50.0, 100.0, 1000.0):
        part.impulse = load
        frame = painter.paint(balls_at_start(blast.scene), obstacles, 0.0)
        seen.append(pixel_at(painter, frame, part.x, part.y))
    assert seen == [load_colour(0.0), load_colour(0.5), load_colour(1.0), load_colour(1.0)]
    assert len(set(seen)) == 3


def test_protected_structures_and_barrier_modules_have_their_outlines(barrier_blast: Blast) -> None:
    painter = FramePainter(barrier_blast)
    frame = start_frame(painter, barrier_blast)
    shelter, _, barrier = barrier_blast.scene.obstacles()
    ring = painter.view.rectangle(shelter.rectangle_m).inflate(2, 2)
    assert (frame[ring.top : ring.bottom, ring.left] == PROTECTED).all()
    for part in barrier.parts:
        place = painter.view.rectangle(part.rectangle_m)
        assert (frame[place.top, place.left : place.right] == BARRIER).all()


def test_a_destroyed_module_looks_different(blast: Blast) -> None:
    painter = FramePainter(blast)
    obstacles = blast.scene.obstacles()
    whole = painter.paint(balls_at_start(blast.scene), obstacles, 0.0)
    part = obstacles[0].parts[0]
    part.impulse, part.capacity = 1.0, 0.5
    broken = painter.paint(balls_at_start(blast.scene), obstacles, 0.0)
    changed = np.argwhere((whole != broken).any(axis=2))
    place = painter.view.rectangle(part.rectangle_m)
    assert len(changed) > 0.5 * place.width * place.height
    changed = changed[changed[:, 0] >= painter.view.top_px]  # above, the load so far changes
    assert (changed.min(axis=0) >= (place.top, place.left)).all()
    assert (changed.max(axis=0) < (place.bottom, place.right)).all()


def test_equal_states_give_equal_frames(barrier_blast: Blast) -> None:
    frames = []
    for _ in range(2):
        run = barrier_blast.start()
        run.advance(0.01)
        painter = FramePainter(barrier_blast)
        frames.append(painter.paint(run.balls(), run.obstacles, run.time_s))
    assert np.array_equal(frames[0], frames[1])


def test_the_scale_of_all_layouts_of_a_scenario_is_the_same(
    blast: Blast, barrier_blast: Blast
) -> None:
    one, other = (FramePainter(each).full_impulse for each in (blast, barrier_blast))
    assert one == other > 0.0


def test_frames_survive_that_someone_else_quits_pygame(blast: Blast) -> None:
    import pygame

    painter = FramePainter(blast)
    before = start_frame(painter, blast)
    pygame.quit()
    assert np.array_equal(before, start_frame(painter, blast))


def test_frames_need_no_display() -> None:
    # A module of its own, because pygame's display stays as it is once it has been opened.
    code = (
        "import pygame\n"
        "from blast_env.rendering.frames import FramePainter, balls_at_start\n"
        "from tests.rendering.scenes import small_blast\n"
        "blast = small_blast()\n"
        "painter = FramePainter(blast)\n"
        "frame = painter.paint(balls_at_start(blast.scene), blast.scene.obstacles(), 0.0)\n"
        "assert not pygame.display.get_init()\n"
        "print(frame.shape)\n"
    )
    hidden = ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY")
    environment = {key: value for key, value in os.environ.items() if key not in hidden}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("(")
    assert done.stderr == ""


def test_a_missing_package_is_named_with_the_command_that_installs_it() -> None:
    code = (
        "import sys\n"
        "sys.modules['pygame'] = None\n"
        "from blast_env.errors import BlastEnvError\n"
        "try:\n"
        "    import blast_env.rendering.frames\n"
        "except BlastEnvError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "pip install blast-env[render]" in done.stdout
    assert "'pygame'" in done.stdout


def test_module_squares_touch_without_a_gap(blast: Blast) -> None:
    painter = FramePainter(blast, width_px=333)
    parts = blast.scene.obstacles()[0].parts
    for left, right in pairwise(parts[:6]):
        assert right.x - left.x == MODULE_SIDE_UNITS
        assert (
            painter.view.rectangle(left.rectangle_m).right
            == painter.view.rectangle(right.rectangle_m).left
        )
