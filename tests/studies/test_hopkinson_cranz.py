"""Charges of several masses, on made-up and on stored numbers."""

import pandas as pd
import pytest

from blast_env.evaluation.free_field import free_field
from blast_env.site import load_scenario
from studies.hopkinson_cranz import HEADERS, law_rows


@pytest.mark.parametrize("tnt_kg", [20.0, 1000.0])
def test_the_free_field_gets_the_charge(tnt_kg: float) -> None:
    (source,) = free_field(tnt_kg=tnt_kg).charge
    assert source.tnt_kg == tnt_kg


def test_the_free_field_without_changes_is_the_bundled_one() -> None:
    assert free_field().content_hash == load_scenario("free_field").content_hash


def test_the_errors_of_both_laws_by_hand() -> None:
    """A reference that is a power of the impulse, and a scaled law that is 10 % too high."""
    rows = [
        (tnt_kg, z * tnt_kg ** (1.0 / 3.0), i_sim, i_sim**1.25, 1.1 * i_sim**1.25)
        for tnt_kg in (20.0, 100.0)
        for z, i_sim in ((2.0, 40.0), (4.0, 20.0), (6.0, 14.0), (8.0, 10.0))
    ]
    names = ("tnt_kg", "distance_m", "i_sim", "reference_psi_s", "scaled_psi_s")
    found = law_rows(pd.DataFrame(rows, columns=list(names)))
    assert [len(row) for row in found] == [len(HEADERS)] * 2
    assert found[0] == ("20", "5.43 to 21.7", "10.0 %", "10.0 %", "10.0 %", "1.250", "0.0 %")
    assert found[1][0] == "100"
