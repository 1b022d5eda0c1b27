"""The table of glass plates."""

import numpy as np

from blast_env.response.plate_table import plate_curve


def test_an_aspect_ratio_between_two_of_the_table() -> None:
    low, between, high = (plate_curve(ratio).load for ratio in (1.5, 1.6, 1.75))
    assert np.all((between - low) * (high - between) >= 0.0)
