"""The league: what searches, rules and trained agents do on the same cases and held-out seeds."""

from agents.league.contest import Contest, Outlook
from agents.league.entries import (
    Agent,
    Entry,
    NoBarrier,
    Proposal,
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
    Case,
    Track,
    find_tracks,
    hidden_track,
    known_track,
    sites_track,
)
from agents.league.verdict import Verdict, verdicts

__all__ = [
    "TRACKS",
    "Agent",
    "Case",
    "Contest",
    "Entry",
    "NoBarrier",
    "Outlook",
    "Proposal",
    "RandomLayout",
    "Result",
    "ResultStore",
    "Rule",
    "Search",
    "SightLineLayout",
    "Standings",
    "Track",
    "Training",
    "Verdict",
    "find_tracks",
    "hidden_track",
    "known_track",
    "sites_track",
    "standard_entries",
    "verdicts",
]
