"""Generated sites: varied, valid, worth solving, and all of one size."""

from blast_env.sites.criterion import (
    Objection,
    SiteCriterion,
    SiteMeasures,
    VisibilityCriterion,
    visibility_layout,
)
from blast_env.sites.generate import draw_site, generate_site
from blast_env.sites.ranges import SiteRanges
from blast_env.sites.source import HELD_OUT_SITES, SITES, SiteSource
from blast_env.sites.turning import turned
from blast_env.sites.visibility import Visibility

__all__ = [
    "HELD_OUT_SITES",
    "SITES",
    "Objection",
    "SiteCriterion",
    "SiteMeasures",
    "SiteRanges",
    "SiteSource",
    "Visibility",
    "VisibilityCriterion",
    "draw_site",
    "generate_site",
    "turned",
    "visibility_layout",
]
