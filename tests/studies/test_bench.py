"""The cost of blasts and environments, and the tables of it."""

from dataclasses import replace
from pathlib import Path

import pytest
from typer import Typer
from typer.testing import CliRunner, Result

from blast_env import Scenario, simulate
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.layout import draw_charge
from studies import bench
from studies.bench import SiteCost, blast_cost, site_cost, street
from studies.side_by_side import ROWS, compare
from tests.envs.small import small_document


def run(*arguments: str) -> Result:
    app = Typer()
    app.command()(bench.main)
    return CliRunner().invoke(app, arguments)


def small() -> Scenario:
    """A small site in the bundled scenarios' model, which the event engine runs in no time."""
    return Scenario.model_validate(small_document())


def test_a_blast_is_timed_with_the_steps_that_it_has() -> None:
    cost = blast_cost(small(), "event", repeats=2, memory=False)
    assert (cost.scenario, cost.engine, cost.memory_mb) == (small().name, "event", None)
    assert cost.steps == simulate(small(), engine="event").steps
    assert cost.cell_updates is None
    assert cost.cpu_s > 0.0


def test_the_command_prints_a_row_a_scenario_and_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.bench.load_scenario", lambda _: small())
    options = ("--engine", "event", "--repeats", "1", "--no-memory")
    result = run(*options, "--no-environment")
    assert result.exit_code == 0, result.output
    for words in ("cores", "pymunk 7", "blasts per CPU s", small().name, "event"):
        assert words in result.stdout
    assert "gas" not in result.stdout
    refused = run("--engine", "steam")
    assert refused.exit_code == 2
    assert "steam" in refused.output


ENGINE = GasEngine(cell_m=0.5)


@pytest.fixture(scope="module")
def cost() -> SiteCost:
    return site_cost(street(20.0), ENGINE)


def test_the_cost_of_a_site_is_that_of_its_blast_and_what_was_told(cost: SiteCost) -> None:
    scenario = street(20.0)
    assert (cost.site, cost.cells) == ("street_20_m", "uniform")
    assert cost.cell_updates > 1000 * cost.steps
    assert cost.cpu_s > 0.0
    assert 100.0 < cost.memory_mb < 1000.0
    assert cost.estimate == ENGINE.cost(scenario, draw_charge(scenario, 0))
    assert 0.5 < cost.estimate.steps / cost.steps < 2.0


def test_the_command_prints_a_row_for_each_site_and_way_of_growing(
    cost: SiteCost, monkeypatch: pytest.MonkeyPatch
) -> None:
    def known(scenario: Scenario, engine: GasEngine) -> SiteCost:
        return replace(cost, site=scenario.name, cells=str(engine.cells))

    monkeypatch.setattr("studies.bench.site_cost", known)
    own = ("--site", "large", "--length", "20", "--site", "visitor_entrance")
    result = run(*own, "--cells", "coarse")
    assert result.exit_code == 0, result.output
    rows = [line.split()[:2] for line in result.output.splitlines()]
    assert ["street_20_m", "coarse"] in rows
    assert ["visitor_entrance", "coarse"] in rows


# --- Two checkouts side by side.


CHECKOUT = """
class Blast:
    def loads(self):
        return sum(number * number for number in range({work}))

def simulate(scenario, engine, cells):
    assert (scenario, engine, cells) == ("control_room", "gas", "uniform")
    return Blast()
"""
"""A package whose blasts only count."""


def checkout(folder: Path, content: str) -> Path:
    (folder / "blast_env").mkdir(parents=True)
    (folder / "blast_env" / "__init__.py").write_text(content)
    return folder


def test_a_checkout_costs_what_it_costs_itself(tmp_path: Path) -> None:
    """Each side measures its own package in a process of its own."""
    older, newer = (
        checkout(tmp_path / name, CHECKOUT.format(work=work))
        for name, work in (("older", 1_600_000), ("newer", 200_000))
    )
    (found,) = compare(older, newer, ["gas-control_room"], turns=2)
    assert found.row is ROWS["gas-control_room"]
    assert len(found.ratios) == 2
    assert 2.0 < found.ratio < 32.0


@pytest.mark.parametrize("name", ["one", "batch"])
def test_environments_are_timed_by_the_step(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in ("_SINGLE_STEPS", "_STEPS"):
        monkeypatch.setattr(f"studies.side_by_side.{number}", 8)
    monkeypatch.setattr("studies.side_by_side._ENVIRONMENTS", 2)
    spent_s, steps = ROWS[name].prepare()()
    assert spent_s > 0.0
    assert 8 <= steps <= 16


def test_what_cannot_be_compared_is_refused(tmp_path: Path) -> None:
    assert "must be the folder of a checkout" in run("--against", str(tmp_path)).output
    assert "needs --against" in run("--row", "one").output
    assert "did you mean 'one'" in run("--against", str(tmp_path), "--row", "onne").output
    checkout(tmp_path, "raise RuntimeError('an older one')")
    failed = run("--against", str(tmp_path), "--row", "one")
    assert failed.exit_code != 0
    assert "row 'one': RuntimeError: an older one" in " ".join(failed.output.split())
