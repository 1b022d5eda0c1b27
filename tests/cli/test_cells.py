"""`--cell` and `--cells`: they reach the environments and what judges."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from blast_agents.training.run_folder import RunFolder

from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.site import save_scenario
from tests.cli.running import run
from tests.gas_sites import glazed_hut

COARSE = 0.5


@pytest.fixture
def cells(monkeypatch: pytest.MonkeyPatch) -> set[float]:
    """The sides of cells of all blasts that are run."""
    used: set[float] = set()
    start = GasBlast.start

    def watched(self: GasBlast, *arguments: Any) -> Any:
        used.add(self.engine.cell_m)
        # As fast as it gets; what comes out does not matter here.
        return start(replace(self, engine=GasEngine(COARSE)), *arguments)

    monkeypatch.setattr(GasBlast, "start", watched)
    return used


def test_training_and_its_evaluations_use_the_cells(
    site: Path, tmp_path: Path, cells: set[float]
) -> None:
    folder = tmp_path / "run"
    small = ("n_steps=4", "batch_size=4", "n_epochs=1", "evaluation_cases=2")
    options = [text for name in small for text in ("--set", name)]
    given = ("--scenario", site, "--run", folder, "--envs", 1, "--steps", 4)
    result = run("train", *given, "--engine", "gas", "--cell", 0.25, *options)
    assert result.exit_code == 0, result.output
    assert cells == {0.25}
    assert "cells of 0.25 m" in result.stdout
    assert RunFolder(folder).configuration().settings.cell_m == 0.25


def test_growing_cells_are_those_of_commands_that_run_gas(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = tmp_path / "glazed.toml"
    save_scenario(glazed_hut(), site)
    used: set[str] = set()
    start = GasBlast.start

    def watched(self: GasBlast, *arguments: Any) -> Any:
        used.add(self.engine.cells)
        return start(replace(self, engine=GasEngine(COARSE)), *arguments)

    monkeypatch.setattr(GasBlast, "start", watched)
    searched = ("--scenario", site, "--engine", "gas", "--method", "random", "--budget", 1)
    commands: tuple[tuple[str | Path | float, ...], ...] = (
        ("simulate", site, "--engine", "gas"),
        ("search", *searched, "--held-out", 1, "--out", tmp_path / "found"),
        ("assess", site),
        ("search", "--method", "package", "--scenario", site, "--verify"),
    )
    for arguments in commands:
        used.clear()
        result = run(*arguments, "--cells", "coarse")
        assert result.exit_code == 0, result.output
        assert used == {"coarse"}, arguments[0]
