"""Generated sites: varied, valid, worth solving, and of one size per family."""

from blast_env.bundled import ITEM_SITES, LARGE_SITES, SITES
from blast_env.sites.criterion import (
    Objection,
    SiteCriterion,
    SiteMeasures,
    Visibility,
    VisibilityCriterion,
    visibility_layout,
)
from blast_env.sites.generate import draw_site, generate_site
from blast_env.sites.item_sites import (
    CLOSE_SIDES_M,
    ItemSiteRanges,
    close_ranges,
    large_ranges,
)
from blast_env.sites.module_sites import SiteRanges
from blast_env.sites.ranges import Ranges
from blast_env.sites.source import (
    FAMILIES,
    HELD_OUT_SITES,
    SiteSource,
    training_sites,
)
from blast_env.sites.turning import turned

__all__ = [
    "CLOSE_SIDES_M",
    "FAMILIES",
    "HELD_OUT_SITES",
    "ITEM_SITES",
    "LARGE_SITES",
    "SITES",
    "ItemSiteRanges",
    "Objection",
    "Ranges",
    "SiteCriterion",
    "SiteMeasures",
    "SiteRanges",
    "SiteSource",
    "Visibility",
    "VisibilityCriterion",
    "close_ranges",
    "draw_site",
    "generate_site",
    "large_ranges",
    "training_sites",
    "turned",
    "visibility_layout",
]
