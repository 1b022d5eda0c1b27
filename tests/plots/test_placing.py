"""Frames of a site on which modules are being placed."""

import numpy as np
import pytest

from blast_env.evaluation.engines import Blast
from blast_env.layout import LayoutState
from blast_env.plots.frames import FramePainter
from blast_env.plots.placing import PlacingPainter, sources_text
from blast_env.plots.plan import EXPLOSIVE, FREE_CELL
from blast_env.site import RectangleSource, SegmentSource
from tests.plots.scenes import LAYOUT, small_scenario

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
