"""Surrogates that nobody has fitted, and the site of the tests."""

import json

import numpy as np
import pandas as pd

from blast_env.evaluation import LoadCaseSet, draw_threats
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.rules import random_layout
from blast_env.site import Charge, Scenario
from blast_env.surrogate import (
    FEATURES,
    INPUTS,
    SHAPES,
    SHARES,
    Check,
    Fit,
    Member,
    Networks,
    Surrogate,
    site_of,
)
from studies.blast_table import COLUMNS
from tests.catalogue_sites import wide_yard

CHARGE_M = np.array([0.0, 0.0, 0.3])
NOTHING = np.empty((0, 5))
FAST = GasEngine(border_m=0.0, until=0.02)
YARD = wide_yard()
PEAKS = Scenario.from_document(YARD.model_dump() | {"objective": {"quantity": "peak"}}, "peaks")
CHECK = Check(rms=0.2, rank=0.8, lost=0.03, spreads=10.0, least_spread=0.0)
ABOUT = Fit(command="by hand", versions={}, engine="made up", blasts=1, sites=1, impulse=CHECK)


def wall(x_m: float, low_m: float, high_m: float, height_m: float) -> list[float]:
    return [x_m, low_m, x_m + 0.5, high_m, height_m]


def by_hand(seed: int = 0, members: int = 2) -> Surrogate:
    """Return networks that nobody has fitted; what hides a wall lowers their guesses."""
    rng = np.random.default_rng(seed)
    networks = []
    for _ in range(2 * members):
        member = Member(*(0.05 * rng.standard_normal(shape) for shape in SHAPES))
        member.first[FEATURES - SHARES : FEATURES] += 0.2
        member.first[FEATURES:] *= 0.3
        member.structure_view[:] *= 0.1
        member.piece_view[:] *= 0.1
        member.second[:] += 0.02
        member.last[:] += 0.02
        networks.append(member)
    of_both = Networks(networks[:members]), Networks(networks[members:])
    return Surrogate(np.zeros(INPUTS), np.ones(INPUTS), *of_both, ABOUT)


def table_of_guesses(truth: Surrogate, layouts: int) -> pd.DataFrame:
    """Return a table of blasts that never were: what one surrogate says, for another to learn.

    Ten layouts meet each charge.
    """
    site, rng = site_of(PEAKS), np.random.default_rng(1)
    tried = [(), *(random_layout(YARD, rng) for _ in range(layouts - 1))]
    places = rng.random((-(-layouts // 10), 2))
    charges = [
        Charge((1.0 + 1.5 * x, 3.0 + 6.0 * y), 5.0)
        for x, y in places[np.arange(layouts) // 10].tolist()
    ]
    said = truth.guess(site, tried, charges)
    assert said.peak_pa is not None
    rows = [
        ("", YARD.content_hash, json.dumps(layout), *charge.position_m, 0.0, 5.0, 0, "gas")
        + (structure.name, True)
        + (float(said.impulse_pa_s[number, column]), float(said.peak_pa[number, column]))
        + ("[]", "[]")
        for number, (layout, charge) in enumerate(zip(tried, charges, strict=True))
        for column, structure in enumerate(site.protected)
    ]
    return pd.DataFrame(rows, columns=[column.name for column in COLUMNS])


def case(charges: int = 1) -> LoadCaseSet:
    return LoadCaseSet(YARD, draw_threats(YARD, range(charges)))
