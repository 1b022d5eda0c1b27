"""The part of `blast-env bench` that is about gas dynamics."""

import importlib

import pytest

from blast_env.studies.benchmark import gas
from blast_env.studies.benchmark.gas import OtherCode, gas_blasts

bench = importlib.import_module("blast_env.cli.bench")  # the package names the command like this


def test_gas_is_timed_by_cells_and_beside_what_is_installed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench, "gas_blasts", lambda: gas_blasts((2.0, 1.0)))
    monkeypatch.setattr(gas, "which", lambda _: None)
    bench._print_gas(threads=1, pyclaw_python=None)
    printed = capsys.readouterr().out
    for words in ("14,400", "million cell updates", "grows with the power"):
        assert words in printed
    assert "PyClaw: not installed (--pyclaw-python)" in printed
    assert "rhoCentralFoam: not installed" in printed


def test_another_code_stands_beside_gas(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench, "gas_blasts", lambda: gas_blasts((2.0, 1.0)))
    found = OtherCode("rhoCentralFoam", "3-D, cells of 0.5 m", 20e6, 0.5e6)
    monkeypatch.setattr(bench, "beside_foam", lambda: found)
    bench._print_gas(threads=1, pyclaw_python=None)
    assert "0.50 million cell updates a CPU second, gas 20.0" in capsys.readouterr().out
