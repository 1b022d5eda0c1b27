"""'simulate': determinism, seeds, the result object, and many blasts in threads."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import joblib
import numpy as np
import pytest

from blast_env import Charge, Scenario, load_scenario, simulate
from blast_env.errors import BlastEnvError, LayoutError, UnknownNameError
from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.layout import draw_charge
from blast_env.particles import CollisionType
from blast_env.runner import run_all
from blast_env.site import ScenarioError
from tests.pieces_of_work import kill, square, workers_within
from tests.scenarios import BALLISTIC_COURTYARD as COURTYARD

LAYOUT = ((4, 0), (5, 0), (6, 1))


def digest(seed: int) -> str:
    return simulate(COURTYARD, LAYOUT, seed=seed, engine="pymunk").digest


@cache
def known() -> BlastResult:
    """The blast of seed 7."""
    return simulate(COURTYARD, LAYOUT, seed=7, engine="pymunk")


def test_one_seed_gives_one_digest_and_another_seed_another() -> None:
    assert digest(7) == known().digest
    assert digest(8) != known().digest


def test_hash_seeds_and_other_objects_in_memory_do_not_matter() -> None:
    """Chipmunk hashes pairs of addresses; the order of our records must not follow them."""
    code = (
        "import blast_env; ballast = [bytearray(997) for _ in range(12345)];"
        "courtyard = blast_env.load_scenario('courtyard').with_simulation('ballistic');"
        f"print(blast_env.simulate(courtyard, {LAYOUT}, seed=7, engine='pymunk').digest)"
    )
    printed = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONHASHSEED": "12345"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert printed.strip() == known().digest


def test_progress_does_not_change_a_blast_and_ends_at_one_or_below() -> None:
    shares: list[float] = []
    result = simulate(COURTYARD, LAYOUT, seed=7, engine="pymunk", progress=shares.append)
    assert result.digest == known().digest
    assert shares == sorted(shares)
    assert 0.0 < shares[0] <= shares[-1] <= 1.0


def test_the_layout_shifts_neither_charge_nor_fan_nor_air() -> None:
    unprotected, protected = (Blast(COURTYARD, layout, seed=3).scene for layout in ((), LAYOUT))
    assert unprotected.charge == protected.charge
    fans = [
        s.balls.position[s.balls.kind == CollisionType.ExplosionBall]
        for s in (unprotected, protected)
    ]
    assert (fans[0] == fans[1]).all()
    air = [
        s.balls.position[s.balls.kind == CollisionType.AirBall] for s in (unprotected, protected)
    ]
    kept = {tuple(position) for position in air[1].tolist()}
    assert kept < {tuple(position) for position in air[0].tolist()}


def test_a_charge_fixed_by_hand_leaves_the_fan_as_it_was() -> None:
    drawn = Blast(COURTYARD, seed=3).scene
    fixed = Blast(COURTYARD, seed=3, charge=Charge((5.0, 15.0), 100.0)).scene
    moved = np.array(fixed.charge_centre) - drawn.charge_centre
    is_fan = drawn.balls.kind == CollisionType.ExplosionBall
    fan = fixed.balls.position[fixed.balls.kind == CollisionType.ExplosionBall]
    assert fan == pytest.approx(drawn.balls.position[is_fan] + moved)


def test_charges_are_drawn_from_the_whole_threat() -> None:
    """The road of the courtyard runs from y = 6 m to y = 24 m at x = 5 m."""
    charges = [draw_charge(COURTYARD, seed) for seed in range(200)]
    y_m = np.array([charge.position_m[1] for charge in charges])
    assert {charge.position_m[0] for charge in charges} == {5.0}
    assert 6.0 <= y_m.min() < 7.0
    assert 23.0 < y_m.max() <= 24.0


def test_the_tables_agree_with_each_other() -> None:
    result = known()
    by_module = result.collisions.groupby("module_id").impulse_sim.sum()
    loaded = result.modules.set_index("module_id").impulse_sim
    assert (loaded[loaded > 0.0].sort_index() == by_module.sort_index()).all()
    for name in ("building", "barrier"):
        of_structure = result.collisions[result.collisions.structure == name]
        assert result.impulse_sim(name) == of_structure.impulse_sim.sum()
        (row,) = result.structures[result.structures.structure == name].itertuples()
        assert row.hits == len(of_structure)
        assert row.first_hit_s == of_structure.time_s.min()


@pytest.mark.parametrize(
    ("scenario", "engine", "share"), [(COURTYARD, "event", 0.3), ("courtyard", "event", 0.4)]
)
def test_a_wall_in_front_takes_load_off_the_building(
    scenario: Scenario | str, engine: str, share: float
) -> None:
    """From (5, 20) m the building is seen through x = 13 m between y = 16.4 m and y = 20 m."""
    site = load_scenario(scenario) if isinstance(scenario, str) else scenario
    rows = [(row, 0) for row in range(22, 32)]
    charge = Charge((5.0, 20.0), 100.0)
    unprotected, protected = (
        np.mean(
            [simulate(site, cells, s, engine, charge).impulse_sim("building") for s in range(2)]
        )
        for cells in ((), rows)
    )
    assert 0.0 < protected < share * unprotected


def test_more_tnt_gives_more_impulse() -> None:
    light, heavy = (
        simulate(COURTYARD, charge=Charge((5.0, 15.0), kg), engine="pymunk").impulse_sim("building")
        for kg in (50.0, 200.0)
    )
    assert heavy > 2.0 * light


def test_the_run_record_has_what_repeats_the_run() -> None:
    record = known().run_record
    assert record["scenario hash"] == COURTYARD.content_hash
    assert record["seed"] == 7
    assert record["layout (row, column)"] == "4,0 5,0 6,1"
    assert record["digest"] == known().digest
    assert str(record["engine version"]).startswith("pymunk 7")
    assert record["parameter air.spacing_units"] == 11.5


def test_layouts_and_charges_that_do_not_fit_are_refused() -> None:
    with pytest.raises(LayoutError, match=r"\(0, 99\)"):
        simulate(COURTYARD, [(0, 99)])
    with pytest.raises(ScenarioError, match="building"):
        simulate(COURTYARD, charge=Charge((29.0, 15.0), 100.0))
    with pytest.raises(BlastEnvError, match=r"charge is \(5, 12\), must be .* kg of TNT"):
        simulate(COURTYARD, charge=(5, 12))  # type: ignore[call-overload]
    with pytest.raises(ValueError, match="seed is -1"):
        simulate(COURTYARD, seed=-1)
    with pytest.raises(UnknownNameError, match="did you mean 'pymunk'"):
        simulate(COURTYARD, engine="pymonk")
    with pytest.raises(UnknownNameError, match="did you mean 'building'"):
        known().impulse_sim("bilding")


def test_a_run_on_its_way_has_no_result() -> None:
    blast = Blast(COURTYARD)
    with pytest.raises(ValueError, match="has not ended"):
        blast.result(blast.start())


# --- Many blasts in threads, and many pieces of work.


WALL = tuple((row, 0) for row in range(2, 12))


def blasts(count: int, engine: str = "event") -> list[Blast]:
    """Blasts that all differ: seeds, and every second one with a wall."""
    return [Blast(COURTYARD, WALL if seed % 2 else (), seed, engine) for seed in range(count)]


def test_threads_change_nothing() -> None:
    """Neither the order of the results nor a single bit of them; one blast may run twice."""
    again = blasts(12)
    with ThreadPoolExecutor(3) as pool:
        together = list(pool.map(Blast.run, [*again, again[3]]))
    assert [result.digest for result in together[:-1]] == [
        blast.run().digest for blast in blasts(12)
    ]
    assert together[-1].digest == together[3].digest
    assert together[-1].obstacles is not together[3].obstacles


def test_a_worker_process_that_is_killed_is_an_error() -> None:
    """As the system does when the memory is full; no traceback of a pool."""
    with pytest.raises(BlastEnvError, match="a worker process has ended"):
        run_all(kill, range(2), workers=2)
    assert run_all(square, range(4), workers=2) == [0, 1, 4, 9]


def test_joblib_may_be_told_how_many_work() -> None:
    """By whoever calls, for all that runs within; without it one item comes after the other."""
    with joblib.parallel_config("threading", n_jobs=2):
        assert run_all(square, range(4)) == [0, 1, 4, 9]
        assert run_all(workers_within, range(1)) == [2]
    assert run_all(workers_within, range(2)) == [1, 1]
