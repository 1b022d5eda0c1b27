"""Pieces of a barrier as rigid bodies: energy, thresholds, anchors."""

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.response.barriers import RigidPiece, Standing, piece_responses

PIECE = RigidPiece(height_m=1.0, base_m=0.6, mass_kg_m=1000.0)


def triangle(peak_pa: float, impulse_pa_s: float) -> tuple[np.ndarray, np.ndarray]:
    end_s = 2.0 * impulse_pa_s / peak_pa
    return np.array([0.0, end_s]), np.array([[peak_pa, 0.0]])


@pytest.mark.parametrize("impulse", [1200.0, 3000.0])
def test_an_impulse_slides_a_piece_until_friction_has_taken_its_energy(impulse: float) -> None:
    """M v^2 / 2 = mu M g x."""
    speed = impulse * PIECE.height_m / PIECE.mass_kg_m
    found = piece_responses([PIECE], *triangle(100.0 * impulse, impulse))
    assert found.slide_m[0] == pytest.approx(speed**2 / (2.0 * 0.5 * 9.81), rel=0.05)


def test_less_than_friction_and_weight_moves_nothing() -> None:
    force = 0.4 * PIECE.mass_kg_m * 9.81
    found = piece_responses([PIECE], np.array([0.0, 1.0]), np.full((1, 2), force))
    assert found.slide_m[0] == 0.0
    assert found.standing == [Standing.STANDS]


def test_the_impulse_that_overturns_by_energy() -> None:
    """I w^2 / 2 = M g (r - H / 2), with i H H / 2 = I w about the edge."""
    inertia = PIECE.mass_kg_m * (1.0 + 0.36) / 3.0
    lift = 0.5 * (np.hypot(1.0, 0.6) - 1.0)
    impulse = inertia * np.sqrt(2.0 * PIECE.mass_kg_m * 9.81 * lift / inertia) / 0.5
    less, more = (
        piece_responses([PIECE], *triangle(500.0 * impulse, factor * impulse))
        for factor in (0.93, 1.07)
    )
    assert less.tilt[0] < 1.0 <= more.tilt[0]
    assert np.isinf(less.overturn_s[0])
    assert more.standing == [Standing.OVERTURNS]


def test_the_side_that_is_pushed_does_not_matter() -> None:
    time_s, pressure = triangle(2e5, 1200.0)
    there, back = (
        piece_responses([PIECE], time_s, pressure),
        piece_responses([PIECE], time_s, -pressure),
    )
    assert there.slide_m[0] == back.slide_m[0]
    assert there.tilt[0] == back.tilt[0]


def test_anchors_hold_up_to_their_capacity() -> None:
    time_s, pressure = triangle(2e5, 1200.0)
    weak, strong = (
        RigidPiece(1.0, 0.6, 1000.0, anchor_n_m=capacity) for capacity in (1.9e5, 2.1e5)
    )
    found = piece_responses([weak, strong], time_s, np.repeat(pressure, 2, axis=0))
    assert found.held.tolist() == [0.0, 1.0]
    assert found.standing[1] is Standing.STANDS


def test_wrong_pieces() -> None:
    with pytest.raises(BlastEnvError, match=r"mass_kg_m is 0.0, must be above 0"):
        RigidPiece(1.0, 0.6, 0.0)
    with pytest.raises(BlastEnvError, match=r"friction is -0.1, must be at least 0"):
        RigidPiece(1.0, 0.6, 1.0, friction=-0.1)
