"""The candidates for the collisional presets: what the search makes of their scores."""

from pathlib import Path

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.journal import Journal
from blast_env.physics.presets import preset
from studies.particles.candidates import (
    HIGH,
    LOW,
    Candidate,
    Score,
    ScoredCandidate,
    Store,
    candidate_table,
    front,
    front_figure,
)


def candidate(number: int) -> Candidate:
    return Candidate.from_point(LOW + (HIGH - LOW) * number / 10.0)


def its_score(mape_percent: float, two_corners: float, events: float) -> Score:
    return Score(mape_percent, 0.0, 1.0, 0.57, two_corners, events)


SCORES = {
    candidate(1): its_score(3.0, 0.49, 1e5),
    candidate(2): its_score(3.1, 0.49, 1e5),  # beaten by the first
    candidate(3): its_score(6.0, 0.49, 5e4),  # cheaper
    candidate(4): its_score(30.0, 0.01, 9e5),  # worse in all
    candidate(5): its_score(1.2, 0.61, 2e5),  # better over distance, at the bound behind corners
}


def test_errors_are_in_units_of_their_bounds() -> None:
    assert its_score(6.0, 0.49, 1.0).distance_error == pytest.approx(1.0)
    assert Score(0.0, 0.0, 1.4, 0.57, 0.49, 1.0).distance_error == pytest.approx(1.0)
    assert its_score(0.0, 0.61, 1.0).shielding_error == pytest.approx(1.0)
    assert its_score(0.0, 0.49, 1.0).shielding_error == 0.0


def test_the_front_is_what_nothing_beats_in_all_three() -> None:
    table = candidate_table(SCORES)
    assert front(table).events.tolist() == [5e4, 1e5, 2e5]
    assert front(table).index.tolist() == [2, 0, 4]


def test_a_candidate_is_balls_of_its_radius_in_the_air_that_it_names() -> None:
    """The packing is kept when balls are made finer, and so is the mass of the charge."""
    each = candidate(3)
    parameters = each.parameters()
    air, explosive = parameters.air, parameters.explosive
    assert air.radius_units == pytest.approx(each.radius_units)
    packing = np.pi * air.radius_units**2 / air.spacing_units**2
    assert packing == pytest.approx(each.packing_fraction)
    assert air.mass / air.spacing_units**2 == pytest.approx(each.air_density)
    assert explosive.mass * explosive.ball_count == pytest.approx(720.0)
    assert explosive.charge_scaling == preset("collisional").explosive.charge_scaling


def test_a_search_goes_on_with_what_it_has_and_refuses_what_is_none(tmp_path: Path) -> None:
    path = tmp_path / "candidates.jsonl"
    journal = Journal(path, ScoredCandidate)
    for each, score in SCORES.items():
        journal.add(ScoredCandidate(each, score))
    whole = path.read_text()
    path.write_text(f"{whole}{whole[:50]}")  # killed in the middle of a line
    assert Store(path, (0,), 1).scores == SCORES
    path.write_text(whole.replace('"loss"', '"los"', 1))
    with pytest.raises(BlastEnvError, match=r"jsonl: line 1: candidate.loss is missing; candidate"):
        Store(path, (0,), 1)


def test_the_figure_shows_every_candidate_and_the_presets() -> None:
    table = candidate_table(SCORES)
    table["on_front"] = table.index.isin(front(table).index)
    presets = table.iloc[:2].assign(preset=["collisional", "collisional_fine"])
    figure = front_figure(table, presets, "made up")
    for axes in figure.axes:
        offsets = np.concatenate([np.asarray(c.get_offsets()) for c in axes.collections])
        assert len(offsets) == len(SCORES) + 2
        low, high = axes.get_ylim()
        assert ((offsets[:, 1] >= low) & (offsets[:, 1] <= high)).all()
