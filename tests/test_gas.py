"""Blasts of gas dynamics from a scenario to loads: sums that must agree, symmetry, bad input."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import openpyxl
import pytest

import blast_env
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import BlastEvaluator, LoadCase, evaluate_layout
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.evaluation.validation import NOT_KNOWN
from blast_env.gas import Gas, GasGrid, GasRun
from blast_env.results import EndReason
from blast_env.site import Charge
from tests.builders import block, zone
from tests.gas_sites import WALL, hut

HUT = hut()


@pytest.fixture(scope="module")
def unprotected() -> GasResult:
    return blast_env.simulate(HUT, engine="gas")


@pytest.fixture(scope="module")
def protected() -> GasResult:
    return blast_env.simulate(HUT, WALL, engine="gas")


def test_faces_modules_and_structures_add_up(unprotected: GasResult) -> None:
    """The same momentum, however it is cut up; all four walls, not the roof."""
    faces = unprotected.faces[unprotected.faces["face"] != "roof"]
    area_m2 = 0.5**2
    total = float((faces["impulse_pa_s"] * area_m2).sum())
    walls = unprotected.modules[unprotected.modules["face"] != "roof"]
    of_modules = float((walls["impulse_pa_s"] * walls["area_m2"]).sum())
    (row,) = unprotected.structures.to_dict("records")
    assert of_modules == pytest.approx(total)
    assert row["impulse_pa_s"] * row["area_m2"] == pytest.approx(total)
    assert unprotected.module_impulse_n_s.sum() == pytest.approx(total)
    assert row["area_m2"] == 4 * 2.0 * 2.0
    assert unprotected.impulse("hut").pa_s == pytest.approx(row["impulse_pa_s"])


def test_the_wall_that_sees_the_charge_takes_most(unprotected: GasResult) -> None:
    (row,) = unprotected.structures.to_dict("records")
    assert row["most_loaded_face"] == "west"
    of_walls = unprotected.faces.groupby("face")["impulse_pa_s"].mean()
    assert of_walls["west"] > 2.0 * of_walls["north"] > 2.0 * of_walls["east"] > 0.0
    assert row["roof_impulse_pa_s"] == pytest.approx(of_walls["roof"])


def test_a_named_wall_is_the_one_that_counts(unprotected: GasResult) -> None:
    document = HUT.model_dump(mode="json", exclude_none=True)
    document["structures"][0]["faces"] = ["west"]
    west = blast_env.simulate(blast_env.Scenario.from_document(document, "west"), engine="gas")
    mean = unprotected.faces[unprotected.faces["face"] == "west"]["impulse_pa_s"].mean()
    assert west.impulse("hut").pa_s == pytest.approx(float(mean))


def test_a_wall_protects_and_is_itself_loaded(unprotected: GasResult, protected: GasResult) -> None:
    assert protected.impulse("hut").pa_s < 0.95 * unprotected.impulse("hut").pa_s
    barrier = protected.modules[protected.modules["structure"] == "barrier"]
    assert barrier["impulse_pa_s"].max() > unprotected.modules["impulse_pa_s"].max()
    assert set(protected.structures["structure"]) == {"hut"}
    front, behind = unprotected.gauges.to_dict("records")
    assert front["peak_pa"] > 3.0 * behind["peak_pa"]
    assert front["arrival_s"] < behind["arrival_s"]


def test_a_run_is_a_function_of_its_arguments(unprotected: GasResult) -> None:
    """Not of the seed, where the charge is fixed; and of the cells."""
    again = blast_env.simulate(HUT, seed=5, engine="gas")
    assert again.digest == unprotected.digest
    assert (
        GasRun(GasEngine(threads=2), unprotected.run.site).grid.shape == unprotected.run.grid.shape
    )
    finer = GasBlast(HUT, engine=GasEngine(cell_m=0.25, until=0.03)).run()
    coarse = GasBlast(HUT, engine=GasEngine(until=0.03)).run()
    assert finer.impulse("hut").pa_s == pytest.approx(coarse.impulse("hut").pa_s, rel=0.1)


def test_a_run_ends_when_its_loads_are_known(unprotected: GasResult) -> None:
    """Four times as long they are the same."""
    assert unprotected.end_reason is EndReason.LOADS_KNOWN
    assert unprotected.structures["known"].all()
    late = blast_env.simulate(HUT, engine="gas", until=4.0 * unprotected.time_s)
    assert late.end_reason is EndReason.TIME_ASKED
    assert late.time_s >= 4.0 * unprotected.time_s
    assert late.impulse("hut").pa_s == pytest.approx(unprotected.impulse("hut").pa_s, rel=0.003)
    assert not any(NOT_KNOWN in note for note in late.impulse("hut").notes)
    cut = blast_env.simulate(HUT, engine="gas", until=0.01)
    assert any(NOT_KNOWN in note for note in cut.impulse("hut").notes)
    assert not cut.structures["known"].any()


SHED = block("shed", 4.5, 6.0, 2, 2, height_m=2.0)


@pytest.fixture(scope="module")
def yard() -> blast_env.Scenario:
    """A shed that nobody protects; of the hut only the wall before the charge counts."""
    document = HUT.model_dump(mode="json", exclude_none=True)
    document["structures"][0]["faces"] = ["west"]
    document["structures"].append(SHED)
    return blast_env.Scenario.from_document(document, "yard")


@pytest.mark.parametrize("until", ["structures", "walls", "gauges"])
def test_a_load_that_counts_as_known_stays(yard: blast_env.Scenario, until: str) -> None:
    """Of each wall, lee walls among them, and each gauge: against a blast four times as long."""
    result = blast_env.simulate(yard, engine="gas", until=until)
    late = blast_env.simulate(yard, engine="gas", until=4.0 * result.time_s)
    assert result.end_reason is EndReason.LOADS_KNOWN
    waited_for = {"structures": result.structures.head(1), "gauges": result.gauges}
    assert waited_for.get(until, result.walls)["known"].all()
    for shown, later in ((result.walls, late.walls), (result.gauges, late.gauges)):
        missed = 1.0 - shown["impulse_pa_s"] / later["impulse_pa_s"]
        assert (missed[shown["known"]] <= 0.01).all()


def test_a_load_that_nobody_waited_for_does_not_blame_the_end(yard: blast_env.Scenario) -> None:
    """The run had ended because other loads were known; the shed is far behind the hut here."""
    document = yard.model_dump(mode="json", exclude_none=True)
    document["site"]["width_m"] = 24.0
    document["structures"][1]["corner_m"] = [22.0, 6.0]
    result = blast_env.simulate(blast_env.Scenario.from_document(document, "far"), engine="gas")
    assert not result.structures.set_index("structure")["known"]["shed"]
    (note,) = [note for note in result.impulse("shed").notes if NOT_KNOWN in note]
    assert note == f"{NOT_KNOWN}: take until='walls' to wait for it"
    assert not any(NOT_KNOWN in note for note in result.impulse("hut").notes)


def test_to_wait_for_all_walls_takes_longer_and_changes_no_load_before(
    yard: blast_env.Scenario,
) -> None:
    short, long = (blast_env.simulate(yard, engine="gas", until=u) for u in ("structures", "walls"))
    assert short.time_s < long.time_s
    same = blast_env.simulate(yard, engine="gas", until=str(short.time_s))
    assert same.steps == short.steps
    assert same.structures.equals(short.structures)


@pytest.mark.parametrize("until", ["wall", "-1", 0.0, float("nan"), True, None])
def test_what_a_run_can_wait_for_is_named(until: object) -> None:
    with pytest.raises(BlastEnvError, match=r"until is .*'structures', 'walls', 'gauges' or sec"):
        GasEngine(until=until)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("charge", "radius_m"),
    [
        (Charge((2.0, 4.0), 5.0), 2.0),  # the zone, if it is the nearest
        (Charge((2.0, 1.5), 5.0), np.hypot(2.0, 1.0)),  # its corner
        (Charge((2.0, 0.5), 5.0), 2.5),  # where the cells begin to grow
        (Charge((2.0, 4.0), 5.0, 1.75), 1.75),  # the ground below
        (Charge((8.5, 6.5), 5.0), np.hypot(0.5, 1.5)),  # the hut
        (Charge((4.5, 4.25), 5.0), 1.0),  # in the zone: two cells
        (Charge((3.75, 4.0), 5.0), 1.0),  # right before it
        (Charge((2.0, 4.0), 500.0), 2.0),
        (Charge((4.5, 4.0), 500.0, 3.0), 1.5),  # over the zone
    ],
)
def test_all_layouts_take_a_charge_over_at_one_radius(charge: Charge, radius_m: float) -> None:
    """Loads depend on it: a barrier that moved it would seem to do what it doesn't."""
    in_the_way = 3.0 < charge.position_m[0] < 5.0
    layouts = ((), ((0, 1),)) if in_the_way else ((), ((0, 1),), WALL)
    runs = []
    for layout in layouts:
        blast = GasBlast(HUT, layout, charge=charge)
        runs.append(blast.start().run)
    assert runs[0].remap_radius_m == pytest.approx(radius_m)
    assert len({(run.remap_radius_m, run.time_s) for run in runs}) == 1


def test_a_charge_that_hangs_or_lies_close_is_flagged_or_runs() -> None:
    hanging = blast_env.simulate(HUT, engine="gas", charge=Charge((2.0, 4.0), 5.0, 1.5))
    assert hanging.impulse("hut").pa_s > 0.0
    close = blast_env.simulate(HUT, engine="gas", charge=Charge((5.25, 4.0), 5.0))
    assert any("from a solid" in note for note in close.impulse("hut").notes)
    assert not close.impulse("hut").in_range


def test_an_evaluation_takes_one_realisation_a_charge() -> None:
    evaluator = BlastEvaluator(HUT, "gas")
    threats = [LoadCase(HUT.sample_charge(np.random.default_rng(0)), seed) for seed in range(4)]
    loads = evaluator.loads_of_many([(WALL, threat) for threat in threats])
    assert evaluator.counts.blasts == 1
    assert evaluator.calibration_name == "none"
    assert len({load.protected_impulse_pa_s for load in loads}) == 1
    evaluation = evaluate_layout(HUT, WALL, range(2), engine="gas", cell_m=0.5)
    assert 0.05 < evaluation.mean_reduction < 0.6
    assert evaluation.to_dict()["calibration"] == "none"


def test_particles_say_that_they_know_no_heights() -> None:
    document = HUT.model_dump(mode="json", exclude_none=True) | {
        "simulation": {"preset": "ballistic"},
        "calibration": "ballistic_kb_100kg",
    }
    document["charge"][0]["tnt_kg"] = 100.0
    scenario = blast_env.Scenario.from_document(document, "hut")
    evaluation = evaluate_layout(scenario, WALL, range(2), engine="event")
    assert any("no heights" in note for note in evaluation.notes)


def test_files_have_the_tables(unprotected: GasResult, tmp_path: Path) -> None:
    workbook = openpyxl.load_workbook(unprotected.to_excel(tmp_path / "gas.xlsx"))
    assert workbook.sheetnames == ["Run", "Structures", "Walls", "Modules", "Gauges", "Columns"]
    assert workbook["Structures"].max_row == 2
    assert workbook["Modules"].max_row == len(unprotected.modules) + 1


def test_a_gauge_deep_in_a_wall_records_the_air_on_small_cells_too() -> None:
    """It may be a module deep, which is more than one cell of 0.25 m."""
    site = hut(gauges=[{"name": "deep", "position_m": [6.45, 4.1, 0.6]}])
    result = blast_env.simulate(site, engine="gas", cell_m=0.25, until=1e-3)
    assert result.gauges["x_m"].tolist() == [5.875]
    assert any("inside a solid" in note for note in result.gauge_notes)


def test_a_gauge_deep_under_pieces_records_the_nearest_air() -> None:
    """A blast had ended by an error where a layout buries a gauge."""
    site = hut(
        build_zone=zone(3.0, 2.5, 6, 6, stock=36, height_m=1.5),
        gauges=[{"name": "buried", "position_m": [4.6, 4.1, 0.25]}],
    )
    layout = [(row, column) for row in range(6) for column in range(6)]
    result = blast_env.simulate(site, layout, engine="gas", until=1e-3)
    assert result.gauges["z_m"].tolist() == [1.75]  # over the pieces
    assert any("gauge buried: lies inside a solid" in note for note in result.gauge_notes)


@pytest.mark.parametrize("after", [0, 2])
def test_too_little_memory_names_the_cells(unprotected: GasResult, after: int) -> None:
    """Before the first step, or in the middle of a run."""
    words = (
        r"a blast of [\d,]+ cells of 0\.5 m and \d+ steps needs some .* GiB, which .*: take larger"
    )

    class Greedy:
        """A recorder for which the memory is too small from a step on."""

        def __init__(self, grid: GasGrid) -> None:
            if not after:
                raise MemoryError

        def record(self, solver: Gas, step_s: float) -> None:
            if solver.steps >= after:
                raise MemoryError

    with pytest.raises(BlastEnvError, match=words):
        GasRun(GasEngine(), unprotected.run.site, lambda grid: [Greedy(grid)]).advance(1.0)


def test_bad_input_is_named(unprotected: GasResult) -> None:
    with pytest.raises(UnknownNameError, match="'front'"):
        unprotected.history("frnt")
    with pytest.raises(UnknownNameError, match="'hut'"):
        unprotected.impulse("hat")
    with pytest.raises(BlastEnvError, match=r"cell_m is 0.3, must be 0.5 m, .* whole number"):
        blast_env.simulate(HUT, engine="gas", cell_m=0.3)
    with pytest.raises(BlastEnvError, match=r"cell_m is 0\.5, but engine 'event' has no cells"):
        evaluate_layout(HUT, WALL, engine="event", cell_m=0.5)
    with pytest.raises(BlastEnvError, match="inside a solid cell"):
        GasRun(GasEngine(), replace(unprotected.run.site, charge=Charge((7.0, 4.0), 5.0)))
    with pytest.raises(BlastEnvError, match=r"would need .* GiB, must be at most 8"):
        GasRun(GasEngine(cell_m=0.5 / 64), unprotected.run.site)
    with pytest.raises(BlastEnvError, match=r"would take .* h of a core, must be at most 6: take"):
        GasRun(GasEngine(until=1e5), unprotected.run.site)
    with pytest.raises(BlastEnvError, match=r"cells is 'large', must be one of 'uniform', 'coarse"):
        blast_env.simulate(HUT, engine="gas", cells="large")


@pytest.mark.parametrize(
    ("charge_m", "base_m", "away_m"),
    [(0.0, 0.0, 4.0), (1.5, 0.0, 4.0), (5.0, 0.0, 5.0), (0.0, 3.0, 5.0)],
)
def test_scaled_distance_is_that_of_the_nearest_point(
    unprotected: GasResult, charge_m: float, base_m: float, away_m: float
) -> None:
    """4 m away in plan; a charge beside a wall is no farther off than its height in plan."""
    site = unprotected.run.site
    hut = replace(site.structures[0], base_m=base_m, height_m=base_m + 2.0)
    raised = replace(site, charge=site.charge._replace(height_m=charge_m))
    found = raised.scaled_distance(hut)
    assert found == pytest.approx(away_m / site.charge.tnt_kg ** (1.0 / 3.0))
