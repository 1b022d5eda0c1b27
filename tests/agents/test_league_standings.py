"""What is made of the impulses: means, intervals, differences, verdicts, tables."""

from math import isnan
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from blast_agents.league import LeagueVerdict, Standings, hidden_track, known_track, verdicts
from blast_agents.league.figure import league_figure
from blast_agents.league.report import (
    case_table,
    markdown,
    summary_table,
    verdict_lines,
    write_league,
)
from blast_agents.league.tracks import HIDDEN_SEEDS
from matplotlib.figure import Figure

from blast_env.errors import BlastEnvError
from blast_env.site import ObjectiveSection
from blast_env.site.scene import Charge
from blast_env.statistics import Estimate, reduction_estimate
from tests.agents.league_cases import TRAINING, result, road_scenario, standings

BARE = [[100.0, 300.0], [10.0, 30.0], [400.0, 400.0]]
"""Without a barrier, on three cases of very different impulse."""

AGENT = [[40.0, 120.0], [8.0, 16.0], [320.0, 320.0]]
"""Reductions of 60, 40 and 20 %."""

SEARCH = [[60.0, 120.0], [10.0, 16.0], [300.0, 380.0]]
"""Reductions of 55, 35 and 15 %: 5 percentage points less in every case."""

T_2 = 4.302652729911275
"""Student's t of 97.5 % with two degrees of freedom."""

REFERENCE = "genetic, 200 blasts"


def three_cases() -> Standings:
    agent = result("agent", AGENT, seconds=[0.01, 0.03, 0.02], training=TRAINING)
    return standings(BARE, agent, result(REFERENCE, SEARCH, blasts=200, seconds=[9.0, 8.0, 10.0]))


def one_case(agent: list[float], search: list[float], bare: list[float]) -> Standings:
    track = hidden_track(road_scenario(), len(bare) // HIDDEN_SEEDS)
    entries = (
        result("agent", [agent], training=TRAINING),
        result(REFERENCE, [search], blasts=200),
    )
    return standings([bare], *entries, track=track)


def test_every_case_counts_alike() -> None:
    """Though one has forty times the impulse of another; the interval is Student's."""
    it = three_cases()
    _, agent, _ = it.results
    assert it.comparison(agent).case_reductions == pytest.approx([0.6, 0.4, 0.2])
    value, low, high = it.reduction(agent)
    assert value == pytest.approx(0.4)
    assert value - low == pytest.approx(T_2 * 0.2 / 3**0.5)
    assert high == pytest.approx(value + T_2 * 0.2 / 3**0.5)
    assert it.comparison(agent).worst_reduction == pytest.approx(0.2)


def test_no_interval_is_above_a_reduction_of_everything() -> None:
    it = standings([[1.0], [1.0]], result("good", [[0.0], [0.1]]))
    assert it.reduction(it.results[1]).value == pytest.approx(0.95)
    assert it.reduction(it.results[1]).high == 1.0


def test_the_difference_is_paired_by_case() -> None:
    """The same 5 points in every case: no spread is left, however the reductions differ."""
    it = three_cases()
    _, agent, search = it.results
    assert it.difference(agent, search) == pytest.approx((0.05, 0.05, 0.05))
    assert it.difference(search, agent).value == pytest.approx(-0.05)


def test_with_one_case_the_threats_are_what_intervals_are_over() -> None:
    bare, agent, search = (
        [100.0, 300.0, 50.0, 0.0],
        [40.0, 90.0, 40.0, 0.0],
        [50.0, 150.0, 30.0, 0.0],
    )
    it = one_case(agent, search, bare)
    _, first, second = it.results
    assert it.reduction(first) == reduction_estimate(np.array(agent), np.array(bare))
    assert it.comparison(first).worst_reduction == pytest.approx(
        0.2
    )  # not the threat that does nothing
    difference = it.difference(first, second)
    assert difference.value == pytest.approx(it.reduction(first).value - it.reduction(second).value)
    spread = np.array([10.0, 60.0, -10.0, 0.0]) - difference.value * np.array(bare)
    half_width = 3.182446305284263 * spread.std() * (4 / 3) ** 0.5 / 2 / 112.5
    assert difference.high - difference.value == pytest.approx(half_width)
    assert difference.value - difference.low == pytest.approx(half_width)


def test_what_agents_cost_is_their_training_and_what_searches_cost_their_cases() -> None:
    _, agent, search = three_cases().results
    assert (agent.blasts, agent.blasts_per_case) == (TRAINING.blasts, 0.0)
    assert (search.blasts, search.blasts_per_case) == (600, 200.0)
    assert agent.seconds == pytest.approx(TRAINING.seconds + 0.06)
    assert search.seconds == pytest.approx(27.0)
    assert (agent.proposal_ms, search.proposal_ms) == pytest.approx((20.0, 9000.0))


def test_a_verdict_is_the_agent_minus_genetic_search() -> None:
    (verdict,) = verdicts(three_cases())
    assert verdict.difference == pytest.approx((0.05, 0.05, 0.05))
    assert verdict.text == (
        "agent minus genetic, 200 blasts: +5.0 percentage points of reduction (95 % interval "
        "+5.0 to +5.0, paired over 3 cases); the agent protects better. It proposes in 20.0 ms "
        "(median)."
    )


def test_agents_are_held_against_the_best_rule_genetic_search_and_the_best_search() -> None:
    agent = result("agent", AGENT, training=TRAINING)
    rules = [
        result("wall near the charge", BARE, is_rule=True),
        result("wall near the building", SEARCH, is_rule=True),
    ]
    searches = [result(REFERENCE, SEARCH, blasts=200), result("annealing, 50 blasts", AGENT, 50)]
    it = standings(BARE, agent, *rules, *searches)
    names = [verdict.reference.name for verdict in verdicts(it)]
    assert names == ["wall near the building", REFERENCE, "annealing, 50 blasts"]
    # What begins with the agent is no search to hold it against, and is judged itself.
    own = result("agent with search, 50 blasts", [[20.0, 30.0], *AGENT[1:]], 50, has_learnt=True)
    by_both = verdicts(standings(BARE, agent, own, *rules, *searches))
    assert [each.result.name for each in by_both] == 3 * ["agent"] + 3 * [own.name]
    assert [each.reference.name for each in by_both] == 2 * names
    assert by_both[-1].difference.value > 0.0
    assert by_both[-1].text.endswith("It spends 50 blasts a case.")


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0.001, 0.1, "protects better"),
        (-0.1, -0.001, "protects worse"),
        (-0.1, 0.1, "no difference shown"),
        (0.0, 0.0, "no difference shown"),
        (np.nan, np.nan, "gives no interval"),
    ],
)
def test_the_interval_decides(low: float, high: float, words: str) -> None:
    sides = result("agent", AGENT, training=TRAINING), result("wall", SEARCH, is_rule=True)
    verdict = LeagueVerdict(*sides, Estimate(0.0, low, high), "9 cases")
    assert words in verdict.conclusion
    assert words in verdict.text


def test_there_is_no_verdict_without_agent_or_reference() -> None:
    agent = result("agent", AGENT, training=TRAINING)
    assert verdicts(standings(BARE, agent)) == ()
    (line,) = verdict_lines(standings(BARE, agent))
    assert "neither a rule nor a search has entered" in line
    (line,) = verdict_lines(standings(BARE, result(REFERENCE, SEARCH, blasts=200)))
    assert "no trained agent" in line


def test_a_case_without_anything_to_reduce_is_refused() -> None:
    with pytest.raises(BlastEnvError, match=r"road 1: nothing arrives .*\(2 threats\)"):
        standings([[1.0, 1.0], [0.0, 0.0]])


def test_the_tables_hold_what_was_found() -> None:
    it = three_cases()
    summary = summary_table(it).set_index("entry")
    assert list(summary.index) == ["no barrier", "agent", REFERENCE]
    row = summary.loc["agent"]
    assert row["reduction"] == pytest.approx(0.4)
    assert (row["blasts"], row["training_blasts"], row["blasts_per_case"]) == (5000, 5000, 0)
    assert row["minus_reference"] == pytest.approx(0.05)
    assert summary.loc[REFERENCE, "minus_reference"] == 0.0
    cases = case_table(it)
    assert len(cases) == 9
    agent = cases[cases["entry"] == "agent"]
    assert list(agent["reduction"]) == pytest.approx([0.6, 0.4, 0.2])
    assert list(agent["case"]) == ["road 0", "road 1", "road 2"]
    assert list(agent["unprotected_load"]) == [200.0, 20.0, 400.0]
    told = [case.charge for case in it.track.cases if isinstance(case.charge, Charge)]
    charges = [charge.position_m for charge in told]
    assert list(zip(agent["charge_x_m"], agent["charge_y_m"], strict=True)) == charges
    assert set(agent["layout"]) == {"0,0"}


def test_without_its_reference_a_table_has_no_differences() -> None:
    assert "minus_reference" not in summary_table(standings(BARE, result("a", AGENT)))


def test_all_is_written_and_the_page_shows_it(tmp_path: Path) -> None:
    it = three_cases()
    written = write_league([it], tmp_path, "blast-env league --out here")
    assert sorted(path.name for path in written) == sorted(path.name for path in tmp_path.iterdir())
    summary = pd.read_csv(tmp_path / "known_road_summary.csv")
    pd.testing.assert_frame_equal(summary, summary_table(it), check_dtype=False)
    assert len(pd.read_csv(tmp_path / "known_road_cases.csv")) == 9
    page = (tmp_path / "league.md").read_text()
    assert "## Known threat at an unseen position: road" in page
    assert "3 cases, 2 held-out threats each" in page
    agent = (
        "| agent | 40.0 % | -9.7 to 89.7 % | 20.0 % | 20.0 % | 0 | 0 | 0.00 | 5,000 | 60.1 | 20.0 |"
    )
    assert agent in page.splitlines()
    assert "+5.0 percentage points" in page
    assert "![Reduction over blasts spent](known_road.png)" in page
    assert (tmp_path / "known_road.png").stat().st_size > 20_000


def test_every_row_of_the_page_has_all_columns() -> None:
    lines = [line for line in markdown([three_cases()], "x").splitlines() if line.startswith("|")]
    assert len(lines) == 2 + 3
    assert len({line.count("|") for line in lines}) == 1


def test_one_threat_has_no_interval_and_can_be_shown_all_the_same(tmp_path: Path) -> None:
    it = standings([[10.0]], result("agent", [[5.0]], training=TRAINING))
    assert isnan(it.reduction(it.results[1]).low)
    assert "| agent | 50.0 % | - | 50.0 % |" in markdown([it], "x")
    write_league([it], tmp_path, "x")


def drawn(it: Standings) -> Figure:
    figure = league_figure(it)
    figure.draw_without_rendering()
    return figure


def test_the_figure_shows_searches_over_blasts_and_agents_as_lines() -> None:
    it = standings(
        BARE,
        result("random layout", [[90.0, 270.0], [9.0, 27.0], [360.0, 360.0]]),
        result("agent", AGENT, training=TRAINING),
        result("genetic, 50 blasts", BARE, blasts=50),
        result(REFERENCE, SEARCH, blasts=200),
    )
    figure = drawn(it)
    (axes,) = figure.axes
    assert axes.get_xscale() == "log"
    assert [label.get_text() for label in axes.get_xticklabels()] == ["0", "50", "200"]
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["agent: no blast a case, 5,000 in training", "random layout", "genetic search"]
    lines = {str(line.get_label()): line for line in axes.lines}
    assert list(np.asarray(lines[names[0]].get_ydata())) == pytest.approx([0.4, 0.4])
    search = next(each for each in axes.containers if each.get_label() == "genetic search")
    assert list(search[0].get_xdata()) == [50.0, 200.0]
    assert list(search[0].get_ydata()) == pytest.approx([0.0, 0.35])
    assert "blasts" in axes.get_xlabel()
    assert "reduction" in axes.get_ylabel()
    assert all(label.get_text().endswith(" %") for label in axes.get_yticklabels())


def test_page_and_figure_say_which_load_the_layouts_lower() -> None:
    site = road_scenario().model_copy(update={"objective": ObjectiveSection(quantity="peak")})
    it = standings(BARE, result("agent", AGENT), track=known_track(site, 3, 2))
    assert "Reduction of the peak overpressure: 3 cases" in markdown([it], "")
    (axes,) = drawn(it).axes
    assert axes.get_ylabel() == "reduction of the peak overpressure on held-out threats"


def test_many_agents_are_told_apart_and_no_name_is_cut_off() -> None:
    names = [f"MaskablePPO (a long name of a run {i}), ranked by the surrogate" for i in range(11)]
    figure = drawn(standings(BARE, *(result(each, AGENT, training=TRAINING) for each in names)))
    (axes,), (legend,) = figure.axes, figure.legends
    kept = [each for each in axes.lines if str(each.get_label()).startswith("MaskablePPO")]
    assert len({(each.get_color(), each.get_linestyle()) for each in kept}) == len(names)
    box, page = legend.get_window_extent(), figure.bbox
    assert page.x0 <= box.x0 < box.x1 <= page.x1
    assert page.y0 <= box.y0 < box.y1 <= page.y1
    assert axes.bbox.width > 0.4 * page.width


def test_methods_at_one_budget_stand_side_by_side() -> None:
    methods = ("random", "best_rule", "population_annealing", "genetic")
    it = standings(BARE, *(result(f"{name}, 50 blasts", SEARCH, blasts=50) for name in methods))
    (axes,) = drawn(it).axes
    places = [float(each[0].get_xdata()[0]) for each in axes.containers]
    assert len(set(places)) == 4
    assert all(0.8 < place / 50.0 < 1.25 for place in places)


def test_the_worst_fifth_and_who_wins_how_often() -> None:
    """Reductions of 60, 40 and 20 % against 50, 40 and 30 %: a win, a tie and a loss."""
    rule = result("wall", [[50.0, 150.0], [8.0, 16.0], [280.0, 280.0]], is_rule=True)
    agent = result("agent", AGENT, training=TRAINING)
    it = standings(BARE, rule, agent)
    assert it.rules == (rule,)
    assert it.cvar_reduction(agent) == pytest.approx(0.2)  # the worst of three
    assert it.win_share(agent, rule) == 0.5
    assert it.win_share(rule, it.results[0]) == 1.0
    rows = summary_table(it).set_index("entry")
    assert rows["wins_wall"].to_dict() == {"no barrier": 0.0, "wall": 0.5, "agent": 0.5}
    assert rows["is_rule"].to_dict() == {"no barrier": False, "wall": True, "agent": False}
    assert "| agent | 50 % |" in markdown([it], "x")
