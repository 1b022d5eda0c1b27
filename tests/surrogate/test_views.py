"""Views: what stands where around the way from a charge to a point."""

from typing import Any

import numpy as np
import pytest

from blast_env.surrogate import (
    VIEW,
    VIEW_ASIDE_M,
    VIEW_BEHIND_M,
    VIEW_BEYOND_M,
    VIEW_MOST,
    VIEW_STRETCHES,
    solid_views,
)

COLUMNS = len(VIEW_ASIDE_M) - 1
ROWS = VIEW // (2 * COLUMNS)
CHARGE_M = np.array([0.0, 0.0, 0.3])
POINT_M = np.array([[20.0, 0.0, 1.5]])
OUTWARD = np.array([[-0.6, 0.8]])
SCALE_M = float(np.cbrt(100.0))


def view(*solids: list[float], scale: float = 1.0, **changes: Any) -> np.ndarray:
    """Return covered shares and heights of the cells (2, ROWS, COLUMNS); lengths times a scale."""
    where = {"start_m": CHARGE_M, "points_m": POINT_M, "outward": OUTWARD} | changes
    where |= {name: scale * where[name] for name in ("start_m", "points_m")}
    found = solid_views(
        **where, scale_m=scale * SCALE_M, solids=scale * np.array(solids).reshape(-1, 5)
    )
    return found[0].reshape(2, ROWS, COLUMNS)


def boxes(seed: int, count: int = 5) -> np.ndarray:
    """Return solids around the way, left, bottom, right, top and height."""
    rng = np.random.default_rng(seed)
    corner_m = rng.uniform((-8.0, -9.0), (18.0, 7.0), (count, 2))
    sides_m, height_m = rng.uniform(0.4, 3.0, (count, 2)), rng.uniform(0.5, 4.0, (count, 1))
    return np.hstack((corner_m, corner_m + sides_m, height_m))


def test_a_wall_is_seen_where_it_stands_and_as_high_as_it_is() -> None:
    shares, heights = view([9.8, -0.25, 10.2, 1.25, 2.0])
    (rows, columns) = np.nonzero(shares)
    assert {*rows.tolist()} == {
        len(VIEW_BEHIND_M) - 1 + 7,
        len(VIEW_BEHIND_M) - 1 + 8,
    }  # at half way
    sides_m = (
        VIEW_ASIDE_M[columns],
        VIEW_ASIDE_M[columns + 1],
    )  # the wall of the point faces the side of y
    assert (sides_m[0].min(), sides_m[1].max()) == (-0.25, 1.25)
    assert heights[shares > 0.0] == pytest.approx(2.0 * 2.0 / SCALE_M * shares[shares > 0.0])
    behind, beyond = view([-2.5, -0.2, -2.0, 0.2, 2.0])[0], view([21.0, -0.2, 21.5, 0.2, 2.0])[0]
    assert np.nonzero(behind.sum(axis=1))[0].tolist() == [VIEW_BEHIND_M.tolist().index(-3.0)]
    assert np.nonzero(beyond.sum(axis=1))[0].tolist() == [ROWS - len(VIEW_BEYOND_M) + 1]


@pytest.mark.parametrize("seed", range(6))
def test_no_area_is_lost_and_solids_add_up(seed: int) -> None:
    solids = boxes(seed)
    together = view(*solids.tolist())
    lengths_m = np.concatenate(
        (
            np.diff(VIEW_BEHIND_M),
            np.full(VIEW_STRETCHES, 20.0 / VIEW_STRETCHES),
            np.diff(VIEW_BEYOND_M),
        )
    )
    cells_m2 = np.outer(lengths_m, np.diff(VIEW_ASIDE_M))
    sides_m = solids[:, 2:4] - solids[:, :2]
    assert (together[0] * cells_m2).sum() == pytest.approx(sides_m.prod(axis=1).sum())
    assert together == pytest.approx(sum(view(solid) for solid in solids.tolist()))


@pytest.mark.parametrize("seed", range(6))
def test_mirrors_turns_and_scales_change_no_view(seed: int) -> None:
    solids = boxes(seed)
    found = view(*solids.tolist())
    mirrored = (solids * (1.0, -1.0, 1.0, -1.0, 1.0))[:, [0, 3, 2, 1, 4]]
    assert view(*mirrored.tolist(), outward=OUTWARD * (1.0, -1.0)) == pytest.approx(found)
    turned = (solids * (1.0, -1.0, 1.0, -1.0, 1.0))[:, [3, 0, 1, 2, 4]]
    turned_to: dict[str, Any] = {
        "points_m": np.array([[0.0, 20.0, 1.5]]),
        "outward": OUTWARD[:, ::-1] * (-1, 1),
    }
    assert view(*turned.tolist(), **turned_to) == pytest.approx(found)
    # A charge of eight times the mass, and all twice as large: parts are no larger, so cells at
    # the edge of a solid have other shares, and all together the same.
    larger = view(*solids.tolist(), scale=2.0)
    assert larger[0].sum(axis=1) == pytest.approx(found[0].sum(axis=1), abs=0.8)
    assert larger.sum() == pytest.approx(found.sum(), rel=0.05)


def test_what_is_far_aside_is_not_seen() -> None:
    far = [[5.0, 12.5, 6.0, 14.0, 3.0], [-14.0, 0.0, -12.5, 1.0, 3.0], [26.0, 0.0, 27.0, 1.0, 3.0]]
    assert not view(*far).any()
    assert view(*far, [5.0, 11.0, 6.0, 11.5, 3.0]).any()


def test_points_of_a_column_share_a_view() -> None:
    points_m = np.array([[20.0, 0.0, 1.0], [20.0, 0.0, 3.0], [20.0, 2.0, 1.0]])
    solids = boxes(0)
    found = solid_views(CHARGE_M, points_m, np.repeat(OUTWARD, 3, axis=0), SCALE_M, solids)
    assert found.shape == (2, VIEW)
    assert found[0].reshape(2, ROWS, COLUMNS) == pytest.approx(view(*solids.tolist()))


def test_what_stands_just_behind_the_charge_is_in_the_last_cell_there() -> None:
    """Rounding had taken it beyond the table of cells."""
    shares, _ = view([-3e-17, -0.1, -1e-17, 0.1, 2.0])
    assert np.nonzero(shares.sum(axis=1))[0].tolist() == [len(VIEW_BEHIND_M) - 2]


def test_close_to_a_wall_numbers_stay_within_what_a_fit_has_seen() -> None:
    point_m = np.array([[0.2, 0.0, 1.5]])
    found = view([0.05, -2.0, 0.15, 2.0, 3.0], points_m=point_m)
    assert found.max() == VIEW_MOST
