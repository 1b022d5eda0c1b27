#!/usr/bin/env bash
# A wall of 10 m carries a roof and is pushed from the side, as a beam on two supports with a thrust.
# The thrust makes it bend more, and a pull would make it bend less: that is what Pynite's
# `analyze_PDelta` is for. One would guess that the deflection of a member grows with the thrust.
# It shrinks: 19.5 mm without a thrust, 13.4 mm with half of the load that buckles the member, where
# 39.7 mm are exact. The moment grows at the same time, though too little (49.5 for 77.2 kN m). With
# a pull of as many kN the deflection is 926 mm instead of 12.9 mm, more than without it, and there
# is no moment that bends the beam down at all.
# In members of half the length the thrust is nearly right (39.3 mm), the pull is still twice too
# large, and eight members are right for both. Nodes are right throughout, but the beam has none
# between its ends unless one adds some. That moments and deflections within members were wrong was
# mended in earlier releases (issues 179, 286). There is no message, and statics are in order.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq PyNiteFEA==3.2.0 numpy==2.4.6 scipy==1.17.1
venv/bin/python -W ignore - <<'PYTHON'
import contextlib
import importlib.metadata
import io
import math
import sys

from Pynite import FEModel3D

LENGTH_M, LOAD_KN_M, EI = 10.0, 3.0, 20_000.0


def bent(thrust_kn, members):
    """Return the largest deflection in mm and the largest moment in kN m."""
    model = FEModel3D()
    model.add_material("steel", 200e6, 80e6, 0.25, 0.0)
    model.add_section("beam", 0.01, 1e-4, 1e-4, 2e-4)
    for node in range(members + 1):
        model.add_node(f"N{node}", node * LENGTH_M / members, 0.0, 0.0)
    for member in range(members):
        model.add_member(f"M{member}", f"N{member}", f"N{member + 1}", "steel", "beam")
        model.add_member_dist_load(f"M{member}", "Fy", -LOAD_KN_M, -LOAD_KN_M)
    model.def_support("N0", True, True, True, True, False, False)
    model.def_support(f"N{members}", False, True, True, False, False, False)
    model.add_node_load(f"N{members}", "FX", -thrust_kn)
    with contextlib.redirect_stdout(io.StringIO()):
        model.analyze_PDelta()
    parts = model.members.values()
    down = -1000.0 * min(part.min_deflection("dy") for part in parts)
    return round(float(down), 1), round(-float(min(part.min_moment("Mz") for part in parts)), 1)


def exact(thrust_kn):
    """Return the same of the differential equation."""
    down, moment = 5.0 * LOAD_KN_M * LENGTH_M**4 / 384.0 / EI, LOAD_KN_M * LENGTH_M**2 / 8.0
    if thrust_kn:
        k = LENGTH_M / 2.0 * math.sqrt(abs(thrust_kn) / EI)
        sign, part = (1.0, 1.0 / math.cos(k)) if thrust_kn > 0.0 else (-1.0, 1.0 / math.cosh(k))
        down *= 12.0 * (2.0 * part - 2.0 - sign * k * k) / (5.0 * k**4)
        moment *= sign * 2.0 * (part - 1.0) / k**2
    return round(1000.0 * down, 1), round(moment, 1)


print("Pynite", importlib.metadata.version("PyNiteFEA"))
print(f"deflection in mm and moment in kN m; buckles at {math.pi**2 * EI / LENGTH_M**2:.0f} kN")
seen = {}
for thrust_kn in (0.0, 100.0, 500.0, 1000.0, -1000.0):
    seen[thrust_kn] = [bent(thrust_kn, members) for members in (1, 2, 8)]
    print(f"thrust {thrust_kn} kN: expected {exact(thrust_kn)}", end=", ")
    print("seen with 1, 2 and 8 members", *seen[thrust_kn])
as_found = exact(1000.0) == (39.7, 77.2) and exact(-1000.0) == (12.9, 24.6)
*shrinks, pulled = [of_one for (of_one, _), _, _ in seen.values()]
as_found = as_found and shrinks == [19.5, 18.4, 15.5, 13.4] and pulled > 100.0
as_found = as_found and seen[-1000.0][1][0] == 27.4
for thrust_kn, (_, _, of_eight) in seen.items():
    as_found = as_found and all(abs(a - b) < 0.11 for a, b in zip(of_eight, exact(thrust_kn)))
sys.exit(0 if as_found else "changed")
PYTHON
