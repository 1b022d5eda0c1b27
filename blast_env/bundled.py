"""What comes with the package, by name; nothing heavy is imported to know it."""

from pathlib import Path
from typing import Final

SCENARIO_SUFFIX: Final = ".toml"

SITES: Final = "sites"
"""Name of the generated sites to train on, where an environment asks for a scenario."""

ITEM_SITES: Final = "item_sites"
"""Name of the generated sites with heights, catalogues and vehicles, in the same place."""

LARGE_SITES: Final = "large_sites"
"""Name of such sites of real size, in the same place."""

REAL_SIZE: Final = frozenset({"street_front", "government_forecourt", "campus", "car_park"})
"""Bundled scenarios of 90 to 120 m: tracks and studies take them only where they are named."""


def bundled_scenarios() -> tuple[str, ...]:
    """Return the names of the scenarios that come with the package."""
    return tuple(sorted(path.stem for path in scenario_folder().glob(f"*{SCENARIO_SUFFIX}")))


def scenario_folder() -> Path:
    """Return the folder of the bundled scenarios: inside the package, or beside it."""
    package = Path(__file__).resolve().parent
    installed = package / "scenarios"
    return installed if installed.is_dir() else package.parent / "scenarios"
