"""Guesses: what they are made of, their bounds, and how a surrogate is kept."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, draw_threats
from blast_env.rules import random_layout
from blast_env.site import Charge, Scenario, load_scenario
from blast_env.surrogate import (
    CLOSE,
    FEATURES,
    INPUTS,
    RELATIONS,
    SHAPES,
    SIGHT,
    TRAITS,
    VIEW,
    WIDE,
    Check,
    Member,
    Networks,
    Samples,
    Surrogate,
    SurrogateEngine,
    load_surrogate,
    packaged_surrogate,
    piece_traits,
    predictions,
    save_surrogate,
    site_of,
)
from tests.surrogate.cases import (
    ABOUT,
    CHARGE_M,
    CHECK,
    NOTHING,
    PEAKS,
    YARD,
    by_hand,
    table_of_guesses,
    wall,
)

VIEWS = ("structure_view", "piece_view")


def test_a_guess_is_the_same_alone_and_among_others() -> None:
    site, surrogate = site_of(YARD), by_hand()
    rng = np.random.default_rng(0)
    layouts = [random_layout(YARD, rng) for _ in range(3)]
    charges = [Charge((1.5, 4.0), 5.0), Charge((2.0, 8.0), 5.0), Charge((1.5, 4.0), 5.0)]
    together = surrogate.guess(site, layouts, charges)
    assert together.impulse_pa_s.shape == together.spread.shape == (3, len(site.protected))
    assert (together.spread > 0.0).all()
    kept = [surrogate.guess(site, layouts, charges) for _ in range(4)][-1]
    assert (kept.impulse_pa_s == together.impulse_pa_s).all()
    for number, (layout, charge) in enumerate(zip(layouts, charges, strict=True)):
        alone = surrogate.guess(site_of(YARD), [layout], [charge])
        assert (alone.impulse_pa_s[0] == together.impulse_pa_s[number]).all()


def silu(values: np.ndarray) -> np.ndarray:
    return values / (1.0 + np.exp(-values))


@pytest.mark.parametrize("rows", [1, 3, 4, 150])
def test_compiled_layers_are_those_of_the_formula(rows: int) -> None:
    """In double precision, and whatever is beside a row; far from 0, too."""
    rng = np.random.default_rng(rows)
    members = [Member(*(rng.normal(0.0, 0.3, shape) for shape in SHAPES)) for _ in range(2)]
    for member in members:
        member.last[:] *= 0.01  # within what a network may say
    networks = Networks(members)
    related, features = (rng.normal(0.0, 3.0, (rows, number)) for number in (RELATIONS, FEATURES))
    of_each = [networks.messages(related, of_pieces=pieces) for pieces in (False, True)]
    heard = np.concatenate(of_each, axis=2)
    seen = [rng.random((rows, VIEW)) * 0.1 for _ in range(2)]
    traits = rng.normal(0.0, 3.0, (rows, TRAITS))
    for number, member in enumerate(members):
        sent = silu(traits @ member.trait + member.trait_bias)
        weights = silu(sent @ member.weight + member.weight_bias)
        assert networks.weights(traits)[number] == pytest.approx(weights, abs=2e-4)
        sent = silu(related @ member.send + member.send_bias)
        said = silu(sent @ member.message + member.message_bias)
        sent = silu(related @ member.piece_send + member.piece_send_bias)
        said = np.hstack((said, silu(sent @ member.piece_message + member.piece_message_bias)))
        assert heard[number] == pytest.approx(said, abs=2e-4)
        views = member.structure_view, member.piece_view
        both = np.hstack((features, said, *(own @ by for own, by in zip(seen, views, strict=True))))
        first = silu(both @ member.first + member.first_bias)
        second = silu(first @ member.second + member.second_bias)
        differs = networks(features, heard, seen)[number]
        assert differs == pytest.approx((second @ member.last + member.last_bias)[:, 0], abs=1e-3)
    assert (networks.messages(related[-1:], of_pieces=False)[:, 0] == of_each[0][:, -1]).all()


def test_the_order_of_a_layout_hardly_changes_a_guess_and_company_does() -> None:
    """What a piece says counts as its traits do: two pieces are not the sum of each alone."""
    surrogate = by_hand()
    pieces = np.array([wall(4.0, -2.0, 2.0, 2.0), wall(5.0, -2.0, 2.0, 2.0)])
    weights = [
        surrogate.impulse.weights(surrogate.told(piece_traits(CHARGE_M, 1.0, NOTHING, own)))
        for own in (pieces, pieces[:1], pieces[1:])
    ]
    assert (weights[0] != np.concatenate(weights[1:], axis=1)).any()
    rng, charge = np.random.default_rng(2), Charge((1.5, 4.0), 5.0)
    layout = random_layout(YARD, rng)
    said = surrogate.guess(site_of(YARD), [layout, layout[::-1]], [charge] * 2).impulse_pa_s
    assert said[0] == pytest.approx(said[1], rel=1e-5)


def test_far_outside_its_fit_no_guess_is_without_bounds() -> None:
    """Walls of 60 m far from the charge, and a site where one network alone goes astray."""
    surrogate = packaged_surrogate()
    for name in ("car_park", "campus", "street_front", "government_forecourt"):
        scenario = load_scenario(name)
        site, rng = site_of(scenario), np.random.default_rng(0)
        layouts = [(), *(random_layout(scenario, rng) for _ in range(3))]
        (threat,) = draw_threats(scenario, range(1))
        charges = [threat.charge_against(scenario, layout) for layout in layouts]
        guess = surrogate.guess(site, layouts, charges)
        assert guess.peak_pa is not None
        for row, charge in enumerate(charges):
            approach = site.approach(charge)
            for load, known in (
                (guess.impulse_pa_s, approach.log_impulse),
                (guess.peak_pa, approach.log_peak),
            ):
                most = [known[approach.points_of(n)].max() for n in range(len(site.protected))]
                assert (load[row] < 2.0 * np.exp(most)).all()


@pytest.mark.parametrize(("bias", "most"), [(50.0, 4.06), (-50.0, 3.4e-4)])
def test_a_network_gone_astray_stays_within_the_loads_that_points_can_have(
    bias: float, most: float
) -> None:
    fine = by_hand(members=3)
    wild = fine.impulse.members[0]._replace(last_bias=np.array([bias]))
    surrogate = replace(fine, impulse=Networks((wild, *fine.impulse.members[1:])))
    site, charge = site_of(YARD), Charge((1.5, 4.0), 5.0)
    alone = replace(fine, impulse=Networks((wild,)))
    over = alone.guess(site, [()], [charge]).impulse_pa_s
    known = np.exp(site.approach(charge).log_impulse)
    assert (over <= most * known.max()).all()
    assert np.isfinite(surrogate.guess(site, [()], [charge]).spread).all()


def test_it_is_kept_in_a_file(tmp_path: Path) -> None:
    surrogate = by_hand()
    path = save_surrogate(surrogate, tmp_path / "surrogate.json")
    again = load_surrogate(str(path))
    assert again.fit == ABOUT
    charge = Charge((1.5, 4.0), 5.0)
    for site in (site_of(YARD), site_of(PEAKS)):
        kept, read = (case.guess(site, [()], [charge]).loads(site) for case in (surrogate, again))
        assert kept == pytest.approx(read, rel=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda content: content["mean"].pop(), "mean"),
        (lambda content: content["scale"].__setitem__(3, 0.0), r"scale\[3\]"),
        (
            lambda content: content["members"][1].pop(),
            "members: network 1 has 19 arrays, must be 20",
        ),
        (
            lambda content: content["members"][1].__setitem__(16, content["members"][1][15]),
            "members: network 1, array 16: has 96 numbers, must be 6144",
        ),
        (
            lambda content: content["members"][0].__setitem__(15, "?"),
            "members: network 0, array 15: ",
        ),
        (
            lambda content: content["members"][0].__setitem__(19, "AH4="),
            "members: network 0, array 19: a weight is beyond 1000, or no number",
        ),
        (lambda content: content.update(members=[]), "members"),
        (lambda content: content.pop("peak_members"), "peak_members"),
        (lambda content: content["peak_members"][0].pop(), "peak_members: network 0 has 19"),
        (lambda content: content["fit"].update(format=1), "fit.format"),
        (lambda content: content["fit"].update(blasts=0), "fit.blasts"),
        (lambda content: content.update(more=1), "more"),
    ],
)
def test_what_is_no_surrogate_is_refused(change: object, words: str, tmp_path: Path) -> None:
    path = save_surrogate(by_hand(), tmp_path / "surrogate.json")
    content = json.loads(path.read_text())
    assert callable(change)
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(BlastEnvError, match=f"surrogate.json: is no surrogate, .*{words}"):
        load_surrogate(path)


def test_peaks_are_guessed_where_they_count() -> None:
    surrogate, charge = by_hand(), Charge((1.5, 4.0), 5.0)
    layouts = [(), random_layout(YARD, np.random.default_rng(0))]
    impulses, peaks = (
        surrogate.guess(site_of(case), layouts, 2 * [charge]) for case in (YARD, PEAKS)
    )
    assert impulses.peak_pa is None
    assert peaks.peak_pa is not None
    assert peaks.peak_spread is not None
    assert (peaks.peak_spread > 0.0).all()
    assert peaks.loads(site_of(PEAKS)) == pytest.approx(peaks.peak_pa.sum(axis=1))
    both = {"quantity": "both", "reference_impulse_pa_s": 500.0, "reference_peak_pa": 2e4}
    document = YARD.model_dump() | {"objective": both}
    of_both = site_of(Scenario.from_document(document, "both"))
    assert surrogate.guess(of_both, layouts, 2 * [charge]).loads(of_both) == pytest.approx(
        peaks.impulse_pa_s.sum(axis=1) / 500.0 + peaks.peak_pa.sum(axis=1) / 2e4
    )


@pytest.mark.parametrize("name", ["control_room", "school_and_clinic"])
def test_the_mean_impulse_needs_fewer_points_than_peaks(name: str) -> None:
    scenario, rng = load_scenario(name), np.random.default_rng(2)
    sites = [site_of(scenario), *(site_of(scenario, spacing=own) for own in (WIDE, CLOSE))]
    layouts = [random_layout(scenario, rng) for _ in range(20)]
    (threat,) = draw_threats(scenario, range(1))
    charges = [threat.charge_against(scenario, layout) for layout in layouts]
    found, wide, close = (
        packaged_surrogate().guess(site, layouts, charges).impulse_pa_s for site in sites
    )
    assert (found == wide).all()
    assert np.sqrt(np.mean(np.log(wide / close) ** 2)) < 0.03
    _, *areas_m2 = (site.arrays.points.area_m2 for site in sites)
    assert len(areas_m2[0]) <= 0.7 * len(areas_m2[1])
    assert areas_m2[0].sum() == pytest.approx(areas_m2[1].sum())


def test_the_peak_on_a_structure_is_nearly_the_largest_on_its_walls() -> None:
    """Of Kingery and Bulmash's alone: networks of zeros change nothing of it."""
    nothing = Networks([Member(*(np.zeros(shape) for shape in SHAPES))])
    surrogate = Surrogate(np.zeros(INPUTS), np.ones(INPUTS), nothing, nothing, ABOUT)
    site, charge = site_of(PEAKS), Charge((1.5, 4.0), 5.0)
    approach = site.approach(charge)
    guess = surrogate.guess(site, [()], [charge])
    assert guess.peak_pa is not None
    largest_pa, mean_pa = np.exp(approach.log_peak.max()), np.exp(approach.log_peak).mean()
    assert mean_pa < 0.8 * largest_pa < guess.peak_pa.item() <= largest_pa
    weights = approach.area_m2 / approach.area_m2.sum()
    mean_pa_s = (weights * np.exp(approach.log_impulse)).sum()
    assert guess.impulse_pa_s.item() == pytest.approx(mean_pa_s)


def test_in_the_place_of_an_engine_it_says_what_it_guesses() -> None:
    surrogate = by_hand()
    evaluator = BlastEvaluator(YARD, SurrogateEngine(surrogate))
    layout = random_layout(YARD, np.random.default_rng(0))
    first, second = draw_threats(YARD, range(2))
    loads = [evaluator.loads(layout, case) for case in (first, replace(first, seed=9), second)]
    charges = [case.charge_against(YARD, layout) for case in (first, second)]
    site = site_of(YARD)
    said = surrogate.guess(site, [layout, layout], charges).impulse_pa_s
    protected = [[structure.impulse_pa_s for structure in of_blast.protected] for of_blast in loads]
    assert protected == [pytest.approx(said[0]), protected[0], pytest.approx(said[1])]
    others = [structure for structure in loads[0].structures if not structure.protected]
    assert np.isnan([other.impulse_pa_s for other in others]).all()
    street = load_scenario("street_front")
    said_of_it = evaluator.engine.caveats(street)
    assert "shops: not protected, so not predicted" in said_of_it
    assert loads[0].are_for(YARD)
    assert evaluator.counts.blasts == 2  # a seed changes nothing
    assert evaluator.calibration_name == "none"
    assert SurrogateEngine(by_hand(1)) != SurrogateEngine(surrogate)


def test_intervals_are_as_wide_as_their_factors_say() -> None:
    peak = Check(rms=0.2, rank=0.8, lost=0.03, spreads=4.0, least_spread=0.07)
    about = ABOUT.model_copy(update={"peak": peak})
    surrogate = replace(by_hand(), fit=about)
    layout, (threat,) = random_layout(YARD, np.random.default_rng(0)), draw_threats(PEAKS, [0])
    guess = surrogate.guess(site_of(PEAKS), [layout], [threat.charge_against(PEAKS, layout)])
    assert guess.peak_spread is not None
    low, high = surrogate.lower_ends(guess), surrogate.upper_ends(guess)
    for loads, own_spread, factor in (
        ("impulse_pa_s", guess.spread, CHECK.spreads),
        ("peak_pa", np.hypot(guess.peak_spread, 0.07), 4.0),
    ):
        below, middle, above = (getattr(item, loads) for item in (low, guess, high))
        assert (below < middle).all()
        assert np.log(above / middle) == pytest.approx(factor * own_spread)
        assert np.log(middle / below) == pytest.approx(factor * own_spread)
    with pytest.raises(BlastEnvError, match=r"has no intervals: .*surrogate fit"):
        by_hand().upper_ends(guess)


def test_an_environment_pays_by_guesses() -> None:
    surrogate = by_hand()
    env = BlastBarrierEnv(YARD, action="place", engine=SurrogateEngine(surrogate))
    _, info = env.reset(seed=0)
    actions = np.flatnonzero(info["action_mask"])
    _, _, _, _, _ = env.step(actions[0])
    _, _, ended, _, info = env.step(YARD.zone.catalogue.finish)
    assert ended
    ((x_m, y_m), tnt_kg, height_m) = info["charges"][0]
    charges = [Charge((x_m, y_m), tnt_kg, height_m)] * 2
    said = surrogate.guess(site_of(YARD), [env.placement.layout, ()], charges).impulse_pa_s.sum(
        axis=1
    )
    assert info["reduction"] == pytest.approx(1.0 - said[0] / said[1])
    with pytest.raises(BlastEnvError, match="realisations is 2, must be 1: surrogate has no noise"):
        BlastBarrierEnv(scenario=YARD, engine=SurrogateEngine(surrogate), realisations=2)


def test_a_guess_is_what_the_networks_say_layer_by_layer() -> None:
    """Without sums that points one above the other have in common, or messages that are kept.

    A fit keeps views in hundredths.
    """
    surrogate = by_hand(members=3)
    samples = Samples.of(table_of_guesses(surrogate, 12), {YARD.content_hash: YARD})
    every = np.ones(len(samples), dtype=bool)
    both = (surrogate.impulse, samples.impulse), (surrogate.peak, samples.peak)
    for networks, guessed in both:
        found = predictions(surrogate, networks, samples, guessed, every)
        assert found.log_load == pytest.approx(guessed.target, abs=2e-3)
    blind = [
        Networks(
            [own._replace(**dict.fromkeys(VIEWS, np.zeros((VIEW, SIGHT)))) for own in networks]
        )
        for networks in (surrogate.impulse.members, surrogate.peak.members)
    ]
    surrogate = replace(surrogate, impulse=blind[0], peak=blind[1])
    samples = Samples.of(table_of_guesses(surrogate, 12), {YARD.content_hash: YARD})
    for networks, guessed in zip(blind, (samples.impulse, samples.peak), strict=True):
        found = predictions(surrogate, networks, samples, guessed, every)
        assert found.log_load == pytest.approx(guessed.target, abs=1e-6)
