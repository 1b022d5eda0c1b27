"""Figures of evaluations of one layout."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

from blast_env import Charge, load_scenario
from blast_env.answers.evaluate import evaluation_picture
from blast_env.evaluation import Evaluation, LoadCase, evaluate_layout
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.plots import save_figure
from blast_env.site import Scenario
from tests.gas_sites import WALL as WALL_OF_HUT
from tests.gas_sites import hut

WALL = [(row, 0) for row in range(22, 32)]
THREATS = (
    LoadCase(Charge((5.0, 20.0), 100.0), 0),
    LoadCase(Charge((5.0, 9.0), 100.0), 1),
    LoadCase(Charge((5.0, 14.0), 15.0), 2),  # no mass that the calibration was made for
)

THREATS_OF_HUT = (LoadCase(Charge((2.0, 4.0), 5.0), 0),)


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    return evaluate_layout(load_scenario("courtyard"), WALL, engine="event", threats=THREATS)


@pytest.fixture(scope="module")
def figure(evaluation: Evaluation) -> Figure:
    return evaluation_picture(evaluation)


def test_charges_are_where_they_were_in_the_colour_of_their_reductions(
    figure: Figure, evaluation: Evaluation
) -> None:
    plan = figure.axes[0]
    circles, squares = (
        collection for collection in plan.collections if isinstance(collection, PathCollection)
    )
    drawn = {
        tuple(place): share
        for case in (circles, squares)
        for place, share in zip(
            np.asarray(case.get_offsets()).tolist(), np.asarray(case.get_array()), strict=True
        )
    }
    expected = {o.charge.position_m: 100.0 * o.reduction for o in evaluation.outcomes}
    assert drawn == pytest.approx(expected)
    assert len(np.asarray(squares.get_offsets())) == 1
    ring = plan.lines[-1]
    worst = evaluation.worst.charge.position_m
    assert tuple(np.ravel(ring.get_xydata())) == worst


def test_every_threat_has_its_pair_and_the_worst_comes_first(
    figure: Figure, evaluation: Evaluation
) -> None:
    panel = figure.axes[1]
    without, with_barrier = (
        np.asarray(line.get_ydata()) for line in panel.lines if line.get_linestyle() == "None"
    )
    table = evaluation.threat_table.sort_values("impulse_pa_s", ascending=False)
    assert with_barrier == pytest.approx(table.impulse_pa_s.to_numpy())
    assert without == pytest.approx(table.unprotected_impulse_pa_s.to_numpy())
    assert [text.get_text() for text in panel.get_xticklabels()] == [str(s) for s in table.seed]
    assert "(Pa·s)" in panel.get_ylabel()
    legend = panel.get_legend()
    assert legend is not None
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == [
        f"without barrier, mean {evaluation.unprotected_impulse_pa_s.value:,.0f} Pa·s",
        f"with barrier, mean {evaluation.impulse_pa_s.value:,.0f} Pa·s",
        f"mean of the worst 20 % with barrier, {evaluation.cvar:,.0f} Pa·s",
    ]


def test_title_and_legend_say_how_much_how_sure_and_where_not_to_trust_it(
    figure: Figure, evaluation: Evaluation
) -> None:
    title = figure.get_suptitle()
    low, high = (f"{100.0 * end:.1f} %" for end in evaluation.ci95)
    share = f"{100.0 * evaluation.mean_reduction:.1f} %"
    assert f"reduction of the impulse {share} (95 %: {low} to {high})" in title
    assert any("outside the validated range" in text.get_text() for text in figure.axes[0].texts)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[:3] == [
        "charge",
        "charge outside the validated range",
        "charge with the largest impulse",
    ]
    assert "barrier module, as high as the air: 10 of 16" in labels


def test_an_empty_layout_and_a_single_threat_can_be_drawn(tmp_path: Path) -> None:
    evaluation = evaluate_layout(
        load_scenario("courtyard"), [], engine="event", threats=THREATS[:1]
    )
    figure = evaluation_picture(evaluation)
    assert "no barrier: reduction of the impulse 0.0 %" in figure.get_suptitle()
    assert "95 %" not in figure.get_suptitle()
    path = save_figure(figure, tmp_path / "empty.png")
    assert path.stat().st_size > 10_000


def test_the_parts_of_a_building_have_one_load() -> None:
    document = hut().model_dump(exclude_none=True)
    (whole,) = document["structures"]
    left, bottom = whole["corner_m"]
    part = {**whole, "rows": 1, "building": "hall", "weight": 0.25}
    north = {**part, "name": "north", "rows": 3, "weight": 0.75, "corner_m": (left, bottom + 0.5)}
    document["structures"] = [{**part, "name": "south"}, north]
    scenario = Scenario.from_document(document, "halves")
    engine = GasEngine(border_m=0.0, until=0.01)
    found = evaluate_layout(scenario, WALL_OF_HUT, threats=THREATS_OF_HUT, engine=engine)
    figure = evaluation_picture(found)
    assert figure.axes[1].get_xlabel().startswith("charge of the threat (m)")
    words = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert not any("calibration" in word for word in words)
    table = found.table.set_index("structure")
    (hall,) = found.building_table.to_dict("records")
    assert (hall["structure"], hall["weight"], hall["protected"]) == ("hall", 1.0, True)
    assert hall["reduction"] == pytest.approx(found.mean_reduction)
    assert hall["peak_pa"] == table["peak_pa"].max()
    for column in ("unprotected_impulse_pa_s", "impulse_pa_s"):
        # Of eight sides of modules that look out, south has three, north five.
        mean = 0.375 * table[column]["south"] + 0.625 * table[column]["north"]
        assert mean == pytest.approx(hall[column])
