"""Whole reports: what they say is what the blasts gave."""

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pypdfium2
import pytest
from typer.testing import CliRunner

import blast_env
from blast_env.cli import app
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, BlastLoads, LoadCase, LoadCaseSet, StructureLoad
from blast_env.evaluation.blasts import NO_BARRIER, Blasts
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult, RecordedBlast
from blast_env.evaluation.questions.grid_error import convergence_index
from blast_env.evaluation.questions.verdict import consequences_of
from blast_env.evaluation.record import BlastRecord
from blast_env.gas import Cells
from blast_env.geometry import Layout, Measure, layout_text
from blast_env.io.export import LayoutPlan, bill_of_quantities
from blast_env.layout import write_layout
from blast_env.report import Limit, Study, StudyOptions, run_study, write_report
from blast_env.report.details import ReportDetails, read_details
from blast_env.report.page import report_html
from blast_env.report.study import Runs, blasts_of
from blast_env.report.threats import other_places
from blast_env.report.verdict import StudyVerdict
from blast_env.response import LevelOfProtection, catalogue
from blast_env.site import Charge, Hardening, Scenario, save_scenario
from tests.blasts import blasts_behind
from tests.catalogue_sites import WALL, yard
from tests.report.sites import LAYOUT, glazed_hut, small_hut
from tests.site.test_hardening import TAKEN, glazed_yard


@pytest.fixture(scope="module")
def page(study: Study) -> str:
    return report_html(study, ["blast-env", "report", "a site.toml"])


@pytest.fixture
def _without_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Spare a study its pictures, which take as long as its blasts."""
    for name in ("blast_pictures", "damage_pictures"):
        monkeypatch.setattr(f"blast_env.report.figures.{name}", lambda *_: ())
    monkeypatch.setattr("blast_env.report.figures.risk_picture", lambda *_: ("risk", b""))


@pytest.fixture(scope="module")
def measured() -> RecordedBlast:
    return GasBlast(small_hut(), LAYOUT).recorded()


def changed(study: Study, change: Callable[[str, float, BlastRecord], BlastRecord]) -> Study:
    """Return a study with other records, by the name of the layout and the side of the cells."""

    def of(blasts: Blasts) -> Blasts:
        records = {
            name: tuple(change(name, blasts.engine.smallest_m, each) for each in own)
            for name, own in blasts.records.items()
        }
        coarse = None if blasts.coarse is None else of(blasts.coarse)
        return replace(blasts, records=records, coarse=coarse)

    return replace(study, blasts=of(study.blasts))


def with_notes(study: Study, notes: Mapping[float, tuple[str, ...]]) -> Study:
    """Return a study with other notes on the blasts with the layout, by the side of the cells."""

    def change(name: str, cell_m: float, record: BlastRecord) -> BlastRecord:
        own = () if name == NO_BARRIER else notes.get(cell_m, ())
        return replace(record, details=replace(record.complete, notes=own))

    return changed(study, change)


def test_names_and_changes_of_the_map_are_in_the_report(study: Study) -> None:
    document = study.scenario.model_dump(mode="json", exclude_none=True)
    document["structures"][0]["title"] = "Дом культуры"
    document["import_notes"] = ["left out: open lines: 1 (LINE 3F on the layer A)"]
    titled = Scenario.from_document(document, "titled")
    assert titled.content_hash == study.scenario.content_hash
    page = report_html(replace(study, scenario=titled), [])
    assert page.count('<td class="l">Дом культуры</td>') >= 4
    assert '<td class="l">Дом культуры (<code>hut</code>)</td>' in page
    assert '<td class="l">hut<' not in page
    assert "<li>left out: open lines: 1 (LINE 3F on the layer A)</li>" in page


def test_loads_are_those_of_the_blast(study: Study, measured: RecordedBlast) -> None:
    (threat,), (target,) = study.threats, study.targets
    result = blast_env.simulate(glazed_hut(), LAYOUT, engine="gas")
    (row,) = result.structures.to_dict("records")
    pair = next(each for each in study.pairs if each.cells == 0.5)
    assert (pair.target, pair.threat) == (target, threat)
    assert pair.protected.impulse_pa_s == pytest.approx(row["impulse_pa_s"])
    assert pair.protected.peak_pa == row["peak_pa"]
    assert pair.protected.arrival_s == row["arrival_s"]
    assert pair.protected.wall == row["most_loaded_face"]
    assert pair.protected.wall_impulse_pa_s == pytest.approx(row["most_loaded_pa_s"])
    assert pair.protected == measured.record.complete.buildings["hut"]
    assert 0.1 < pair.reduction < 0.5
    assert {each.cells for each in study.pairs} == {0.5, 0.25}
    (fine,) = study.fine
    assert study.grid_error == fine.reduction_error
    assert fine.reduction_error == pytest.approx(convergence_index(fine.reduction, pair.reduction))
    both = (each.protected.impulse_pa_s for each in (fine, pair))
    assert fine.protected_error_pa_s == pytest.approx(convergence_index(*both))
    assert np.isnan(pair.reduction_error)  # of the coarser cells there is none
    digests = dict(study.digests)
    assert digests["T1 with the layout, cells of 0.5 m"] == result.digest


def test_histories_are_the_momentum_of_the_walls(measured: RecordedBlast) -> None:
    """Mean overpressure over time is the running impulse at the end.

    Histories have the middles of the steps, so half of the last step is beyond the last time.
    """
    faces, time_s = measured.result.faces, measured.histories.time_s
    for wall in ("west", "north"):
        own = faces[faces["face"] == wall]
        own = own[own["structure"] == "hut"]
        total = own["net_impulse_pa_s"]
        history = measured.histories.of("hut", wall)
        assert history is not None
        along = np.trapezoid(history, time_s) + 0.5 * history[-1] * (time_s[-1] - time_s[-2])
        assert along == pytest.approx(float(total.mean()), abs=0.02 * own["impulse_pa_s"].mean())
    assert measured.histories.of("hut", "roof") is None  # type: ignore[arg-type]


def test_worth_of_a_module_is_what_comes_back_without_it(study: Study) -> None:
    (threat,) = study.threats
    impulses = [
        GasBlast(small_hut(), layout, charge=threat.charge).run().impulse("hut").pa_s
        for layout in ((), LAYOUT, LAYOUT[1:])
    ]
    unprotected, whole, without = impulses
    worths = {each.name: each.worth for each in study.worths}
    first, second, third, last = (layout_text([each]) for each in LAYOUT)
    assert worths.keys() == {first, second, third, last}
    assert worths[first] == pytest.approx((without - whole) / unprotected)
    assert [each.worth for each in study.worths] == sorted(worths.values(), reverse=True)
    # The charge is in the middle before the wall: both halves are worth alike, but for rounding.
    assert worths[first] == pytest.approx(worths[last], rel=0.05)
    assert worths[second] == pytest.approx(worths[third], rel=0.05)
    assert min(worths.values()) > 0.0


def test_places_are_those_of_the_scenario(study: Study) -> None:
    (place,) = study.outcomes
    pair = next(each for each in study.pairs if each.cells == 0.5)
    assert place.load == pytest.approx(pair.protected.impulse_pa_s)
    assert place.reduction == pytest.approx(pair.reduction)


def test_impulses_stay_impulses_where_damage_counts() -> None:
    """The page gives them in Pa s: not the shortfall of a level that an objective counts."""
    scenario = glazed_yard(target="medium")
    bare, walled = (
        BlastLoads(tuple(StructureLoad.on(each, pa_s) for each in scenario.structures), np.zeros(0))
        for pa_s in (200.0, 150.0)
    )
    case = LoadCaseSet(scenario, (LoadCase(Charge((2.0, 6.0), 1.0), name="T1"),))
    layouts: dict[str, Layout] = {NO_BARRIER: (), "layout": (TAKEN,)}
    records = {NO_BARRIER: (BlastRecord(bare),), "layout": (BlastRecord(walled),)}
    blasts = Blasts(case, layouts, records, GasEngine())
    (each,) = Study(scenario, (TAKEN,), StudyOptions(), blasts, places=blasts).outcomes
    assert (each.unprotected_load, each.load) == (200.0, 150.0)
    assert each.reduction == pytest.approx(0.25)


def test_page_one_counts_the_notes_on_the_cells_that_decide(study: Study) -> None:
    of_both = report_html(with_notes(study, {0.25: ("far",), 0.5: ("far",)}), [])
    assert "1 note on loads outside the validated range" in of_both
    assert "2 notes, under validity; 1 with the finer cells, which decide" in of_both
    of_one = report_html(with_notes(study, {0.5: ("far",)}), [])
    assert "on loads outside the validated range of the engine" not in of_one


def test_pieces_of_a_catalogue_are_the_items() -> None:
    """Ranked one by one, each left out whole."""
    scenario, threats = yard(), other_places(yard(), 1)[:1]
    items = Runs(scenario, WALL, StudyOptions(), lambda _, __: None).without_items(threats)
    study = Study(scenario, WALL, StudyOptions(), items, items=items)
    worths = {each.name: each for each in study.worths}
    assert worths.keys() == {"5,1,wall,turned", "8,1,wall,turned", "4,1,post"}
    assert worths["5,1,wall,turned"].rectangle_m == (4.0, 5.0, 4.5, 6.5)
    assert worths["5,1,wall,turned"].worth > worths["4,1,post"].worth


def test_page_needs_nothing_else(page: str) -> None:
    sources = re.findall(r'(?:src|href)="([^"]{0,40})', page)
    assert len(sources) >= 8
    assert all(each.startswith("data:image/png;base64,iVBOR") for each in sources)
    assert "<script" not in page
    assert "@import" not in page
    assert "url(" not in page


def test_page_has_the_numbers_and_all_it_takes_to_repeat_it(study: Study, page: str) -> None:
    fine = study.fine[0]
    pm = "\N{PLUS-MINUS SIGN}"
    assert (
        f"<td>{fine.unprotected.impulse_pa_s:.0f} {pm} {fine.unprotected_error_pa_s:.1f}</td>"
        in page
    )
    assert f"<td>{100 * fine.reduction:.1f} % {pm} {100 * fine.reduction_error:.1f}</td>" in page
    assert small_hut().content_hash in page
    assert "<code>blast-env report &#34;a site.toml&#34;</code>" in page
    assert "&#34;cells&#34;: [[1, 0], [2, 0], [3, 0], [4, 0]]" in page
    assert "name = &#34;hut&#34;" in page
    for label, digest in study.digests:
        assert f'{label}</td><td class="l"><code>{digest[:16]}' in page
    titles = re.findall(r"<h2>(\d+)\. ([^<]+)</h2>", page)
    assert titles == [
        (str(number), title)
        for number, title in enumerate(
            (
                *("Plan", "Facades before and after", "Alternatives and cost"),
                *("Design-basis threat", "Assumptions", "Limits", "References"),
                *("Loads", "Contribution of each item", "Other places"),
                *("Checks by hand", "Reproduction"),
            ),
            start=1,
        )
    ]


def test_limits_are_passed_or_failed(study: Study, page: str) -> None:
    fine = study.fine[0]
    assert fine.protected.wall_impulse_pa_s < 300.0 < fine.unprotected.wall_impulse_pa_s
    whole, *limits = re.findall(r'<span class="(\w+)">([^<]+)</span>', page)
    assert fine.unprotected.flagged  # 6.8 cells per m/kg^(1/3)
    assert fine.protected.flagged
    assert whole[1] in ("COMPLIES (flagged)", "DOES NOT COMPLY")
    assert limits == [("fail", "does not comply"), ("pass", "complies (flagged)")]
    assert ">complies<" not in page
    assert "1 of 1</strong> cases with the layout, 0 without" in page


def test_loads_within_what_was_checked(study: Study, page: str) -> None:
    """What is outside is said by name; here a copy of the study without notes."""
    assert any("checked from 9.2" in note for note in study.notes)
    assert "outside the validated range of the engine" in page
    silent = report_html(with_notes(study, {}), ["blast-env"])
    assert f"<td>{study.fine[0].unprotected.peak_pa / 1e3:.0f}</td>" in silent
    assert "No load in this report is outside that range." in silent


def test_pdf_has_the_same_pages_of_text_and_pictures(study: Study, tmp_path: Path) -> None:
    html, pdf = write_report(study, tmp_path / "a.html", tmp_path / "a.pdf", ["blast-env"])
    assert html.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    document = pypdfium2.PdfDocument(pdf)
    text = "".join(each.get_textpage().get_text_range() for each in document)
    assert "Contribution of each item" in text
    assert small_hut().content_hash[:20] in text
    assert f"{len(document)} / {len(document)}" in text
    pictures = sum(1 for each in document for item in each.get_objects() if item.type == 3)
    assert pictures >= 8
    # Nothing runs out of the page: the outermost pixels are white.
    for each in document:
        pixels = np.asarray(each.render(scale=0.5).to_numpy())
        assert (pixels[:, :12] > 250).all()
        assert (pixels[:, -12:] > 250).all()


@pytest.mark.parametrize(
    ("html", "pdf", "words"), [("a.txt", None, "must be .html"), ("a.html", "a.ps", "must be .pdf")]
)
def test_suffixes(study: Study, html: str, pdf: str | None, words: str, tmp_path: Path) -> None:
    with pytest.raises(BlastEnvError, match=words):
        write_report(study, tmp_path / html, None if pdf is None else tmp_path / pdf)


def test_layout_of_nothing_is_refused() -> None:
    with pytest.raises(BlastEnvError, match="the layout is empty"):
        run_study(small_hut(), ())


def test_command_passes_on_what_it_was_asked(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[Scenario, Layout, StudyOptions]] = []

    def run(scenario: Scenario, layout: Layout, options: StudyOptions, _: object) -> Study:
        asked.append((scenario, layout, options))
        return study

    monkeypatch.setattr("blast_env.report.run_study", run)
    monkeypatch.setattr("blast_env.report.write_report", lambda _, *paths: list(paths))
    site, wall, out, pdf = (
        str(tmp_path / name) for name in ("s.toml", "w.json", "a.html", "a.pdf")
    )
    save_scenario(small_hut(), site)
    write_layout(wall, small_hut(), LAYOUT, {})
    files = ("report", site, "--layout", wall, "--out", out, "--pdf", pdf)
    few = ("--no-items", "--charge", "2,3,4", "--limit", "hut=9,2")
    done = CliRunner().invoke(app, [*files, *few])
    assert done.exit_code == 0, done.stderr
    assert done.stdout.split()[-4:] == ["wrote", out, "wrote", pdf]
    ((scenario, layout, options),) = asked
    assert (scenario, layout) == (small_hut(), LAYOUT)
    assert not options.items
    assert options.charges == (Charge((2.0, 3.0), 4.0),)
    assert options.limits == (Limit("hut", 9.0, 2000.0),)


def test_engines_of_both_sizes_are_gas() -> None:
    assert StudyOptions().coarse == GasEngine(cell_m=0.5)


def test_the_verdict_comes_first_and_says_what_it_rests_on(study: Study, page: str) -> None:
    verdict = StudyVerdict(study)
    ((_, behind),) = verdict.buildings.values()
    assert (behind.panes, behind.panels) == (8, 4)
    assert verdict.passes == (study.protected.passes(study.target) and verdict.kept(1) == 1)
    first = page[page.index("<h3>Verdict") : page.index("<h2>")]
    assert f">{verdict.word}<" in first
    assert f"<td>{behind.broken:.1f} of 8</td>" in first
    assert '<td class="l">4 cost units, for 4 modules</td>' in first
    assert f"level {study.target.label!r}".replace("'", "&#39;") in first
    assert "driven by" in first
    assert "with it the level is kept at the same place" in first
    assert "falls by" in first
    assert all(f"all windows: {each.title}" in page for each in verdict.glazing)
    assert page.count("no price given in the site file") == len(verdict.glazing) - 1
    assert "installed already" in page  # of the windows as they are
    bays = page[page.index("Bay by bay") :]
    assert all(f"hut/{wall}/1/1" in bays for wall in ("west", "east", "south", "north"))


def test_page_one_has_the_verdict_in_the_words_of_the_field(study: Study) -> None:
    harsh = replace(study.options, limits=(Limit("hut", impulse_pa_s=1.0),))
    verdict = StudyVerdict(replace(study, options=replace(harsh, target=LevelOfProtection.HIGH)))
    assert verdict.word == "DOES NOT COMPLY"
    assert verdict.words == "level of protection below High; 1 load limit exceeded (threat T1)"


def test_details_and_currency_are_on_the_page_and_the_marking_on_every_page(study: Study) -> None:
    details = ReportDetails(project="North gate", client="City", marking='"</style> X')
    document = study.scenario.model_dump(mode="json", exclude_none=True)
    document["build_zone"]["currency"] = "EUR"
    priced = Scenario.from_document(document, "priced")
    assert priced.content_hash == study.scenario.content_hash
    options = replace(study.options, details=details)
    page = report_html(replace(study, options=options, scenario=priced), [])
    assert "<h1>North gate</h1>" in page
    assert "Client: <strong>City</strong>" in page
    assert "4 EUR, for 4 modules" in page
    assert page.count("</style>") == 1
    assert r'@top-center { content: "\22 \3c \2f style\3e  X"' in page


def test_details_come_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "details.toml"
    path.write_text('client = "City"\nrevision = "A"\n')
    assert read_details(path) == ReportDetails(client="City", revision="A")
    path.write_text('clients = "City"\n')
    with pytest.raises(BlastEnvError, match="clients"):
        read_details(path)
    with pytest.raises(BlastEnvError, match="marking has 201 characters"):
        ReportDetails(marking="x" * 201)


def test_a_barrier_that_adds_load_is_named(study: Study) -> None:
    protected = study.fine[0].protected

    def change(name: str, _: float, record: BlastRecord) -> BlastRecord:
        share = 0.9 if name == NO_BARRIER else 1.0
        load = replace(protected, impulse_pa_s=share * protected.impulse_pa_s)
        return replace(record, details=replace(record.complete, buildings={"hut": load}))

    page = report_html(changed(study, change), [])
    assert "\N{MINUS SIGN}11.1 % (the barrier makes it worse)" in page


def test_a_stricter_target_fails_and_limits_count_as_well(study: Study) -> None:
    strict = replace(study, options=replace(study.options, target=LevelOfProtection.HIGH))
    assert StudyVerdict(strict).passes is False
    harsh = replace(study.options, limits=(Limit("hut", impulse_pa_s=1.0),))
    assert StudyVerdict(replace(study, options=harsh)).passes is False


def test_without_facades_and_limits_there_is_no_verdict_but_loads(study: Study) -> None:
    none = np.zeros((0, 0))
    plain = changed(study, lambda *each: replace(each[2], bays=(), pressure_pa=none))
    plain = replace(plain, options=replace(study.options, limits=()))
    assert StudyVerdict(plain).word == "NO VERDICT"
    page = report_html(plain, ["blast-env"])
    assert "no building has a facade" in page
    assert "Loads of the protected buildings" in page


@pytest.mark.usefixtures("_without_pictures")
@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ((0.5, 0.5), "cells of 0.5 m"),
        (("coarse", "fine"), "coarse cells from 0.5 m and fine cells from 0.25 m"),
    ],
)
def test_a_report_that_is_stopped_has_what_was_done(
    cells: tuple[Cells, Cells], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Runs, "without_items", stop)
    stopped = run_study(small_hut(), LAYOUT, StudyOptions(cells=cells))
    assert stopped.stopped == "without each item"
    assert {each.cells for each in stopped.pairs} == {*cells}
    page = report_html(stopped, ["blast-env"])
    assert "This report was stopped before: without each item" in page
    assert f"three dimensions), {words}." in page
    assert f"take those with {words.split(' and ')[-1]} as a lower bound" in page
    assert not re.search(r"\b(coarse|fine) m\b", page)
    shown = f"{100.0 * stopped.pairs[-1].reduction:.1f} %"
    error = f"{shown} \N{PLUS-MINUS SIGN} {100.0 * stopped.grid_error:.1f}"
    assert (error in page) == (cells[0] != cells[1])


@pytest.mark.usefixtures("_without_pictures")
def test_stopped_among_the_finer_cells_a_report_has_the_coarser_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sizes: list[float] = []

    record = GasEngine.record

    def recorded(engine: GasEngine, *rest: Any) -> BlastRecord:
        sizes.append(engine.cell_m)
        if len(sizes) == 4:
            raise KeyboardInterrupt
        return record(engine, *rest)

    monkeypatch.setattr(GasEngine, "record", recorded)
    stopped = run_study(glazed_hut(), LAYOUT, StudyOptions())
    assert sizes == [0.5, 0.5, 0.25, 0.25]
    assert stopped.stopped == "cells of 0.25 m"
    assert {each.cells for each in stopped.pairs} == {0.5}
    page = report_html(stopped, ["blast-env"])
    assert "This report was stopped before: cells of 0.25 m" in page
    assert "only one cell size was used" in page
    assert not re.search(r"\bnan\b", re.sub(r"base64,[^\"]*", "", page))
    sizes[:] = [0.5] * 2
    with pytest.raises(KeyboardInterrupt):  # nothing is done yet
        run_study(glazed_hut(), LAYOUT, StudyOptions(cells=(0.5, 0.5)))


def test_other_glass_has_the_price_of_the_measures_that_put_it_into_all_windows(
    study: Study,
) -> None:
    glass = "window_laminated_6"
    west = Hardening(name="w", glazing=glass, walls=("west",), cost=10.0)
    others = Hardening(name="o", glazing=glass, walls=("east", "south", "north"), cost=20.0)
    every = Hardening(name="e", glazing=glass, cost=50.0)

    def price(*measures: Hardening, taken: tuple[Measure, ...] = ()) -> float | None:
        zone = study.scenario.zone.model_copy(update={"hardening": measures})
        site = study.scenario.model_copy(update={"build_zone": zone})
        verdict = StudyVerdict(replace(study, scenario=site, layout=(*LAYOUT, *taken)))
        title = catalogue()[glass].title
        return next(each.cost for each in verdict.glazing if each.title == title)

    assert price() is None
    assert price(west) is None
    assert price(west, others) == 30.0
    assert price(west, others, every) == 30.0
    assert price(west, every) == 50.0
    assert price(west, others, taken=(Measure.named("w"),)) == 20.0


def test_measures_are_in_the_bill_without_sizes(
    study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    bill = bill_of_quantities(LayoutPlan(glazed_yard(), (TAKEN,)))
    monkeypatch.setattr(Study, "bill", bill)
    page = report_html(study, ["blast-env"])
    row = re.search(r"<tr><td class=\"l\">glass</td>.*</tr>", page)
    assert row is not None
    assert row[0].count("<td></td>") == 3


@pytest.mark.usefixtures("_without_pictures")
def test_the_blasts_that_are_counted_before_are_those_that_are_run(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each part that is told of is one that was counted, and no blast runs twice."""
    seen: list[str] = []
    charges: list[Any] = []
    blasts: list[Any] = []
    run = GasBlast.run

    def counted_run(self: GasBlast, *arguments: Any) -> GasResult:
        charges.append(self.threat)
        blasts.append((self.threat, tuple(self.layout), self.engine.cell_m))
        return run(self, *arguments)

    monkeypatch.setattr(GasBlast, "run", counted_run)
    options = replace(study.options, cache=tmp_path)
    run_study(small_hut(), LAYOUT, options, lambda label, _: seen.append(label))
    parts = blasts_of(small_hut(), LAYOUT, options, study.threats)
    assert set(seen) == {each.label for each in parts if each.charges}
    assert Counter(charges) == Counter(charge for each in parts for charge in each.charges)
    assert len(charges) == len(set(blasts)) == 4 + len(LAYOUT)
    fewer = blasts_of(small_hut(), LAYOUT, replace(options, items=False), study.threats)
    assert sum(len(each.charges) for each in fewer) == 4

    threat = LoadCase(study.threats[0].charge, 0)
    kept = BlastEvaluator(small_hut(), options.coarse, cache=tmp_path)
    anew = BlastEvaluator(small_hut(), options.coarse)
    for layout in ((), LAYOUT):
        one, other = (
            [
                (each.impulse_pa_s, each.peak_pa)
                for each in evaluator.loads(layout, threat).structures
            ]
            for evaluator in (kept, anew)
        )
        assert one == other
    assert kept.counts.blasts == 0
    fine = BlastEvaluator(small_hut(), GasEngine.with_cells(options.cells[1]), cache=tmp_path)
    fine.loads_of_many([((), threat), (LAYOUT, threat)])
    assert fine.counts.blasts == 0  # an evaluation after the report has them too
    monkeypatch.setattr(GasEngine, "record", None)
    found = blasts_behind(fine, LAYOUT, [threat.charge])  # and so has `assess`
    assert consequences_of(found).barriers
