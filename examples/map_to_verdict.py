"""From a map to a verdict: import a site, take the wall of a rule, judge it by gas dynamics."""

from pathlib import Path

import blast_env
from blast_env.io.importing import ImportOptions, import_site
from blast_env.rules import wall_near_building

MAP = Path(__file__).parents[1] / "docs" / "data" / "pump_house.geojson"

imported = import_site(MAP, ImportOptions(protect=("Pump House",), stock=8, tnt_kg=20.0))
site = imported.scenario
for note in imported.notes:
    print(f"note: {note}")
blast_env.save_scenario(site, "site.toml")

wall = wall_near_building(site, None)  # None: the charge may be at any of its places
found = blast_env.evaluate_layout(site, wall, seeds=range(2), cell_m=0.5)  # quick, not final
print(f"{len(wall)} modules near the building take off {found.mean_reduction:.1%} of the load")
print("below 10 %: look for another place" if found.mean_reduction < 0.1 else "worth building")
