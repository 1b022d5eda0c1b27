"""Facades in scenario files: which bays they make, what is refused, what stays as it was."""

from typing import Any

import pytest

import blast_env
from blast_env.site import Scenario, ScenarioError

PLAIN = blast_env.load_scenario("control_room")
FACADE = {"storey_m": 3.5, "glazing": "window_annealed_6", "wall": "brick_215"}


def with_facade(facade: dict[str, Any], **more: Any) -> Scenario:
    document = PLAIN.model_dump(mode="json")
    document["structures"][0]["facade"] = facade
    return Scenario.from_document(document | more, "test")


def test_a_scenario_without_facades_has_no_bays() -> None:
    assert PLAIN.bays == ()


def test_loads_do_not_depend_on_the_facade() -> None:
    assert with_facade(FACADE).content_hash == PLAIN.content_hash


def test_bays_of_the_walls_that_count() -> None:
    bays = with_facade(FACADE).bays
    assert [bay.bay.name for bay in bays] == [f"control_room/west/1/{n}" for n in (1, 2, 3)]
    assert all(bay.panes == 2 and bay.wall is not None for bay in bays)
    assert sum(bay.bay.area_m2 for bay in bays) == pytest.approx(10.0 * 3.5)


def test_other_components_in_some_bays_and_own_ones() -> None:
    own = {
        "our_window": {
            "kind": "glazing",
            "title": "a large pane",
            "source": "drawing 12",
            "width_m": 2.0,
            "height_m": 2.0,
            "thickness_mm": 9.02,
        }
    }
    parts = [{"walls": ["west"], "storeys": [1], "glazing": "our_window"}]
    scenario = with_facade(FACADE | {"parts": parts}, components=own)
    assert {bay.glazing.title for bay in scenario.bays if bay.glazing} == {"a large pane"}
    again = Scenario.from_document(scenario.model_dump(mode="json"), "again")
    assert again == scenario


@pytest.mark.parametrize(
    ("facade", "message"),
    [
        ({"glazing": "window_anealed_6"}, r"facade.glazing: .* did you mean 'window_annealed_6'"),
        ({"wall": "window_annealed_6"}, r"facade.wall: .* there is no such component"),
        ({"glazing": "window_annealed_6", "bay_m": 1.0}, r"a pane of 1.2 x 1.5 m .* must fit"),
        ({"storey_m": 3.5}, "neither windows nor a wall"),
        ({"glazing": "window_annealed_6", "storey_m": 0.5}, "storey_m"),
    ],
)
def test_wrong_facades(facade: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        with_facade(facade)


def test_a_facade_needs_a_height() -> None:
    document = PLAIN.model_dump(mode="json")
    document["structures"][0] |= {"facade": FACADE, "height_m": None}
    with pytest.raises(ScenarioError, match="needs the structure's height_m"):
        Scenario.from_document(document, "test")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"interlayer": {"tear_shere": 0.1}}, "interlayer.tear_shere: unknown key"),
        ({"kind": "door"}, "kind: Input tag 'door' found using 'kind' does not match"),
    ],
)
def test_a_wrong_component_is_all_that_is_wrong(wrong: dict[str, Any], message: str) -> None:
    """No second message says that there is no such component, or that measures cover nothing."""
    document = blast_env.load_scenario("clinic_front").model_dump(mode="json")
    thin = {"kind": "glazing", "title": "x", "source": "y", "thickness_mm": 6.0}
    thin |= {"width_m": 1.0, "height_m": 1.0, **wrong}
    document["components"] = {"thin": thin}
    document["structures"][0]["facade"]["glazing"] = "thin"
    with pytest.raises(ScenarioError) as refused:
        Scenario.from_document(document, "test")
    assert str(refused.value).startswith(f"test: components.thin.{message}")
    assert "\n" not in str(refused.value)


def test_a_site_without_a_height_is_not_told_that_its_measures_cover_nothing() -> None:
    document = blast_env.load_scenario("clinic_front").model_dump(mode="json")
    del document["structures"][0]["height_m"]
    with pytest.raises(ScenarioError) as refused:
        Scenario.from_document(document, "test")
    assert "\n" not in str(refused.value)
