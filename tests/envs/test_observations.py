"""Observations of the barrier environment: planes, vectors, and both with the mask."""

import math
import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.observable import Observable
from blast_env.envs.observations import FeaturesObservation
from blast_env.envs.planes import GridObservation, ImageObservation, SiteGrid
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.geometry import Rectangle
from blast_env.site import (
    AnySource,
    PointSource,
    RectangleSource,
    Scenario,
    SegmentSource,
    Site,
    load_scenario,
)
from tests.catalogue_sites import item, yard
from tests.envs.small import make, play, restricted_scenario, same, small_document, small_scenario
from tests.vehicle_sites import gate_site

CHANNEL = {name: index for index, name in enumerate(GridObservation.channels)}
FINISH = 40
ZONE = np.s_[14:22, 14:19]  # where the build zone lies on the site, rows and columns


def grid(scenario: Scenario | None = None, **arguments: Any) -> BlastBarrierEnv:
    """Return an environment that shows planes, unless another observation is asked for."""
    return make(scenario, **({"observation": "grid"} | arguments))


def plane(env: Any, name: str, *, action: int | None = None, **options: Any) -> np.ndarray:
    """Return a plane after `reset`, or after an action."""
    observation, _ = env.reset(seed=1, options=options)
    assert observation.dtype == np.float32
    if action is not None:
        observation = env.step(action)[0]
    assert observation in env.observation_space
    return observation[CHANNEL[name]]


def test_structures_cover_their_squares_row_0_at_the_bottom() -> None:
    protected, others = plane(grid(), "protected"), plane(grid(), "other_structures")
    assert (protected[10:22, 28:32] == 1.0).all()  # the house, of weight 2
    assert protected[2:5, 24:27] == pytest.approx(0.5, abs=0.002)  # the store, of weight 1
    assert protected.shape == (36, 38)
    assert protected.sum() == pytest.approx(48.0 + 4.5, abs=0.05)
    assert (others[28:30, 22:26] == 1.0).all()
    assert others.sum() == 8.0


def test_a_module_stands_on_its_cell_which_is_free_no_longer() -> None:
    env = grid()
    before, after = plane(env, "free"), plane(env, "free", action=5 + 3)
    expected = np.zeros((36, 38))
    expected[ZONE] = 1.0
    expected[18, 14:16] = 0.0  # the hydrant
    assert (before == expected).all()
    expected[14 + 1, 14 + 3] = 0.0
    assert (after == expected).all()
    barrier = plane(env, "barrier", action=5 + 3)
    assert np.argwhere(barrier).tolist() == [[15, 17]]
    assert barrier.max() == 1.0


def test_free_cells_are_the_action_mask() -> None:
    env = grid(restricted_scenario())
    observation, info = env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(4):
        mask = info["action_mask"][:-1]
        in_zone = observation[CHANNEL["free"]][12:26, 14:24] == 1.0
        assert (in_zone.ravel() == mask).all()
        observation, _, _, _, info = env.step(rng.choice(np.flatnonzero(mask)))


def test_stock_and_budget_are_shown_everywhere() -> None:
    env = grid(restricted_scenario())
    for name, first, second in (
        ("stock_share", 1.0, 11 / 12),
        ("stock", 0.12, 0.11),
        ("budget_share", 1.0, 11.5 / 14),  # the first cell is rock, which costs 2.5
    ):
        assert plane(env, name) == pytest.approx(first, abs=0.002)
        assert plane(env, name, action=0) == pytest.approx(second, abs=0.002)
    assert (plane(grid(), "budget_share", action=0) == 1.0).all()


def test_the_cost_is_relative_to_the_highest() -> None:
    cost = plane(grid(restricted_scenario()), "cost")
    assert (cost[12:20, 14:19] == 1.0).all()
    assert cost[20:26, 19:24] == pytest.approx(1.0 / 2.5, abs=0.002)
    cost[12:26, 14:24] = 0.0
    assert not cost.any()


@pytest.mark.parametrize("position_m", [(3.0, 9.0), (3.25, 9.25), (2.9, 8.7)])
@pytest.mark.parametrize("tnt_kg", [20.0, 160.0])
def test_a_visible_charge_shows_its_place_and_mass(position_m: tuple, tnt_kg: float) -> None:
    charge = plane(grid(), "charge", charge_position_m=position_m, tnt_kg=tnt_kg)
    assert charge.max() == pytest.approx((tnt_kg / 1000.0) ** (1 / 3), abs=0.002)
    shares = charge**2 / (charge**2).sum()
    rows, columns = np.indices(charge.shape)
    place = [((index + 0.5) * 0.5 * shares).sum() for index in (columns, rows)]
    assert place == pytest.approx(position_m, abs=0.01)
    assert (charge > 0.0).sum() <= 4
    heavy = [plane(grid(), "charge", tnt_kg=mass).max() for mass in (1000.0, 3000.0)]
    assert heavy == [1.0, 1.0]


def test_a_hidden_charge_shows_all_places_where_it_may_be() -> None:
    charge = plane(grid(threat="hidden", threats=2), "charge")
    on_road, at_shed = charge[12:24, 5:7], charge[31:33, 16:18]
    assert on_road.min() > 0.2  # two thirds of the charges, along 6 m
    assert at_shed == pytest.approx((20.0 / 1000.0) ** (1 / 3), abs=0.002)
    assert (on_road == on_road[:, ::-1]).all()  # the road lies between two columns
    charge[11:25, 5:7] = charge[31:33, 16:18] = 0.0
    assert not charge.any()


def test_a_hidden_observation_tells_nothing_about_the_charges_that_were_drawn() -> None:
    for observation in ("grid", "image", "features"):
        env = grid(observation=observation, threat="hidden", threats=2)
        first, second = env.reset(seed=1)[0], env.reset(seed=2)[0]
        assert (first == second).all()
        ends = []
        for seed in (1, 2):
            env.reset(seed=seed)
            ends.append(env.step(FINISH)[4]["charges"])
        assert ends[0] != ends[1]


def test_what_lies_off_the_grid_is_shown_by_the_share_of_a_square() -> None:
    document = small_document(corner_m=(7.25, 7.0))
    document["structures"][0]["corner_m"] = (11.0, 14.25)
    env = grid(Scenario.model_validate(document))
    others, barrier = plane(env, "other_structures"), plane(env, "barrier", action=0)
    assert others[28:31, 22] == pytest.approx([0.5, 1.0, 0.5], abs=0.003)
    assert barrier[14, 14:16] == pytest.approx([0.5, 0.5], abs=0.003)


def test_scenarios_of_one_size_share_a_space_whatever_stands_on_them() -> None:
    document = small_document(stock=7, budget=5.0)
    document["structures"] = document["structures"][1:]
    document["charge"] = document["charge"][1:]
    variant = Scenario.model_validate(document)
    assert GridObservation().space(variant) == GridObservation().space(small_scenario())


def test_an_observation_is_not_changed_afterwards() -> None:
    env = grid()
    first, _ = env.reset(seed=1)
    kept = first.copy()
    env.step(3)
    assert (first == kept).all()


# --- The vector of the observation `"features"`, value by value.


CELLS = 40


def test_what_is_left_to_build_with() -> None:
    env = make(restricted_scenario(), observation="features")
    first, _ = env.reset(seed=1)
    assert first[:3].tolist() == pytest.approx([1.0, 0.12, 1.0])
    assert env.step(0)[0][:3].tolist() == pytest.approx([11 / 12, 0.11, 11.5 / 14])
    cost = first[-140:]  # relative to the highest
    assert (cost[0], cost[-1]) == pytest.approx((1.0, 1.0 / 2.5))


def test_a_visible_charge_is_a_point() -> None:
    env = make(observation="features")
    options = {"charge_position_m": (3.8, 9.0), "tnt_kg": 8.0}
    values, _ = env.reset(seed=1, options=options)
    assert values[3:9].tolist() == pytest.approx([0.2, 0.5, 0.2, 0.5, 0.2, 0.2])
    heavy, _ = env.reset(seed=1, options=options | {"tnt_kg": 3000.0})
    assert heavy[7:9].tolist() == [1.0, 1.0]


def test_a_hidden_charge_is_a_box_around_its_places() -> None:
    env = make(observation="features", threat="hidden", threats=2)
    values, _ = env.reset(seed=1)
    box = [3.0 / 19.0, 6.0 / 18.0, 8.5 / 19.0, 16.0 / 18.0]
    assert values[3:7].tolist() == pytest.approx(box)
    assert values[7:9].tolist() == pytest.approx([0.02 ** (1 / 3), 0.1 ** (1 / 3)])


def test_zone_and_structures_protected_ones_first() -> None:
    values, _ = make(observation="features").reset(seed=1)
    assert values[9:11].tolist() == pytest.approx([7.0 / 19.0, 7.0 / 18.0])
    house, store, shed, *rest = values[11:59].reshape(8, 6).tolist()
    assert house == pytest.approx([14 / 19, 5 / 18, 16 / 19, 11 / 18, 1.0, 1.0])
    assert store == pytest.approx([12 / 19, 1 / 18, 13.5 / 19, 2.5 / 18, 1.0, 0.5])
    assert shed == pytest.approx([11 / 19, 14 / 18, 13 / 19, 15 / 18, 1.0, 0.0])
    assert not np.any(rest)


def test_cells_row_by_row() -> None:
    env = make(observation="features")
    _, info = env.reset(seed=1)
    values, _, _, _, info = env.step(7)
    barrier, free, cost = values[59:].reshape(3, CELLS)
    assert np.flatnonzero(barrier).tolist() == [7]
    assert (free == info["action_mask"][:-1]).all()
    assert (cost == 1.0).all()


@pytest.mark.parametrize("name", ["courtyard", "hotel_forecourt", "control_room"])
def test_each_value_of_the_vector_has_a_name(name: str) -> None:
    scenario = load_scenario(name)
    names = FeaturesObservation().names(scenario)
    assert (len(names),) == FeaturesObservation().space(scenario).shape
    assert len({*names}) == len(names)
    env = make(scenario, observation="features", engine="surrogate")
    before, _ = env.reset(seed=1)
    action = int(env.action_masks()[:-1].argmax())
    variants, (rows, columns) = scenario.zone.catalogue.variants, scenario.zone.shape
    variant, cell = divmod(action, rows * columns)
    after, *_ = env.step(action)
    changed = {names[number] for number in np.flatnonzero(before != after)}
    assert f"cell {divmod(cell, columns)}: module" in changed
    assert "modules left / at first" in changed
    assert not any(name.startswith(("structure", "charge", "build zone")) for name in changed)
    if scenario.zone.items:
        assert f"{variants[variant].name}: pieces left / at first" in changed


def count_of(text: str, sizes: dict[str, int]) -> int:
    """Return what a cell of a table says, such as `59 + 2 cells` or `variants x cells`."""
    return sum(
        math.prod(sizes[word] if word in sizes else int(word) for word in re.findall(r"\w+", term))
        for term in text.replace(" x ", " ").split("+")
    )


@pytest.mark.parametrize("name", ["courtyard", "hotel_forecourt", "control_room"])
def test_the_tables_of_the_page_add_up_to_the_space(name: str) -> None:
    """Place and length of all parts of the vector, as the page on environments repeats them."""
    scenario = load_scenario(name)
    catalogue, cells = scenario.zone.catalogue, math.prod(scenario.zone.shape)
    sizes = {"cells": cells, "items": len(catalogue.names), "variants": len(catalogue.variants)}
    rows = [
        [cell.strip() for cell in line.strip().strip("|").split("|")]
        for line in (FeaturesObservation.__doc__ or "").splitlines()
        if line.strip().startswith("|") and "length" not in line and "---" not in line
    ]
    always, with_items = ([row for row in rows if len(row) == columns] for columns in (3, 2))
    place = 0
    for first, length, _ in always:
        assert count_of(first, sizes) == place
        place += count_of(length, sizes)
    if catalogue.has_items:
        place += sum(count_of(length, sizes) for length, _ in with_items)
    assert FeaturesObservation().space(scenario).shape == (place + bool(scenario.vehicles),)


def test_too_many_structures_are_named() -> None:
    document = small_document()
    shed = document["structures"][0]
    more = [{**shed, "name": f"shed_{n}", "corner_m": (n + 0.0, 0.0)} for n in range(0, 12, 2)]
    document["structures"] = [*more, *document["structures"]]
    env = make(Scenario.model_validate(document), observation="features")
    with pytest.raises(BlastEnvError, match=r"has 9 structures, .* has room for 8: use 'grid'"):
        env.reset(seed=1)


# --- The observation as a `Dict`: planes, vector and mask.


@pytest.mark.parametrize("scenario", [small_scenario(), yard(), gate_site()])
def test_it_has_what_image_features_and_information_have(scenario: Scenario) -> None:
    """The vector has the values of `features` that belong to no cell and no structure."""
    engine = {} if scenario == small_scenario() else {"engine": "gas", "realisations": 1}
    envs = [make(scenario, observation=name, **engine) for name in ("dict", "image", "features")]
    (seen, info), (image, _), (features, _) = [env.reset(seed=3) for env in envs]
    space = envs[0].observation_space
    assert isinstance(space, spaces.Dict)
    assert list(space) == ["action_mask", "planes", "vector"]
    assert space["planes"] == ImageObservation().space(scenario)
    assert space["action_mask"] == spaces.MultiBinary(int(envs[0].action_space.n))  # type: ignore[attr-defined]
    assert seen in space
    assert same(seen["planes"], image)
    assert same(seen["action_mask"], info["action_mask"])
    assert same(seen["vector"][:11], features[:11])
    items = len(scenario.zone.catalogue.names) if scenario.zone.items else 0
    assert len(seen["vector"]) == 11 + 3 * items + bool(scenario.vehicles)
    if scenario.vehicles:
        assert seen["vector"][-1] == features[-1]
    assert FeaturesObservation().space(scenario).shape == features.shape


def test_mask_and_stock_change_with_the_layout() -> None:
    steps = play(make(observation="dict"), seed=1)
    for before, after in pairwise(steps):
        assert after[0]["vector"][0] < before[0]["vector"][0]
        assert same(after[0]["action_mask"], after[4]["action_mask"])
    assert steps[-1][0]["action_mask"].sum() == 1  # the charge has gone off


def test_a_run_of_training_takes_single_arrays() -> None:
    from blast_agents.training.run_folder import settings_from

    with pytest.raises(UnknownNameError, match="no observation 'dict'"):
        settings_from({"observation": "dict"})


def test_a_dictionary_of_ones_own_gets_the_mask_too() -> None:
    class Own:
        def space(self, scenario: Scenario) -> spaces.Dict:
            return spaces.Dict({"none": spaces.Box(0.0, 1.0, (1,), np.float32)})

        def episode(self, observable: object) -> "Own":
            return self

        def observe(self, placement: object) -> dict[str, np.ndarray]:
            return {"none": np.zeros(1, dtype=np.float32)}

    env = make(observation=Own())
    observation, info = env.reset(seed=0)
    assert observation in env.observation_space
    assert same(observation["action_mask"], info["action_mask"])


def test_images_of_many_planes_have_one_size_with_and_without_a_vehicle() -> None:
    """Both sides are longer than there are planes, those of absent vehicles among them."""
    items = [item(f"wall_{number}", 2, 1, 1.0) for number in range(12)]
    among_vehicles = Observable(yard(items=items), yard().charge, among_vehicles=True)
    image = ImageObservation().episode(among_vehicles)
    assert image.static.shape[:2] == (image.static.shape[2] + 1,) * 2


# --- Rectangles, lattices and places of charges on the grid of the site.


GRID = SiteGrid(*Site(width_m=10.0, height_m=6.0).squares)
across = st.floats(0.5, 9.5)
up = st.floats(0.5, 5.5)
points = st.tuples(across, up)
sources = st.one_of(
    st.builds(lambda p: PointSource(position_m=p, tnt_kg=1.0), points),
    st.builds(
        lambda p, q: SegmentSource(kind="segment", start_m=p, end_m=q, tnt_kg=1.0), points, points
    ),
    st.builds(
        lambda p: RectangleSource(
            kind="rectangle", corner_m=p, size_m=(9.9 - p[0], 5.9 - p[1]), tnt_kg=1.0
        ),
        points,
    ),
)


def test_the_grid_covers_a_site_that_is_no_whole_number_of_modules() -> None:
    assert (GRID.rows, GRID.columns) == (12, 20)
    assert Site(width_m=10.1, height_m=6.0).squares == (12, 21)


@given(points, points)
def test_a_rectangle_covers_its_area(one: tuple, other: tuple) -> None:
    left, right = sorted((one[0], other[0]))
    bottom, top = sorted((one[1], other[1]))
    plane = GRID.rectangle(Rectangle(left, bottom, right, top))
    assert plane.sum(dtype=float) * 0.25 == pytest.approx((right - left) * (top - bottom), abs=1e-4)
    assert 0.0 <= plane.min() <= plane.max() <= 1.0


@given(sources)
def test_the_places_of_a_charge_add_up_to_1_around_their_middle(source: AnySource) -> None:
    plane = GRID.source(source)
    assert plane.sum(dtype=float) == pytest.approx(1.0, abs=1e-5)
    rows, columns = np.indices(plane.shape)
    mean = [((index + 0.5) * 0.5 * plane).sum() for index in (columns, rows)]
    if isinstance(source, RectangleSource):
        middle = source.rectangle_m.centre
    else:
        assert isinstance(source, SegmentSource | PointSource)
        middle = tuple(np.mean(source.segment_m, axis=0))
    # The share of a square that is covered does not tell where in it the rectangle begins.
    tolerance = 0.3 if isinstance(source, RectangleSource) else 1e-4
    assert mean == pytest.approx(middle, abs=tolerance)
