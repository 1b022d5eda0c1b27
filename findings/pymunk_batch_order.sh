#!/usr/bin/env bash
# pymunk reads the positions of all bodies at once (`pymunk.batch`), many times faster than a loop.
# One would guess that they come in the order of `space.bodies`. They do until a body is removed:
# then the last body has the place of the removed one in the batch, while `space.bodies` keeps the
# order of adding.
# A particle model of a blast removes balls all the time. Who pairs the rows of the batch with a
# list of bodies then gives balls the speeds of others, and every impulse after the first removal is
# wrong.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq pymunk==7.3.1
venv/bin/python - <<'PYTHON'
import sys

import pymunk
import pymunk.batch

space = pymunk.Space()
for x in range(5):
    body = pymunk.Body(1.0, 1.0)
    body.position = (x, 0.0)
    space.add(body)
space.remove(next(each for each in space.bodies if each.position.x == 1.0))
buffer = pymunk.batch.Buffer()
pymunk.batch.get_space_bodies(space, pymunk.batch.BodyFields.POSITION, buffer)
batch = list(memoryview(buffer.float_buf()).cast("d"))[::2]
listed = [body.position.x for body in space.bodies]
print("pymunk", pymunk.version)
print("expected: the batch has the order of space.bodies,", listed)
print("seen:", batch)
sys.exit(0 if (batch, listed) == ([0.0, 4.0, 2.0, 3.0], [0.0, 2.0, 3.0, 4.0]) else "changed")
PYTHON
