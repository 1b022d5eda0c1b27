"""A surrogate of gas dynamics, which predicts the loads of a blast within a millisecond."""

from blast_agents.surrogate.engine import SurrogateEngine
from blast_agents.surrogate.network import Guess, Surrogate, load_surrogate, packaged_surrogate
from blast_agents.surrogate.search import LearntSearch, search_by
from blast_agents.surrogate.walls import SurrogateSite, site_of

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
