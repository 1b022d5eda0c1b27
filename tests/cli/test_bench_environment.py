"""The part of `blast-env bench` that is about the environment."""

import importlib

import pytest

from blast_env import Scenario, load_scenario
from blast_env.studies.benchmark.parallel import FleetFigures
from tests.studies.test_benchmark_env import collisional_courtyard

bench = importlib.import_module("blast_env.cli.bench")  # the package names the command like this


def fleets(scenario: Scenario, episodes: int) -> tuple[FleetFigures, ...]:
    """Stand in for processes that take long to start; they have a test of their own."""
    return (FleetFigures("one process", 1, 1234.5, 56.78), FleetFigures("vector", 7, 8.0, 9.0))


def test_it_prints_parts_and_fleets(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench, "measure_fleets", fleets)
    bench._print_environment(collisional_courtyard(), 1)
    printed = capsys.readouterr().out
    for words in (
        "outside engine",
        "outside physics",
        "mask (ms)",
        "observation (ms)",
        "event",
    ):
        assert words in printed
    assert "1,234" in printed
    assert "56.8" in printed


def test_a_scenario_without_a_build_zone_is_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    bench._print_environment(load_scenario("free_field"), 1)
    assert "needs a build zone and a calibration, free_field lacks one" in capsys.readouterr().out
