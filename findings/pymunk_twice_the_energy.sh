#!/usr/bin/env bash
# pymunk's `Body.kinetic_energy` is half the mass times the square of the speed, one would guess,
# and `Arbiter.total_ke` what of it a collision takes. Both are twice that. They agree with each
# other, so that shares of energy are right, and a balance made of them alone closes.
# Who gives balls their speeds by the energy of a charge makes them slower by the root of two, and
# every impulse smaller with them.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq pymunk==7.3.1
venv/bin/python - <<'PYTHON'
import sys

import pymunk

MASS = 2.0
space = pymunk.Space()
body = pymunk.Body(MASS, 1.0)
body.velocity = (3.0, 0.0)
ball = pymunk.Circle(body, 0.5)
ball.elasticity = 0.5
wall = pymunk.Segment(space.static_body, (2.0, -9.0), (2.0, 9.0), 0.1)
wall.elasticity = 1.0
space.add(body, ball, wall)
lost = []
space.on_collision(post_solve=lambda arbiter, *_: lost.append(arbiter.total_ke))


def by_mechanics():
    return 0.5 * MASS * body.velocity.length**2


seen, expected = [body.kinetic_energy], [by_mechanics()]
while not lost:
    space.step(0.01)
seen.append(lost[0])
expected.append(expected[0] - by_mechanics())
print("pymunk", pymunk.version)
print("expected: the energy before the collision, and what it takes:", expected)
print("seen:", seen)
as_found = all(abs(a - b) < 1e-9 for a, b in zip(seen + expected, [18.0, 13.5, 9.0, 6.75]))
sys.exit(0 if as_found else "changed")
PYTHON
