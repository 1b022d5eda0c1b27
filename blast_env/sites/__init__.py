"""Generated sites: varied, valid, worth solving, and of one size per family."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.bundled import ITEM_SITES, LARGE_SITES, SITES
    from blast_env.sites.criterion import (
        TARGETS,
        Objection,
        SiteCriterion,
        SiteMeasures,
        Visibility,
        VisibilityCriterion,
        cut_share_of,
        visibility_layout,
    )
    from blast_env.sites.generate import HELD_OUT_SITES, draw_site, generate_site
    from blast_env.sites.headroom_sites import HEADROOM_HELD_OUT, HEADROOM_TRAINING, headroom_site
    from blast_env.sites.item_sites import (
        CLOSE_SIDES_M,
        ITEM_KINDS,
        POST,
        ItemSiteRanges,
        close_ranges,
        large_ranges,
    )
    from blast_env.sites.kerb_sites import (
        KerbSiteRanges,
        court_site,
        kerb_site,
        lane_site,
        low_site,
        square_site,
        street_site,
    )
    from blast_env.sites.module_sites import SiteRanges
    from blast_env.sites.ranges import Draws, ObstacleSpace, Ranges, draw_place
    from blast_env.sites.source import FAMILIES, SITE_KINDS, SiteSource, training_sites
    from blast_env.sites.turning import turned
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "CLOSE_SIDES_M",
    "FAMILIES",
    "HEADROOM_HELD_OUT",
    "HEADROOM_TRAINING",
    "HELD_OUT_SITES",
    "ITEM_KINDS",
    "ITEM_SITES",
    "LARGE_SITES",
    "POST",
    "SITES",
    "SITE_KINDS",
    "TARGETS",
    "Draws",
    "ItemSiteRanges",
    "KerbSiteRanges",
    "Objection",
    "ObstacleSpace",
    "Ranges",
    "SiteCriterion",
    "SiteMeasures",
    "SiteRanges",
    "SiteSource",
    "Visibility",
    "VisibilityCriterion",
    "close_ranges",
    "court_site",
    "cut_share_of",
    "draw_place",
    "draw_site",
    "generate_site",
    "headroom_site",
    "kerb_site",
    "lane_site",
    "large_ranges",
    "low_site",
    "square_site",
    "street_site",
    "training_sites",
    "turned",
    "visibility_layout",
]
