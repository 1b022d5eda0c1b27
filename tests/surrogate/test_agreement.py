"""Guesses agree with gas dynamics about what has a load, and what it is the load of."""

import json
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from blast_env.design.search import Guesses
from blast_env.errors import BlastEnvError
from blast_env.evaluation import (
    BlastEvaluator,
    BlastLoads,
    Evaluators,
    LoadCase,
    LoadCaseSet,
    draw_threats,
    evaluate_layout,
)
from blast_env.evaluation.engines.contract import EngineBlast
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.geometry import Layout
from blast_env.rules import layouts_by_rule, random_layout
from blast_env.site import Charge, Scenario, load_scenario, save_scenario
from blast_env.surrogate import CLOSE, SurrogateEngine, packaged_surrogate, site_of
from tests.catalogue_sites import WALL, yard_document
from tests.cli.running import run
from tests.evaluation.test_walls_without_verdict import CHARGE, WALLS, site
from tests.site.test_removable import AWAY, fenced

SURROGATE = SurrogateEngine()
COARSE = GasEngine.with_cells("coarse")


def known(loads: BlastLoads) -> dict[str, bool]:
    return {load.name: bool(np.isfinite(load.impulse_pa_s)) for load in loads.protected}


@pytest.mark.parametrize(
    ("others", "layout"),
    [
        ((), ()),
        (("other",), ()),
        (("other",), WALLS[:1]),
        (("other",), WALLS),
        (("other", "house"), WALLS),
        (("porch", "house"), ()),
        (("annex",), ()),
    ],
)
def test_what_no_air_touches_has_no_load(others: tuple[str, ...], layout: Layout) -> None:
    """The surrogate had guessed one, as if the wall stood in the open."""
    scenario = site(*others)
    guessed, computed = (
        engine.loads(scenario, layout, CHARGE, 0) for engine in (SURROGATE, COARSE)
    )
    assert known(guessed) == known(computed)
    assert guessed.without_load == computed.without_load
    assert np.isnan(guessed.protected_impulse_pa_s) == np.isnan(computed.protected_impulse_pa_s)
    guess = packaged_surrogate().guess(site_of(scenario), [layout], [CHARGE])
    own = guess.loads(site_of(scenario))
    np.testing.assert_allclose(own, [guessed.protected_impulse_pa_s], rtol=1e-9)


def test_no_search_by_guesses_likes_to_hide_a_building() -> None:
    scenario = site("other")
    case = LoadCaseSet(scenario, (LoadCase(CHARGE),))
    guesses = Guesses.of(packaged_surrogate(), case)
    bare, hidden = guesses.loads([(), WALLS])
    assert 0.0 < bare < hidden
    assert guesses.ranked() == [(), WALLS]
    covered = replace(case, scenario=site("porch"))
    with pytest.raises(BlastEnvError, match="lane: no load without a barrier on front: no air"):
        Guesses.of(packaged_surrogate(), covered)
    env = gym.make("BlastBarrier-v0", scenario=scenario, engine=SURROGATE, reward="relative")
    env.reset(seed=0, options={"layout": WALLS})
    *_, paid, _, _, info = env.step(env.get_wrapper_attr("finish"))
    assert (paid, info["reduction"]) == (0.0, 0.0)


def test_what_a_layout_takes_away_stops_nothing_any_more() -> None:
    """The surrogate had left it standing."""
    scenario, never = fenced(), Scenario.from_document(yard_document(), "yard")
    charge = draw_threats(scenario, [0])[0].charge
    there, away = SURROGATE.loads_at_once(
        [EngineBlast(scenario, layout, charge, 0) for layout in (WALL, (*WALL, AWAY))]
    )
    alone = SURROGATE.loads(never, WALL, charge, 0)
    assert [load.name for load in away.structures] == ["hut"]
    assert [load.name for load in there.structures] == ["hut", "fence"]
    assert away.protected_impulse_pa_s == alone.protected_impulse_pa_s
    assert there.protected_impulse_pa_s < away.protected_impulse_pa_s


def test_the_load_of_a_building_is_the_mean_over_the_area_of_its_parts(tmp_path: Path) -> None:
    """Weights of the parts had taken the place of areas, which gas dynamics takes."""
    document = site("house").model_dump(mode="json", exclude_none=True)
    front, house = document["structures"]
    front["building"] = house["building"] = "school"
    house |= {"corner_m": [8.0, 6.0], "rows": 4}
    scenario = Scenario.from_document(document, "school")
    for engine in (SURROGATE, COARSE):
        loads = BlastEvaluator(scenario, engine, cache=tmp_path).loads((), LoadCase(CHARGE))
        one, other = (load.impulse_pa_s for load in loads.structures)
        mean = (8 * one + 4 * other) / 12
        assert loads.protected_impulse_pa_s == pytest.approx(2.0 * mean, rel=1e-9)
    guess = packaged_surrogate().guess(site_of(scenario), [()], [CHARGE])
    again = SURROGATE.loads(scenario, (), CHARGE, 0).protected_impulse_pa_s
    assert guess.loads(site_of(scenario)).item() == pytest.approx(again, rel=1e-9)


def test_a_load_that_is_not_predicted_is_a_dash_and_null(tmp_path: Path) -> None:
    """It had been 0, and that on a module the impulse of its structure in the unit of momentum."""
    save_scenario(site("other"), tmp_path / "site.toml")
    (tmp_path / "layout.json").write_text("[]")
    files = ("--scenario", tmp_path / "site.toml", "--layout", tmp_path / "layout.json")
    done = run("evaluate", *files, "--engine", "surrogate")
    (row,) = (line.split() for line in done.output.splitlines() if line.startswith("other "))
    assert row[1:6] == ["no", "-", "-", "-", "-"]
    assert "note: other: not protected, so not predicted" in done.output
    found = json.loads(run("evaluate", *files, "--engine", "surrogate", "--json").stdout)
    loads = {row["structure"]: row["impulse_pa_s"] for row in found["structures"]}
    assert loads["front"] > 0.0
    assert loads["other"] is None
    modules = evaluate_layout(
        site("other"), (), threats=[LoadCase(CHARGE)], engine=SURROGATE
    ).module_table
    assert len(modules) == 32
    assert modules["impulse_n_s"].isna().all()


@pytest.mark.parametrize("engine", ["gas", "surrogate"])
def test_the_same_walls_are_another_site_as_parts_of_one_building(engine: str) -> None:
    """Loads of the first had been those of the second: the hash of a site has no buildings."""
    bare = site("house")
    weighted = (bare.structures[0], bare.structures[1].model_copy(update={"weight": 3.0}))
    apart = bare.model_copy(update={"structures": weighted})
    structures = tuple(own.model_copy(update={"building": "school"}) for own in apart.structures)
    together = apart.model_copy(update={"structures": structures})
    used = COARSE if engine == "gas" else SurrogateEngine()
    evaluators = Evaluators(used)
    front, house = (
        load.impulse_pa_s for load in evaluators.of(apart).loads((), LoadCase(CHARGE)).structures
    )
    first, second = (
        evaluators.of(scenario).loads((), LoadCase(CHARGE)).protected_impulse_pa_s
        for scenario in (apart, together)
    )
    assert first == pytest.approx(front + 3.0 * house)
    assert second == pytest.approx(2.0 * (front + house))
    own = used.loads(together, (), CHARGE, 0)
    assert [load.building for load in own.structures] == ["school", "school"]
    assert second == own.protected_impulse_pa_s


def test_an_evaluation_by_guesses_says_how_sure_they_are() -> None:
    """Intervals had been dropped, also far outside the fit, where they are wide."""
    scenario, surrogate = site("other"), packaged_surrogate()
    layout = WALLS[:1]
    found = evaluate_layout(scenario, layout, threats=[LoadCase(CHARGE)], engine=SURROGATE)
    (said,) = (note for note in found.notes if note.startswith("95 % intervals"))
    guess = surrogate.guess(site_of(scenario), [layout], [CHARGE])
    ends = surrogate.lower_ends(guess), surrogate.upper_ends(guess)
    low, high = (f"{end.impulse_pa_s.item():,.0f} Pa s" for end in ends)
    assert said.endswith(f"without barrier, {low} to {high} with")
    above = Charge((7.0, 4.0), 0.1, 6.0)
    rough = evaluate_layout(scenario, (), threats=[LoadCase(above)], engine=SURROGATE)
    assert any(note.startswith("95 % intervals") for note in rough.notes)
    unchecked = replace(surrogate, fit=surrogate.fit.model_copy(update={"impulse": None}))
    bare = evaluate_layout(
        scenario, (), threats=[LoadCase(CHARGE)], engine=SurrogateEngine(unchecked)
    )
    assert "the surrogate has no intervals: its errors are not known" in bare.notes


def test_each_bay_responds_to_its_own_load() -> None:
    """The post's bays had responded to the mean over both fronts: no hazard, where gas has one."""
    scenario = load_scenario("guard_post")
    charge = Charge((17.0, 0.5), 31.0)
    guessed, computed = (
        engine.loads(scenario, (), charge, 0) for engine in (SURROGATE, GasEngine())
    )
    worst = [
        {bay.name: max(bay.damage.values()) for bay in loads.bays} for loads in (guessed, computed)
    ]
    assert worst[0] == pytest.approx(worst[1], rel=0.2)
    (said,) = SURROGATE.doubts(scenario, (), charge)
    assert said.endswith("set on whole buildings: bays err more")
    assert worst[0]["post/south/1/1"] > 4.0 > 2.0 > worst[0]["post/west/1/1"]


def test_the_load_on_a_structure_is_that_of_its_bays() -> None:
    """Its mean impulse and largest peak, for a polygon and several storeys, too."""
    surrogate = packaged_surrogate()
    for name in ("guard_post", "car_park"):
        scenario = load_scenario(name)
        layout = random_layout(scenario, np.random.default_rng(0))
        (threat,) = draw_threats(scenario, [0])
        charge = threat.charge_against(scenario, layout)
        bays, whole = (
            surrogate.guess(site, [layout], [charge])
            for site in (site_of(scenario), site_of(scenario, spacing=CLOSE))
        )
        np.testing.assert_allclose(bays.impulse_pa_s, whole.impulse_pa_s, rtol=0.05)
        assert bays.on_bays is not None
        assert whole.on_bays is None
        areas_m2 = np.array([bay.area_m2 for bay in SURROGATE.loads(scenario, layout, charge).bays])
        assert bays.on_bays.impulse_pa_s.shape == (1, len(areas_m2))
        if name == "guard_post":  # in the car park networks are far apart, and means are trimmed
            mean = float(bays.on_bays.impulse_pa_s[0] @ areas_m2 / areas_m2.sum())
            assert mean == pytest.approx(bays.impulse_pa_s.item(), rel=0.02)


def test_searches_by_guesses_are_on_the_safe_side_where_facades_respond() -> None:
    """A search would find layouts just before a step of the response; without intervals it must."""
    scenario, surrogate = load_scenario("guard_post"), packaged_surrogate()
    case = LoadCaseSet(scenario, (LoadCase(Charge((17.0, 0.5), 31.0)),))
    layout = layouts_by_rule(scenario)["long wall near the building"]
    site = site_of(scenario)
    guess = surrogate.guess(site, [layout], [Charge((17.0, 0.5), 31.0)])
    above = surrogate.upper_ends(guess, 2.0)
    plain, upper = (own.loads(site, [layout]) for own in (guess, above))
    assert plain < upper
    assert Guesses.of(surrogate, case).loads([layout]) == case.objective_value(upper, layout)
    bare = replace(surrogate, fit=surrogate.fit.model_copy(update={"impulse": None}))
    assert Guesses.of(bare, case).loads([layout]) == case.objective_value(plain, layout)
