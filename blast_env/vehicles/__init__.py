"""Vehicles with a charge: reach, speeds, worst places, crash ratings, and the access way."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.geometry import Wall
    from blast_env.vehicles.drive import Drive, Impact, VehicleGround
    from blast_env.vehicles.driving import KM_H_PER_M_S, STEP_M, SpeedField
    from blast_env.vehicles.reach import Reach
    from blast_env.vehicles.vehicle import (
        NOTHING,
        AccessWay,
        CrashPiece,
        CrashRating,
        Entry,
        Motion,
        Obstacles,
        SlowArea,
        Vehicle,
        closing_places,
        is_open,
    )
    from blast_env.vehicles.worst_places import WorstPlaces, nearest_point_m, stand_off_m
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "KM_H_PER_M_S",
    "NOTHING",
    "STEP_M",
    "AccessWay",
    "CrashPiece",
    "CrashRating",
    "Drive",
    "Entry",
    "Impact",
    "Motion",
    "Obstacles",
    "Reach",
    "SlowArea",
    "SpeedField",
    "Vehicle",
    "VehicleGround",
    "Wall",
    "WorstPlaces",
    "closing_places",
    "is_open",
    "nearest_point_m",
    "stand_off_m",
]
