"""A surrogate of gas dynamics: what a blast would do, told in a millisecond."""

from blast_agents.surrogate.engine import SurrogateEngine
from blast_agents.surrogate.network import Guess, Surrogate, load_surrogate, packaged_surrogate
from blast_agents.surrogate.search import RankedAgent, SurrogateAgent, SurrogateSearch
from blast_agents.surrogate.walls import SurrogateSite, site_of

__all__ = [
    "Guess",
    "RankedAgent",
    "Surrogate",
    "SurrogateAgent",
    "SurrogateEngine",
    "SurrogateSearch",
    "SurrogateSite",
    "load_surrogate",
    "packaged_surrogate",
    "site_of",
]
