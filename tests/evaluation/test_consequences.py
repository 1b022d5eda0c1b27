"""What charges do to buildings, neighbours and the barrier, on a yard where a blast is cheap."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blast_env.calibration import kingery_bulmash
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.blasts import Severity
from blast_env.evaluation.engines import simulate
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.questions.verdict import (
    BuildingResponse,
    Consequences,
    bay_table,
    side_on_impulse_pa_s,
    side_on_peak_pa,
)
from blast_env.geometry import Layout
from blast_env.response import (
    BuildingDamage,
    LevelOfProtection,
    Requirement,
    peak_corrected,
    peak_factor,
    respond,
)
from blast_env.site import Charge, Scenario
from tests.blasts import consequences
from tests.builders import block, point, site_document
from tests.catalogue_sites import ITEMS, WALL, yard_document
from tests.gas_sites import glazed_hut

FACADE = {"storey_m": 2.5, "bay_m": 1.5, "glazing": "window_laminated_6", "wall": "concrete_200"}
CHARGE = Charge((2.0, 6.0), 5.0)


def site(**wall: Any) -> Scenario:
    """Return the yard with a facade on the hut, and a shed without one."""
    document = yard_document(items=[ITEMS[0] | wall, *ITEMS[1:]])
    shed = document["structures"][0] | {"name": "shed", "corner_m": [7.5, 0.5], "rows": 4}
    document["structures"][0] = document["structures"][0] | {"facade": FACADE, "faces": ["west"]}
    document["structures"].append(shed | {"protected": False})
    return Scenario.from_document(document, "yard")


def judge(
    scenario: Scenario, layout: Layout, without_fallen: bool = False, charge: Charge = CHARGE
) -> Consequences:
    evaluator = BlastEvaluator(scenario, GasEngine())
    return consequences(evaluator, layout, [charge], without_fallen=without_fallen)


@pytest.fixture(scope="module")
def found() -> Consequences:
    return judge(site(), WALL)


def test_what_stands_without_a_facade_is_a_neighbour(found: Consequences) -> None:
    (shed,) = found.worst_neighbours
    assert (shed.building, shed.wall) == ("shed", "west")
    order = [shed.probability[damage] for damage in BuildingDamage]
    assert order == sorted(order, reverse=True)
    assert 0.0 < order[0] < 1.0
    assert found.buildings == ("hut",)


def test_a_charge_that_the_engine_was_not_checked_for_is_named(found: Consequences) -> None:
    """5 kg on cells of 0.5 m, as the blast itself says."""
    result = simulate(site(), WALL, charge=CHARGE, engine=GasEngine())
    reason = "; ".join(result.impulse("hut").notes)
    assert "cells per m/kg^(1/3)" in reason
    words = "are outside the validated range of the engine, e.g."
    assert f"hut: 1 of 1 charges {words} {reason}" in found.notes
    both = Consequences.together([found, replace(found, unchecked=())])
    assert f"hut: 1 of 2 charges {words} {reason}" in both.notes


def test_no_verdict_passes_without_the_flags_of_its_loads(found: Consequences) -> None:
    """5 kg on cells of 0.5 m."""
    below = LevelOfProtection.BELOW_STANDARDS
    assert found.verdict_word(below) == "COMPLIES (flagged)"
    assert replace(found, unchecked=()).is_flagged
    # On cells fine enough, and with all loads known, nothing is left to flag.
    fine = replace(found.responses[0], peak_factor=1.5)
    is_known = all(case for case in fine.known.values())
    assert Consequences((fine,)).is_flagged is not is_known
    unprotected = Consequences((replace(fine, known={}),))
    assert unprotected.verdict_word(below) == "COMPLIES"
    assert unprotected.verdict_word(LevelOfProtection.HIGH) == "DOES NOT COMPLY"
    assert (
        replace(unprotected, unchecked=(("kiosk", "too near"),)).verdict_word(below) == "COMPLIES"
    )


def test_a_verdict_on_loads_of_a_charge_above_the_ground_is_flagged(found: Consequences) -> None:
    """Their validation status is `approximate`, which no note of the engine says."""
    fine = replace(found.responses[0], peak_factor=1.5, known={})
    assert fine.site is not None
    raised = replace(fine, site=replace(fine.site, charge=CHARGE._replace(height_m=1.0)))
    below = LevelOfProtection.BELOW_STANDARDS
    words = [Consequences((own,)).verdict_word(below) for own in (fine, raised)]
    assert words == ["COMPLIES", "COMPLIES (flagged)"]
    (note,) = Consequences((raised,)).notes
    count = len(raised.on_cells.bays)
    assert note.startswith(f"hut: the loads on {count} of {count} bays of all charges are approx")
    assert "a charge above the ground" in note


def test_bending_alone_is_no_verdict_on_a_wall_that_may_be_breached() -> None:
    """100 kg 5.5 m from the hut, 1.18 m/kg^(1/3); 5 kg there are 3.2 m/kg^(1/3) away."""
    near = judge(site(), (), charge=CHARGE._replace(tnt_kg=100.0))
    (why,) = (why for building, why in near.unchecked if building == "hut")
    assert "walls may be breached" in why
    assert "checked from 1.7 to 8.6" in why
    far = judge(site(), ())
    assert not any("breached" in why for _, why in far.unchecked)


def test_peaks_far_away_on_cells_that_have_doubled_are_flagged() -> None:
    """Coarse cells of 0.5 m are doubled after 45 m; the back of a long hut has no bays."""
    facade = {"facade": FACADE, "height_m": 2.5, "protected": True}
    front = {**facade, "faces": ["west"]}
    huts = [
        block("near", 20.0, 4.0, 4, 4, **facade),
        block("far", 50.0, 4.0, 4, 4, **facade),
        block("long", 42.0, 9.0, 4, 20, **front),
    ]
    document = site_document("street", (60.0, 12.0, 6.0), point(2.0, 5.0, 5.0), *huts)
    for cells, doubtful in (("coarse", {"far"}), ("uniform", set())):
        evaluator = BlastEvaluator(
            Scenario.from_document(document, "street"), GasEngine(cells=cells)
        )
        own = consequences(evaluator, (), [Charge((2.0, 5.0), 5.0)])
        doubts = {building for building, why in own.unchecked if "may be too low" in why}
        assert doubts == doubtful
        said = "farther than 45 m from the charge are those of cells larger than 0.5 m"
        assert any(said in note for note in own.notes) is bool(doubtful)


@pytest.mark.parametrize("scaled", [5.0, 10.0, 15.0])
def test_side_on_values_come_back_from_reflected_ones(scaled: float) -> None:
    """Kingery and Bulmash's curves in the open: peaks exactly, impulses within 8 %."""
    reflected, peak, reflected_i, impulse = (
        float(kingery_bulmash(quantity, scaled, 1.0, "hemispherical"))
        for quantity in (
            "reflected_overpressure",
            "incident_overpressure",
            "reflected_impulse",
            "incident_impulse",
        )
    )
    assert side_on_peak_pa(np.array([reflected])).item() == pytest.approx(peak, rel=0.01)
    assert side_on_impulse_pa_s(np.array([reflected_i])).item() == pytest.approx(impulse, rel=0.08)


def test_pieces_that_fall_in_time_are_taken_away(found: Consequences) -> None:
    """A wall of 500 kg is on its way when the blast is over; lighter ones do not count."""
    (barrier,) = judge(site(mass_kg=500.0), WALL, without_fallen=True).barriers
    assert barrier.taken_away == ()
    assert "overturns" in list(barrier.pieces["outcome"])
    gone = judge(site(mass_kg=60.0, friction=2.0), WALL, without_fallen=True)
    (barrier,) = gone.barriers
    assert barrier.taken_away == WALL[:2]
    assert list(barrier.pieces["piece"]) == ["post_x4.250_y4.750"]
    peaks = [case.responses[0].facade.pressure_pa.max() for case in (gone, found)]
    assert peaks[0] > peaks[1]


def test_no_verdict_passes_on_peaks_that_cells_clip() -> None:
    assert peak_factor(0.5, 5.0) == pytest.approx(1.0 + 9.3 * 0.5 / 5.0 ** (1.0 / 3.0))
    document = site().model_dump(mode="json")
    facade = FACADE | {"glazing": "window_tempered_6", "wall": "block_190"}
    document["structures"][0]["facade"] = facade
    bays = Scenario.from_document(document, "yard").bays
    time_s = np.array([0.0, 0.02, 0.021, 0.06, 0.1])
    doubted: set[bool] = set()
    for peak_pa in np.geomspace(1e3, 3e4, 30).tolist():
        history = np.tile([peak_pa, 0.0, -0.4 * peak_pa, 0.0, 0.0], (len(bays), 1))
        response = BuildingResponse("hut", CHARGE, respond(bays, time_s, history), 2.0)
        found = Consequences((response,))
        sharper = respond(bays, *peak_corrected(time_s, history, 2.0)).level_of_protection
        on_cells = response.on_cells.level_of_protection
        assert found.level("hut") == min(sharper, on_cells)
        for level in LevelOfProtection:
            turns = sharper < level <= on_cells
            assert ("sharp" in found.doubt(level)) == turns
            assert found.passes(level) == (min(sharper, on_cells) >= level)
            assert found.passes_on_cells(level) == (on_cells >= level)
            assert ("on the cells" in found.level_words("hut")) == (sharper < on_cells)
            doubted.add(turns)
    assert doubted == {False, True}


def test_no_cell_keeps_a_required_peak_by_clipping(found: Consequences) -> None:
    """As with the limits of a report."""
    (response,) = found.responses
    clipped_pa = float(response.facade.pressure_pa.max())
    assert response.counted_peak_pa > 1.2 * clipped_pa
    limits_pa = (0.9 * clipped_pa, 1.1 * clipped_pa, 1.1 * response.counted_peak_pa)
    required = [Requirement.parsed(f"peak {limit_pa / 1e3:.6f}") for limit_pa in limits_pa]
    assert [response.keeps(own) for own in required] == [False, False, True]
    assert response.keeps(Requirement.parsed("impulse 1e5"))


def test_the_table_has_a_row_a_layout_charge_and_bay(found: Consequences) -> None:
    both = {"none": judge(site(), ()), "walls": found}
    bays = bay_table(both)
    assert list(bays["layout"]) == ["none", "none", "walls", "walls"]
    assert list(bays["bay"][:2]) == ["hut/west/1/1", "hut/west/1/2"]


# --- Which of several blasts governs: levels before damage, damage before loads.


def test_levels_come_before_damage_and_damage_before_loads() -> None:
    ordered = [
        Severity(0, 9.0, 9.0),
        Severity(4, 1.0, 9.0),
        Severity(4, 2.0, 1.0),
        Severity(4, 2.0, 5.0),
    ]
    assert max(reversed(ordered), key=lambda response: response) == ordered[-1]
    assert sorted(ordered) == ordered


def test_of_buildings_below_standards_the_one_with_more_damage_governs_then_more_load() -> None:
    bays = glazed_hut().bays
    time_s = np.array([0.0, 0.001, 0.02, 0.05])

    def response(peaks_pa: np.ndarray) -> BuildingResponse:
        history = np.outer(peaks_pa, [0.0, 1.0, 0.0, 0.0])
        return BuildingResponse("hut", Charge((2.0, 4.0), 5.0), respond(bays, time_s, history))

    low = np.full(len(bays), 1e3)
    one, every = low.copy(), np.full(len(bays), 5e6)
    one[0] = 5e6
    some, more, most = (response(peaks) for peaks in (one, every, 2.0 * every))
    assert len({response.facade.level_of_protection for response in (some, more, most)}) == 1
    assert some.severity.damage < more.severity.damage <= most.severity.damage
    assert max([some, more, most], key=lambda response: response.severity) is most
    assert max([some, response(low)], key=lambda case: case.severity) is some
