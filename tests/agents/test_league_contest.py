"""Entries on a track: the same blasts for all, and nothing is done twice."""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from blast_agents.league import (
    NO_BARRIER,
    Contest,
    LeagueEntry,
    ResultStore,
    Standings,
    hidden_track,
    known_track,
    standard_entries,
)
from blast_agents.league.store import search_key
from blast_agents.league.tracks import practice_of

from blast_env import load_scenario
from blast_env.design.rules import wall_near_charge
from blast_env.design.search import (
    LayoutProblem,
    ProposerKind,
    RandomSearch,
    Report,
    SearchResult,
    find_proposer,
)
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, evaluate_against
from blast_env.evaluation.cases import visible_case
from blast_env.files import FolderStore
from blast_env.site import PointSource
from blast_env.site.scene import Charge
from blast_env.sites import Visibility
from tests.agents.league_cases import TRAINING, WallAgent, road_scenario
from tests.design.search_cases import every_layout

SCENARIO = road_scenario()
TRACK = known_track(SCENARIO, 3, 2)
BUDGET = 6


@dataclass(frozen=True)
class CountedSearch:
    """Random search that remembers how often it was called, and may be interrupted."""

    interrupted: bool = False
    calls: list[int] = field(default_factory=list, repr=False, compare=False)
    name: str = "counted"

    def propose(
        self, problem: LayoutProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        self.calls.append(seed)
        found = RandomSearch(batch=2).propose(problem, budget, seed, report)
        return replace(found, interrupted=self.interrupted)


@dataclass(frozen=True)
class Cheat:
    """Spends blasts and reports one.

    Attributes:
        layouts: How many layouts it looks at under every threat.
        past_the_meter: Whether it asks the evaluator, and not the problem.
    """

    layouts: int
    past_the_meter: bool = False
    name: str = "cheat"

    def propose(
        self,
        problem: LayoutProblem,
        budget: int,
        seed: int = 0,
        report: Report | None = None,
    ) -> SearchResult:
        layouts = tuple(every_layout(problem)[: self.layouts])
        pairs = [(layout, threat) for layout in layouts for threat in problem.threats]
        if self.past_the_meter:
            problem.evaluator.loads_of_many(pairs)
        else:
            problem.loads(pairs)
        return SearchResult(layouts[-1], self.name, blasts=1, budget=budget, seed=seed)


@pytest.mark.parametrize("past_the_meter", [False, True])
def test_a_league_counts_blasts_itself(tmp_path: Path, past_the_meter: bool) -> None:
    """What a method says of its blasts enters no table; beyond the budget there is no result."""
    threats = len(practice_of(TRACK.cases[0]).threats)
    honest = LeagueEntry(Cheat(3, past_the_meter), 3 * threats)
    _, result = Contest(TRACK, (NO_BARRIER, honest), store(tmp_path)).play().results
    assert [each.blasts for each in result.proposals] == [3 * threats] * len(TRACK.cases)
    beyond = LeagueEntry(Cheat(3, past_the_meter), 3 * threats - 1)
    contest = Contest(TRACK, (NO_BARRIER, beyond), store(tmp_path))
    named = f"cheat, {3 * threats - 1} blasts.* {3 * threats} blasts.*budget is {3 * threats - 1}"
    with pytest.raises(BlastEnvError, match=named):
        contest.play()
    assert contest.outlook().kept_searches == 0


def store(folder: Path) -> ResultStore:
    return ResultStore(folder / "results")


def test_every_entry_meets_the_same_threats_as_no_barrier(tmp_path: Path) -> None:
    """The numbers are those of an evaluation of each layout against none on the held-out seeds."""
    entries = (
        *standard_entries([SCENARIO], ["random"], [BUDGET]),
        LeagueEntry(WallAgent("wall agent"), kind=ProposerKind.LEARNT, training=TRAINING),
    )
    standings = Contest(TRACK, entries, store(tmp_path)).play()
    assert [result.name for result in standings.results] == [
        "no barrier",
        "random layout",
        "wall near the charge",
        "wall in the middle",
        "wall near the building",
        "most sight lines cut",
        "random, 6 blasts",
        "wall agent",
    ]
    evaluator = BlastEvaluator(SCENARIO)
    for result in standings.results:
        reductions = standings.comparison(result).case_reductions
        for case, proposal, reduction in zip(
            TRACK.cases, result.proposals, reductions, strict=True
        ):
            expected = evaluate_against(evaluator, proposal.layout, case.threats)
            assert reduction == pytest.approx(expected.mean_reduction, abs=1e-12)
    assert standings.reduction(standings.results[0]) == (0.0, 0.0, 0.0)
    assert standings.reduction(standings.results[-1]).value > 0.05


def test_a_search_finds_what_it_finds_alone(tmp_path: Path) -> None:
    """On the threats for searching, with the budget, and with the case's seed."""
    entries = (NO_BARRIER, LeagueEntry(find_proposer("genetic"), BUDGET))
    proposals = Contest(TRACK, entries, store(tmp_path)).play().results[1].proposals
    for case, proposal in zip(TRACK.cases, proposals, strict=True):
        problem = LayoutProblem(BlastEvaluator(SCENARIO), practice_of(case))
        expected = find_proposer("genetic").propose(problem, BUDGET, case.seed)
        assert proposal.layout == expected.layout
        assert 0 < proposal.blasts == expected.blasts <= BUDGET
        assert proposal.seconds > 0.0


def test_an_agent_is_told_the_charge_only_where_it_is_known(tmp_path: Path) -> None:
    agent = WallAgent()
    entries = (NO_BARRIER, LeagueEntry(agent, kind=ProposerKind.LEARNT, training=TRAINING))
    Contest(TRACK, entries, store(tmp_path)).play()
    assert agent.told[-3:] == [case.charge for case in TRACK.cases]
    agent.told.clear()
    Contest(hidden_track(SCENARIO, 1), entries, store(tmp_path)).play()
    assert set(agent.told) == {None}


def test_a_rule_stands_in_the_middle_of_a_hidden_threat() -> None:
    (case,) = hidden_track(SCENARIO, 1).cases
    first = practice_of(case).threats[0].charge
    middle = Charge((5.0, 20.0), first.tnt_kg, first.height_m)
    problem = LayoutProblem(BlastEvaluator(SCENARIO), practice_of(case))
    layout = find_proposer("wall_near_charge").propose(problem, 0).layout
    assert layout == tuple(sorted(wall_near_charge(SCENARIO, middle)))


def test_lines_of_sight_are_cut_before_the_charge_or_before_all_its_places() -> None:
    """A known charge has but one place: its lines are cut, and not those of the others."""
    scenario = load_scenario("courtyard")
    place = PointSource(position_m=(5.0, 10.0), tnt_kg=100.0)
    (hidden,) = hidden_track(scenario, 1).cases
    known = visible_case(scenario, Charge(place.position_m, place.tnt_kg), [1])
    lines_of_one = Visibility.of(scenario.model_copy(update={"charge": (place,)}))
    lines_of_all = Visibility.of(scenario)
    of_one, of_all = (
        find_proposer("sight_lines")
        .propose(LayoutProblem(BlastEvaluator(scenario), case), 0)
        .layout
        for case in (known, hidden)
    )
    assert lines_of_one.cut_share(of_one) > lines_of_one.cut_share(of_all)
    assert lines_of_all.cut_share(of_all) > lines_of_all.cut_share(of_one)


def test_an_interrupted_league_goes_on(tmp_path: Path) -> None:
    """After two of three searches: one is left, and all comes out as if nothing had happened."""
    counted = CountedSearch()
    entries = (NO_BARRIER, LeagueEntry(counted, BUDGET))
    shares: list[float] = []

    def interrupt(share: float) -> None:
        shares.append(share)
        if len(shares) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Contest(TRACK, entries, store(tmp_path)).play(progress=interrupt)
    assert len(counted.calls) == 2
    again = Contest(TRACK, entries, store(tmp_path))
    outlook = again.outlook()
    assert (outlook.searches, outlook.kept_searches, outlook.search_blasts) == (3, 2, BUDGET)
    standings = again.play(progress=shares.append)
    assert len(counted.calls) == 3
    assert shares[-1] == 1.0
    untroubled = Contest(TRACK, entries, store(tmp_path / "other")).play()
    assert np.array_equal(standings.results[1].loads, untroubled.results[1].loads, equal_nan=False)


def test_what_is_finished_is_not_done_again(tmp_path: Path) -> None:
    counted = CountedSearch()
    entries = (NO_BARRIER, LeagueEntry(counted, BUDGET))
    first = Contest(TRACK, entries, store(tmp_path)).play()
    second = Contest(TRACK, entries, store(tmp_path))
    assert second.outlook().blasts == 0
    repeated = second.play()
    assert len(counted.calls) == 3
    assert repeated.results[1].proposals == first.results[1].proposals  # times as well
    more_seeds = Contest(known_track(SCENARIO, 3, 4), entries, store(tmp_path))
    assert more_seeds.outlook().search_blasts == 0
    assert more_seeds.outlook().held_out_blasts == 2 * 3 * 4


def test_a_result_of_something_else_is_not_taken() -> None:
    """Other settings, budget, seed, scenario or engine: other keys."""
    case = TRACK.cases[0]
    other = road_scenario(stock=2)
    keys = {
        search_key(case, LeagueEntry(RandomSearch(), 6), "event"),
        search_key(case, LeagueEntry(RandomSearch(batch=4), 6), "event"),
        search_key(case, LeagueEntry(RandomSearch(), 7), "event"),
        search_key(replace(case, seed=9), LeagueEntry(RandomSearch(), 6), "event"),
        search_key(TRACK.cases[1], LeagueEntry(RandomSearch(), 6), "event"),
        search_key(replace(case, scenario=other), LeagueEntry(RandomSearch(), 6), "event"),
        search_key(case, LeagueEntry(RandomSearch(), 6), "pymunk"),
    }
    assert len(keys) == 7


def test_a_key_is_the_same_in_every_process() -> None:
    """A method's settings may hold functions; where these lie in memory does not matter."""
    key = search_key(TRACK.cases[0], LeagueEntry(find_proposer("genetic"), 6), "event")
    assert "random_walls" in key
    assert " at 0x" not in key


def test_the_code_of_a_method_counts_wherever_it_is(tmp_path: Path) -> None:
    """As that of the surrogate's search does, which is not with the others."""
    keys = []
    for number, source in enumerate(("", "", "DRAWN = 4")):
        (tmp_path / str(number)).mkdir()
        path = tmp_path / str(number) / "own.py"
        path.write_text(f"{source}\nclass Own:\n    name = 'own'\n")
        spec = spec_from_file_location("own", path)
        assert spec is not None
        assert spec.loader is not None
        own = module_from_spec(spec)
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(sys.modules, "own", own)
            spec.loader.exec_module(own)
            keys.append(search_key(TRACK.cases[0], LeagueEntry(own.Own(), 6), "event"))
    assert keys[0] == keys[1] != keys[2]


@dataclass(frozen=True)
class Played:
    """A league of a search that has come to its end.

    Attributes:
        folder: Where its results are; not to be changed.
        standings: What came of it.
    """

    folder: Path
    standings: Standings

    def damaged(self, folder: Path, damage: Callable[[Path], object]) -> Contest:
        """Return the same league on a copy of the results, each of which is damaged."""
        copytree(self.folder, folder, dirs_exist_ok=True)
        for path in store(folder).folder.iterdir():
            damage(path)
        return Contest(TRACK, FINISHED, store(folder))


FINISHED = (NO_BARRIER, LeagueEntry(RandomSearch(), BUDGET))


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Played:
    folder = tmp_path_factory.mktemp("played")
    contest = Contest(TRACK, FINISHED, store(folder))
    standings = contest.play()
    assert contest.outlook().kept_searches == len(TRACK.cases)
    return Played(folder, standings)


@pytest.mark.parametrize("damage", [b"", b"{", b'{"key": "another", "value": null}'])
def test_a_damaged_result_is_found_again(tmp_path: Path, played: Played, damage: bytes) -> None:
    again = played.damaged(tmp_path, lambda path: path.write_bytes(damage))
    assert again.outlook().kept_searches == 0
    for one, other in zip(played.standings.results, again.play().results, strict=True):
        assert np.array_equal(one.loads, other.loads)


@pytest.mark.parametrize(
    "content",
    [
        b"[1e999]",
        b"[-1.0]",
        b"[1.0]",
        b'{"layout": [[999, 999]], "seconds": 1.0}',
        b'{"layout": [[0, 0], [0, 0]], "seconds": 1.0}',
        b'{"layout": [], "seconds": "2026-01-01"}',
        b"[" * 1000,
        b"\xff",
    ],
)
def test_a_result_with_a_right_checksum_that_does_not_fit_is_done_again(
    content: bytes, tmp_path: Path, played: Played
) -> None:
    def damage(path: Path) -> None:
        key = json.loads(path.read_bytes()[32:].partition(b"\n")[0])
        FolderStore(path.parent, ".result").put(key, content)

    again = played.damaged(tmp_path, damage)
    assert again.outlook().kept_searches == 0
    for one, other in zip(played.standings.results, again.play().results, strict=True):
        assert np.array_equal(one.loads, other.loads)


def test_what_an_interrupted_search_has_is_not_its_answer(tmp_path: Path) -> None:
    """Searches end at Ctrl-C with the best so far; the league must not take that for more."""
    entries = (NO_BARRIER, LeagueEntry(CountedSearch(interrupted=True), BUDGET))
    contest = Contest(TRACK, entries, store(tmp_path))
    with pytest.raises(KeyboardInterrupt):
        contest.play()
    assert contest.outlook().kept_searches == 0


def test_processes_change_nothing(tmp_path: Path) -> None:
    track = known_track(SCENARIO, 2, 1)
    entries = standard_entries([SCENARIO], ["random"], [BUDGET])
    one, two = (
        Contest(track, entries, store(tmp_path / str(processes))).play(processes)
        for processes in (1, 2)
    )
    for first, second in zip(one.results, two.results, strict=True):
        assert np.array_equal(first.loads, second.loads)


def test_bad_input_is_refused(tmp_path: Path) -> None:
    kept = store(tmp_path)
    with pytest.raises(BlastEnvError, match="'no barrier' appears twice"):
        Contest(TRACK, (NO_BARRIER, NO_BARRIER), kept)
    with pytest.raises(BlastEnvError, match="no barrier is not among"):
        Contest(TRACK, (LeagueEntry(RandomSearch(), 6),), kept)
    with pytest.raises(BlastEnvError, match="budget is -1 blasts"):
        LeagueEntry(RandomSearch(), -1)
    with pytest.raises(BlastEnvError, match="did you mean 'genetic'"):
        standard_entries([SCENARIO], ["genetik"], [6])
    with pytest.raises(BlastEnvError, match="processes is 0"):
        Contest(TRACK, (NO_BARRIER,), kept).play(0)
    (tmp_path / "file").touch()
    with pytest.raises(BlastEnvError, match="cannot be a folder"):
        ResultStore(tmp_path / "file")


def test_a_cheaper_engine_s_best_layouts_are_judged_by_the_judge(tmp_path: Path) -> None:
    search = LeagueEntry(find_proposer("random"), 3, first_engine="pymunk", finalists=2)
    assert search.name == "random, 3 blasts of pymunk, the best 2 judged"
    entries = (NO_BARRIER, search, LeagueEntry(find_proposer("random"), 3))
    track = known_track(SCENARIO, 1, 1)
    _, staged, plain = Contest(track, entries, store(tmp_path)).play().results
    for case, proposal in zip(track.cases, staged.proposals, strict=True):
        practice = practice_of(case)
        first = LayoutProblem(BlastEvaluator(SCENARIO, "pymunk"), practice)
        found = find_proposer("random").propose(first, 3, case.seed)
        finalists = {each.layout for each in found.history[-2:]}
        assert proposal.layout in finalists
        judge = LayoutProblem(BlastEvaluator(SCENARIO), practice)
        assert judge.load(proposal.layout) == min(map(judge.load, finalists))
        assert proposal.other_blasts == found.blasts
        assert proposal.blasts == len(finalists) * len(practice.threats)
        assert proposal.cpu_s > 0.0
    assert all(each.other_blasts == 0 for each in plain.proposals)
