"""Fits: what they learn, what they say of held-out sites, and the blasts they take."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import studies.surrogate
from blast_env.design.search import (
    Guesses,
    layouts_by_rule,
)
from blast_env.errors import BlastEnvError
from blast_env.layout import LayoutState
from blast_env.surrogate import (
    FEATURES,
    MEMBERS,
    SHARES,
    Samples,
    fit,
    folds,
    load_errors,
    packaged_surrogate,
    predictions,
    save_surrogate,
)
from blast_env.surrogate.intervals import widened
from studies.surrogate import Holdout, Recipe
from tests.surrogate.cases import ABOUT, YARD, by_hand, case, table_of_guesses


def test_the_loads_at_points_of_published_blasts_are_within_what_a_network_may_say() -> None:
    rows = studies.surrogate.named_rows([Path("docs/data/close_site_blasts.parquet")])
    samples = studies.surrogate.samples_of(rows[rows["protected"]].iloc[:60])
    for loads in (samples.impulse, samples.peak):
        over = (loads.at_points - loads.known)[np.isfinite(loads.at_points)]
        assert len(over) > 1000
        assert -8.0 < over.min() < over.max() < 1.4


def test_what_the_package_brings_was_checked_on_sites_that_it_had_not_met() -> None:
    """A surrogate that ranks no better than chance has no place in the package."""
    about = packaged_surrogate().fit
    for check in (about.impulse, about.peak):
        assert check is not None
        assert check.rank > 0.5
        assert check.lost < 0.1


def test_it_learns_what_it_is_shown_and_says_how_well() -> None:
    table = table_of_guesses(by_hand(7, members=1), 120)
    with pytest.raises(BlastEnvError, match="no load of a protected structure"):
        Samples.of(table, {})
    samples = Samples.of(table, {YARD.content_hash: YARD})
    held = folds(samples.case, 4, 0)
    assert sum(fold.sum() for fold in held) == len(samples)
    learnt = fit(samples, ~held[0], 80, 0, ABOUT, 2)
    of_kinds = (learnt.impulse, samples.impulse), (learnt.peak, samples.peak)
    for networks, loads in of_kinds:
        found = load_errors(learnt, networks, samples, loads, held[0])
        assert found.within < 0.5 * float(np.std(loads.target[held[0]]))
        assert found.cases == held[0].sum() / 10
        assert found.rank > 0.8
        assert 0.0 <= found.lost < 0.05
    once, again = (fit(samples, held[0], 1, 0, ABOUT) for _ in range(2))
    assert len(once.impulse.members) == len(once.peak.members) == MEMBERS
    assert once.digest == again.digest


def test_loads_at_points_count_beside_their_mean() -> None:
    """They contradict the means here by 0.5 in the logarithm: the fit ends between both."""
    table = table_of_guesses(by_hand(), 40)
    samples = Samples.of(table, {YARD.content_hash: YARD})
    every = np.ones(len(samples), dtype=bool)
    assert np.isnan(samples.impulse.at_points).all()  # the table tells none
    found = {}
    for off in (np.nan, -0.5, 0.5):
        at_points = (samples.impulse.known + off).astype(np.float32)
        owner = np.repeat(np.arange(len(samples)), samples.counts)
        weights = samples.area_m2 * np.exp(samples.impulse.known)
        mean = np.bincount(owner, weights) / np.bincount(owner, samples.area_m2)
        told = replace(samples.impulse, target=np.log(mean), at_points=at_points)
        learnt = fit(replace(samples, impulse=told), every, 60, 0, ABOUT, 1, peaks=False)
        found[off] = load_errors(learnt, learnt.impulse, samples, told, every).bias
    assert found[-0.5] < -0.1
    assert found[0.5] > 0.1
    (alone,) = (bias for off, bias in found.items() if np.isnan(off))
    assert abs(alone) < 0.05


def test_loads_at_points_of_a_table_are_those_of_its_structures() -> None:
    table = table_of_guesses(by_hand(), 4)
    first = table["structure"] == table["structure"].iloc[0]
    few = table[first].assign(point_impulses_pa_s="[]", point_peaks_pa="[1.0,null]")
    with pytest.raises(BlastEnvError, match="loads at 2 points, must have"):
        Samples.of(few, {YARD.content_hash: YARD})
    (count,) = {*Samples.of(table[first], {YARD.content_hash: YARD}).counts.tolist()}
    loads = json.dumps([None, *range(count - 1)])
    told = Samples.of(
        few.assign(point_peaks_pa=[loads, *["[]"] * (len(few) - 1)]), {YARD.content_hash: YARD}
    )
    at_points = told.peak.at_points.reshape(len(few), count)
    assert np.isnan(at_points[0, 0])
    assert np.isnan(at_points[1:]).all()
    least = [0.0, *np.log(np.arange(1, count - 1))]  # where no wave came, 1 Pa
    assert at_points[0, 1:] == pytest.approx(np.array(least), abs=1e-6)


def test_it_learns_from_messages_what_ways_do_not_see() -> None:
    """Loads go by how near the charge solids stand; of ways, views and traits nothing is told."""
    samples = Samples.of(table_of_guesses(by_hand(), 20), {YARD.content_hash: YARD})
    samples.features[:, FEATURES - SHARES :] = 0.0
    samples.views[:] = 0
    samples.traits[:] = 0.0
    rows = samples.counts * samples.solids
    near = np.add.reduceat(samples.relations[:, 8], np.cumsum([0, *rows[:-1]])) / samples.counts
    made_up = replace(samples.impulse, target=5.0 - 0.1 * near)
    blind = replace(samples, relations=np.zeros_like(samples.relations))
    every = np.ones(len(samples), dtype=bool)
    within = [
        load_errors(found, found.impulse, given, made_up, every).within
        for given in (blind, samples)
        for found in [fit(replace(given, impulse=made_up), every, 160, 0, ABOUT, 1, peaks=False)]
    ]
    assert within[1] < 0.3 * within[0]


def test_loads_that_are_no_numbers_stop_a_fit() -> None:
    samples = Samples.of(table_of_guesses(by_hand(), 10), {YARD.content_hash: YARD})
    target = np.full_like(samples.impulse.target, np.nan)
    odd = replace(samples, impulse=replace(samples.impulse, target=target))
    every = np.ones(len(samples), dtype=bool)
    with pytest.raises(BlastEnvError, match="networks of seed 0 in epoch 0: no finite error"):
        fit(odd, every, 1, 0, ABOUT, 1, peaks=False)


def test_layouts_to_learn_from_are_legal_and_of_all_kinds() -> None:
    (threat,) = case().threats
    ruled = {tuple(sorted(layout)) for layout in layouts_by_rule(YARD).values()}
    layouts = Recipe(8).of(YARD, threat, 1)
    assert layouts[0] == ()
    assert len(set(layouts)) == len(layouts) > 8
    assert ruled <= set(layouts)
    for layout in layouts:
        assert LayoutState.of(YARD, layout).layout == layout
    assert layouts == Recipe(8).of(YARD, threat, 1)
    few = Recipe(0, 2).of(YARD, threat, 1)
    assert len(few) == 3
    assert set(few[1:]) < ruled
    liked = Recipe(0, 0, by_hand(), 2).of(YARD, threat, 1)[1:]
    best, tenth = Guesses.of(by_hand(), case()).loads(liked)
    assert best < tenth < Guesses.of(by_hand(), case()).loads([*ruled]).min()
    unprotected, best = Guesses.of(by_hand(), case()).loads([(), liked[0]])
    takes_off = 1.0 - best / unprotected
    assert Recipe(0, 0, by_hand(), 2, least=0.9 * takes_off).of(YARD, threat, 1)[1:] == liked
    assert Recipe(0, 0, by_hand(), 2, least=1.1 * takes_off).of(YARD, threat, 1) == []
    drawn = Recipe(0, 0, draws=3).of(YARD, threat, 1)[1:]
    assert 0 < len(drawn) <= 3
    assert all(LayoutState.of(YARD, layout).layout == layout for layout in drawn)


def test_blasts_with_a_least_share_need_a_surrogate(tmp_path: Path) -> None:
    folder = tmp_path / "blasts"
    options = ["blasts", "--least", "0.3", "--cache", str(folder)]
    done = CliRunner().invoke(studies.surrogate.app, options)
    assert done.exit_code != 0
    assert not folder.exists()


def test_a_surrogate_is_checked_on_the_sites_of_a_table(tmp_path: Path) -> None:
    table = pq.read_table("docs/data/close_site_blasts.parquet")
    names = table["scenario"].unique()[:40]
    pq.write_table(table.filter(pc.is_in(table["scenario"], names)), tmp_path / "few.parquet")
    surrogate = save_surrogate(packaged_surrogate(), tmp_path / "surrogate.json")
    options = ["check", str(tmp_path / "few.parquet"), "--surrogate", str(surrogate)]
    done = CliRunner().invoke(studies.surrogate.app, options, catch_exceptions=False)
    rows_of = [line.split("|")[1:-1] for line in done.output.splitlines()[2:4]]
    assert [row[0].strip() for row in rows_of] == [
        f"{load} on 40 sites of few" for load in ("impulse", "peak")
    ]
    for row in rows_of:
        assert 0.0 < float(row[2]) < 0.2  # near what it was fitted to, and never quite right
        assert float(row[4]) > 0.5
    coverage = [line.split("|")[1:-1] for line in done.output.splitlines()[-40:]]
    assert {line[0].strip() for line in coverage} == set(names.to_pylist())
    # A site has four loads or eight: one outside its interval is a quarter of them.
    assert np.mean([float(line[3].strip(" %")) for line in coverage]) > 85.0


def test_errors_on_held_out_sites_stand_beside_those_on_sites_of_the_fit(tmp_path: Path) -> None:
    table = pq.read_table("docs/data/close_site_blasts.parquet")
    names = table["scenario"].unique()[:12]
    few, surrogate = tmp_path / "few.parquet", tmp_path / "surrogate.json"
    pq.write_table(table.filter(pc.is_in(table["scenario"], names)), few)
    save_surrogate(packaged_surrogate(), surrogate)
    options = ["gap", "--data", str(few), "--surrogate", str(surrogate), "--every", "4"]
    done = CliRunner().invoke(studies.surrogate.app, options, catch_exceptions=False)
    rows = [line.split("|")[1:-1] for line in done.output.splitlines()[2:]]
    held_out, own = "3 held-out sites", "9 of the fit"
    wanted = [f"{kind} on {where}" for where in (held_out, own) for kind in ("impulse", "peak")]
    assert [row[0].strip() for row in rows] == wanted
    assert all(0.0 < float(row[1]) < 0.3 for row in rows)


def test_a_fit_with_too_few_sites_for_intervals_is_refused_before_it_begins(tmp_path: Path) -> None:
    table = pq.read_table("docs/data/close_site_blasts.parquet")
    names = table["scenario"].unique()[:20]
    few, out = tmp_path / "few.parquet", tmp_path / "surrogate.json"
    pq.write_table(table.filter(pc.is_in(table["scenario"], names)), few)
    options = ["fit", "--data", str(few), "--out", str(out)]
    done = CliRunner().invoke(studies.surrogate.app, options)
    assert done.exit_code == 2
    assert "--every 8 holds out 3 sites, must be at least 38" in " ".join(done.output.split())
    assert not out.exists()


def test_held_out_loads_set_the_intervals() -> None:
    """Off by three spreads on two of 120 sites, by 0.5 to 1 on the others."""
    fitted = by_hand(members=3)
    table = table_of_guesses(fitted, 160)
    samples = Samples.of(table, {YARD.content_hash: YARD})
    samples = replace(samples, site=np.arange(len(samples)))
    every = np.ones(len(samples), dtype=bool)
    found = predictions(fitted, fitted.impulse, samples, samples.impulse, every)
    spreads = np.where(samples.site % 80 == 0, 3.0, np.linspace(0.5, 1.0, len(samples)))
    loads = replace(samples.impulse, target=found.log_load + spreads * widened(found.spread, 0.02))
    held_out = samples.site < 120
    joined = Holdout.of(fitted, fitted.impulse, samples, loads, held_out, 0.02, 0)
    assert 0.85 < joined.check.spreads < 0.9
    off = (spreads * widened(found.spread, 0.02))[held_out]
    assert joined.errors.rms == pytest.approx(np.sqrt(np.mean(off**2)))
    far = spreads[held_out] > 2.0
    assert not joined.covered.inside[far].any()
    assert 0.9 < joined.covered.inside[~far].mean() < 1.0
