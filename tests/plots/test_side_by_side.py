"""Two blasts in one film: the same moment, the same colours, nothing shifted."""

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imageio.plugins import ffmpeg

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Blast
from blast_env.plots.film import plan_film, write_film
from blast_env.plots.frames import FramePainter

WIDTH_PX = 640


def frames_of(path: Path) -> np.ndarray:
    """Return all frames (frames, height, width, 3), as ffmpeg reads them."""
    untyped: Any = ffmpeg
    command = [untyped.get_exe(), "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(command, capture_output=True, check=True)
    size = re.search(r"yuv420p.*?, (\d+)x(\d+)", done.stderr.decode())
    assert size is not None
    width, height = int(size[1]), int(size[2])
    return np.frombuffer(done.stdout, dtype=np.uint8).reshape(-1, height, width, 3)


def write(left: Blast, right: Blast, path: Path, **changes: Any) -> tuple[Any, ...]:
    options: dict[str, Any] = {"frames_per_s": 5.0, "slow_motion": 40.0, "width_px": WIDTH_PX}
    return write_film(right, path, beside=left, **(options | changes))


@dataclass(frozen=True)
class Written:
    """A film of both blasts, what came back from writing it, and the progress that was told."""

    path: Path
    results: tuple[Any, ...]
    frames: np.ndarray
    shares: list[float]


@pytest.fixture(scope="module")
def both(blast: Blast, barrier_blast: Blast, tmp_path_factory: pytest.TempPathFactory) -> Written:
    path = tmp_path_factory.mktemp("film") / "both.mp4"
    shares: list[float] = []
    results = write(blast, barrier_blast, path, progress=shares.append)
    return Written(path, results, frames_of(path), shares)


def test_both_blasts_are_shown_to_the_end_of_the_longer_one(
    blast: Blast, barrier_blast: Blast, both: Written
) -> None:
    digests = [each.digest for each in both.results]
    assert digests == [blast.run().digest, barrier_blast.run().digest]
    plans = [plan_film(each, 5.0, 40.0) for each in both.results]
    assert len(both.frames) == max(plan.frame_count for plan in plans) > 3
    assert both.frames.shape[2] == WIDTH_PX
    assert both.frames.shape[1] % 2 == 0
    assert list(both.path.parent.iterdir()) == [both.path]


def test_the_barrier_is_in_its_own_half_alone(barrier_blast: Blast, both: Written) -> None:
    first = both.frames[0].astype(int)
    painter = FramePainter(barrier_blast, width_px=WIDTH_PX // 2)
    part = barrier_blast.scene.obstacles()[-1].parts[0]
    across, down = painter.sheet.pixel(part.rectangle_m.left, part.centre_m[1])
    left, right = first[down, across], first[down, across + WIDTH_PX // 2]
    assert np.abs(left - right).max() > 50  # a black edge beside the ground


def test_what_is_no_film_of_two_is_refused(blast: Blast, tmp_path: Path) -> None:
    with pytest.raises(BlastEnvError, match=r"suffix '.avi', must be .mp4 or .gif"):
        write(blast, blast, tmp_path / "film.avi")
    with pytest.raises(BlastEnvError, match="width_px is 300, must be 320"):
        write(blast, blast, tmp_path / "film.mp4", width_px=600)
    assert list(tmp_path.iterdir()) == []
