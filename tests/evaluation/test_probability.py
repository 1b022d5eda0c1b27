"""The probability of a level, what drives it, and histories scaled to another mass."""

from dataclasses import replace

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.questions.probability import (
    LevelProbability,
    Uncertainty,
    level_probability,
    probability_text,
    scaled_to,
)
from blast_env.evaluation.questions.verdict import Consequences
from blast_env.response import LevelOfProtection, impulses
from blast_env.site import Charge
from tests.blasts import consequences
from tests.gas_sites import WALL, glazed_hut

CHARGE = Charge((2.0, 4.0), 0.1)
CERTAIN = Uncertainty(mass=0.0, scatter=0.0, in_sight=0.0, in_shade=0.0, panels=0.0)


def judge(tnt_kg: float = CHARGE.tnt_kg) -> Consequences:
    return consequences(
        BlastEvaluator(glazed_hut(), GasEngine()), WALL, [CHARGE._replace(tnt_kg=tnt_kg)]
    )


@pytest.fixture(scope="module")
def found() -> Consequences:
    return judge()


def test_with_certain_loads_the_share_of_panes_that_break_decides(found: Consequences) -> None:
    """The worst pane alone: one draw of the strength stands for all panes."""
    glazing = found.responses[0].facade.glazing
    likely = level_probability(found, CERTAIN, 500)
    breaks = float(glazing.break_probability.max())
    assert 0.05 < breaks < 0.95
    assert likely.of(LevelOfProtection.HIGH) == pytest.approx(1.0 - breaks, abs=2e-3)
    assert next(iter(likely.drivers(LevelOfProtection.HIGH))) == "glass"


def test_no_bay_that_is_left_out_decides(found: Consequences) -> None:
    few, every = (level_probability(found, Uncertainty(), 100, deciding=k) for k in (3, 100))
    np.testing.assert_array_equal(few.levels, every.levels)


def test_more_charge_makes_a_level_less_likely(found: Consequences) -> None:
    level = LevelOfProtection.HIGH
    shares = [
        level_probability(scaled_to(found, CHARGE._replace(tnt_kg=kg)), Uncertainty(), 100).of(
            level
        )
        for kg in (0.31, 0.4, 0.52)
    ]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > shares[2]


@pytest.mark.parametrize("share", [1.3, 1.0 / 1.3])
def test_scaled_histories_are_those_of_a_blast_of_that_mass(
    found: Consequences, share: float
) -> None:
    """On the bays with a tenth of the largest impulse or more."""
    mass_kg = share * CHARGE.tnt_kg
    blast, scaled = (
        case.responses[0].on_cells
        for case in (judge(mass_kg), scaled_to(found, CHARGE._replace(tnt_kg=mass_kg)))
    )
    of_blast, of_scaled = (
        impulses(case.time_s, case.pressure_pa).max(axis=1) for case in (blast, scaled)
    )
    counts = of_blast > 0.1 * of_blast.max()
    assert np.abs(of_scaled / of_blast - 1.0)[counts].max() < 0.1


def test_an_index_is_the_share_of_the_variance_that_a_quantity_explains() -> None:
    """A level that the charge decides alone, and one that nothing decides alone."""
    quantiles = np.random.default_rng(1).random((4000, 5))
    alone = np.where(quantiles[:, 0] < 0.7, 3, 2)
    together = np.where((quantiles[:, 0] < 0.5) == (quantiles[:, 1] < 0.5), 3, 2)
    level = LevelOfProtection.MEDIUM
    of_alone, of_both = (LevelProbability(case, quantiles) for case in (alone, together))
    assert of_alone.drivers(level)["charge"] > 0.9
    assert max(of_both.drivers(level).values()) < 0.05
    assert of_alone.words(level).startswith("'medium' with 0.7")
    assert "driven by charge (1.0)" in of_alone.words(level)
    assert of_alone.words(LevelOfProtection.HIGH) == "'high' with less than 0.001"


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.0, "more than 0.997"), (0.0, "less than 0.003"), (0.84, "0.84"), (0.998, "0.998")],
)
def test_a_thousand_draws_prove_no_certainty(value: float, text: str) -> None:
    assert probability_text(value, 1000) == text


@pytest.mark.parametrize("draws", [1, 2, 3, 4, 5, 19, 20, 39, 41])
def test_a_few_draws_tell_what_they_can(draws: int) -> None:
    """As many classes as have two draws each; of fewer than four nothing drives the level."""
    quantiles = (np.tile(np.arange(draws)[:, np.newaxis], 5) + 0.5) / draws
    likely = LevelProbability(np.where(quantiles[:, 0] < 0.5, 3, 2), quantiles)
    shares = likely.drivers(LevelOfProtection.MEDIUM).values()
    assert len(shares) == (5 if draws >= 4 else 0)
    assert all(0.0 < share <= 1.0 for share in shares)
    assert likely.words(LevelOfProtection.MEDIUM).startswith("'medium' with ")
    assert 0.0 <= float(probability_text(1.0, draws).split()[-1]) < 1.0


def test_no_draw_and_no_bay_are_refused(found: Consequences) -> None:
    with pytest.raises(BlastEnvError, match="draws is 0, must be an integer from 1"):
        level_probability(found, Uncertainty(), 0)
    with pytest.raises(BlastEnvError, match="deciding is 0, must be an integer from 1"):
        level_probability(found, Uncertainty(), deciding=0)


def test_a_mass_beyond_the_scaled_range_and_a_site_without_facades() -> None:
    with pytest.raises(BlastEnvError, match=r"mass is 0\.4, must be at most 0\.3"):
        Uncertainty(mass=0.4)
    with pytest.raises(BlastEnvError, match="no building has a facade"):
        level_probability(Consequences(()), Uncertainty())


def test_in_the_shade_of_a_wall_loads_are_less_certain(found: Consequences) -> None:
    places = found.responses[0].places
    assert places.distance_m.min() == pytest.approx(4.0, abs=0.5)
    assert not places.seen.any()
    site = found.responses[0].site
    assert site is not None
    unprotected = replace(found.responses[0], site=replace(site, structures=site.structures[:1]))
    assert unprotected.places.seen.tolist() == [True, True, *[False] * (len(places.seen) - 2)]
    shaded, seen = (
        level_probability(replace(found, responses=(case,)), replace(CERTAIN, in_shade=0.5), 200)
        for case in (found.responses[0], unprotected)
    )
    assert shaded.of(LevelOfProtection.LOW) < seen.of(LevelOfProtection.LOW)
