"""Threats that depend on the layout: a vehicle's charge, with the barrier and without it."""

import numpy as np
import pytest

from blast_env.evaluation import (
    BlastEvaluator,
    Evaluation,
    Evaluators,
    LoadCase,
    LoadCaseSet,
    compare,
    draw_threats,
    evaluate_layout,
)
from blast_env.evaluation.cases import search_set
from blast_env.evaluation.engines import simulate
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.layout import build_site, charge_against, worst_places
from blast_env.site import Charge, VehicleCharge
from tests.vehicle_sites import POSTS, gate_site, vehicle_document, vehicle_of

SITE = gate_site(vehicle_document(places=2), calibration="ballistic_kb_100kg")
SOURCE = vehicle_of(SITE)
GAS = GasEngine()


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    """Posts against two places, by gas."""
    return evaluate_layout(SITE, POSTS, seeds=range(2), engine=GAS)


def test_each_threat_is_at_its_own_worst_place_with_the_posts_and_without(
    evaluation: Evaluation,
) -> None:
    with_posts, unprotected = worst_places(SITE, SOURCE, POSTS), worst_places(SITE, SOURCE)
    for rank, outcome in enumerate(evaluation.outcomes):
        assert outcome.threat == LoadCase(VehicleCharge(SOURCE, rank), rank)
        assert outcome.charge.position_m == with_posts.places_m[rank]
        assert outcome.stand_off_m == pytest.approx(with_posts.distances_m[rank])
        assert outcome.unprotected_stand_off_m == pytest.approx(unprotected.distances_m[rank])
        charge = Charge(unprotected.places_m[rank], 5.0)
        alone = simulate(gate_site(), charge=charge, engine=GAS)
        assert outcome.unprotected_impulse_pa_s == pytest.approx(alone.impulse("hut").pa_s)
    assert evaluation.mean_reduction > 0.5  # distance does that, not the posts of 1 m
    table = evaluation.threat_table
    assert table["stand_off_m"].tolist() == pytest.approx(list(with_posts.distances_m))
    assert table["charge_x_m"].tolist() == [place[0] for place in with_posts.places_m]
    assert evaluation.to_dict()["result"]["worst"]["charge_x_m"] < 4.0


def test_the_mechanism_is_the_same_for_all_that_judge_layouts(evaluation: Evaluation) -> None:
    case = LoadCaseSet(SITE, evaluation.threats)
    together = compare(Evaluators(GAS), [case, case], [POSTS, ()])
    assert together.case_reductions.tolist() == [evaluation.mean_reduction, 0.0]


def test_more_threats_than_places_meet_the_worst_ones_again_and_cost_nothing() -> None:
    evaluator = BlastEvaluator(SITE, GAS)
    threats = draw_threats(SITE, range(5))
    ranks = [threat.charge.rank for threat in threats if isinstance(threat.charge, VehicleCharge)]
    assert ranks == list(range(5))
    loads = evaluator.loads_of_many([(POSTS, threat) for threat in threats])
    assert evaluator.counts.blasts == 2
    impulses = np.array([load.protected_impulse_pa_s for load in loads])
    assert (impulses[[0, 1, 0, 1, 0]] == impulses).all()


def test_particles_judge_a_vehicle_too() -> None:
    threat = LoadCase(VehicleCharge(SOURCE), 3)
    evaluator = BlastEvaluator(SITE, "event")
    load = evaluator.loads(POSTS, threat).protected_impulse_sim
    place = charge_against(SITE, POSTS, VehicleCharge(SOURCE))
    assert load == simulate(SITE, POSTS, 3, "event", place).impulse_sim("hut")


def test_a_blast_without_a_charge_given_has_the_vehicle_at_its_worst_place() -> None:
    for layout in ((), POSTS):
        expected = charge_against(SITE, layout, VehicleCharge(SOURCE))
        assert build_site(SITE, layout, seed=4).charge == expected


def test_a_search_meets_the_worst_places_first() -> None:
    road = {"kind": "segment", "start_m": [2.0, 2.0], "end_m": [2.0, 6.0], "tnt_kg": 5.0}
    both = gate_site(charge=[vehicle_document(), road])
    threats = search_set(both, None, 1, seed=0, charges=12).threats
    vehicles = [threat.charge for threat in threats if isinstance(threat.charge, VehicleCharge)]
    assert 0 < len(vehicles) < 12
    assert [threat.charge for threat in threats[: len(vehicles)]] == vehicles
    assert [vehicle.rank for vehicle in vehicles] == list(range(len(vehicles)))


def test_a_reduction_is_flagged_where_only_the_load_without_the_barrier_is_out_of_range() -> None:
    """Without a barrier the vehicle comes too near; the flags had been of the other load alone."""
    site = gate_site(vehicle_document(tnt_kg=20.0))
    engine = GasEngine(border_m=0.0, cell_m=0.25)
    found = evaluate_layout(site, POSTS, seeds=[0], engine=engine)
    own, bare = (
        found.blasts.records[side][0].loads.structures[0]
        for side in (found.blasts.judged, found.blasts.unprotected)
    )
    assert own.in_range
    assert not bare.in_range
    assert not found.in_range
    assert found.table["threats_in_range"].item() == 0
    assert found.threat_table["in_range"].tolist() == [False]
    assert found.table["validation"].item() == "outside"
    assert found.table["reason"].item().startswith("without a barrier, scaled distance 0.")
    (note,) = (note for note in found.notes if "outside the validated range" in note)
    assert "hut: 1 of 1 threats" in note
    assert "without a barrier, scaled distance 0." in note
