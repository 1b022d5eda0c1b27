"""Films of one blast and of two beside each other."""

import re
import subprocess
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np
import pytest
from imageio.plugins import ffmpeg
from PIL import Image

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.plots import FilmPlan, FramePainter, plan_until, shown_until_s, write_film


def test_an_mp4_has_the_planned_frames_and_even_sizes(blast: Blast, tmp_path: Path) -> None:
    path = tmp_path / "blast.mp4"
    (result,) = write_film(blast, path, frames_per_s=10.0, slow_motion=60.0, width_px=401)
    plan = plan_until(shown_until_s(result), 10.0, 60.0)
    reader: Any = imageio.get_reader(path, format="FFMPEG")
    try:
        assert reader.count_frames() == plan.frame_count > 5
        metadata = reader.get_meta_data()
        first = np.array(reader.get_data(0))
    finally:
        reader.close()
    assert metadata["codec"] == "h264"
    assert metadata["pix_fmt"].startswith("yuv420p")
    assert first.shape[1] == 400
    assert first.shape[0] % 2 == 0
    assert b"1/60 of real time" in path.read_bytes()
    assert result.digest == blast.run().digest
    assert list(tmp_path.iterdir()) == [path]


def test_a_gif_loops_and_states_the_real_time_factor(blast: Blast, tmp_path: Path) -> None:
    path = tmp_path / "blast.gif"
    (result,) = write_film(blast, path, frames_per_s=10.0, slow_motion=60.0, width_px=401)
    with Image.open(path) as film:
        assert film.format == "GIF"
        assert film.n_frames == plan_until(shown_until_s(result), 10.0, 60.0).frame_count  # type: ignore[attr-defined]
        assert film.info["loop"] == 0
        assert film.info["duration"] == 100
        assert b"1/60 of real time" in film.info["comment"]
        first = np.asarray(film.convert("RGB")).astype(int)
        film.seek(film.n_frames - 1)  # type: ignore[attr-defined]
        last = np.asarray(film.convert("RGB")).astype(int)
    assert first.shape[1] == 400
    assert (np.abs(first - last).max(axis=2) > 50).mean() > 0.005
    write_film(blast, path, frames_per_s=5.0, slow_motion=20.0, width_px=1200)
    with Image.open(path) as film:
        assert film.size[0] == 640  # made narrower


def test_ctrl_c_leaves_nothing_behind(blast: Blast, tmp_path: Path) -> None:
    def stop(share: float) -> None:
        if share > 0.3:
            raise KeyboardInterrupt

    few: dict[str, Any] = {"frames_per_s": 5.0, "slow_motion": 20.0, "width_px": 320}
    with pytest.raises(KeyboardInterrupt):
        write_film(blast, tmp_path / "blast.mp4", progress=stop, **few)
    assert list(tmp_path.iterdir()) == []


def test_a_film_shows_most_of_the_impulse_but_no_long_tail(result: BlastResult) -> None:
    end_s = shown_until_s(result)
    hits = result.collisions[result.collisions["structure"] == "shelter"]
    early = hits["time_s"] <= end_s
    assert hits.loc[early, "impulse_sim"].sum() >= 0.95 * hits["impulse_sim"].sum()
    assert end_s <= result.time_s


@pytest.mark.parametrize(
    ("slow_motion", "words"),
    [(1.0, "real time"), (250.0, "1/250 of real time"), (0.5, "2 times real time")],
)
def test_the_real_time_factor_in_words(slow_motion: float, words: str) -> None:
    assert FilmPlan(1.0, slow_motion, 25.0).real_time_factor == words


@pytest.mark.parametrize("slow_motion", [0.0, -1.0, float("nan"), float("inf")])
def test_slow_motion_must_be_positive(slow_motion: float) -> None:
    with pytest.raises(BlastEnvError, match=r"slow_motion is .*, must be positive"):
        plan_until(0.1, slow_motion=slow_motion)


def test_a_film_without_end_is_refused() -> None:
    with pytest.raises(BlastEnvError, match="lower slow_motion or frames_per_s"):
        plan_until(0.1, slow_motion=1e6)


# --- Two blasts in one film: the same moment, the same colours, nothing shifted.


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


def test_two_blasts_in_one_film_are_shown_to_the_end_of_the_longer_one(
    blast: Blast, barrier_blast: Blast, tmp_path: Path
) -> None:
    """The same moment, the same colours, nothing shifted; the barrier is in its own half alone."""
    path = tmp_path / "both.mp4"
    results = write(blast, barrier_blast, path)
    frames = frames_of(path)
    assert [result.digest for result in results] == [blast.run().digest, barrier_blast.run().digest]
    plans = [plan_until(shown_until_s(result), 5.0, 40.0) for result in results]
    assert len(frames) == max(plan.frame_count for plan in plans) > 3
    assert frames.shape[2] == WIDTH_PX
    assert frames.shape[1] % 2 == 0
    assert list(tmp_path.iterdir()) == [path]
    first = frames[0].astype(int)
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
