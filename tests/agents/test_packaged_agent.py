"""The agent that comes with the package: one policy for any site."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from blast_agents import PackagedAgent, packaged_agent
from blast_agents.packaged import (
    SURE_GAIN,
    AgentProposer,
    load_packaged,
    read_weights,
    search_from_agent,
    write_weights,
)
from blast_agents.policies.candidates import Candidates
from typer.testing import CliRunner

import blast_env
from blast_env import load_scenario
from blast_env.cli import app
from blast_env.design.proposal import problem_of
from blast_env.design.search import Guesses, layouts_by_rule, search_by
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, DesignProblem, LoadCase, LoadCaseSet
from blast_env.layout import LayoutState, draw_threat, load_layout
from blast_env.rules import expected_charge, random_layout
from blast_env.site import AnyCharge, Charge, Scenario
from blast_env.sites import ItemSiteRanges, generate_site, kerb_site, turned
from blast_env.surrogate import packaged_surrogate
from tests.agents.sites import site
from tests.vehicle_sites import gate_site

CONTROL_ROOM = load_scenario("control_room")
SITES = {
    "modules": site(),
    "items": CONTROL_ROOM,
    "vehicle": gate_site(),
    "generated": generate_site(9_500, ItemSiteRanges()),
    "kerb": kerb_site(9_500),
}


def guesses_of(scenario: Scenario, charge: AnyCharge) -> Guesses:
    """Return the surrogate's guesses for a known charge."""
    case = LoadCaseSet(scenario, (LoadCase(charge),), charge=charge)
    return Guesses.of(packaged_surrogate(), case)


@pytest.mark.parametrize("is_known", [True, False], ids=["known", "hidden"])
@pytest.mark.parametrize("scenario", SITES.values(), ids=SITES)
def test_its_layouts_keep_every_condition_of_any_zone(scenario: Scenario, is_known: bool) -> None:
    charge: AnyCharge | None = draw_threat(scenario, 0) if is_known else None
    agent = packaged_agent()
    layout, drawn = agent.likeliest(scenario, charge), agent.sample(scenario, charge, 6, 1)
    proposed = agent.propose(scenario, charge)
    assert layout
    assert len(drawn) == 6
    changed = agent.ranked(scenario, charge, 2, changes=16)
    for own in (layout, proposed, *drawn, *changed):
        assert LayoutState.of(scenario, own).layout == own
    assert agent.likeliest(scenario, charge) == layout
    assert agent.propose(scenario, charge) == proposed
    assert agent.sample(scenario, charge, 6, 1) == drawn
    assert agent.sample(scenario, charge, 6, 2) != drawn


def test_layouts_that_are_drawn_differ_and_the_first_one_of_the_ranked_has_the_best_guess() -> None:
    charge = draw_threat(CONTROL_ROOM, 0)
    ranked = packaged_agent().ranked(CONTROL_ROOM, charge, 8)
    assert len(set(ranked)) == len(ranked) > 2
    guesses = guesses_of(CONTROL_ROOM, charge)
    loads = guesses.loads(ranked)
    assert (np.diff(loads[1:]) >= 0.0).all()
    assert loads[0] <= loads[1] + SURE_GAIN * guesses.loads([()])
    assert packaged_agent().ranked(CONTROL_ROOM, charge, 8) == ranked


def test_a_proposal_is_behind_no_rule_and_hardly_behind_the_policy_by_guesses() -> None:
    for scenario in (CONTROL_ROOM, SITES["vehicle"]):
        charge = draw_threat(scenario, 0)
        likeliest = tuple(sorted(packaged_agent().likeliest(scenario, charge)))
        others = [(), likeliest, *layouts_by_rule(scenario, charge).values()]
        own, bare, policy, *ruled = guesses_of(scenario, charge).loads(
            [packaged_agent().propose(scenario, charge), *others]
        )
        assert own <= min(bare, *ruled)
        assert own <= policy + SURE_GAIN * bare


def test_a_search_by_guesses_with_its_changes_is_not_behind_its_draws_and_the_rules() -> None:
    charge = draw_threat(CONTROL_ROOM, 0)
    guesses, rules = guesses_of(CONTROL_ROOM, charge), layouts_by_rule(CONTROL_ROOM, charge)
    arguments = guesses, charge, rules, 8
    known = packaged_agent().searched(*arguments, changes=0)
    found = packaged_agent().searched(*arguments, changes=40)
    assert len(set(found)) == len(found) > len(known)
    assert set(known) < set(found)
    loads = guesses.loads([found[0], known[0], *rules.values()])
    assert loads[0] <= loads[1] <= min(loads[2:])


def test_it_is_better_by_guesses_than_random_layouts_on_sites_that_it_has_not_seen() -> None:
    ahead = []
    for seed in (9_500, 9_501, 9_502):
        scenario = generate_site(seed, ItemSiteRanges())
        charge = draw_threat(scenario, 0)
        guesses = guesses_of(scenario, charge)
        rng = np.random.default_rng(seed)
        random = [tuple(sorted(random_layout(scenario, rng))) for _ in range(8)]
        proposed = tuple(sorted(packaged_agent().likeliest(scenario, charge)))
        unprotected, own, *others = guesses.loads([(), proposed, *random]) / guesses.loads([()])
        ahead.append(np.mean(others) - own)
        assert own < unprotected
    assert np.mean(ahead) > 0.05


@pytest.mark.parametrize("quarter_turns", [1, 2, 3])
def test_a_turned_site_has_the_same_candidates(quarter_turns: int) -> None:
    scenario = site((5.0, 19.0), budget=9.0)
    both = [scenario, turned(scenario, quarter_turns)]
    upright, other = (np.sort(Candidates.of(own, None).static, axis=0) for own in both)
    np.testing.assert_allclose(upright, other, atol=1e-4)


def test_what_it_cannot_serve_is_refused() -> None:
    without_zone = CONTROL_ROOM.model_copy(update={"build_zone": None})
    with pytest.raises(BlastEnvError, match="no build zone"):
        packaged_agent().propose(without_zone)
    bare = tuple(own.model_copy(update={"protected": False}) for own in CONTROL_ROOM.structures)
    with pytest.raises(BlastEnvError, match="no structure is protected"):
        packaged_agent().propose(CONTROL_ROOM.model_copy(update={"structures": bare}))
    for count in (0, 2.5, True):
        with pytest.raises(BlastEnvError, match="count is"):
            packaged_agent().sample(CONTROL_ROOM, count=count)  # type: ignore[arg-type]


@pytest.mark.parametrize("x_m", [8.0, 9.0])
def test_nobody_proposes_to_stand_on_a_known_charge_from_elsewhere(x_m: float) -> None:
    charge = Charge((x_m, 8.5), 100.0)
    with_it = CONTROL_ROOM.with_possible_charges([charge])
    agent = packaged_agent()
    layouts = [agent.propose(CONTROL_ROOM, charge), *agent.sample(CONTROL_ROOM, charge)]
    layouts.append(blast_env.propose(CONTROL_ROOM, charge).layout)
    search = blast_env.search(CONTROL_ROOM, "random", 12, charge=charge, engine="surrogate")
    for layout in (*layouts, search.layout):
        assert LayoutState.of(with_it, layout).layout == layout


def test_weights_come_back_from_their_file(tmp_path: Path) -> None:
    agent = packaged_agent()
    path = tmp_path / "agent.safetensors"
    in_another_order = {name: np.asfortranarray(own) for name, own in agent.network.weights.items()}
    write_weights(in_another_order, {"seed": "0"}, path)
    again = load_packaged(path)
    assert again.digest == agent.digest
    assert isinstance(again, PackagedAgent)
    assert again.likeliest(CONTROL_ROOM) == agent.likeliest(CONTROL_ROOM)
    content = path.read_bytes()
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    assert header["__metadata__"] == {"seed": "0"}
    assert max(end for entry in [*header.values()][1:] for end in entry["data_offsets"]) == (
        len(content) - 8 - length
    )


@pytest.mark.parametrize("damage", ["short", "empty", "type", "infinite", "missing"])
def test_damaged_weights_are_refused(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "agent.safetensors"
    weights = {**packaged_agent().network.weights}
    if damage == "infinite":
        weights["score"] = np.full_like(weights["score"], np.inf)
    if damage == "missing":
        del weights["second"]
    write_weights(weights, {}, path)
    content = path.read_bytes()
    if damage == "short":
        path.write_bytes(content[:-40])
    if damage == "empty":
        path.write_bytes(b"")
    if damage == "type":
        path.write_bytes(content.replace(b'"F32"', b'"F64"'))
    with pytest.raises(
        BlastEnvError, match=r"agent\.safetensors: (is damaged|has arrays|score has)"
    ):
        load_packaged(path)


def test_only_arrays_are_read() -> None:
    with pytest.raises(BlastEnvError, match="is damaged"):
        read_weights(b"\x02\x00\x00\x00\x00\x00\x00\x00[]", "list")


def test_the_command_writes_the_best_of_the_draws(tmp_path: Path) -> None:
    options = ("--method", "agent", "--scenario", "control_room", "--charge", "2,8.5")
    result = CliRunner().invoke(app, ["search", *options, "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert "the best guess of the rules' layouts, 32 draws and changes of them" in result.output
    mean = expected_charge(CONTROL_ROOM.charge)
    charge = Charge((2.0, 8.5), mean.tnt_kg, mean.height_m)
    problem = problem_of(CONTROL_ROOM, charge)
    expected = AgentProposer().propose(problem)
    assert load_layout(tmp_path / "layout.json", CONTROL_ROOM) == expected.layout
    assert f"{100.0 * (expected.gain or 0.0):.1f} %" in result.output
    refused = CliRunner().invoke(app, ["search", *options, "--budget", "5"])
    assert refused.exit_code != 0
    assert "does not apply to --method agent" in refused.output


def test_a_search_by_the_surrogate_starts_from_its_layouts() -> None:
    """The first blast is its proposal's; without blasts the best guess is no worse than that."""
    charge = draw_threat(CONTROL_ROOM, 0)
    case = LoadCaseSet(CONTROL_ROOM, (LoadCase(charge),), charge=charge)
    problem = DesignProblem(BlastEvaluator(CONTROL_ROOM, "surrogate"), case)
    search = replace(search_from_agent(), guesses=40, changes=16)
    assert search.digest != search_by(packaged_surrogate()).digest
    proposed = tuple(sorted(packaged_agent().propose(CONTROL_ROOM, charge)))
    assert search.propose(problem, 1, 0).layout == proposed
    at_once = search.at_once(CONTROL_ROOM, charge)
    loads = guesses_of(CONTROL_ROOM, charge).loads([at_once, proposed])
    assert loads[0] <= loads[1]
