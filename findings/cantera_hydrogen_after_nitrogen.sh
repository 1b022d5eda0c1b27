#!/usr/bin/env bash
# A vessel of 1 m3 is tested with nitrogen of 10 atm, and holds hydrogen of 10 atm in service. A gas
# is given by temperature, pressure and composition (`gas.TPX`), so one would guess that
# `gas.X = "H2:1"` alone changes the composition and leaves the other two. It leaves temperature and
# density: the pressure is 139 atm now. The docstring of `X` speaks of no other quantity. `gas.TPX`
# with None for temperature and pressure is what leaves them.
# The speed of sound is right either way, as it is the temperature's, and so it is no check. The
# blast of a vessel that bursts goes with its energy, here by Brode, which is 15 times too large.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq cantera==3.2.0 numpy==2.4.6
venv/bin/python - <<'PYTHON'
import sys

import cantera


def nitrogen():
    gas = cantera.Solution("h2o2.yaml")
    gas.TPX = 300.0, 10.0 * cantera.one_atm, "N2:1"
    return gas


def told(gas):
    """Return pressure (atm), energy of 1 m3 by Brode (MJ) and speed of sound (m/s)."""
    energy = (gas.P - cantera.one_atm) / (gas.cp / gas.cv - 1.0)
    return round(gas.P / cantera.one_atm, 1), round(energy / 1e6, 1), round(gas.sound_speed)


by_name, by_all = nitrogen(), nitrogen()
by_name.X = "H2:1"
by_all.TPX = None, None, "H2:1"
seen = {"X": told(by_name), "TPX": told(by_all)}
print("cantera", cantera.__version__, "- nitrogen:", told(nitrogen()))
print("expected: hydrogen of 10 atm by either way, 2.3 MJ, sound of 1318 m/s")
print("seen:", seen)
as_found = seen["X"] == (139.0, 34.5, 1318) and seen["TPX"] == (10.0, 2.3, 1318)
sys.exit(0 if as_found else "changed")
PYTHON
