"""The comparison with other codes, as far as it can be tried without them."""

from pathlib import Path

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from studies.other_codes import openfoam, pyclaw
from studies.other_codes.histories import Histories, histories_figure


def test_impulse_counts_what_is_above_still_air_only() -> None:
    time_s = np.linspace(0.0, 2.0, 201)
    wave = np.where(time_s <= 1.0, 100.0 * (1.0 - time_s), -30.0)[:, None]
    found = Histories(time_s, wave, 1.0, 1.0)
    assert found.impulse_pa_s == pytest.approx([50.0])
    assert found.peak_pa == pytest.approx([100.0])


@pytest.mark.parametrize("cell_m", [0.3, 1.0])
def test_cells_must_fit_the_walls(cell_m: float) -> None:
    with pytest.raises(BlastEnvError, match="cell_m is"):
        openfoam.scene(cell_m)
    with pytest.raises(BlastEnvError, match="cell_m is"):
        pyclaw.plane_grid(cell_m)


def test_facade_is_the_mean_of_the_cells_before_it() -> None:
    scene = openfoam.scene(0.5)
    gauges = len(openfoam.GAUGES_M)
    assert scene.gauges.shape == (gauges + 8 * 6, 3)  # 4 m wide, 3 m high
    assert not scene.grid.solid[tuple(scene.gauges.T)].any()
    values = np.arange(len(scene.gauges), dtype=float)[None]
    assert scene.named(values)[0, -1] == values[0, gauges:].mean()


def test_plane_scene_stays_plane_and_its_walls_shield() -> None:
    found = pyclaw.ours(0.5, 0.03)
    before, behind = (list(pyclaw.GAUGES_M).index(f"{at} the wall") for at in ("before", "behind"))
    assert found.impulse_pa_s[before] > 3.0 * found.impulse_pa_s[behind] > 0.0


def test_missing_openfoam_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BlastEnvError, match=r"blockMesh.*not found: install it"):
        openfoam.rho_central_foam(openfoam.scene(0.5), 0.01, tmp_path / "case")


def test_openfoam_does_not_write_over_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for program in openfoam.PROGRAMS:
        (tmp_path / program).write_text("#!/bin/sh\nexit 3\n")
        (tmp_path / program).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin")
    with pytest.raises(BlastEnvError, match="is not empty"):
        openfoam.rho_central_foam(openfoam.scene(0.5), 0.01, tmp_path)
    with pytest.raises(BlastEnvError, match="blockMesh failed with status 3"):
        openfoam.rho_central_foam(openfoam.scene(0.5), 0.01, tmp_path / "case")
    start = (tmp_path / "case" / "system" / "controlDict").read_text()
    assert start.count("(12.25 ") == 2 + 8 * 6  # the gauges before the building


def test_interpreter_without_clawpack_is_said(tmp_path: Path) -> None:
    with pytest.raises(BlastEnvError, match="cannot be run"):
        pyclaw.by_pyclaw(0.5, 0.001, tmp_path / "python")


def test_each_place_has_a_panel() -> None:
    found = Histories(np.array([0.0, 1.0]), np.zeros((2, 3)), 1.0, 1.0)
    figure = histories_figure("title", ("a", "b", "c"), (("one", found), ("two", found)))
    assert [axes.get_title() for axes in figure.axes if axes.get_visible()] == ["a", "b", "c"]
