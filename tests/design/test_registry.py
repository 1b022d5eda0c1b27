"""A rule and a search are a file and a line each, and then they are everywhere."""

from functools import partial
from pathlib import Path
from types import MappingProxyType

import pytest
from typer.testing import CliRunner, Result

import blast_env
from blast_env import save_scenario
from blast_env.app import offers
from blast_env.benchmark import SubmissionJudgement, make, play
from blast_env.benchmark.methods import find_method
from blast_env.cli import app
from blast_env.design.search import (
    DesignProblem,
    ProposerKind,
    ProposerRow,
    Report,
    RuleProposer,
    SearchResult,
    SurrogateSearch,
    layouts_by_rule,
    registry,
)
from blast_env.errors import BlastEnvError
from blast_env.rules import RuleRow, random_layout, table
from blast_env.values import generator
from tests.benchmark.row import RowEngine
from tests.design.corner import fill_from_the_corner
from tests.design.one_after_another import OneAfterAnother
from tests.design.search_cases import small_scenario
from tests.gas_sites import hut
from tests.surrogate.cases import YARD, by_hand

OWN = {
    "corner": ProposerRow(
        partial(RuleProposer, "corner", fill_from_the_corner),
        "from the corner",
        ProposerKind.RULE,
        budget=0,
    ),
    "one_after_another": ProposerRow(OneAfterAnother, "one after another", budget=6),
}


@pytest.fixture(autouse=True)
def two_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Add the lines: the files are `tests/design/corner.py` and `one_after_another.py`."""
    corner = {"corner": RuleRow("from the corner", fill_from_the_corner)}
    monkeypatch.setattr(table, "RULES", MappingProxyType({**table.RULES, **corner}))
    monkeypatch.setattr(registry, "_TABLE", MappingProxyType({**registry._TABLE, **OWN}))


def run(*arguments: object) -> Result:
    result = CliRunner().invoke(app, [*map(str, arguments)], env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output
    return result


@pytest.fixture
def site(tmp_path: Path) -> Path:
    save_scenario(small_scenario(), tmp_path / "site.toml")
    return tmp_path / "site.toml"


@pytest.mark.parametrize("name", OWN)
def test_both_are_methods_of_search(name: str, site: Path) -> None:
    options = ("--budget", 4, "--held-out", 1, "--engine", "event")
    shown = run("search", "--scenario", site, "--method", name, *options).stdout
    assert f"{name} search" in shown
    assert f"{0 if name == 'corner' else 4} of 4 blasts spent" in shown


def test_the_library_has_them_and_their_budget() -> None:
    found = blast_env.search(small_scenario(), "one_after_another", engine="event", seed=2)
    assert (found.blasts, found.budget, found.method) == (6, 6, "one_after_another")
    ruled = blast_env.search(small_scenario(), "corner", engine="event")
    assert ruled.layout == tuple(sorted(fill_from_the_corner(small_scenario(), None)))


def test_the_rule_is_among_those_that_a_proposal_is_chosen_from_and_held_against(
    tmp_path: Path,
) -> None:
    low = hut(site={"width_m": 9.0, "height_m": 7.0, "air_height_m": 2.5}, gauges=[])
    assert "from the corner" in layouts_by_rule(low)
    save_scenario(low, tmp_path / "hut.toml")
    shown = run(
        "search", "--method", "package", "--scenario", tmp_path / "hut.toml", "--verify"
    ).stdout
    assert "blasts of gas: about " in shown
    verdict = shown.partition("judged by gas dynamics")[2]
    assert "from the corner" in verdict
    ruled = next(line for line in verdict.splitlines() if line.startswith("from the corner"))
    assert ruled.count("+-") == 2  # beside the load and its reduction
    assert "(cells)" in ruled


def test_both_are_methods_of_the_benchmark(tmp_path: Path) -> None:
    save_scenario(hut(), tmp_path / "hut.toml")
    few = ("--method", "rules", "--method", "one_after_another", "--budget", 2, "--cell", 0.5)
    run("judge", *few, "--scenario", tmp_path / "hut.toml", "--out", tmp_path / "out")
    rule, search = (
        SubmissionJudgement.load(tmp_path / "out" / f"judged_{name}.json").runs[0]
        for name in ("corner", "one_after_another")
    )
    assert (rule.problem, rule.blasts, search.blasts) == ("hut-known-v2", 0, 2)
    assert min(rule.share, search.share) >= rule.best


def test_the_page_offers_both() -> None:
    offered = offers.offered(hut())
    assert offered["corner"] == "rule: from the corner"
    assert offered["one_after_another"] == "search: one after another"
    assert offers.runs_blasts("one_after_another")
    assert not offers.runs_blasts("corner")


def test_what_lacks_something_is_not_offered_and_refused_by_name(site: Path) -> None:
    name = "ring_around_building"
    assert name not in offers.offered(hut())
    result = CliRunner().invoke(app, ["search", "--scenario", str(site), "--method", name])
    assert result.exit_code == 2
    assert (
        "has no catalogue (build_zone.items): ring_around_building is of no use there"
        in " ".join(result.stderr.split())
    )


def test_a_proposal_says_how_far_it_has_come() -> None:
    shares: list[float] = []
    SurrogateSearch(by_hand(), changes=24).at_once(YARD, None, shares.append)
    assert shares == sorted(shares)
    assert len(shares) >= 3
    assert 0.0 < shares[0] < shares[-1] <= 1.0


def test_something_must_have_learnt() -> None:
    with pytest.raises(BlastEnvError, match="neither a surrogate nor an agent"):
        SurrogateSearch()


class Own:
    """Takes the first of some random layouts, or breaks a rule."""

    name = "own"

    def __init__(self, layouts: int = 1, illegal: bool = False) -> None:
        self.layouts, self.illegal = layouts, illegal

    def propose(
        self, problem: DesignProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        rng = generator(seed)
        count = self.layouts * budget // len(problem.threats)
        tried = [random_layout(problem.scenario, rng) for _ in range(count)]
        best = min(tried, key=problem.load)
        return SearchResult(((99, 99),) if self.illegal else best)


greedy = Own(layouts=4)
illegal = Own(illegal=True)
nothing = 3


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("greedy", "the search asks for"),
        ("illegal", "has 2 values"),
        ("nothing", "must be something to call"),
        ("missing", "has no attribute 'missing'"),
    ],
)
def test_an_optimiser_of_ones_own_is_held_to_the_rules(name: str, words: str) -> None:
    problem = make("control_room-known-v2", 2, engine=RowEngine())
    with pytest.raises(BlastEnvError, match=words):
        play(find_method(f"{__name__}:{name}"), [(lambda _: problem, 2, 0)])


def test_an_optimiser_of_ones_own_enters_as_an_object_or_a_class() -> None:
    problem = make("control_room-known-v2", 2, engine=RowEngine())
    (found,) = play(find_method(f"{__name__}:Own"), [(lambda _: problem, 2, 0)])
    assert found.blasts == 2
