"""Every writer of the packages, with something small to write."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final
from unittest.mock import Mock, patch

import torch
from blast_agents.training.checkpoint import Checkpoint
from blast_agents.training.run_folder import RunConfiguration
from matplotlib.figure import Figure

from blast_env.evaluation import Evaluation, evaluate_layout
from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.files import scratch_folder
from blast_env.io.export import LayoutPlan, export_layout
from blast_env.layout import write_layout
from blast_env.particles.calibration.model import load_calibration, save_calibration
from blast_env.plots.figures import save_figure
from blast_env.plots.film import write_film
from blast_env.report.page import write_report
from blast_env.site import save_scenario
from blast_env.tables import write_csv
from tests.agents.training_runs import hyperparameters, settings
from tests.plots.scenes import LAYOUT, small_blast

Writer = Callable[[Path], Any]


@cache
def _blast() -> Blast:
    return small_blast(with_barrier=True)


@cache
def _result() -> BlastResult:
    return _blast().run()


@cache
def _plan() -> LayoutPlan:
    return LayoutPlan(_blast().scenario, LAYOUT, provenance={"text": "x" * 3000})


@cache
def _figure() -> Figure:
    """Return a small one, of one text."""
    figure = Figure(figsize=(2.0, 1.0))
    figure.text(0.1, 0.5, "a figure")
    return figure


@cache
def _evaluation() -> Evaluation:
    return evaluate_layout("courtyard", (), (0, 1), engine="event")


def _mp4(path: Path) -> None:
    write_film(_blast(), path, frames_per_s=5.0, slow_motion=40.0, width_px=320)


def _pair(path: Path) -> None:
    options: Any = {"frames_per_s": 5.0, "slow_motion": 40.0, "width_px": 640}
    write_film(_blast(), path, beside=_blast(), **options)


def _checkpoint(path: Path) -> None:
    configuration = RunConfiguration(
        settings=settings(path), hyperparameters=hyperparameters(), scenario_hash="0" * 64
    )
    Checkpoint.of_start(configuration, {"weight": torch.zeros(2000)}).save(path)


def _report(html: Path, pdf: Path | None = None, words: int = 600) -> None:
    """Write a page that says little: what it says costs blasts."""
    with patch("blast_env.report.page.report_html", lambda *_: "<p>" + "words " * words):
        write_report(Mock(), html, pdf, [])


def _pdf(path: Path) -> None:
    with scratch_folder() as folder:
        _report(folder / "report.html", path, words=10)  # so that the page has room


WRITERS: Final[Mapping[str, Writer]] = MappingProxyType(
    {
        "scenario.toml": lambda path: save_scenario(_blast().scenario, path),
        "layout.json": lambda path: write_layout(path, _plan().scenario, LAYOUT, {"a": "b" * 3000}),
        "layout.csv": lambda path: export_layout(_plan(), path),
        "layout.geojson": lambda path: export_layout(_plan(), path),
        "layout.dxf": lambda path: export_layout(_plan(), path),
        "table.csv": lambda path: write_csv(_result().collisions, path),
        "table.xlsx": lambda path: _result().to_excel(path),
        "table.parquet": lambda path: _result().to_parquet(path),
        "figure.png": lambda path: save_figure(_figure(), path),
        "figure.svg": lambda path: save_figure(_figure(), path),
        "figure.pdf": lambda path: save_figure(_figure(), path),
        "film.mp4": _mp4,
        "pair.mp4": _pair,
        "film.gif": _mp4,
        "evaluation.json": lambda path: _evaluation().to_json(path),
        "calibration.json": lambda path: save_calibration(load_calibration("ballistic_ufc"), path),
        "checkpoint.pt": _checkpoint,
        "report.html": _report,
        "report.pdf": _pdf,
    }
)
"""By the name of a file that each of them writes."""
