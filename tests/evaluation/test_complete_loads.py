"""Tables of consequences and reports flag loads that are not known at the end of a run."""

import pytest

from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.evaluation.questions.verdict import Consequences, bay_table
from blast_env.evaluation.validation import NOT_KNOWN
from blast_env.site import Charge
from tests.blasts import consequences
from tests.gas_sites import glazed_hut, hut

CUT, WHOLE = GasEngine(border_m=0.0, until=0.012), GasEngine(border_m=0.0, until="walls")
"""A blast that ends while the wave is at the hut, and one that waits for every wall of it."""


def judged(engine: GasEngine) -> Consequences:
    scenario = glazed_hut()
    return consequences(BlastEvaluator(scenario, engine), (), [Charge((2.0, 4.0), 5.0)])


def test_bays_that_are_cut_off_are_flagged() -> None:
    cut, whole = judged(CUT), judged(WHOLE)
    table = bay_table({"cut": cut, "whole": whole}).set_index("layout")
    late = ~table["known"].loc["cut"]
    assert late.any()
    assert table["known"].loc["whole"].all()
    assert cut.is_flagged
    words = f"{late.sum()} of {len(late)} bays of all charges: impulse not yet captured"
    assert cut.notes[-1].startswith(words)
    assert not any("captured" in note for note in whole.notes)
    (response,) = whole.responses
    assert set(response.known) == {bay.bay.name for bay in response.facade.bays}


@pytest.mark.parametrize(("engine", "known"), [(CUT, False), (WHOLE, True)])
def test_reports_flag_every_building(engine: GasEngine, known: bool) -> None:
    details = GasBlast(hut(), engine=engine).recorded().record.complete
    assert details.buildings["hut"].known == known
    assert (f"hut: {NOT_KNOWN}" in details.notes) != known


@pytest.mark.parametrize(("until", "late"), [(0.004, ["front", "behind"]), ("gauges", [])])
def test_gauges_that_are_cut_off_are_flagged(until: str | float, late: list[str]) -> None:
    found = GasBlast(hut(), engine=GasEngine(border_m=0.0, until=until)).run()
    assert found.gauge_notes == tuple(f"gauge {name}: {NOT_KNOWN}" for name in late)
