"""Which of several blasts governs: levels before damage, damage before loads."""

import numpy as np

from blast_env.evaluation.blasts import Severity
from blast_env.evaluation.questions.verdict import BuildingResponse
from blast_env.response import respond
from blast_env.site import Charge
from tests.gas_sites import glazed_hut


def test_levels_come_before_damage_and_damage_before_loads() -> None:
    ordered = [
        Severity(0, 9.0, 9.0),
        Severity(4, 1.0, 9.0),
        Severity(4, 2.0, 1.0),
        Severity(4, 2.0, 5.0),
    ]
    assert max(reversed(ordered), key=lambda response: response) == ordered[-1]
    assert sorted(ordered) == ordered


def test_of_buildings_below_standards_the_one_with_more_damage_governs_then_more_load() -> None:
    bays = glazed_hut().bays
    time_s = np.array([0.0, 0.001, 0.02, 0.05])

    def response(peaks_pa: np.ndarray) -> BuildingResponse:
        history = np.outer(peaks_pa, [0.0, 1.0, 0.0, 0.0])
        return BuildingResponse("hut", Charge((2.0, 4.0), 5.0), respond(bays, time_s, history))

    low = np.full(len(bays), 1e3)
    one, every = low.copy(), np.full(len(bays), 5e6)
    one[0] = 5e6
    some, more, most = (response(peaks) for peaks in (one, every, 2.0 * every))
    assert len({response.facade.level_of_protection for response in (some, more, most)}) == 1
    assert some.severity.damage < more.severity.damage <= most.severity.damage
    assert max([some, more, most], key=lambda response: response.severity) is most
    assert max([some, response(low)], key=lambda case: case.severity) is some
