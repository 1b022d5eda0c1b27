"""Results to the last bit, so that a change of results is a decision.

A digest here fails where the same blast, the same file or the same scenario has become another. If
nobody meant to change results, the change at hand is wrong: find it. If somebody did, then

- raise the version of the package, or of the engine, so that stored results, run folders and
  caches of before are not taken for those of now;
- make the stored calibrations of that engine anew (`blast-env calibrate`), and their checksums;
- write the change into CHANGELOG.md, and the new digests here, in one commit that says why.

Each digest stands beside what it depends on, the engine's version and the parameters' digest: if
one of those differs as well, that is the cause. `tests/digests.py` says on which machines a digest
of a blast holds. Elsewhere the loads hold to the bound, and the digest is skipped with the reason.
"""

from hashlib import sha256
from importlib.resources import files
from typing import Final, NamedTuple

import pytest

from blast_env.evaluation.engines import simulate
from blast_env.site import Scenario, bundled_scenarios, load_scenario, parameters_digest
from tests.builders import block, site, square, zone
from tests.digests import CONDITIONS, Condition, need_the_same_bits

LAYOUT: Final = ((4, 0), (5, 0), (6, 1))
ROUNDING: Final = 1e-5
"""Most by which another machine's load differs; one last bit of all velocities moves it by 1e-8."""


class Golden(NamedTuple):
    """The outcome of a blast, and what it depends on.

    Attributes:
        engine_version: With which the digest was made; another Numba may well give the same.
        parameters: Digest of the parameters that the engine heeds.
        barrier_sim: Impulse on the barrier, in the simulation's units.
        digest: Of the outcome.
    """

    engine_version: str
    parameters: str
    barrier_sim: float
    digest: str


def sparse_courtyard() -> Scenario:
    """Return the courtyard in sparse air; the charge is drawn along the road."""
    return load_scenario("courtyard").with_simulation("ballistic")


def dense_yard() -> Scenario:
    """Return a small yard in dense air, with friction, spin and modules that break."""
    overrides = {
        "air": {"spacing_units": 3.4, "mass": 0.2, "elasticity": 0.97, "friction": 0.6},
        "explosive": {"ball_count": 240, "elasticity": 0.97, "friction": 0.4},
        "contact": {"module_friction": 0.5, "base_impulse": 1.0},
        "stepping": {"time_limit_s": 0.1},
    }
    return site(
        "dense_yard",
        (24.0, 18.0),
        {"kind": "rectangle", "corner_m": (4.0, 7.0), "size_m": (1.0, 4.0), "tnt_kg": 20.0},
        block("house", 14.0, 6.0, 12, 4, protected=True, module_capacity=2000.0),
        square("shed", 8.0, 14.0, 4),
        build_zone=zone(8.0, 5.0, 12, 4, stock=6, module_capacity=1000.0),
        simulation={"preset": "ballistic", "overrides": overrides},
    )


SCENES: Final = {"sparse_courtyard": sparse_courtyard, "dense_yard": dense_yard}
BLASTS: Final = {
    ("sparse_courtyard", "pymunk"): Golden(
        engine_version="pymunk 7.3.1",
        parameters="26d44c291cdc5c98f83eda50f68490c22eb0779341bae1db5e6c40ab431d44aa",
        barrier_sim=61652.232809,
        digest="cb9c2de33daa75854592c07fa861267937a483f012cbc3cd4486c04c3bf82c30",
    ),
    ("sparse_courtyard", "event"): Golden(
        engine_version="event 1 (numba 0.68.1)",
        parameters="582a7d9bdce6d9f62fd19f90ad16f01b039396a847aa9d807c37b585c25e88f8",
        barrier_sim=56904.103963,
        digest="b8ca7e57cb19356ffc5c2ea03c32134e33ee4ce3b555ac39ccb5cbbdfd921cb1",
    ),
    ("dense_yard", "pymunk"): Golden(
        engine_version="pymunk 7.3.1",
        parameters="b0bb2e379ec4eee3b6bee9041e32bae74a3b15c6cd7779f627a34f75a1a7c316",
        barrier_sim=3526.779416,
        digest="205f919c4e76e4c9547f4f3c3a60055288ef1432f98730f778f04164fe9de27a",
    ),
    ("dense_yard", "event"): Golden(
        engine_version="event 1 (numba 0.68.1)",
        parameters="8e27747f9833bf85c7652150841b4c7d883a4d858929124846e7ddefae02caec",
        barrier_sim=3675.274474,
        digest="42a94c16b09787aee297dcab0da7984d4d87fc030b09811a9e8d4e28b08e7082",
    ),
}


@pytest.mark.parametrize(("scene", "engine"), BLASTS)
def test_a_blast_is_what_it_was(scene: str, engine: str) -> None:
    scenario = SCENES[scene]()
    result = simulate(scenario, LAYOUT, seed=3, engine=engine)
    golden = BLASTS[scene, engine]
    versions = f"{result.engine_version}, was {golden.engine_version}"
    assert parameters_digest(scenario.parameters, engine) == golden.parameters, versions
    barrier_sim = result.impulse_sim("barrier")
    assert barrier_sim == pytest.approx(golden.barrier_sim, rel=ROUNDING), versions
    need_the_same_bits(engine)
    assert result.digest == golden.digest, versions


def test_on_another_machine_a_digest_is_skipped_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in CONDITIONS:
        monkeypatch.setitem(CONDITIONS, name, Condition(lambda: "same", "same"))
    need_the_same_bits("gas")
    monkeypatch.setitem(
        CONDITIONS, "fused products and sums", Condition(lambda: "other", "recorded")
    )
    need_the_same_bits("event")  # which never fuses
    with pytest.raises(pytest.skip.Exception, match=r"on fused .*: made with recorded, here other"):
        need_the_same_bits("gas")


CONTENT_HASHES: Final = {
    "street_front": "b088a354e90ec7e2f011afe6c60a280ffa4d522f18023169c0879187817891b7",
    "government_forecourt": "81fda966f11e6a2df1bdba6098858def65dcdb0c1c5136090db4829f275d3981",
    "car_park": "a7e2bab6ddf9c5f92dced90091b7c7cb5773c4d46f1c1ddab2a7153ddf592fdd",
    "campus": "d5799deb8d55a7d9255402d7b8dc0dc9e4319cd4565b13e3d4a103a35d8a4729",
    "clinic_front": "d2fc02932afa74582250ccb52aea44d016093c32f7caea6bf4e0582c31c3a036",
    "control_room": "f0b4d497dccfd3fb5c7fa88a4d7442000a78207db5b421985695c92a320c52d6",
    "courtyard": "76c48339ea3f457b906e152fbc0abd85ec13b276c4ecda0be3a9c6dcc0131cb7",
    "free_field": "2356d490bee5e2af05f7c80a219c16f8ceb886210f1e0a53aa86954cd4b1ac54",
    "guard_post": "3af6055e299e890df10ead2a60427c9acd0c5ada29aabbc46bae005948a8b5de",
    "hotel_forecourt": "9b5360183b00680dc721c96579e47652bc6abe59af04289e67d32bae9f932c69",
    "ministry_kerb": "82c433ab302fd18f47b4dd6db7aece86e894f3a3803265551b017d64e18b6d7c",
    "perimeter_gate": "06955a399c03dbe9aad722de7981e16cb7405f389b4c56d1034d496c08e1a94d",
    "school_and_clinic": "e7108ad01f9785be89d65ae66993d201b389c62a96647a8958b896f78e93ac6a",
    "school_wing": "d126f782267a92b2807d52648ac3bc0d87d33376edd0e2204ebb41ad2e61ec7e",
    "shopping_street": "fc400c0490aff067a563d800e38ec8f09d76fd246359914dfb8171af907a1004",
    "street_junction": "57291072154f0caa826fe1cb6e4e0682b528042494dd445e303e23d0f1557ff2",
    "visitor_entrance": "5bffa26f5e878df20c765c6d284d7b247fd49a4b5c286013580a98c04dbc0297",
}


def test_the_bundled_scenarios_are_what_they_were() -> None:
    assert {name: load_scenario(name).content_hash for name in bundled_scenarios()} == (
        CONTENT_HASHES
    )


DATA: Final = {
    "ballistic_kb_100kg.event.json": "73c0093c99eb55db396460eb68f76b7d",
    "ballistic_kb_100kg.pymunk.json": "55f36cfd974f803625f8e8e64b8a14b6",
    "ballistic_ufc.event.json": "cd80f3d8e32913e34b5fda0b74216939",
    "ballistic_ufc.pymunk.json": "a679736a659cba77672144860911ab84",
    "collisional_fine_kb.event.json": "7150162b624fa65d6827f96a34829759",
    "collisional_kb.event.json": "25691f05b6a25db6594e55984bd9050e",
    "collisional_kb.pymunk.json": "b694d6b01615d1ff73bb311a0f65ec60",
    "collisional_kb_1000kg.event.json": "aebcfaf86875f61538ba77e5d42ef5b2",
    "collisional_kb_20kg.event.json": "033479cf0fce4cf31b854576bf8febf6",
    "kingery_bulmash.json": "3e08a2fc57a92b7c8ff8aba851d2eafa",
    "paper_tables.csv": "35786679504739d998d0ed93ddd66445",
}
"""First half of the SHA-256 of the calibrations, and of the files that they are made from."""


def test_the_stored_calibrations_are_what_they_were() -> None:
    folder = files("blast_env.particles.calibration")
    curves = files("blast_env.curves")
    stored = [*(folder / "stored").iterdir()]
    stored += [*(folder / "data").iterdir(), *(curves / "data").iterdir()]
    found = {
        entry.name: sha256(entry.read_bytes()).hexdigest()[:32]
        for entry in stored
        if entry.name.endswith((".json", ".csv"))
    }
    assert found == DATA
