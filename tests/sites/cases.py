"""Small scenarios of which the lines of sight can be told by hand."""

from typing import Any

from blast_env.site import Scenario
from tests import builders
from tests.builders import block, point

ROWS, COLUMNS = 8, 6


def yard_document(*structures: dict[str, Any], **zone: Any) -> dict[str, Any]:
    """A charge on the left, a house on the right, a zone of 8 x 6 cells that lies between."""
    house = block("house", 16.0, 8.0, 8, 4) | {"protected": True}
    cells = builders.zone(9.0, 8.0, ROWS, COLUMNS, stock=8) | zone
    return builders.site_document(
        "yard",
        (20.0, 20.0),
        point(2.0, 10.0),
        house,
        *structures,
        build_zone=cells,
        calibration="ballistic_kb_100kg",
    )


def yard(*structures: dict[str, Any], **zone: Any) -> Scenario:
    """The scenario of `yard_document`."""
    return Scenario.model_validate(yard_document(*structures, **zone))
