"""The parts of the data that the learning curve of the surrogate fits to."""

import numpy as np

from studies.learning_curve import parts_of


def test_larger_parts_have_the_smaller_ones_and_no_held_out_site() -> None:
    site = np.repeat(np.arange(20), 3)
    held_out = site % 5 == 0
    quarter, half, whole = parts_of(site, held_out, (0.25, 0.5, 1.0), 0)
    assert [len(np.unique(site[mask])) for mask in (quarter, half, whole)] == [4, 8, 16]
    assert half[quarter].all()
    assert (whole == ~held_out).all()
