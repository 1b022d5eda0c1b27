"""The policy sees the cells where they are, alike wherever the charge is, and one by one."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from blast_agents.policies.features import (
    CELL_FEATURES,
    SITE_FEATURES,
    Planes,
    ZoneGeometry,
    ZoneView,
)
from blast_agents.policies.spatial import SpatialMaskablePolicy, SpatialPolicy
from blast_agents.training.agent import logits_of

import blast_env  # noqa: F401
from blast_env import load_scenario
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.observable import Observable
from blast_env.envs.planes import GridObservation
from blast_env.layout import LayoutState
from blast_env.site import Scenario
from blast_env.sites import Visibility, generate_site, turned
from tests.builders import block, point, site, zone

LENGTH_M = 10.0  # what the features of length are divided by
ALONG, ASIDE, CUT, OPEN_CUT, COVERED = (
    CELL_FEATURES.index(name) for name in ("along", "aside", "cut", "open_cut", "covered")
)
OPEN_FACADE = SITE_FEATURES.index("open_facade")
SHARE_GAIN = 10.0  # what the features of shares of the facade are multiplied by


def environment(scenario: Scenario | str = "courtyard") -> BlastBarrierEnv:
    env = gym.make(
        "BlastBarrier-v0", scenario=scenario, engine="event", observation="grid", action="place"
    ).unwrapped
    assert isinstance(env, BlastBarrierEnv)
    return env


def zone_view(planes: torch.Tensor, rows: int, columns: int, places: int = 1) -> ZoneView:
    named = Planes(planes)
    return ZoneGeometry.of(named, rows, columns, places).view(named)


def observed(env: BlastBarrierEnv, charge_m: tuple[float, float], **options: Any) -> torch.Tensor:
    planes, _ = env.reset(seed=0, options={"charge_position_m": charge_m, **options})
    return torch.as_tensor(planes)[None]


@pytest.mark.parametrize("charge_m", [(5.0, 15.0), (5.0, 8.25), (5.0, 23.0)])
def test_cells_are_measured_along_the_line_of_sight(charge_m: tuple[float, float]) -> None:
    """Against the geometry of the scenario: the observation has to give it to half a square."""
    scenario = load_scenario("courtyard")
    zone = scenario.zone
    view = zone_view(observed(environment(), charge_m), zone.rows, zone.columns)
    middle_m = np.array(scenario.structures[0].rectangle_m.centre)
    unit = (middle_m - charge_m) / np.hypot(*(middle_m - charge_m))
    for cell in ((0, 0), (39, 0), (17, 15)):
        offset_m = np.array(zone.cell_rectangle_m(cell).centre) - charge_m
        along_m, aside_m = offset_m @ unit, offset_m @ (-unit[1], unit[0])
        assert LENGTH_M * float(view.cells[0, *cell, ALONG]) == pytest.approx(along_m, abs=0.05)
        assert LENGTH_M * float(view.cells[0, *cell, ASIDE]) == pytest.approx(aside_m, abs=0.05)


def test_a_turned_site_has_the_same_features_at_the_turned_cells() -> None:
    """What is learnt on one side of a building must hold on the others."""
    document = load_scenario("courtyard").model_dump()
    document["build_zone"] |= {"rows": 16, "columns": 16, "corner_m": (13.0, 16.0)}
    document["build_zone"]["keep_outs"] = []
    document["site"] |= {"width_m": 40.0, "height_m": 40.0}
    scenario = Scenario.from_document(document, "square")
    straight = zone_view(observed(environment(scenario), (5.0, 12.0)), 16, 16)
    quarter = zone_view(observed(environment(turned(scenario, 1)), (28.0, 5.0)), 16, 16)
    expected = torch.rot90(straight.cells, 1, dims=(2, 1))
    torch.testing.assert_close(quarter.cells, expected, atol=0.02, rtol=0.0)


def test_bearings_behind_a_module_are_covered_and_others_are_not() -> None:
    env = environment()
    planes = observed(env, (5.0, 12.0), layout=[(14, 0)])
    view = zone_view(planes, 40, 16)
    covered = view.cells[0, :, :, COVERED]
    assert covered[14, 0] == 1.0
    assert covered[14, 8] == 1.0  # straight behind it
    assert covered[14, 15] == 1.0
    assert covered[30, 0] == 0.0
    assert view.barrier.sum() == 1.0


@pytest.mark.parametrize("policy_class", [SpatialPolicy, SpatialMaskablePolicy])
def test_acting_and_learning_agree_and_observations_do_not_mix(
    policy_class: type[SpatialPolicy] | type[SpatialMaskablePolicy],
) -> None:
    """PPO divides the probability in an update by that of the action: both must be the same."""
    env = environment()
    policy = policy_class(
        env.observation_space, env.action_space, lambda _: 1e-3, rows=40, columns=16, width=8
    )
    planes = torch.cat([observed(env, (5.0, y_m)) for y_m in (8.0, 12.0, 20.0)])
    actions, values, log_probability = policy(planes)
    learnt_values, learnt_log_probability, _ = policy.evaluate_actions(planes, actions)
    torch.testing.assert_close(learnt_values, values)
    torch.testing.assert_close(learnt_log_probability, log_probability)
    torch.testing.assert_close(policy.predict_values(planes[1:2]), values[1:2])


def test_another_charge_is_not_taken_for_the_one_before() -> None:
    """What stays the same in an episode is kept: it must not outlive the episode."""
    env = environment()
    arguments: dict[str, Any] = {"rows": 40, "columns": 16, "width": 8}
    used, fresh = (
        SpatialPolicy(env.observation_space, env.action_space, lambda _: 1e-3, **arguments)
        for _ in range(2)
    )
    fresh.load_state_dict(used.state_dict())
    for y_m in (8.0, 20.0):
        logits = logits_of(used, observed(env, (5.0, y_m)))
    torch.testing.assert_close(logits, logits_of(fresh, observed(env, (5.0, 20.0))))
    placed = observed(env, (5.0, 20.0), layout=[(30, 2), (31, 2)])
    assert not torch.equal(logits_of(used, placed), logits)


@pytest.mark.parametrize("seed", [10_000, 10_003, 10_005, 10_010])
def test_what_modules_hide_is_what_lines_of_sight_say(seed: int) -> None:
    """A charge that may be anywhere on a road or in a parking area, against lines drawn one by one.

    The features know the structures by their extent alone, and 96 bearings of each of 9 places.
    """
    site = generate_site(seed)
    bare_site = site.model_copy(  # the features do not say what a neighbouring building hides
        update={
            "structures": tuple(structure for structure in site.structures if structure.protected)
        }
    )
    zone = bare_site.zone
    planes = GridObservation().episode(Observable(bare_site, bare_site.charge))
    seen = torch.as_tensor(planes.observe(LayoutState.empty(bare_site)))[None]
    view = zone_view(seen, zone.rows, zone.columns, places=9)
    lines = Visibility.of(bare_site)
    expected = np.tensordot(lines.weight, lines.cut, axes=1) / lines.weight.sum()
    found = view.cells[0, :, :, CUT].numpy() / SHARE_GAIN
    assert np.corrcoef(found.ravel(), expected.ravel())[0, 1] > 0.95
    assert np.abs(found - expected).max() < 0.05


def test_a_place_counts_by_the_angle_under_which_it_sees_the_facade() -> None:
    """More of a blast meets the facade from nearby: a wall before that place hides the more."""
    points = ((2.25, 10.25), (35.25, 10.25))  # 7.75 m before the house, and 3 times that behind it
    house, cells = block("house", 10.0, 8.0, 9, 4, protected=True), zone(5.0, 8.0, 9, 1, stock=9)
    charges = [point(*case) for case in points]
    scenario = site("two_sides", (40.0, 20.0), charges, house, build_zone=cells)
    wall = LayoutState.of(scenario, list(scenario.zone.cells()))
    episode = GridObservation().episode(Observable(scenario, scenario.charge))
    unprotected, protected = (
        zone_view(torch.as_tensor(episode.observe(placement))[None], 9, 1, places=2)
        for placement in (LayoutState.empty(scenario), wall)
    )
    assert unprotected.cells[..., CUT].sum() == pytest.approx(0.75 * SHARE_GAIN, rel=0.02)
    assert unprotected.site[0, OPEN_FACADE] == pytest.approx(1.0)
    assert protected.site[0, OPEN_FACADE] == pytest.approx(0.25, abs=0.01)  # as seen from the right
