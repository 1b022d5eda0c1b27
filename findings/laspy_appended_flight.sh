#!/usr/bin/env bash
# Heights of a town come as one LAS file for each strip of a flight. LAS keeps whole numbers, with a
# scale and an offset in each file's header. laspy knows them: points that are read have their
# coordinates in metres, and `write_points` into a file with another header changes the numbers so
# that the coordinates stay. One would guess that `append_points`, which takes the same points, does
# so too. It writes the numbers as they are, and they count by the header of the first strip. Points
# 250 m to the east come to lie on the first strip, spread ten times as wide, since its scale is
# centimetres and not millimetres. There is no message. `LasData(header, points)` is the same.
# Strips with one scale and one offset are right.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq laspy==2.7.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys

import laspy
import numpy as np

EAST = {"west": [500000.0, 500001.0], "east": [500250.5, 500251.0]}


def strip(name, offset, scale):
    header = laspy.LasHeader(point_format=3, version="1.4")
    header.offsets, header.scales = [offset, 0.0, 0.0], [scale] * 3
    points = laspy.LasData(header)
    points.x, points.y, points.z = np.array(EAST[name]), np.zeros(2), np.full(2, 8.0)
    points.write(f"{name}.las")
    return laspy.read(f"{name}.las")


def told(name):
    points = laspy.read(name)
    return np.asarray(points.x).round(3).tolist(), np.asarray(points.z).round(3).tolist()


west, east = strip("west", 500000.0, 0.01), strip("east", 500250.0, 0.001)
with laspy.open("written.las", mode="w", header=west.header) as file:
    file.write_points(west.points)
    file.write_points(east.points)
with laspy.open("west.las", mode="a") as file:
    file.append_points(east.points)
laspy.LasData(west.header, east.points).write("joined.las")

seen = {name: told(f"{name}.las") for name in ("east", "written", "west", "joined")}
print("laspy", importlib.metadata.version("laspy"))
print("expected: eastings", EAST["west"] + EAST["east"], "and heights of 8 m after either")
print("seen, write_points: ", *seen["written"])
print("seen, append_points:", *seen["west"])
print("seen, LasData(header, points) of the eastern ones:", *seen["joined"])
right = (EAST["west"] + EAST["east"], [8.0] * 4)
wrong = ([500000.0, 500001.0, 500005.0, 500010.0], [8.0, 8.0, 80.0, 80.0])
as_found = seen["east"] == (EAST["east"], [8.0] * 2) and seen["written"] == right
as_found = as_found and seen["west"] == wrong and seen["joined"] == (wrong[0][2:], [80.0] * 2)
sys.exit(0 if as_found else "changed")
PYTHON
