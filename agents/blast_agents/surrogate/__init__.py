"""A surrogate of gas dynamics: what a blast would do, told in a millisecond."""

from blast_agents.surrogate.network import Guess, Surrogate
from blast_agents.surrogate.walls import Site, site_of

__all__ = ["Guess", "Site", "Surrogate", "site_of"]
