"""The grid error: the index, the cells it takes, and where it stands."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.answers import Number
from blast_env.answers.assess import governing, response_table
from blast_env.answers.document import TYPOGRAPHIC, percent, worse
from blast_env.errors import BlastEnvError
from blast_env.evaluation import (
    Estimate,
    Evaluators,
    LoadCase,
    LoadCaseSet,
    compare,
    convergence_index,
    draw_threats,
    evaluate_layout,
)
from blast_env.evaluation.blasts import NO_BARRIER
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines import choosing_engine, final_engine, find_engine
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.evaluation.questions.verdict import consequences_by_layout
from blast_env.site import Charge, load_scenario
from blast_env.statistics import reductions
from tests.gas_sites import WALL, glazed_hut, hut, site_document
from tests.scenarios import BALLISTIC_COURTYARD

NUMBERS = st.floats(-1e6, 1e6)


def test_the_index_is_that_of_a_published_example() -> None:
    """Pressure recovery of an inlet on three grids, in NASA's tutorial on grid convergence."""
    fine, medium, coarse = 0.97050, 0.96854, 0.96178
    one = convergence_index(fine, medium, 2.0, 1.786170, 1.25) / fine
    other = convergence_index(medium, coarse, 2.0, 1.786170, 1.25) / medium
    assert one == pytest.approx(0.00103083, rel=1e-4)
    assert other == pytest.approx(0.00356244, rel=2e-4)


def test_with_two_sizes_it_is_three_times_the_extrapolated_change() -> None:
    """By hand: 3 |0.48 - 0.50| / (2^2 - 1) = 0.02, and 3 * 0.02 / (2 - 1) with order 1."""
    assert convergence_index(0.48, 0.50) == pytest.approx(0.02)
    assert convergence_index(0.48, 0.50, order=1.0) == pytest.approx(0.06)


@given(NUMBERS, NUMBERS)
def test_it_has_no_sign(one: float, other: float) -> None:
    assert convergence_index(one, other) == convergence_index(other, one) >= 0.0
    assert convergence_index(-one, -other) == convergence_index(one, other)
    assert convergence_index(one, one) == 0.0


@pytest.mark.parametrize(
    ("name", "value"), [("ratio", 1.0), ("order", 0.0), ("factor", -1.25), ("ratio", float("nan"))]
)
def test_nonsense_is_refused(name: str, value: float) -> None:
    with pytest.raises(BlastEnvError, match=f"{name} is .*, must be above"):
        convergence_index(1.0, 2.0, **{name: value})


def test_final_cells_are_uniform_up_to_40_m_and_grow_beyond() -> None:
    small, wide = load_scenario("courtyard"), load_scenario("street_front")
    assert (small.site.width_m, wide.site.width_m > 40.0) == (40.0, True)
    assert final_engine("gas", [small]) == GasEngine(cell_m=0.25)
    assert final_engine("gas", [small, wide]) == GasEngine(cells="fine")
    assert final_engine("gas", [wide], 0.5) == GasEngine(cell_m=0.5)
    assert final_engine("gas", [small], cells="coarse") == GasEngine(cells="coarse")
    assert final_engine(GasEngine(), [wide]) == GasEngine()
    assert final_engine("event", [small]) == find_engine("event")


def test_layouts_are_chosen_on_cells_twice_as_large() -> None:
    small, wide = load_scenario("courtyard"), load_scenario("street_front")
    assert choosing_engine("gas", [small]) == GasEngine()
    assert choosing_engine("gas", [wide]) == GasEngine(cells="coarse")
    assert choosing_engine("gas", [wide], 0.5) == GasEngine()
    assert choosing_engine("gas", [wide], cells="fine") == GasEngine(cells="fine")
    assert choosing_engine("event", [wide]) == find_engine("event")


@pytest.mark.parametrize(
    ("engine", "coarser"),
    [
        (GasEngine(cell_m=0.25), GasEngine(cell_m=0.5)),
        (GasEngine(cell_m=0.125, until="walls"), GasEngine(cell_m=0.25, until="walls")),
        (GasEngine(cells="fine"), GasEngine(cells="coarse")),
        (GasEngine(cells="fine", cell_m=0.125), GasEngine(cells="coarse", cell_m=0.25)),
        (GasEngine(cell_m=0.5), None),
        (GasEngine(cells="coarse"), None),
        (GasEngine(cell_m=0.5 / 3), None),
        (find_engine("event"), None),
    ],
)
def test_the_coarser_cells_are_twice_as_large(engine: GasEngine, coarser: GasEngine | None) -> None:
    assert engine.coarser == coarser


def test_words() -> None:
    share = Number.share(0.485, 0.0141)
    assert share.text() == "48.5 % +- 1.4"
    assert share.sampled_by(Estimate(0.485, 0.464, 0.506), "charges", 0.01).text() == (
        "48.5 % +- 1.4 (cells), +- 2.1 (95 %, charges)"
    )
    assert Number.share(0.485).text() == "48.5 %"
    assert Number(1234.56, "Pa s", 12.34).text() == "1,235 Pa s +- 12"
    assert Number(-0.01234, error=0.00056).text(TYPOGRAPHIC) == "\N{MINUS SIGN}0.0123 ± 0.00056"
    assert [Number(case).text() for case in (0.0, 99.96, float("nan"))] == ["0", "100.0", "-"]
    assert [percent(case) for case in (-4e-4, -6e-4, float("nan"))] == ["0.0 %", "-0.1 %", "-"]


def test_final_statements_have_it_beside_each_number() -> None:
    """The loads on the hut by hand: fine cells, and coarse ones under the only charge."""
    fine = GasEngine(cell_m=0.25, border_m=0.0)
    evaluation = evaluate_layout(hut(), WALL, [0], engine=fine)
    protected, unprotected = (
        [
            GasBlast(hut(), layout, 0, replace(fine, cell_m=cell_m)).run().impulse("hut").pa_s
            for cell_m in (0.25, 0.5)
        ]
        for layout in (WALL, ())
    )
    gone = [reductions(*case).item() for case in zip(protected, unprotected, strict=True)]
    (row,) = evaluation.table.to_dict("records")
    assert row["reduction_error"] == pytest.approx(convergence_index(*gone))
    assert row["impulse_error_pa_s"] == pytest.approx(convergence_index(*protected))
    assert row["unprotected_impulse_error_pa_s"] == pytest.approx(convergence_index(*unprotected))
    found = evaluation.to_dict()["result"]["grid_error"]
    assert found["coarser"] == "gas, cells of 0.5 m"
    assert found["reduction"] == pytest.approx(convergence_index(*gone))
    assert found["load"] == pytest.approx(convergence_index(*protected))
    assert found["unprotected_load"] == pytest.approx(convergence_index(*unprotected))
    assert evaluation.objective_error == pytest.approx(found["load"])
    assert 0.001 < found["reduction"] < 0.05


def test_panes_have_the_error_by_the_ratio_of_the_cells() -> None:
    """A report may have any two sizes: its panes had the error of cells twice as large."""
    site, fine = glazed_hut(), GasEngine(cell_m=0.25)
    threats = [LoadCase(Charge((2.0, 4.0), 0.2))]  # breaks a part of the panes
    blasts = Campaign.on(site, {NO_BARRIER: ()}, threats, fine, fine.coarser).run(worst=governing)
    assert blasts.coarse is not None
    nearer = replace(
        blasts, engine=GasEngine(cell_m=0.5 / 3.0), coarse=replace(blasts.coarse, engine=fine)
    )
    errors = []
    for own in (blasts, nearer):
        table = response_table(own, consequences_by_layout(own))
        (panes,) = (cell for cell in table.rows[0] if isinstance(cell, Number))
        errors.append(panes.error)
    assert errors[0] > 0.0
    assert errors[1] == pytest.approx((2.0**2 - 1.0) / (1.5**2 - 1.0) * errors[0])


@pytest.mark.parametrize("engine", ["event", GasEngine(border_m=0.0)])
def test_particles_and_the_largest_cells_have_none(engine: str | GasEngine) -> None:
    site = BALLISTIC_COURTYARD if engine == "event" else hut()
    evaluation = evaluate_layout(site, (), [0], engine=engine)
    assert evaluation.to_dict()["result"]["grid_error"] is None
    assert evaluation.table["reduction_error"].isna().all()


def test_several_cases_have_that_of_the_worst_charge() -> None:
    document = site_document()
    document["charge"][0]["tnt_kg"] = 2.0
    light = hut().from_document(document, "light")
    evaluators = Evaluators(GasEngine(cell_m=0.25, border_m=0.0))
    cases = [LoadCaseSet(case, draw_threats(case, [0])) for case in (light, hut())]
    found = compare(evaluators, cases, [WALL, WALL], with_error=True)
    assert found.grid_error is not None
    assert found.every[1].coarse is not None
    assert found.every[0].coarse is None
    assert evaluators.counts.blasts == 2 * 2 + 2
    assert 0.0 < found.reduction_error < 0.05
    assert 0.0 < found.mean_error < 0.1 * found.mean.value


@pytest.mark.parametrize(("reduction", "says"), [(-0.02, True), (-0.0004, False), (0.3, False)])
def test_a_barrier_that_adds_load_is_called_worse(reduction: float, says: bool) -> None:
    assert ("makes it worse" in worse(reduction)) is says
