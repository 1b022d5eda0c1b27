"""Names of the bundled scenarios and generated sites; importing this module is cheap."""

from pathlib import Path
from typing import Final

SCENARIO_SUFFIX: Final = ".toml"

SITES: Final = "sites"
"""Name of the generated sites for training, in the place of an environment's scenario."""

ITEM_SITES: Final = "item_sites"
"""Name of the generated sites with heights, catalogues and vehicles."""

LARGE_SITES: Final = "large_sites"
"""Name of such sites of real size."""

KERB_SITES: Final = "kerb_sites"
"""Name of sites with a front along a kerb, of any size."""

STREET_SITES: Final = "street_sites"
"""Name of streets along which a vehicle drives, of any size."""

COURT_SITES: Final = "court_sites"
"""Name of courts between several buildings, of any size."""

SQUARE_SITES: Final = "square_sites"
"""Name of short fronts on open ground, of any size."""

LOW_SITES: Final = "low_sites"
"""Name of buildings of one storey, as low as the walls before them, of any size."""

LANE_SITES: Final = "lane_sites"
"""Name of lanes between short fronts, along which a vehicle drives, of any size."""

HEADROOM_SITES: Final = "headroom_sites"
"""Name of those of the sites on which layouts are ahead of all rules."""

GENERATED: Final = (SITES, ITEM_SITES, LARGE_SITES)
"""Those of an environment: all sites of a name have one size."""

OF_ANY_SIZE: Final = (
    KERB_SITES,
    STREET_SITES,
    COURT_SITES,
    SQUARE_SITES,
    LOW_SITES,
    LANE_SITES,
    HEADROOM_SITES,
)
"""Those whose sites differ in size and catalogue."""


def bundled_scenarios() -> tuple[str, ...]:
    """Return the names of the scenarios that come with the package."""
    return tuple(sorted(path.stem for path in scenario_folder().glob(f"*{SCENARIO_SUFFIX}")))


def scenario_folder() -> Path:
    """Return the folder of the bundled scenarios: inside the package, or beside it."""
    package = Path(__file__).resolve().parent
    installed = package / "scenarios"
    return installed if installed.is_dir() else package.parent / "scenarios"
