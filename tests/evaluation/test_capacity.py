"""The largest charge and the least stand-off that keep a level, with scaled histories as blasts."""

from dataclasses import replace

import pytest

from blast_env.answers import Table
from blast_env.answers.assess import capacity_answer
from blast_env.evaluation import BlastEvaluator, LoadCaseSet
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.questions import capacity
from blast_env.evaluation.questions.capacity import Edge, Ladder, PlaceCapacity
from blast_env.evaluation.questions.probability import scaled_to
from blast_env.evaluation.questions.verdict import Consequences
from blast_env.response import LevelOfProtection
from blast_env.site import Charge
from tests.blasts import consequences
from tests.gas_sites import glazed_hut

CHARGE = Charge((2.0, 4.0), 0.1)


@pytest.fixture(scope="module")
def blast() -> Consequences:
    return consequences(BlastEvaluator(glazed_hut(), GasEngine()), (), [CHARGE])


@pytest.fixture
def ladder(blast: Consequences, monkeypatch: pytest.MonkeyPatch) -> Ladder:
    def scaled(campaign: Campaign) -> LoadCaseSet:
        campaign.scenario.with_possible_charges(campaign.case.charges)
        return campaign.case

    monkeypatch.setattr(Campaign, "run", scaled)
    answer = lambda case: scaled_to(blast, case.charges[0])  # noqa: E731
    monkeypatch.setattr(capacity, "consequences_of", answer)
    return Ladder(BlastEvaluator(glazed_hut(), GasEngine()), (), CHARGE)


@pytest.mark.parametrize(
    ("level", "nearer"), [(LevelOfProtection.MEDIUM, False), (LevelOfProtection.LOW, True)]
)
def test_a_level_is_kept_up_to_the_edge(
    ladder: Ladder, blast: Consequences, level: LevelOfProtection, nearer: bool
) -> None:
    if nearer:  # a charge that keeps the level where it stands, and has room towards the wall
        ladder = replace(ladder, charge=CHARGE._replace(tnt_kg=0.2))
    edge = ladder.edge(level, nearer)
    assert edge.is_kept
    assert not edge.is_end
    for share, keeps in ((0.95, True), (1.05, False)):
        charge = edge.charge._replace(tnt_kg=share * edge.charge.tnt_kg)
        assert scaled_to(blast, charge).passes(level) is keeps
    if nearer:
        assert edge.charge.tnt_kg == ladder.charge.tnt_kg
        assert edge.stand_off_m == pytest.approx(6.0 - edge.charge.position_m[0])


def test_the_stand_off_ends_at_the_border_of_the_site(ladder: Ladder) -> None:
    edge = ladder.edge(LevelOfProtection.HIGH, nearer=True)
    assert not edge.is_kept
    assert edge.is_end


def test_a_lower_level_bears_more(ladder: Ladder) -> None:
    edges = [ladder.edge(level) for level in list(LevelOfProtection)[1:]]
    masses = [edge.charge.tnt_kg for edge in edges]
    assert masses == sorted(masses, reverse=True)
    before = ladder.blasts
    ladder.edge(LevelOfProtection.MEDIUM)
    assert ladder.blasts == before <= 11


def test_the_end_of_the_ladder_is_a_bound() -> None:
    edges = (
        Edge(CHARGE, 4.0, is_end=True),
        Edge(CHARGE, 4.0, is_kept=False, is_end=True),
        *(Edge(CHARGE, 4.0),) * 2,
    )
    place = PlaceCapacity("wall", CHARGE, 4.0, edges, edges, 3)
    _, masses, stand_offs = capacity_answer(glazed_hut(), [place])
    assert isinstance(masses, Table)
    assert isinstance(stand_offs, Table)
    raised = replace(place, charge=CHARGE._replace(height_m=1.5))
    _, high, _ = capacity_answer(glazed_hut(), [raised])
    assert isinstance(high, Table)
    assert high.cells()[0][1] == "2.0, 4.0, 1.5 m high"
    assert masses.cells() == [("wall", "2.0, 4.0", "4.0 m", ">= 0.1", "< 0.1", "0.1", "0.1")]
    assert stand_offs.cells() == [("wall", "2.0, 4.0", "0.1 kg", "<= 4.0", "> 4.0", "4.0", "4.0")]


def test_a_largest_charge_is_rounded_down_and_a_least_stand_off_up() -> None:
    edges = (Edge(CHARGE._replace(tnt_kg=116.9), 8.04), Edge(CHARGE._replace(tnt_kg=2.239), 8.0))
    _, masses, stand_offs = capacity_answer(
        glazed_hut(), [PlaceCapacity("wall", CHARGE, 4.0, edges, edges, 3)]
    )
    assert isinstance(masses, Table)
    assert isinstance(stand_offs, Table)
    assert masses.cells()[0][-2:] == ("116", "2.23")
    assert stand_offs.cells()[0][-2:] == ("8.1", "8.0")
