from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np
import pytest
from PIL import Image

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.plots.film import FilmPlan, plan_film, write_film
from blast_env.plots.style import shown_until_s


def test_an_mp4_has_the_planned_frames_and_even_sizes(blast: Blast, tmp_path: Path) -> None:
    path = tmp_path / "blast.mp4"
    (result,) = write_film(blast, path, frames_per_s=10.0, slow_motion=60.0, width_px=401)
    plan = plan_film(result, 10.0, 60.0)
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
        assert film.n_frames == plan_film(result, 10.0, 60.0).frame_count  # type: ignore[attr-defined]
        assert film.info["loop"] == 0
        assert film.info["duration"] == 100
        assert b"1/60 of real time" in film.info["comment"]
        first = np.asarray(film.convert("RGB")).astype(int)
        film.seek(film.n_frames - 1)  # type: ignore[attr-defined]
        last = np.asarray(film.convert("RGB")).astype(int)
    assert first.shape[1] == 400
    assert (np.abs(first - last).max(axis=2) > 50).mean() > 0.005


def test_a_wide_gif_is_made_narrower(blast: Blast, tmp_path: Path) -> None:
    path = tmp_path / "blast.gif"
    write_film(blast, path, frames_per_s=5.0, slow_motion=20.0, width_px=1200)
    with Image.open(path) as film:
        assert film.size[0] == 640


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
def test_slow_motion_must_be_positive(result: BlastResult, slow_motion: float) -> None:
    with pytest.raises(BlastEnvError, match=r"slow_motion is .*, must be positive"):
        plan_film(result, slow_motion=slow_motion)


def test_a_film_without_end_is_refused(result: BlastResult) -> None:
    with pytest.raises(BlastEnvError, match="lower slow_motion or frames_per_s"):
        plan_film(result, slow_motion=1e6)
