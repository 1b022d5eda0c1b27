"""Zones with a catalogue, and vehicles that pieces keep away."""

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.observable import Observable
from blast_env.envs.observations import FeaturesObservation
from blast_env.envs.planes import EMPTY_REACH, REACH, GridObservation
from blast_env.envs.strategies import check_size
from blast_env.errors import BlastEnvError
from blast_env.geometry import Piece
from blast_env.layout import LayoutState, charge_against, vehicle_reach, worst_places
from blast_env.site import VehicleCharge
from tests.catalogue_sites import ITEMS, WALL, item, yard
from tests.vehicle_sites import POSTS, gate_site, site_document, vehicle_document, vehicle_of


def yard_env(**arguments: Any) -> BlastBarrierEnv:
    return BlastBarrierEnv(scenario=yard(), engine="gas", **({"action": "place"} | arguments))


def test_actions_place_pieces_and_the_charge_goes_off() -> None:
    env = yard_env()
    catalogue = yard().zone.catalogue
    assert env.action_space == gym.spaces.Discrete(4 * 14 * 6 + 1)
    env.reset(seed=0)
    rewards = []
    for piece in WALL:
        _, reward, ended, _, info = env.step(catalogue.action(piece))
        assert (ended, info["invalid_actions"]) == (False, 0)
        rewards.append(reward)
    _, reward, ended, _, info = env.step(catalogue.finish)
    assert (ended, env.placement.layout) == (True, WALL)
    assert rewards == [-1.0] + [0.0] * (len(WALL) - 1)
    assert reward == pytest.approx(info["reduction"], rel=1e-9)
    assert 0.1 < info["reduction"] < 1.0


def test_an_episode_can_begin_with_pieces() -> None:
    env = yard_env(render_mode="ansi")
    env.reset(seed=0, options={"layout": WALL})
    assert env.placement.layout == WALL
    text = env.render()
    assert "6 of 9 pieces left" in text
    assert "budget: 7 of 20 left" in text
    assert text.count("M") >= 7
    env.reset(seed=0)
    assert pickle.loads(pickle.dumps(env)).placement.layout == ()


# --- Observations.

CHANNELS = GridObservation().channels_of(yard())


def planes(placement: LayoutState) -> dict[str, np.ndarray]:
    """Return the planes of an observation on the cells of the build zone, from 0 to 1."""
    scenario = placement.scenario
    episode = GridObservation().episode(Observable(scenario, scenario.charge))
    observed = episode.observe(placement)
    assert GridObservation().space(scenario).contains(observed)
    # The zone begins at 3.5 m and 2.5 m.
    zone = observed[:, 5 : 5 + 14, 7 : 7 + 6]
    return dict(zip(CHANNELS, zone, strict=True))


def test_planes_of_other_zones_stay_as_they_were() -> None:
    assert CHANNELS[:9] == GridObservation.channels
    assert CHANNELS[9:] == (
        "structure_height",
        *("wall:height", "basket:height", "post:height"),
        *("wall:cost", "basket:cost", "post:cost"),
        *("barrier_height", "stops_vehicles"),
        *("wall:left", "basket:left", "post:left"),
        *("wall:legal", "wall:turned:legal", "basket:legal", "post:legal"),
    )


def test_planes_show_heights_items_and_where_they_may_go() -> None:
    placement = LayoutState.of(yard(), WALL)
    seen = planes(placement)
    taken = np.zeros((14, 6), dtype=bool)
    taken[5:11, 1] = taken[4, 1] = True
    assert np.array_equal(seen["barrier"] == 1.0, taken)
    assert np.array_equal(seen["stops_vehicles"] == 1.0, taken)
    assert seen["barrier_height"][6, 1] == pytest.approx(2.0 / 12.0, abs=0.002)
    assert seen["barrier_height"][4, 1] == pytest.approx(1.0 / 12.0, abs=0.002)
    assert seen["barrier_height"][0, 0] == 0.0
    assert seen["wall:height"] == pytest.approx(2.0 / 12.0, abs=0.002)
    assert seen["wall:cost"] == pytest.approx(6.0 / 20.0, abs=0.002)
    left = {name: seen[f"{name}:left"][0, 0] for name in ("wall", "basket", "post")}
    assert left == pytest.approx({"wall": 1 / 3, "basket": 1.0, "post": 0.75}, abs=0.002)
    shown = [seen[name] for name in CHANNELS[-4:]]
    assert np.array_equal(np.array(shown) == 1.0, placement.legal)
    assert np.array_equal(seen["free"] == 1.0, placement.free)


def test_structures_show_their_heights() -> None:
    episode = GridObservation().episode(Observable(yard(), yard().charge))
    height = episode.observe(LayoutState.empty(yard()))[CHANNELS.index("structure_height")]
    assert height[9:15, 15:21] == pytest.approx(2.5 / 12.0, abs=0.002)
    assert height.max() == height[9, 15]


def test_features_end_with_what_pieces_may_go_where() -> None:
    placement = LayoutState.of(yard(), WALL)
    episode = FeaturesObservation().episode(Observable(yard(), yard().charge))
    values, cells = episode.observe(placement), 14 * 6
    space = FeaturesObservation().space(yard())
    assert space.shape == (59 + 3 * cells + 8 + 9 + 6 * cells,)
    assert space.contains(values)
    more = values[59 + 3 * cells :]
    assert more[:2] == pytest.approx([2.5 / 12.0, 0.0])
    assert more[8:11] == pytest.approx([2.0 / 12.0, 1.5 / 12.0, 1.0 / 12.0])
    assert more[11:14] == pytest.approx([0.3, 0.15, 0.05])
    assert more[14:17] == pytest.approx([1 / 3, 1.0, 0.75])
    heights = more[17 : 17 + cells].reshape(14, 6)
    assert heights[5:11, 1] == pytest.approx(2.0 / 12.0)
    assert np.array_equal(more[17 + 2 * cells :] == 1.0, placement.legal.ravel())


def test_scenarios_of_one_source_share_items_but_not_their_costs() -> None:
    dearer = [{**item, "cost": 2.0, "height_m": 3.0} for item in ITEMS]
    check_size(yard(items=dearer), yard())
    with pytest.raises(BlastEnvError, match=r"the catalogue \(item, turned, size\) is"):
        check_size(yard(items=[*ITEMS[:2], item("stone", 1, 1, 1.0)]), yard())


# --- The environment with a vehicle: its charge depends on the layout, and the agent sees its way.


SITE = gate_site(vehicle_document(places=2))
SOURCE = vehicle_of(SITE)
FINISH = np.int64(16 * 4)


def gate(**changes: Any) -> BlastBarrierEnv:
    return BlastBarrierEnv(
        SITE, **({"engine": "gas", "action": "place", "observation": "grid"} | changes)
    )


@pytest.fixture(scope="module")
def finished() -> tuple[float, dict[str, Any]]:
    """Reward and information at the end of an episode with the posts."""
    barrier = gate(threat="hidden", threats=3)
    barrier.reset(seed=0, options={"layout": POSTS})
    _, reward, terminated, _, info = barrier.step(FINISH)
    assert terminated
    return float(reward), info


def test_the_charges_are_where_the_layout_let_the_vehicle_come(
    finished: tuple[float, dict[str, Any]],
) -> None:
    _, info = finished
    expected = tuple(charge_against(SITE, POSTS, VehicleCharge(SOURCE, rank)) for rank in range(3))
    assert info["charges"] == expected
    assert expected[2] == expected[0]
    assert info["reduction"] > 0.4
    assert info["impulse_pa_s"] < info["unprotected_impulse_pa_s"]


def test_pieces_stop_the_vehicle_as_what_they_are() -> None:
    """A wall of eight cells shuts half of the site; what it drives over shuts nothing."""
    items = [item("wall", 8, 1, 1.0), item("mat", 4, 1, 0.5, stock=2, stops_vehicles=False)]
    zone = {"corner_m": [4.0, 0.0], "rows": 16, "columns": 4, "items": items}
    site = gate_site(build_zone=zone)
    layout = (Piece(4, 1, "wall", True), Piece(12, 0, "mat", True), Piece(0, 0, "mat", True))
    barrier = BlastBarrierEnv(site, engine="gas", action="place", observation="grid")
    barrier.reset(seed=0, options={"layout": layout})
    *_, info = barrier.step(site.zone.catalogue.finish)
    worst = worst_places(site, vehicle_of(site), barrier.placement.layout)
    assert barrier.placement.layout == layout
    vehicle = VehicleCharge(vehicle_of(site))
    assert info["charges"] == (charge_against(site, layout, vehicle),)
    assert worst.stand_off_m == pytest.approx(worst_places(site, vehicle_of(site)).stand_off_m)


def test_incremental_rewards_add_up_though_the_charge_moves(
    finished: tuple[float, dict[str, Any]],
) -> None:
    barrier = gate(threat="hidden", threats=3, reward="incremental")
    barrier.reset(seed=0)
    actions = [row * 4 + column for row, column in POSTS]
    rewards = [float(barrier.step(action)[1]) for action in actions]
    _, last, terminated, _, info = barrier.step(FINISH)
    assert terminated
    assert sum(rewards) + float(last) == pytest.approx(finished[0])
    # A line with a gap keeps nothing away: it is the post in the last gap of 2 m or more that pays.
    assert rewards[4] == max(rewards) > 100.0 * max(rewards[:4])
    assert info["charges"] == finished[1]["charges"]


def test_the_planes_show_the_entry_and_the_ground_that_the_vehicle_reaches() -> None:
    for threat in ("visible", "hidden"):
        barrier = gate(threat=threat)
        observation, _ = barrier.reset(seed=1)
        channels = GridObservation().channels_of(SITE)
        planes = dict(zip(channels, observation, strict=True))
        unprotected = vehicle_reach(SITE, SOURCE).ground(16, 28)
        assert (planes[EMPTY_REACH] == unprotected).all()
        assert (planes[REACH] == unprotected).all()
        rows, columns = np.nonzero(planes["charge"])
        assert set(columns.tolist()) == {0}
        assert (rows.min(), rows.max()) == (3, 12) or (rows.min(), rows.max()) == (4, 11)
        for row, column in POSTS:
            observation, *_ = barrier.step(row * 4 + column)
        planes = dict(zip(channels, observation, strict=True))
        assert (planes[REACH] == vehicle_reach(SITE, SOURCE, POSTS).ground(16, 28)).all()
        assert (planes[EMPTY_REACH] == unprotected).all()
        assert planes[REACH][:, 8:].max() == 0


def test_the_vector_ends_with_the_stand_off() -> None:
    barrier = gate(observation="features")
    first, _ = barrier.reset(seed=1)
    last, _ = barrier.reset(seed=1, options={"layout": POSTS})
    diagonal_m = np.hypot(14.0, 8.0)
    assert first[-1] == pytest.approx(1.0 / diagonal_m)
    assert last[-1] == pytest.approx(7.0 / diagonal_m)
    assert len(first) == FeaturesObservation().space(SITE).shape[0]  # type: ignore[index]
    cells = 16 * 4
    assert last[-1 - 3 * cells : -1 - 2 * cells].sum() == len(POSTS)


def test_with_a_catalogue_the_vector_keeps_the_order_of_its_parts() -> None:
    items = [{"name": "post", "length_modules": 1, "height_m": 1.0, "cost": 1.0, "stock": 8}]
    zone = {"corner_m": [4.0, 0.0], "rows": 16, "columns": 4, "items": items}
    site = gate_site(build_zone=zone)
    barrier = BlastBarrierEnv(site, engine="gas", action="place", observation="features")
    observation, info = barrier.reset(seed=0)
    assert observation[-1] == pytest.approx(1.0 / np.hypot(14.0, 8.0))
    legal = np.asarray(info["action_mask"][:-1], dtype=bool)
    assert (observation[-1 - len(legal) : -1] == legal).all()


def test_a_fixed_charge_comes_in_no_vehicle() -> None:
    barrier = gate()
    barrier.reset(seed=0, options={"charge_position_m": (2.0, 2.0), "tnt_kg": 7.0})
    *_, info = barrier.step(FINISH)
    assert info["charges"] == (((2.0, 2.0), 7.0, 0.0),)
    barrier.reset(seed=0, options={"tnt_kg": 7.0})
    *_, info = barrier.step(FINISH)
    assert info["charges"] == (((9.0, 4.0), 7.0, 0.0),)


def test_a_vehicle_needs_spaces_with_room_for_it() -> None:
    point = {"kind": "point", "position_m": [2.0, 4.0], "tnt_kg": 5.0}
    without = gate_site(**(site_document() | {"charge": [point]}))
    check_size(without, SITE)
    with pytest.raises(BlastEnvError, match="room for vehicles"):
        check_size(SITE, without)


def test_the_picture_shows_the_ground_that_is_left() -> None:
    barrier = gate(render_mode="rgb_array")
    barrier.reset(seed=0)
    before = np.asarray(barrier.render(), dtype=int)
    barrier.reset(seed=0, options={"layout": POSTS})
    after = np.asarray(barrier.render(), dtype=int)
    # Beside the hut, far from zone and text: red as long as the vehicle gets there.
    height, width = before.shape[:2]
    reddened = (before[..., 0] - before[..., 2] > 10) & (after[..., 0] - after[..., 2] <= 10)
    assert reddened[:, int(0.6 * width) :].sum() > 0.02 * height * width
