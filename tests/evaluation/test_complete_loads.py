"""What tables of consequences and reports say of loads of which more may come."""

import pytest

from blast_env.engines.gas import NOT_COMPLETE, GasBlast, GasEngine
from blast_env.evaluation.consequences import Consequences, bay_table, consequences
from blast_env.physics.scene import Charge
from blast_env.reporting.loads import measure, targets_of
from tests.gas_sites import glazed_hut, hut

CUT, WHOLE = GasEngine(border_m=0.0, until=0.012), GasEngine(border_m=0.0, until="walls")
"""A blast that ends while the wave is at the hut, and one that waits for every wall of it."""


def judged(engine: GasEngine) -> Consequences:
    scenario = glazed_hut()
    return consequences(scenario, (), [Charge((2.0, 4.0), 5.0)], engine)


def test_bays_say_that_more_may_come() -> None:
    cut, whole = judged(CUT), judged(WHOLE)
    table = bay_table({"cut": cut, "whole": whole}).set_index("layout")
    late = ~table["complete"].loc["cut"]
    assert late.any()
    assert table["complete"].loc["whole"].all()
    assert cut.is_flagged
    words = f"{late.sum()} of {len(late)} bays of all charges are not complete"
    assert cut.notes[-1].startswith(words)
    assert not any("complete" in note for note in whole.notes)
    (response,) = whole.responses
    assert set(response.tails) == {each.bay.name for each in response.facade.bays}


@pytest.mark.parametrize(("engine", "complete"), [(CUT, False), (WHOLE, True)])
def test_reports_say_it_of_every_building(engine: GasEngine, complete: bool) -> None:
    scenario = hut()
    measured = measure(GasBlast(scenario, engine=engine), targets_of(scenario))
    assert measured.loads["hut"].complete == complete
    assert (f"hut: {NOT_COMPLETE}" in measured.notes) != complete


@pytest.mark.parametrize(("until", "late"), [(0.012, ["front", "behind"]), ("gauges", [])])
def test_a_blast_says_which_gauges_are_not_complete(until: str | float, late: list[str]) -> None:
    found = GasBlast(hut(), engine=GasEngine(border_m=0.0, until=until)).run()
    assert found.gauge_notes == tuple(f"gauge {name}: {NOT_COMPLETE}" for name in late)
