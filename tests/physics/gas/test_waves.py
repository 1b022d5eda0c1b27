"""When all waves have passed: direct ones, and echoes between walls that face each other."""

from dataclasses import replace
from math import hypot, inf

import pytest

from blast_env.engines.gas import GasEngine
from blast_env.geometry import Removal
from blast_env.physics.engine import EndReason
from blast_env.physics.gas.engine import GasRun
from blast_env.physics.gas.settings import SOUND_M_S, SWING_S
from blast_env.physics.gas.waves import Waves, watched_structures, waves_of
from blast_env.physics.scene import BlastSite
from blast_env.scenario import Scenario, load_scenario
from blast_env.scenario.build_scene import build_site
from tests.catalogue_sites import item

SMALL_KG = 0.1
SWING_M = SOUND_M_S * SWING_S * 0.1
"""How far sound comes while the waves of such a charge pass."""


def yard(height_m: float = 4.0, shops_m: tuple[float, float] = (0.0, 30.0)) -> Scenario:
    """An office in the north, 10 m from a charge, and shops 6 m from it in the south."""
    left_m, right_m = shops_m
    solid = {"kind": "ModularObstacle", "rows": 4}
    office = {"name": "office", "corner_m": (8.0, 18.0), "columns": 28, "height_m": 4.0}
    columns = round(2.0 * (right_m - left_m))
    shops = {"name": "shops", "corner_m": (left_m, 0.0), "columns": columns, "height_m": height_m}
    return Scenario.from_document(
        {
            "schema_version": 2,
            "name": "yard",
            "site": {"width_m": 30.0, "height_m": 20.0, "air_height_m": 5.0},
            "charge": [{"kind": "point", "position_m": (15.0, 8.0), "tnt_kg": SMALL_KG}],
            "structures": [
                solid | office | {"protected": True},
                solid | shops,
                solid | {"name": "shed", "corner_m": (0.0, 12.0), "columns": 2, "height_m": 1.0},
            ],
            "build_zone": {
                "corner_m": (10.0, 12.0),
                "rows": 4,
                "columns": 20,
                "budget": 5.0,
                "items": [item("post", 1, 1, 1.0)],
                "removable": [{"name": "clear", "structures": ["shops"], "cost": 1.0}],
            },
        },
        "yard",
    )


def waves(site: BlastSite) -> Waves:
    return waves_of(site, watched_structures(site, "structures"))


def lasting(site: BlastSite) -> BlastSite:
    """Return a site on which all that stands is there with every layout."""
    return replace(site, structures=tuple(replace(s, is_lasting=True) for s in site.structures))


def direct_s() -> float:
    return (hypot(14.0 - 7.0, 12.0) + SWING_M) / SOUND_M_S


def test_an_echo_comes_from_the_charge_s_mirror_image_by_the_far_corner() -> None:
    found = waves(lasting(build_site(yard())))
    way_m = hypot(7.0, 6.0 + 18.0)
    assert found.passed_s == pytest.approx((way_m + SWING_M) / SOUND_M_S)
    assert found.pause_s == pytest.approx(2.0 * 16.0 / SOUND_M_S)


@pytest.mark.parametrize(
    "scenario",
    [
        yard(height_m=1.0),  # lower than half of the office
        yard(shops_m=(0.0, 10.0)),  # beside all ways to the office
    ],
)
def test_what_throws_nothing_back_is_not_waited_for(scenario: Scenario) -> None:
    found = waves(lasting(build_site(scenario)))
    assert found.pause_s == 0.0
    assert found.passed_s == pytest.approx(direct_s())


@pytest.mark.parametrize(("bases_m", "echoes"), [((1.0, 1.0), True), ((0.0, 1.0), False)])
def test_walls_on_one_terrace_face_each_other(bases_m: tuple[float, float], echoes: bool) -> None:
    """Below shops that begin higher than the office is air."""
    site = lasting(build_site(yard()))
    ends = zip(site.structures, (*bases_m, 0.0), strict=True)
    raised = tuple(replace(each, base_m=base_m) for each, base_m in ends)
    assert (waves(replace(site, structures=raised)) == waves(site)) == echoes


def test_what_a_layout_may_take_away_is_waited_for_by_none() -> None:
    scenario = yard()
    standing, away = (build_site(scenario, layout) for layout in ((), (Removal.named("clear"),)))
    assert len(standing.structures) == len(away.structures) + 1
    assert waves(standing) == waves(away) == Waves(direct_s())


@pytest.mark.parametrize(
    ("name", "pause_s"),
    [("street_front", 0.294), ("car_park", 0.156), ("courtyard", 0.0), ("perimeter_gate", 0.0)],
)
def test_which_bundled_sites_have_late_echoes(name: str, pause_s: float) -> None:
    assert waves(build_site(load_scenario(name))).pause_s == pytest.approx(pause_s, abs=5e-4)


def test_a_load_between_facing_walls_is_complete_when_a_run_ends() -> None:
    """The pause before the first echo is no end: a tenth of the impulse comes after it."""
    engine, site = GasEngine(), lasting(build_site(yard()))
    run = engine.start_on(site)
    run.advance(direct_s())
    early_pa_s = on_office_pa_s(run)
    run.advance(inf)
    assert run.end_reason is EndReason.LOADS_COMPLETE
    later = replace(engine, until=2.0 * run.time_s).start_on(site)
    later.advance(inf)
    assert on_office_pa_s(run) == pytest.approx(on_office_pa_s(later), rel=0.03)
    assert early_pa_s < 0.9 * on_office_pa_s(later)


def on_office_pa_s(run: GasRun) -> float:
    """Return the mean impulse on the office so far."""
    return float(run.loads.positive_impulse_pa_s[run.table.structure == 0].mean())
