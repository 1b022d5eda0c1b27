"""Problems: blasts are counted, versions say what they said, any vector of keys is a layout."""

from itertools import count
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.benchmark import (
    DEFINITIONS,
    BenchmarkProblem,
    Definition,
    LayoutSpace,
    RunGrid,
    Submission,
    make,
    play,
    secret_sites,
    stored_references,
)
from blast_env.benchmark.methods import find_method
from blast_env.errors import BlastEnvError, LayoutError, UnknownNameError
from blast_env.evaluation import BudgetError
from blast_env.geometry import Layout, Measure, Piece
from blast_env.layout import LayoutState
from blast_env.site import PointSource, load_scenario
from tests.benchmark.row import RowEngine
from tests.catalogue_sites import WALL as YARD_WALL
from tests.site.test_hardening import glazed_yard

WALL = [Piece(12, 0, "low_wall", True)]
HIDDEN = Definition("control_room", "hidden")


def problem(budget: int = 3, asked: str | Definition = "control_room-known-v2") -> BenchmarkProblem:
    return make(asked, budget, engine=RowEngine())


def test_blasts_are_counted_and_refused_beyond_the_budget() -> None:
    own = problem()
    with pytest.raises(LayoutError):
        own.evaluate([Piece(99, 0, "low_wall", True)])
    assert own.blasts == 0
    shares = [own.evaluate(WALL), own.evaluate([]), own.evaluate(WALL)]
    assert shares[0] == shares[2] == pytest.approx(0.9)
    assert shares[1] == 1.0
    assert own.blasts == 1  # the one without a barrier is free
    own.evaluate([Piece(19, 0, "low_wall", True)])
    own.evaluate([Piece(20, 0, "low_wall", True)])
    with pytest.raises(BudgetError, match="1 blasts asked for, 0 of the budget of 3 are left"):
        own.evaluate([Piece(21, 0, "low_wall", True)])
    assert own.evaluate(WALL) == shares[0]
    assert own.best is not None
    assert own.best.layout == tuple(WALL)


def test_a_hidden_charge_takes_a_blast_a_place_or_fewer() -> None:
    own = problem(7, HIDDEN)
    own.evaluate(WALL)
    assert own.blasts == 3
    own.evaluate([], threats=1)
    assert own.blasts == 3
    assert own.best is not None
    assert own.best.threats == 3
    with pytest.raises(BlastEnvError, match="threats is 4, must be 1 to 3"):
        own.evaluate(WALL, threats=4)
    own.evaluate([Piece(3, 0, "low_wall", True)])
    with pytest.raises(BudgetError):
        own.evaluate([Piece(4, 0, "low_wall", True)])


@pytest.mark.parametrize("name", ["random", "genetic"])
def test_searches_of_the_package_stay_within_the_budget(name: str) -> None:
    own = problem(12)
    layout = find_method(name)(own, 1)
    assert 0 < own.blasts <= 12
    assert own.judged(layout) < 1.0
    assert layout == find_method(name)(problem(12), 1)


def test_the_budget_ends_a_method_with_its_best_layout() -> None:
    """The row engine's best wall is in row 12, the search comes nearer to it by the blast."""

    def endless(own: BenchmarkProblem, seed: int) -> Layout:
        for row in count():
            own.evaluate([Piece(row, 0, "low_wall", True)])
        return ()

    (run,) = play(endless, RunGrid([problem], (5,)))
    assert run.layout == (Piece(4, 0, "low_wall", True),)
    assert [blasts for blasts, _ in run.curve] == [1, 2, 3, 4, 5]
    with pytest.raises(BudgetError):
        play(endless, RunGrid([problem], (0,)))


def test_a_method_without_new_questions_ends() -> None:
    def stubborn(own: BenchmarkProblem, seed: int) -> Layout:
        while True:
            own.evaluate(WALL)

    (run,) = play(stubborn, RunGrid([problem], (5,)))
    assert (run.blasts, run.layout) == (1, tuple(WALL))


@pytest.mark.parametrize("asked", ["control_room-known-v2", HIDDEN])
def test_the_curve_of_a_search_ends_at_its_layout(asked: str | Definition) -> None:
    (run,) = play(find_method("genetic"), RunGrid([lambda budget: problem(budget, asked)], (12,)))
    blasts, shares = zip(*run.curve, strict=True)
    assert blasts[-1] <= run.blasts
    assert shares[-1] == pytest.approx(problem(0, asked).judged(run.layout), abs=1e-5)
    assert blasts == tuple(sorted(blasts))


def test_where_facades_count_measures_take_no_blast() -> None:
    """What counts is the shortfall or, of a layout that passes, its share of the budget."""
    definition = Definition("yard", "response")
    vars(definition)["scenario"] = glazed_yard(target="medium")
    own = make(definition, len(definition.case.threats), engine="surrogate")
    measures = [Measure.named("glass"), Measure.named("panels")]
    assert own.evaluate(()) == 1.0
    spent = own.blasts
    shares = [own.evaluate(measures[:1]), own.evaluate(measures)]
    assert own.blasts == spent
    assert shares[1] < 1.0
    assert own.judged(measures) < 1.0


def test_every_version_says_what_it_said() -> None:
    """The digest has the site, the charges and the budgets; a change needs a new version."""
    known = stored_references()
    assert set(known) == set(DEFINITIONS)
    assert {name: definition.digest for name, definition in DEFINITIONS.items()} == {
        name: value.digest for name, value in known.items()
    }


def test_a_problem_that_has_changed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    changed = Definition("control_room", "known")
    monkeypatch.setitem(vars(changed), "digest", "0" * 16)
    with pytest.raises(BlastEnvError, match=r"control_room-known-v2: .* never changes"):
        make(changed, engine=RowEngine())


def test_a_problem_that_there_is_not_names_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'control_room-known-v2'"):
        make("control_room-tol-v1")


def test_families_ask_what_they_say() -> None:
    for definition in (*DEFINITIONS.values(), HIDDEN):
        case, scenario = definition.case, definition.scenario
        search_set = case.search_set
        assert search_set is not None
        assert (case.charge is not None) == (definition.family == "known")
        if definition.family == "vehicle":
            assert scenario.vehicles
        points = [source for source in scenario.charge if isinstance(source, PointSource)]
        if definition.family == "hidden" and len(points) == len(scenario.charge):
            assert len(case.threats) == len(search_set.threats) == len(points)
        assert (definition.family == "response") == scenario.objective.is_response
        if definition.family == "known":
            assert case.charges == search_set.charges


def test_what_is_stored_can_be_built() -> None:
    for name, stored_reference in stored_references().items():
        if DEFINITIONS[name].site.startswith(("site_", "item_sites_")):
            continue  # drawing a site takes half a second
        own = make(name)
        assert (
            own.check(stored_reference.rule.layout) == own.check(stored_reference.best.layout) == ()
        )
        assert (
            stored_reference.best.shares["0.5"]
            <= stored_reference.rule.shares["0.5"]
            == min(stored_reference.rules.values())
        )


def test_sites_of_a_secret_are_the_same_again_and_of_no_other() -> None:
    sites = secret_sites("the judge's own", 3)
    assert sites == secret_sites("the judge's own", 3)
    assert sites[:2] == secret_sites("the judge's own", 2)
    assert not set(sites) & set(secret_sites("the judge's own ", 3))
    assert all(int(site.site.removeprefix("site_")) >= 2**62 for site in sites)
    assert sites[0].scenario.zone.items
    with pytest.raises(BlastEnvError, match="secret has 3 characters, must have at least 8"):
        secret_sites("abc", 3)


def test_runs_go_on_where_they_were(tmp_path: Path) -> None:
    asked = RunGrid([lambda budget: problem(budget)], (0, 4), range(2))
    calls = []

    def wall(own: BenchmarkProblem, seed: int) -> Layout:
        calls.append((own.budget, seed))
        return (Piece((12 + seed), 0, "low_wall", True),)

    runs = play(wall, asked, tmp_path / "runs.sqlite")
    assert [run.key[1:] for run in runs] == [(0, 0), (4, 0), (4, 1)]
    assert play(wall, asked, tmp_path / "runs.sqlite") == runs
    assert len(calls) == 3
    path = Submission("wall", runs, "a note").save(tmp_path / "wall.json")
    assert Submission.load(path) == Submission("wall", runs, "a note")


# --- Any vector of keys is a legal layout; choices a place say everything and check everything.


SITES = ("control_room", "courtyard", "hotel_forecourt", "shopping_street", "perimeter_gate")


@pytest.mark.parametrize("site", SITES)
def test_any_keys_are_a_legal_layout(site: str) -> None:
    space = LayoutSpace(load_scenario(site))

    @given(st.lists(st.floats(-3.0, 3.0), min_size=space.keys, max_size=space.keys))
    def check(keys: list[float]) -> None:
        layout = space.from_keys(keys)
        assert space.reasons_against(layout) == ()
        assert space.layout(space.choices_of(layout)) == tuple(
            sorted(layout, key=lambda element: (element[0], element[1]))
        )

    check()


def test_keys_reach_what_the_budget_pays_for() -> None:
    """The stock is nine walls, the budget pays for six low ones: 18 keys are enough."""
    space = LayoutSpace(load_scenario("control_room"))
    assert space.most_pieces == 6
    rng = np.random.default_rng(0)
    pieces = [len(space.from_keys(rng.random(space.keys))) for _ in range(50)]
    assert max(pieces) >= 4
    # Walls across the strip fit nowhere. Were they asked for, two things of five would be set down.
    assert np.mean(pieces) > 0.4 * space.most_pieces


def test_without_a_catalogue_each_free_cell_has_two_choices() -> None:
    yard = LayoutSpace(load_scenario("courtyard"))
    assert (yard.choices == 2).all()
    assert len(yard.places) == int(LayoutState.empty("courtyard").free.sum())


def test_every_measure_is_a_place_of_its_own() -> None:
    """All of them can be taken together, beside what stands on the cell (0, 0)."""
    space = LayoutSpace(glazed_yard())
    layout = (*YARD_WALL[:1], Measure.named("glass"), Measure.named("panels"))
    choices = space.choices_of(layout)
    assert choices[-2:].tolist() == [1, 1]
    assert space.choices[-2:].tolist() == [2, 2]
    assert sorted(space.layout(choices)) == sorted(layout)
    rng = np.random.default_rng(0)
    drawn = [space.from_keys(rng.random(space.keys)) for _ in range(30)]
    assert any(sum(isinstance(case, Measure) for case in own) == 2 for own in drawn)


def test_a_vector_of_use_to_nobody_is_refused() -> None:
    space = LayoutSpace(load_scenario("control_room"))
    with pytest.raises(BlastEnvError, match=r"keys: has the shape \(3,\), must have \(18,\)"):
        space.from_keys([0.0, 0.5, 1.0])
    with pytest.raises(BlastEnvError, match=r"keys\[1\] is nan, must be a finite"):
        space.from_keys([0.0, np.nan, *[0.0] * 16])
    with pytest.raises(BlastEnvError, match=r"keys\[1\] is inf, must be a finite"):
        space.from_keys([0.0, np.inf, *[0.0] * 16])
    with pytest.raises(BlastEnvError, match=r"choices\[1\] is 1\.9, must be an integer from 0 to"):
        space.layout(np.array([0, 1.9, *[0] * (len(space.choices) - 2)], dtype=object))
    with pytest.raises(BlastEnvError, match=r"choices\[0\] is 9, must be an integer from 0 to 2"):
        space.layout([9] + [0] * (len(space.places) - 1))


def test_reasons_name_each_piece_that_cannot_stand() -> None:
    problem = make("control_room-known-v2")
    reasons = problem.check(
        [Piece(0, 0, "low_wall", True), Piece(0, 0, "low_wall", True), Piece(99, 0, "low_wall")]
    )
    assert len(reasons) == 2
    assert "is taken by" in reasons[0]
    assert "outside" in reasons[1]
    assert problem.check([]) == ()
