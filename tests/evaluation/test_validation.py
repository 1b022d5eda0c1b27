"""The validation status of a load, and its reason."""

import pytest

from blast_env.answers.compare import building_verdicts
from blast_env.evaluation import BlastEvaluator, LoadCase, evaluate_layout
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.evaluation.engines.gas_validation import validation_of
from blast_env.evaluation.questions.limits import Limit, LoadLimit, SiteVerdict
from blast_env.evaluation.questions.verdict import Consequences, bay_table
from blast_env.evaluation.record import BuildingLoad
from blast_env.evaluation.validation import NOT_KNOWN, Validation, ValidationStatus
from blast_env.geometry import Layout
from blast_env.response import Glazing, Interlayer, LevelOfProtection, catalogue
from blast_env.site import Charge
from tests.blasts import consequences
from tests.gas_sites import WALL, glazed_hut, hut, site_document
from tests.scenarios import BALLISTIC_COURTYARD


@pytest.mark.parametrize(
    ("place", "status", "reason"),
    [
        ((3.0, 0.0, 12.0, True, False, False), "measured", "in sight"),
        ((3.0, 1.0, 12.0, True, False, False), "verified", "in the shade"),
        ((3.0, 0.25, 12.0, True, False, False), "verified", "25% of it in the shade"),
        ((3.0, 0.0, 12.0, True, True, False), "approximate", "oblique"),
        ((3.0, 0.0, 12.0, True, False, True), "approximate", "above the ground"),
        ((3.0, 1.0, 12.0, True, False, True), "approximate", "above the ground"),
        (
            (3.0, 0.0, 5.0, True, False, False),
            "approximate",
            "5 cells per m/kg^(1/3), checked from 9.2",
        ),
        ((1.2, 0.0, 12.0, True, False, False), "outside", "scaled distance 1.20 m/kg^(1/3)"),
        ((9.0, 1.0, 5.0, True, True, False), "outside", "checked from 1.7 to 8.6"),
        ((3.0, 0.0, 12.0, False, False, False), "outside", "not yet captured"),
    ],
)
def test_the_worst_reason_decides(
    place: tuple[float, float, float, bool, bool, bool], status: str, reason: str
) -> None:
    found = validation_of(*place)
    assert found.status.label == status
    assert reason in found.reason
    assert found.words == f"{status} ({found.reason})"


def test_bays_have_their_standing_in_tables_and_the_deciding_one_in_the_verdict() -> None:
    found = consequences(BlastEvaluator(glazed_hut(), GasEngine()), WALL, [Charge((2.0, 4.0), 5.0)])
    table = bay_table({"wall": found})
    assert set(table["validation"]) == {"approximate"}  # 3.4 cells per m/kg^(1/3)
    assert table["reason"].str.startswith("3.4 cells").all()
    (response,) = found.responses
    assert found.validation("hut") == response.validations[response.deciding_bay]
    facade = response.facade
    worst = max(facade.glazing.hazard.max(), facade.walls.damage.max())
    own = [*facade.glazing.hazard[facade.glazed == response.deciding_bay]]
    own += [*facade.walls.damage[facade.walled == response.deciding_bay]]
    assert max(own) == worst


@pytest.fixture(scope="module")
def fine_blasts() -> dict[str, GasResult]:
    """Blasts of 13 kg at 4.5 m on cells of 0.25 m, 9.4 per m/kg^(1/3); the west wall counts."""
    scenario = hut(structures=[{**site_document()["structures"][0], "faces": ["west"]}])
    engine, charge = GasEngine(cell_m=0.25), Charge((1.5, 4.0), 13.0)
    layouts: dict[str, Layout] = {"bare": (), "wall": WALL[:3]}
    return {
        name: GasBlast(scenario, layout, engine=engine, charge=charge).run()
        for name, layout in layouts.items()
    }


def test_the_load_on_a_structure_stands_by_the_walls_that_count(
    fine_blasts: dict[str, GasResult],
) -> None:
    found = {name: fine_blast.validation(["hut"]) for name, fine_blast in fine_blasts.items()}
    assert found["bare"].status is ValidationStatus.MEASURED
    assert found["wall"].status is ValidationStatus.VERIFIED
    assert "of it in the shade" in found["wall"].reason  # the wall is half as wide
    for name, fine_blast in fine_blasts.items():
        (load,), (row,) = fine_blast.structure_loads, fine_blast.structures.to_dict("records")
        assert load.validation == found[name]
        assert (row["validation"], row["reason"]) == (found[name].status.label, found[name].reason)
        assert fine_blast.buildings["validation"].tolist() == [row["validation"]]


def test_an_evaluation_has_the_worst_validation_of_its_threats() -> None:
    """With 5 kg on cells of 0.5 m approximate, with 400 kg outside."""
    threats = [LoadCase(Charge((2.0, 4.0), kg)) for kg in (5.0, 400.0)]
    found = evaluate_layout(hut(), WALL, threats=threats, cell_m=0.5)
    assert found.table["validation"].tolist() == ["outside"]
    assert found.table["reason"].str.startswith("scaled distance 0.54 m/kg^(1/3)").all()
    assert found.to_dict()["structures"][0]["validation"] == "outside"
    by_particles = evaluate_layout(BALLISTIC_COURTYARD, (), range(1), engine="event")
    assert set(by_particles.table["validation"]) <= {"approximate", "outside"}


def test_no_measurement_covers_an_air_burst() -> None:
    """20 kg at a height of 3 m on cells of 0.25 m; on the ground it is measured."""
    front = {**site_document()["structures"][0], "faces": ["west"]}
    scenario, engine = hut(structures=[front]), GasEngine(cell_m=0.25)
    for height_m, status in (
        (0.0, ValidationStatus.MEASURED),
        (3.0, ValidationStatus.APPROXIMATE),
    ):
        charge = Charge((1.5, 4.0), 13.0, height_m)
        found = GasBlast(scenario, engine=engine, charge=charge).run()
        assert found.validation(["hut"]).status is status


# --- Loads that are not known at the end of a run.


CUT, WHOLE = GasEngine(border_m=0.0, until=0.012), GasEngine(border_m=0.0, until="walls")
"""A blast that ends while the wave is at the hut, and one that waits for every wall of it."""


def judged(engine: GasEngine) -> Consequences:
    scenario = glazed_hut()
    return consequences(BlastEvaluator(scenario, engine), (), [Charge((2.0, 4.0), 5.0)])


def test_bays_that_are_cut_off_are_flagged() -> None:
    cut, whole = judged(CUT), judged(WHOLE)
    table = bay_table({"cut": cut, "whole": whole}).set_index("layout")
    late = ~table["known"].loc["cut"]
    assert late.any()
    assert table["known"].loc["whole"].all()
    assert cut.is_flagged
    words = f"{late.sum()} of {len(late)} bays of all charges: impulse not yet captured"
    assert cut.notes[-1].startswith(words)
    assert not any("captured" in note for note in whole.notes)
    (response,) = whole.responses
    assert set(response.known) == {bay.bay.name for bay in response.facade.bays}


@pytest.mark.parametrize(("engine", "known"), [(CUT, False), (WHOLE, True)])
def test_reports_flag_every_building(engine: GasEngine, known: bool) -> None:
    details = GasBlast(hut(), engine=engine).recorded().record.complete
    assert details.buildings["hut"].known == known
    assert (f"hut: {NOT_KNOWN}" in details.notes) != known


@pytest.mark.parametrize(("until", "late"), [(0.004, ["front", "behind"]), ("gauges", [])])
def test_gauges_that_are_cut_off_are_flagged(until: str | float, late: list[str]) -> None:
    found = GasBlast(hut(), engine=GasEngine(border_m=0.0, until=until)).run()
    assert found.gauge_notes == tuple(f"gauge {name}: {NOT_KNOWN}" for name in late)


def test_a_limit_is_flagged_where_its_load_is_approximate() -> None:
    """As a charge above the ground: of bays that flags a verdict, of limits it did not."""
    words = {}
    for status in ValidationStatus:
        load = BuildingLoad(
            *(100.0, 5e3, 5e3, "gas", 0.01, "west", 120.0, 0.02),
            known=True,
            flagged=False,
            validation=Validation(status, "why"),
        )
        limited = LoadLimit(Limit("hut", 200.0), "T1", load)
        verdict = SiteVerdict(Consequences(()), LevelOfProtection.LOW, (limited,))
        words[status.label] = limited.word, verdict.word
    plain, flagged = ("complies", "COMPLIES"), ("complies (flagged)", "COMPLIES (flagged)")
    doubtful = {"approximate", "outside"}
    assert words == {label: flagged if label in doubtful else plain for label in words}


def test_the_table_of_buildings_has_the_flags_of_a_verdict() -> None:
    """That of thin interlayers stood beside the verdicts of commands alone."""
    laminated = catalogue()["window_laminated_6"]
    assert isinstance(laminated, Glazing)
    thin = laminated.model_copy(update={"interlayer": Interlayer(thickness_mm=0.76)})
    whole = judged(WHOLE)
    said = [
        any("interlayers under" in flag for own in building_verdicts(found) for flag in own.flags)
        for found in (whole, whole.with_glazing(thin))
    ]
    assert said == [False, True]
