"""The league: searches, rules and trained agents on the same cases and held-out seeds."""

from blast_agents.league.contest import Contest, Outlook
from blast_agents.league.entries import (
    NO_BARRIER,
    LeagueEntry,
    RandomLayout,
    Training,
    own_proposer,
    searches,
    standard_entries,
)
from blast_agents.league.standings import LeagueVerdict, Result, Standings, verdicts
from blast_agents.league.store import ResultStore
from blast_agents.league.tracks import (
    TRACKS,
    Track,
    find_tracks,
    hidden_track,
    known_track,
    sites_track,
    vehicle_track,
)

__all__ = [
    "NO_BARRIER",
    "TRACKS",
    "Contest",
    "LeagueEntry",
    "LeagueVerdict",
    "Outlook",
    "RandomLayout",
    "Result",
    "ResultStore",
    "Standings",
    "Track",
    "Training",
    "find_tracks",
    "hidden_track",
    "known_track",
    "own_proposer",
    "searches",
    "sites_track",
    "standard_entries",
    "vehicle_track",
    "verdicts",
]
