"""What the attributes of maps mean: each case is one form in which public maps have them."""

from pathlib import Path
from typing import Any

import pytest

from blast_env.io.importing import ImportedSite, ImportOptions, import_site

CASES = Path(__file__).parent / "cases"


def case(name: str, **options: Any) -> ImportedSite:
    return import_site(CASES / name, ImportOptions(**{"protect": ("Court",)} | options))


@pytest.mark.parametrize("name", ["g_facade_tag.geojson", "g_facade_number.geojson"])
def test_tags_of_facades_are_no_windows_of_a_model(name: str) -> None:
    (court,) = case(name).buildings
    assert (court.height_m, court.facade) == (12.0, {})
