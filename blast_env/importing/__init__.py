"""Sites from maps and drawings: GeoJSON, OpenStreetMap, DXF."""

from blast_env.importing.convert import ImportedSite, import_site
from blast_env.importing.fitting import FittedBuilding
from blast_env.importing.options import ImportOptions

__all__ = ["FittedBuilding", "ImportOptions", "ImportedSite", "import_site"]
