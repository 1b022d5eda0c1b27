"""Whole reports: what they say is what the blasts gave."""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pypdfium2
import pytest
from typer.testing import CliRunner

import blast_env
from blast_env.answers import Line, Number, Picture
from blast_env.answers import report as reports
from blast_env.answers.report import (
    Limit,
    Report,
    ReportDetails,
    Study,
    StudyOptions,
    StudyPlan,
    report_document,
    run_report,
    write_report,
)
from blast_env.answers.report.basis import glazing_cost
from blast_env.app.work import Answer, Question
from blast_env.cli import app
from blast_env.errors import BlastEnvError
from blast_env.evaluation import (
    BlastEvaluator,
    BlastLoads,
    LoadCase,
    LoadCaseSet,
    StructureLoad,
    convergence_index,
)
from blast_env.evaluation.blasts import NO_BARRIER, Blasts
from blast_env.evaluation.engines.gas import BlastMeasurement, GasBlast, GasEngine, GasResult
from blast_env.evaluation.places import other_places
from blast_env.evaluation.questions.verdict import consequences_of
from blast_env.evaluation.record import BlastRecord
from blast_env.evaluation.study import run_study
from blast_env.gas import Cells
from blast_env.geometry import Layout, Measure, layout_text
from blast_env.layout import write_layout
from blast_env.response import Glazing, LevelOfProtection, catalogue
from blast_env.site import Charge, Hardening, Scenario, save_scenario
from tests.blasts import blasts_behind
from tests.catalogue_sites import WALL, yard
from tests.report.sites import LAYOUT, glazed_hut, page_text, small_hut, table_of
from tests.site.test_hardening import TAKEN, glazed_yard


@pytest.fixture(scope="module")
def page(report: Report) -> str:
    return page_text(report, ["blast-env", "report", "a site.toml"])


@pytest.fixture(scope="module")
def measured() -> BlastMeasurement:
    return GasBlast(small_hut(), LAYOUT).recorded()


def on_site(study: Study, **changes: Any) -> Study:
    """Return a study of a scenario that differs in what changes no blast."""
    document = study.scenario.model_dump(mode="json", exclude_none=True)
    for keys, value in changes.items():
        part: Any = document
        *path, last = keys.split("__")
        for key in path:
            part = part[int(key) if key.isdigit() else key]
        part[last] = value
    scenario = Scenario.from_document(document, "changed")
    assert scenario.content_hash == study.scenario.content_hash
    blasts = replace(study.blasts, case=LoadCaseSet(scenario, study.threats))
    return replace(study, plan=replace(study.plan, scenario=scenario), blasts=blasts)


def asked(study: Study, **changes: Any) -> Study:
    """Return a study with other options."""
    options = replace(study.options, **changes)
    return replace(study, plan=replace(study.plan, options=options))


def changed(study: Study, change: Callable[[str, float, BlastRecord], BlastRecord]) -> Study:
    """Return a study with other records, by the name of the layout and the side of the cells."""

    def of(blasts: Blasts) -> Blasts:
        records = {
            name: tuple(change(name, blasts.engine.smallest_m, record) for record in own)
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
    notes = ["left out: open lines: 1 (LINE 3F on the layer A)"]
    titled = on_site(study, structures__0__title="Дом культуры", import_notes=notes)
    page = page_text(Report(titled))
    assert page.count('<td class="l">Дом культуры</td>') >= 3
    assert '<td class="l">hut: Дом культуры</td>' in page
    assert '<td class="l">Дом культуры (hut)</td>' in page
    assert '<td class="l">hut<' not in page
    assert "<li>left out: open lines: 1 (LINE 3F on the layer A)</li>" in page


def test_structures_of_a_building_are_one() -> None:
    document = glazed_hut().model_dump(mode="json", exclude_none=True)
    hut = document["structures"][0]
    shed = hut | {"name": "shed", "corner_m": [0.5, 0.5], "rows": 1, "protected": False}
    shed.pop("facade")
    halves = [
        hut | {"name": f"hut_{side}", "building": "hut", "corner_m": [6.0, y_m], "rows": 2}
        for side, y_m in (("a", 3.0), ("b", 5.0))
    ]
    document["structures"] = [shed, *halves]
    site = Scenario.from_document(document, "hut")
    plan = StudyPlan(site, LAYOUT, StudyOptions(cells=(0.5, 0.5), items=False))
    first, second = table_of(
        report_document(Report(plan.run(lambda *_: None))), "Buildings"
    ).cells()
    assert first == ("hut", "protected", "2", "6 to 8", "3 to 6", "2")
    assert second[:2] == ("shed", "other")


def test_loads_are_those_of_the_blast(study: Study, measured: BlastMeasurement) -> None:
    result = blast_env.simulate(glazed_hut(), LAYOUT, engine="gas")
    (row,) = result.structures.to_dict("records")
    coarse, fine = (study.effect(blasts, 0, "hut") for blasts in study.sizes)
    assert [blasts.engine.smallest_m for blasts in study.sizes] == [0.5, 0.25]
    assert coarse.value == pytest.approx(row["impulse_pa_s"])
    load = study.sizes[0].records[study.sizes[0].judged][0].complete.buildings["hut"]
    assert load.peak_pa == row["peak_pa"]
    assert load.arrival_s == row["arrival_s"]
    assert load.wall == row["most_loaded_face"]
    assert load.wall_impulse_pa_s == pytest.approx(row["most_loaded_pa_s"])
    assert load == measured.record.complete.buildings["hut"]
    assert 0.1 < coarse.reduction < 0.5
    assert study.grid_error == fine.reduction_error
    assert fine.reduction_error == pytest.approx(
        convergence_index(fine.reduction, coarse.reduction)
    )
    assert fine.error == pytest.approx(convergence_index(fine.value, coarse.value))
    assert np.isnan(coarse.reduction_error)  # of the coarser cells there is none
    digests = dict(study.digests)
    assert digests["T1 with the layout, cells of 0.5 m"] == result.digest


def test_histories_are_the_momentum_of_the_walls(measured: BlastMeasurement) -> None:
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
    worths = {layout_text([element]): worth for element, worth in study.worths}
    first, second, third, last = (layout_text([element]) for element in LAYOUT)
    assert worths.keys() == {first, second, third, last}
    assert worths[first] == pytest.approx((without - whole) / unprotected)
    assert [worth for _, worth in study.worths] == sorted(worths.values(), reverse=True)
    # The charge is in the middle before the wall: both halves are worth alike, but for rounding.
    assert worths[first] == pytest.approx(worths[last], rel=0.05)
    assert worths[second] == pytest.approx(worths[third], rel=0.05)
    assert min(worths.values()) > 0.0


def test_places_are_those_of_the_scenario(study: Study) -> None:
    (place,) = study.outcomes
    coarse = study.effect(study.sizes[0], 0, "hut")
    assert place.load == pytest.approx(coarse.value)
    assert place.reduction == pytest.approx(coarse.reduction)


def test_impulses_stay_impulses_where_damage_counts() -> None:
    """The report gives them in Pa s: not the shortfall of a level that an objective counts."""
    scenario = glazed_yard(target="medium")
    bare, walled = (
        BlastLoads(tuple(StructureLoad.on(own, pa_s) for own in scenario.structures), np.zeros(0))
        for pa_s in (200.0, 150.0)
    )
    case = LoadCaseSet(scenario, (LoadCase(Charge((2.0, 6.0), 1.0), name="T1"),))
    layouts: dict[str, Layout] = {NO_BARRIER: (), "layout": (TAKEN,)}
    records = {NO_BARRIER: (BlastRecord(bare),), "layout": (BlastRecord(walled),)}
    blasts = Blasts(case, layouts, records, GasEngine())
    plan = StudyPlan(scenario, (TAKEN,), StudyOptions())
    (outcome,) = Study(plan, blasts, places=blasts).outcomes
    assert (outcome.unprotected_load, outcome.load) == (200.0, 150.0)
    assert outcome.reduction == pytest.approx(0.25)


def test_page_one_counts_the_notes_on_the_cells_that_decide(study: Study) -> None:
    of_both = page_text(Report(with_notes(study, {0.25: ("far",), 0.5: ("far",)})))
    assert "1 note on loads outside the validated range" in of_both
    assert "2 notes, under validity; 1 with the finer cells, which decide" in of_both
    of_one = page_text(Report(with_notes(study, {0.5: ("far",)})))
    assert "on loads outside the validated range of the engine" not in of_one


def test_pieces_of_a_catalogue_are_the_items() -> None:
    """Ranked one by one, each left out whole."""
    scenario, threats = yard(), other_places(yard(), 1)[:1]
    plan = StudyPlan(scenario, WALL, StudyOptions())
    items = plan.items(threats).campaign.run()
    worths = {layout_text([piece]): worth for piece, worth in Study(plan, items, items).worths}
    assert worths.keys() == {"5,1,wall,turned", "8,1,wall,turned", "4,1,post"}
    assert worths["5,1,wall,turned"] > worths["4,1,post"]


def test_page_needs_nothing_else(page: str) -> None:
    sources = re.findall(r'(?:src|href)="([^"]{0,40})', page)
    assert len(sources) >= 8
    assert all(source.startswith("data:image/png;base64,iVBOR") for source in sources)
    assert "<script" not in page
    assert "@import" not in page
    assert "url(" not in page


def test_page_has_the_numbers_and_all_it_takes_to_repeat_it(study: Study, page: str) -> None:
    fine = study.effect(study.blasts, 0, "hut")
    pm = "\N{PLUS-MINUS SIGN}"
    assert f"<td>{fine.unprotected:.0f} {pm} {fine.unprotected_error:.1f}</td>" in page
    assert f"<td>{100 * fine.reduction:.1f} % {pm} {100 * fine.reduction_error:.1f}</td>" in page
    assert small_hut().content_hash in page
    assert "blast-env report &#34;a site.toml&#34;</pre>" in page
    assert "&#34;cells&#34;: [[1, 0], [2, 0], [3, 0], [4, 0]]" in page
    assert "name = &#34;hut&#34;" in page
    for label, digest in study.digests:
        assert f'{label}</td><td class="l">{digest[:16]}' in page
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


def test_limits_are_passed_or_failed(report: Report, study: Study, page: str) -> None:
    (bare,), (behind,) = (side.limited for side in study.verdicts)
    assert behind.load.wall_impulse_pa_s < 300.0 < bare.load.wall_impulse_pa_s
    assert bare.load.flagged  # 6.8 cells per m/kg^(1/3)
    assert behind.load.flagged
    (row,) = table_of(report_document(report), "Limits of loads").cells()
    assert row[-2:] == ("does not comply", "complies (flagged)")
    assert "Limits are kept in 1 of 1 cases with the layout, 0 without." in page


def test_loads_within_what_was_checked(study: Study, page: str) -> None:
    """What is outside is said by name; here a copy of the study without notes."""
    assert any("checked from 9.2" in note for note in study.notes_of(study.blasts))
    assert "outside the validated range of the engine" in page
    silent = page_text(Report(with_notes(study, {})))
    load = study.blasts.records[NO_BARRIER][0].complete.buildings["hut"]
    assert f"<td>{load.peak_pa / 1e3:.0f}</td>" in silent
    assert "No load in this report is outside that range." in silent


def test_pdf_has_the_same_pages_of_text_and_pictures(report: Report, tmp_path: Path) -> None:
    html, pdf = write_report(report, tmp_path / "a.html", tmp_path / "a.pdf")
    assert html.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    document = pypdfium2.PdfDocument(pdf)
    text = "".join(sheet.get_textpage().get_text_range() for sheet in document)
    assert "Contribution of each item" in text
    first = document[0].get_textpage().get_text_range()
    assert report.study.verdicts[1].word in first  # also where the summary is long
    assert "Loads of the protected buildings" in first
    assert small_hut().content_hash[:20] in text
    assert f"{len(document)} / {len(document)}" in text
    pictures = sum(1 for sheet in document for item in sheet.get_objects() if item.type == 3)
    assert pictures >= 8
    # Nothing runs out of the page: the outermost pixels are white.
    for sheet in document:
        pixels = np.asarray(sheet.render(scale=0.5).to_numpy())
        assert (pixels[:, :12] > 250).all()
        assert (pixels[:, -12:] > 250).all()


@pytest.mark.parametrize(
    ("html", "pdf", "words"), [("a.txt", None, "must be .html"), ("a.html", "a.ps", "must be .pdf")]
)
def test_suffixes(report: Report, html: str, pdf: str | None, words: str, tmp_path: Path) -> None:
    with pytest.raises(BlastEnvError, match=words):
        write_report(report, tmp_path / html, None if pdf is None else tmp_path / pdf)


def test_layout_of_nothing_is_refused() -> None:
    with pytest.raises(BlastEnvError, match="the layout is empty"):
        run_report(small_hut(), ())


def test_command_passes_on_what_it_was_asked(
    report: Report, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[tuple[Scenario, Sequence[Any], StudyOptions]] = []

    def run(scenario: Scenario, layout: Layout, options: StudyOptions, _: object) -> Report:
        given.append((scenario, tuple(layout), options))
        return report

    monkeypatch.setattr(reports, "run_report", run)
    monkeypatch.setattr(reports, "write_report", lambda _, *paths: [*paths[:2]])
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
    ((scenario, layout, options),) = given
    assert (scenario, layout) == (small_hut(), LAYOUT)
    assert not options.items
    assert options.charges == (Charge((2.0, 3.0), 4.0),)
    assert options.limits == (Limit("hut", 9.0, 2000.0),)


@pytest.mark.parametrize(
    ("heights_m", "text", "charge"),
    [
        ((1.0, 1.0), "2,3,4", Charge((2.0, 3.0), 4.0, 1.0)),
        ((0.0, 1.5), "2,3,7", Charge((2.0, 3.0), 7.0, 1.5)),
        ((0.0, 1.5), "2,3,4", None),
    ],
)
def test_a_charge_of_the_command_is_as_high_as_those_of_the_site(
    heights_m: tuple[float, float],
    text: str,
    charge: Charge | None,
    report: Report,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As with `assess --charge`; it had gone to the ground."""
    document = small_hut().model_dump(mode="json", exclude_none=True)
    (own,) = document["charge"]
    pairs = zip((5.0, 7.0), heights_m, strict=True)
    document["charge"] = [own | {"tnt_kg": mass, "height_m": high} for mass, high in pairs]
    site, wall, out = (str(tmp_path / name) for name in ("s.toml", "w.json", "a.html"))
    save_scenario(Scenario.from_document(document, "raised"), site)
    write_layout(wall, small_hut(), LAYOUT, {})
    given: list[StudyOptions] = []

    def run(_: Scenario, __: Layout, options: StudyOptions, ___: object) -> Report:
        given.append(options)
        return report

    monkeypatch.setattr(reports, "run_report", run)
    monkeypatch.setattr(reports, "write_report", lambda _, *paths: [*paths[:1]])
    files = ("report", site, "--layout", wall, "--out", out, "--charge", text)
    done = CliRunner().invoke(app, [*files])
    if charge is None:
        assert done.exit_code == 2
        words = " ".join(done.stderr.replace("\n", " ").split())
        assert "--charge is 2,3,4, but the scenario has charges 0, 1.5 m high" in words
    else:
        assert [options.charges for options in given] == [(charge,)]


def test_no_glass_keeps_a_limit_that_is_exceeded(study: Study) -> None:
    """Its verdict had forgotten the limits, so that it said `complies`."""
    loads = [own.load.wall_impulse_pa_s for side in study.verdicts for own in side.limited]
    results = {}
    for name, most_pa_s in (("kept", 2.0 * max(loads)), ("exceeded", 0.5 * min(loads))):
        limits = (Limit("hut", impulse_pa_s=most_pa_s),)
        document = report_document(Report(asked(study, limits=limits)))
        rows = table_of(document, "Alternatives examined").rows
        results[name] = [str(row[1]).split(" with the layout")[0] for row in rows[1:]]
    assert any(result.startswith("complies") for result in results["kept"])
    assert {*results["exceeded"]} == {"does not comply"}


def test_the_verdict_comes_first_and_says_what_it_rests_on(study: Study, page: str) -> None:
    verdict = study.verdicts[1]
    behind = study.protected.summary("hut")
    assert (behind.panes, behind.panels) == (8, 4)
    assert verdict.passes == (study.protected.passes(study.target) and verdict.limited[0].is_kept)
    first = page[page.index("<h3>Verdict") : page.index("<h2>")]
    assert f">{verdict.word}: {verdict.words}." in first
    assert f"{behind.broken:.1f} of 8 panes break and {behind.failed} of 4 panels fail" in first
    assert '<td class="l">4 cost units, for 4 modules</td>' in first
    assert f"level {study.target.label!r}".replace("'", "&#39;") in first
    assert "driven by" in first
    assert "with it the level is kept at the same place" in first
    assert "falls by" in first
    glasses = [own for own in catalogue().values() if isinstance(own, Glazing)]
    assert all(f"all windows: {glass.title}" in page for glass in glasses)
    assert page.count("no price given in the site file") == len(glasses)
    assert "installed already" in page  # of the windows as they are
    bays = page[page.index("Bay by bay") :]
    assert all(f"hut/{wall}/1/1" in bays for wall in ("west", "east", "south", "north"))


def test_page_one_has_the_verdict_in_the_words_of_the_field(study: Study) -> None:
    harsh = (Limit("hut", impulse_pa_s=1.0),)
    (_, verdict) = asked(study, limits=harsh, target=LevelOfProtection.HIGH).verdicts
    assert verdict.word == "DOES NOT COMPLY"
    assert verdict.words == "level of protection below High; 1 load limit exceeded (threat T1)"


def test_details_and_currency_are_on_the_page_and_the_marking_on_every_page(study: Study) -> None:
    details = ReportDetails(project="North gate", client="City", marking='"</style> X')
    page = page_text(Report(on_site(study, build_zone__currency="EUR")), details=details)
    assert "<h1>North gate</h1>" in page
    assert "Client: <strong>City</strong>" in page
    assert "4 EUR, for 4 modules" in page
    assert page.count("</style>") == 1
    assert r'@top-center { content: "\22 \3c \2f style\3e  X"' in page


def test_details_come_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "details.toml"
    path.write_text('client = "City"\nrevision = "A"\n')
    assert ReportDetails.read(path) == ReportDetails(client="City", revision="A")
    path.write_text('clients = "City"\n')
    with pytest.raises(BlastEnvError, match="clients"):
        ReportDetails.read(path)
    with pytest.raises(BlastEnvError, match="marking has 201 characters"):
        ReportDetails(marking="x" * 201)


def test_page_one_says_how_many_fixed_charges_the_verdict_leaves_out() -> None:
    """As `assess` does: the worst by impulse were judged, and a verdict rests on damage."""
    document = glazed_hut().model_dump(mode="json", exclude_none=True)
    first = document["charge"][0]
    others = [first | {"position_m": [2.0, y_m]} for y_m in (2.0, 5.0)]
    site = Scenario.from_document(document | {"charge": [first, *others]}, "hut")
    said = {}
    for most in (2, 3):
        options = StudyOptions(cells=(0.5, 0.5), places=1, items=False, most_threats=most)
        document_of = report_document(Report(run_study(site, LAYOUT, options)))
        texts = [part.text() for part in document_of.sections[1].parts if isinstance(part, Line)]
        said[most] = [text for text in texts if "not among these" in text]
    assert said == {2: ["not among these: 1 of the 3 fixed charges of the site"], 3: []}


def test_a_barrier_that_adds_load_is_named(study: Study) -> None:
    protected = study.blasts.records[study.blasts.judged][0].complete.buildings["hut"]

    def change(name: str, _: float, record: BlastRecord) -> BlastRecord:
        share = 0.9 if name == NO_BARRIER else 1.0
        load = replace(protected, impulse_pa_s=share * protected.impulse_pa_s)
        return replace(record, details=replace(record.complete, buildings={"hut": load}))

    page = page_text(Report(changed(study, change)))
    assert "\N{MINUS SIGN}11.1 % \N{PLUS-MINUS SIGN} 0.0 (the barrier makes it worse)" in page


def test_a_stricter_target_fails_and_limits_count_as_well(study: Study) -> None:
    assert not asked(study, target=LevelOfProtection.HIGH).verdicts[1].passes
    harsh = (Limit("hut", impulse_pa_s=1.0),)
    assert not asked(study, limits=harsh).verdicts[1].passes


def test_without_facades_and_limits_there_is_no_verdict_but_loads(study: Study) -> None:
    none = np.zeros((0, 0))
    plain = changed(study, lambda *given: replace(given[2], bays=(), pressure_pa=none))
    page = page_text(Report(asked(plain, limits=())))
    assert ">NO VERDICT<" in page
    assert "no building has a facade" in page
    assert "Loads of the protected buildings" in page


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

    monkeypatch.setattr(StudyPlan, "items", stop)
    stopped = run_study(small_hut(), LAYOUT, StudyOptions(cells=cells))
    assert stopped.stopped == "without each item"
    assert [blasts.engine for blasts in stopped.sizes] == [
        *dict.fromkeys(map(GasEngine.with_cells, cells))
    ]
    page = page_text(Report(stopped))
    assert "This report was stopped before: without each item" in page
    assert f"three dimensions), {words}." in page
    assert f"take those with {words.split(' and ')[-1]} as a lower bound" in page
    effect = stopped.effect(stopped.blasts, 0, "hut")
    shown = Number.reduction(effect.reduction).text()
    error = f"{shown} \N{PLUS-MINUS SIGN} {100.0 * stopped.grid_error:.1f}"
    assert (error in page) == (cells[0] != cells[1])


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
    stopped = run_report(glazed_hut(), LAYOUT, StudyOptions())
    assert sizes == [0.5, 0.5, 0.25, 0.25]
    assert stopped.study.stopped == "cells of 0.25 m"
    assert [blasts.engine.smallest_m for blasts in stopped.study.sizes] == [0.5]
    assert not stopped.pictures
    page = page_text(stopped)
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
        plan = replace(study.plan, scenario=site, layout=(*LAYOUT, *taken))
        return glazing_cost(replace(study, plan=plan), glass)

    assert price() is None
    assert price(west) is None
    assert price(west, others) == 30.0
    assert price(west, others, every) == 30.0
    assert price(west, every) == 50.0
    assert price(west, others, taken=(Measure.named("w"),)) == 20.0


def test_measures_are_in_the_bill_without_sizes(study: Study) -> None:
    site = glazed_yard()
    plan = replace(study.plan, scenario=site, layout=(*WALL[:1], TAKEN))
    bill = {row[0]: row for row in _bill(plan)}
    assert bill["wall"][4:7] == ("1.5", "0.5", "2")
    assert bill["glass"][4:7] == ("", "", "")
    assert bill["total"][-1] == "11"


def _bill(plan: StudyPlan) -> list[tuple[str, ...]]:
    study = Study(
        plan, plan.threats([other_places(plan.scenario, 1)[0]], GasEngine())[0].campaign.run()
    )
    return table_of(report_document(Report(study)), "Bill of quantities").cells()


def test_a_document_is_the_same_after_a_file(report: Report) -> None:
    """Numbers, their errors and pictures are data, not text."""
    document = report_document(report)
    kept = Answer(question=Question.ASSESS, subject="", document=document)
    again = Answer.model_validate_json(kept.model_dump_json())
    assert repr(again.document) == repr(document)  # NaN differ


def test_every_picture_of_a_threat_is_shown_once(report: Report) -> None:
    (pictures,) = report.pictures.values()
    parts = [part for part in report_document(report).parts if isinstance(part, Picture)]
    assert len(parts) == len(pictures) + 2  # the plan, and the worth of the items
    assert len({part.caption for part in parts}) == len(parts)


def test_the_blasts_that_are_counted_before_are_those_that_are_run(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each part that is told of is one that was counted, and no blast runs twice."""
    seen: list[str] = []
    blasts: list[Any] = []
    run = GasBlast.run

    def counted_run(self: GasBlast, *arguments: Any) -> GasResult:
        blasts.append((self.threat, tuple(self.layout), self.engine.cell_m))
        return run(self, *arguments)

    monkeypatch.setattr(GasBlast, "run", counted_run)
    options = replace(study.options, cache=tmp_path)
    plan = StudyPlan(small_hut(), LAYOUT, options)
    plan.run(lambda label, _: seen.append(label))
    cost = plan.cost()
    assert {*seen} == {label for label, own in cost.parts.items() if own}
    assert len(blasts) == len({*blasts}) == sum(map(len, cost.parts.values())) == 4 + len(LAYOUT)
    counted = Counter(cost_of.cells for own in cost.parts.values() for cost_of in own)
    assert sorted(counted.values()) == [2, 2 + len(LAYOUT)]
    fewer = StudyPlan(small_hut(), LAYOUT, replace(options, items=False)).cost()
    assert sum(map(len, fewer.parts.values())) == 4

    threat = LoadCase(study.threats[0].charge, 0)
    coarse, final = options.engines
    kept = BlastEvaluator(small_hut(), coarse, cache=tmp_path)
    anew = BlastEvaluator(small_hut(), coarse)
    for layout in ((), LAYOUT):
        one, other = (
            [
                (load.impulse_pa_s, load.peak_pa)
                for load in evaluator.loads(layout, threat).structures
            ]
            for evaluator in (kept, anew)
        )
        assert one == other
    assert kept.counts.blasts == 0
    fine = BlastEvaluator(small_hut(), final, cache=tmp_path)
    fine.loads_of_many([((), threat), (LAYOUT, threat)])
    assert fine.counts.blasts == 0  # an evaluation after the report has them too
    monkeypatch.setattr(GasEngine, "record", None)
    found = blasts_behind(fine, LAYOUT, [threat.charge])  # and so has `assess`
    assert consequences_of(found).barriers
