"""A surrogate of gas dynamics, which predicts the loads of a blast within a millisecond."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.surrogate.approach import FEATURES, INPUTS
    from blast_env.surrogate.correction import Correction, apart_m3, stacked
    from blast_env.surrogate.engine import SurrogateEngine
    from blast_env.surrogate.ensemble import Surrogate
    from blast_env.surrogate.fit_record import Check, Fit
    from blast_env.surrogate.fitting import MEMBERS, fit
    from blast_env.surrogate.guess import Guess
    from blast_env.surrogate.holdout import Predictions, folds, load_errors, predictions
    from blast_env.surrogate.intervals import COVERAGE, covered, interval_factor, least_sites
    from blast_env.surrogate.neighbours import TRAITS, piece_traits
    from blast_env.surrogate.network import SHAPES, SIGHT, Member, Networks
    from blast_env.surrogate.points import CLOSE, WIDE, Spacing, WallPoints
    from blast_env.surrogate.relations import RELATIONS, solid_relations
    from blast_env.surrogate.samples import Samples
    from blast_env.surrogate.surrogate_file import (
        load_surrogate,
        packaged_surrogate,
        save_surrogate,
    )
    from blast_env.surrogate.views import (
        VIEW,
        VIEW_ASIDE_M,
        VIEW_BEHIND_M,
        VIEW_BEYOND_M,
        VIEW_MOST,
        VIEW_STRETCHES,
        solid_views,
    )
    from blast_env.surrogate.walls import SurrogateSite, site_of
    from blast_env.surrogate.ways import ABOVE_M, FALLS_M, SHARES, STATIONS, Ways
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "ABOVE_M",
    "CLOSE",
    "COVERAGE",
    "FALLS_M",
    "FEATURES",
    "INPUTS",
    "MEMBERS",
    "RELATIONS",
    "SHAPES",
    "SHARES",
    "SIGHT",
    "STATIONS",
    "TRAITS",
    "VIEW",
    "VIEW_ASIDE_M",
    "VIEW_BEHIND_M",
    "VIEW_BEYOND_M",
    "VIEW_MOST",
    "VIEW_STRETCHES",
    "WIDE",
    "Check",
    "Correction",
    "Fit",
    "Guess",
    "Member",
    "Networks",
    "Predictions",
    "Samples",
    "Spacing",
    "Surrogate",
    "SurrogateEngine",
    "SurrogateSite",
    "WallPoints",
    "Ways",
    "apart_m3",
    "covered",
    "fit",
    "folds",
    "interval_factor",
    "least_sites",
    "load_errors",
    "load_surrogate",
    "packaged_surrogate",
    "piece_traits",
    "predictions",
    "save_surrogate",
    "site_of",
    "solid_relations",
    "solid_views",
    "stacked",
]
