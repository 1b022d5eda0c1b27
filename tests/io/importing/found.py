"""Imports for tests, and what they found."""

from pathlib import Path
from typing import Any

import pytest

from blast_env.errors import BlastEnvError
from blast_env.io.importing import Fate, ImportOptions, LedgerEntry, SiteImport, import_site


def imported(path: Path, **options: Any) -> SiteImport:
    return import_site(path, ImportOptions(**options))


def error_of(path: Path, **options: Any) -> str:
    """Return the message of the refusal of a file or of the options."""
    with pytest.raises(BlastEnvError) as caught:
        imported(path, **options)
    return str(caught.value)


def entries(site: SiteImport, fate: Fate, words: str) -> tuple[LedgerEntry, ...]:
    """Return the entries of the ledger of a fate whose kind has some words."""
    return tuple(entry for entry in site.ledger.of(fate) if words in entry.kind)


def places(site: SiteImport, fate: Fate, words: str) -> list[str]:
    return [entry.place for entry in entries(site, fate, words)]


def boxes(site: SiteImport) -> list[tuple[float, float, float | None]]:
    """Return area, underside and height of the buildings, the largest first."""
    found = [
        (round(building.outline.area, 1), building.base_m, building.height_m)
        for building in site.buildings
    ]
    return sorted(found, reverse=True)
