"""The league: what searches, rules and trained agents do on the same cases and held-out seeds."""

from agents.league.contest import Contest, Outlook
from agents.league.entries import (
    Agent,
    Entry,
    NoBarrier,
    RandomLayout,
    Rule,
    Search,
    SightLineLayout,
    Training,
    standard_entries,
)
from agents.league.standings import Result, Standings
from agents.league.store import ResultStore
from agents.league.tracks import (
    TRACKS,
    Track,
    TrackCase,
    find_tracks,
    hidden_track,
    known_track,
    sites_track,
)
from agents.league.verdict import Verdict, verdicts

__all__ = [
    "TRACKS",
    "Agent",
    "Contest",
    "Entry",
    "NoBarrier",
    "Outlook",
    "RandomLayout",
    "Result",
    "ResultStore",
    "Rule",
    "Search",
    "SightLineLayout",
    "Standings",
    "Track",
    "TrackCase",
    "Training",
    "Verdict",
    "find_tracks",
    "hidden_track",
    "known_track",
    "sites_track",
    "standard_entries",
    "verdicts",
]
