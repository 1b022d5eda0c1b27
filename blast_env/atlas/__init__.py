"""The atlas of shielding: what walls, rows, fronts and shadows do to the load of a bay."""

from blast_env.atlas.between import Row, around_of, numbers_between, rows_between
from blast_env.atlas.echoes import fronts_among, numbers_of_echoes
from blast_env.atlas.laws import Factors, FamilyError, Law, Laws, packaged_laws
from blast_env.atlas.shadow import numbers_of_shadow
from blast_env.atlas.surroundings import SiteAtlas, Surroundings, Walls

__all__ = [
    "Factors",
    "FamilyError",
    "Law",
    "Laws",
    "Row",
    "SiteAtlas",
    "Surroundings",
    "Walls",
    "around_of",
    "fronts_among",
    "numbers_between",
    "numbers_of_echoes",
    "numbers_of_shadow",
    "packaged_laws",
    "rows_between",
]
