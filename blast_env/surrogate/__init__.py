"""A surrogate of gas dynamics, which predicts the loads of a blast within a millisecond."""

from blast_env.surrogate.engine import SurrogateEngine
from blast_env.surrogate.network import Guess, Surrogate, load_surrogate, packaged_surrogate
from blast_env.surrogate.walls import SurrogateSite, site_of

__all__ = [
    "Guess",
    "Surrogate",
    "SurrogateEngine",
    "SurrogateSite",
    "load_surrogate",
    "packaged_surrogate",
    "site_of",
]
