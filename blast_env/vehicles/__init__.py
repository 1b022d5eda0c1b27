"""Vehicles with a charge: reach, speeds, worst places, crash ratings, and the access way."""

from blast_env.vehicles.access_way import AccessWay
from blast_env.vehicles.crash_rating import CrashRating
from blast_env.vehicles.drive import (
    NOTHING,
    Drive,
    Impact,
    Obstacles,
    RatedPiece,
    VehicleGround,
)
from blast_env.vehicles.reach import Reach
from blast_env.vehicles.vehicle import Entry, Motion, SlowArea, Vehicle
from blast_env.vehicles.worst_places import Wall, WorstPlaces, nearest_point_m, stand_off_m

__all__ = [
    "NOTHING",
    "AccessWay",
    "CrashRating",
    "Drive",
    "Entry",
    "Impact",
    "Motion",
    "Obstacles",
    "RatedPiece",
    "Reach",
    "SlowArea",
    "Vehicle",
    "VehicleGround",
    "Wall",
    "WorstPlaces",
    "nearest_point_m",
    "stand_off_m",
]
