"""The plain arrays that the compiled code of the event engine works on.

Records rather than one array a quantity: all that is known of a ball lies together in memory, and
a compiled function takes few arguments.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

RecordArray = NDArray[np.void]
Record = Any
"""One element of a `RecordArray`."""

# Partners of a ball that are not balls.
NOBODY: Final = -1
BORDER: Final = -2
FIRST_SURFACE: Final = -3  # surface k is FIRST_SURFACE - k

# Kinds of surfaces.
FACE_X: Final = 0  # its normal is along x
FACE_Y: Final = 1
CORNER: Final = 2

# What the loop has to do before it goes on.
NEW: Final = 0  # put the balls into their cells
RUNNING: Final = 1
CHANGED: Final = 2  # look at the walls again

BALL: Final = np.dtype(
    [
        ("x", np.float64),  # at the last collision
        ("y", np.float64),
        ("vx", np.float64),
        ("vy", np.float64),
        ("since_s", np.float64),  # time of the last collision
        ("radius", np.float64),
        ("mass", np.float64),
        ("following", np.int32),  # next ball in the list of the cell, -1 for none
        ("collisions", np.int32),  # so far
        # Up to here one cache line: what others need to know of the ball.
        ("spin", np.float64),  # radians per second
        ("contact_s", np.float64),  # time of the next collision, inf for none
        ("crossing_s", np.float64),  # time at which the ball leaves its cell
        ("module_s", np.float64),  # time of the last collision with a module
        ("partner", np.int32),  # of the next collision: a ball, or one of the numbers above
        # `collisions` of the partner when that was found: another number now means that the
        # partner was hit in between.
        ("partner_collisions", np.int32),
        ("cell", np.int32),
        ("crossing", np.int32),  # step to the number of the next cell
        ("previous", np.int32),  # ball before in that list, -1 for none
        ("rattles", np.int32),  # collisions with modules alone so far within one contact
        ("presses", np.int32),  # collisions of any kind so far within one contact
        ("explosive", np.int16),  # 1 for a ball of the charge, 0 for air
        ("alive", np.int16),  # 1 while it is on the site
    ],
    align=True,
)

CELL: Final = np.dtype(
    [
        ("left", np.float64),
        ("bottom", np.float64),
        ("first_air", np.int32),  # first ball of each list, -1 for none
        ("first_explosive", np.int32),
        ("surfaces_from", np.int32),  # the surfaces that a ball in this cell can touch
        ("surfaces_to", np.int32),
    ]
)

HEAP_ENTRY: Final = np.dtype(
    [
        ("time_s", np.float64),
        ("ball", np.int32),
        # In the heap, of the ball that has this entry's number; 0 if it is not in it. Every move
        # in the heap writes one: here they lie closer together than they would in `BALL`.
        ("place", np.int32),
    ]
)
"""Entry 0 is no entry: its `ball` is the number of entries."""

SURFACE: Final = np.dtype(
    [
        ("a", np.float64),  # faces: sign of the normal; corners: x
        ("b", np.float64),  # faces: coordinate along the normal; corners: y
        ("low", np.float64),  # faces: the ends across the normal
        ("high", np.float64),
        ("modules_from", np.int32),  # its modules, ordered along it, in the array of modules
        ("modules_to", np.int32),
        ("kind", np.int64),  # FACE_X, FACE_Y or CORNER
    ],
    align=True,
)

LOAD: Final = np.dtype(
    [
        ("hits", np.int64),
        ("impulse", np.float64),  # sum of m |v|
        ("transferred", np.float64),  # sum of the momentum along the normals
        ("first_hit_s", np.float64),  # inf before the first
        ("capacity", np.float64),  # impulse that the module bears, inf for any
    ]
)

RULES: Final = np.dtype(
    [
        ("left", np.float64),  # the site
        ("bottom", np.float64),
        ("right", np.float64),
        ("top", np.float64),
        ("cell_units", np.float64),  # side of a cell
        ("columns", np.int64),  # cells in a row, with the two of the ring around the site
        # By the number of explosive balls among the two:
        ("restitution", np.float64, (3,)),
        ("friction", np.float64, (3,)),
        # Of air and of explosive balls:
        ("inertia_factor", np.float64, (2,)),  # moment of inertia over m r^2
        ("module_friction", np.float64, (2,)),
        ("module_restitution", np.float64),
        ("module_shrink", np.float64),
        ("air_shrink", np.float64),
        ("minimum_radius", np.float64),
        ("base_impulse", np.float64),
        ("charge_collides", np.int64),  # 1 if balls of the charge collide with each other
        ("contact_time_s", np.float64),  # hits within this time belong to one contact
        ("rest_speed", np.float64),  # a ball slower than this within one contact is at rest
        ("quantum", np.float64),  # recorded impulses are multiples of this
        ("time_limit_s", np.float64),
        ("most_collisions", np.int64),
    ],
    align=True,
)

PROGRESS: Final = np.dtype(
    [
        ("time_s", np.float64),  # of the last collision
        ("collisions", np.int64),
        ("crossings", np.int64),  # of balls into other cells
        ("outdated", np.int64),  # collisions that did not happen, their partner being hit before
        ("next_check", np.int64),  # collisions at which to look whether a structure is in reach
        ("records", np.int64),  # rows written
        ("stage", np.int64),  # NEW, RUNNING or CHANGED
        ("source_digest", np.int64),  # of the compiled code
    ]
)

RECORD_COLUMNS: Final = (
    "time_s",
    "ball",
    "module",
    "mass",
    "vx",
    "vy",
    "normal_x",
    "normal_y",
    "impulse",
    "transferred_impulse",
    "earlier_collisions",
    "first_contact",
)
"""Columns of the record that the compiled code writes; fields of `COLLISION_DTYPE`."""
