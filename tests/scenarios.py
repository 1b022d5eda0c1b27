"""A scenario for tests that need blasts of pymunk, or of the paper's regime."""

from typing import Final

from blast_env.site import Scenario, load_scenario


def _ballistic_courtyard() -> Scenario:
    ballistic = load_scenario("courtyard").with_simulation("ballistic")
    document = ballistic.model_dump() | {"calibration": "ballistic_kb_100kg"}
    return Scenario.from_document(document, "courtyard in sparse air")


BALLISTIC_COURTYARD: Final = _ballistic_courtyard()
"""The courtyard in sparse air: a tenth of the time of a blast in the bundled scenario's air."""
