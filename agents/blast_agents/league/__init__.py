"""The league: what searches, rules and trained agents do on the same cases and held-out seeds."""

from blast_agents.league.contest import Contest, Outlook
from blast_agents.league.entries import (
    Agent,
    Entry,
    NoBarrier,
    RandomLayout,
    Rule,
    Search,
    Training,
    VisibilityLayout,
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
    "TRACKS",
    "Agent",
    "Contest",
    "Entry",
    "LeagueVerdict",
    "NoBarrier",
    "Outlook",
    "RandomLayout",
    "Result",
    "ResultStore",
    "Rule",
    "Search",
    "Standings",
    "Track",
    "Training",
    "VisibilityLayout",
    "find_tracks",
    "hidden_track",
    "known_track",
    "sites_track",
    "standard_entries",
    "vehicle_track",
    "verdicts",
]
