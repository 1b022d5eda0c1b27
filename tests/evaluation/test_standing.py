"""The standing of a load, and its reason."""

import pytest

from blast_env.evaluation.consequences import bay_table, consequences
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.standing import standing_of
from blast_env.site.scene import Charge
from tests.gas_sites import WALL, glazed_hut


@pytest.mark.parametrize(
    ("place", "standing", "reason"),
    [
        ((3.0, True, 12.0, True, False), "measured", "in sight"),
        ((3.0, False, 12.0, True, False), "verified", "in the shade"),
        ((3.0, True, 12.0, True, True), "approximate", "oblique"),
        ((3.0, True, 5.0, True, False), "approximate", "5 cells per m/kg^(1/3), checked from 9.2"),
        ((1.2, True, 12.0, True, False), "outside", "scaled distance 1.2 m/kg^(1/3)"),
        ((9.0, False, 5.0, True, True), "outside", "checked from 1.7 to 8.6"),
        ((3.0, True, 12.0, False, False), "outside", "not yet captured"),
    ],
)
def test_the_worst_reason_decides(
    place: tuple[float, bool, float, bool, bool], standing: str, reason: str
) -> None:
    stood = standing_of(*place)
    assert stood.standing.label == standing
    assert reason in stood.reason
    assert stood.words == f"{standing} ({stood.reason})"


def test_bays_have_their_standing_in_tables_and_the_deciding_one_in_the_verdict() -> None:
    found = consequences(glazed_hut(), WALL, [Charge((2.0, 4.0), 5.0)], GasEngine())
    table = bay_table({"wall": found})
    assert set(table["standing"]) == {"approximate"}  # 3.4 cells per m/kg^(1/3)
    assert table["reason"].str.startswith("3.4 cells").all()
    (response,) = found.responses
    assert found.standing("hut") == response.standings[response.deciding_bay]
    facade = response.facade
    worst = max(facade.glazing.hazard.max(), facade.walls.damage.max())
    own = [*facade.glazing.hazard[facade.glazed == response.deciding_bay]]
    own += [*facade.walls.damage[facade.walled == response.deciding_bay]]
    assert max(own) == worst
