"""A surrogate of gas dynamics, which predicts the loads of a blast within a millisecond."""

from blast_env.design.surrogate.engine import SurrogateEngine
from blast_env.design.surrogate.network import Guess, Surrogate, load_surrogate, packaged_surrogate
from blast_env.design.surrogate.search import LearntSearch, search_by
from blast_env.design.surrogate.walls import SurrogateSite, site_of

__all__ = [
    "Guess",
    "LearntSearch",
    "Surrogate",
    "SurrogateEngine",
    "SurrogateSite",
    "load_surrogate",
    "packaged_surrogate",
    "search_by",
    "site_of",
]
