"""One blast has one answer, to the printed digit, whichever door asks for it.

The doors are `evaluate` (text and JSON), `assess`, the report, the page, and Python. All of them
read one store, so that each blast is run once. A few sites have both sizes of cells, and so grid
errors; the others have coarse cells alone. Some have two threats, one of which governs.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from typing import Final

import pytest
from typer.testing import CliRunner

from blast_env.answers import Document, Line, Number, Table, assess, compare
from blast_env.answers.report import Report, StudyOptions, basis, report_document, summary
from blast_env.app.folder import WorkFolder
from blast_env.app.session import Session, Sessions
from blast_env.app.threats import threats_of
from blast_env.app.work import Question
from blast_env.cli import app
from blast_env.design.search import layouts_by_rule
from blast_env.evaluation import BlastStore, Evaluation, LoadCase, evaluate_layout
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.questions.grid_error import impulse_of
from blast_env.evaluation.questions.probability import level_probability
from blast_env.evaluation.questions.verdict import Consequences, consequences_of, other_glazing
from blast_env.evaluation.study import Study, run_study
from blast_env.gas import Cells
from blast_env.geometry import Layout
from blast_env.layout import write_layout
from blast_env.response import Glazing, LevelOfProtection
from blast_env.site import Charge, PointSource, Scenario, load_scenario, save_scenario
from tests.app.here import Here
from tests.blasts import soon_growing_cells
from tests.figures import undrawn_figures

LARGE: Final = ("campus", "car_park", "government_forecourt", "street_front")
COARSE: Final = (
    *("guard_post", "hotel_forecourt", "ministry_kerb", "school_and_clinic", "shopping_street"),
)
WITH_ERRORS: Final = ("clinic_front", "control_room", "school_wing", "visitor_entrance")
TWO_THREATS: Final = ("control_room", "guard_post", "hotel_forecourt")
"""Sites where one of two threats governs: blasts cost most here, so the others have one."""
GLASS, WALL = "window_laminated_6", "concrete_200"


@pytest.fixture(scope="module", autouse=True)
def _quick() -> Iterator[None]:
    """Leave figures empty, draw few of the uncertain quantities, and let cells grow soon.

    One road serves all cells, as it does all draws, bays and glass.
    """
    few = partial(level_probability, draws=5, deciding=1)
    with undrawn_figures(), soon_growing_cells(), pytest.MonkeyPatch.context() as patch:
        for module in (assess, compare, summary):
            patch.setattr(module, "level_probability", lambda judged, known, *_: few(judged, known))
        for module in (assess, basis):
            patch.setattr(module, "other_glazing", _first_other_glazing)
        yield


def _first_other_glazing(scenario: Scenario) -> dict[str, Glazing]:
    return dict(islice(other_glazing(scenario).items(), 1))


def test_these_are_all_sites_with_heights() -> None:
    known = {*LARGE, *COARSE, *WITH_ERRORS}
    for path in (Path(__file__).parents[1] / "scenarios").glob("*.toml"):
        heights = [structure.height_m for structure in load_scenario(path.stem).structures]
        assert (path.stem in known) == (None not in heights)


@dataclass(frozen=True)
class Inquiry:
    """A site with fixed charges, a layout of it, and the folder of all doors.

    Attributes:
        scenario: The site, with a facade on each protected structure.
        layout: The layout.
        cells: The coarser and the finer cells.
        folder: The folder.
    """

    scenario: Scenario
    layout: Layout
    cells: tuple[Cells, Cells]
    folder: Path

    @classmethod
    def on(cls, name: str, folder: Path) -> "Inquiry":
        """Return a bundled site with one of its charges, or two, and the layout of a rule."""
        site = load_scenario(name)
        if any(structure.protected and structure.facade is None for structure in site.structures):
            site = site.with_facades(GLASS, WALL)
        charges = [threat.charge_against(site) for threat in threats_of(site)]
        charges = list(dict.fromkeys(charges))[: 1 + (name in TWO_THREATS)]
        if name in TWO_THREATS and len(charges) < 2:
            charges.append(charges[0]._replace(tnt_kg=0.5 * charges[0].tnt_kg))
        sources = [
            PointSource(kind="point", position_m=position_m, tnt_kg=tnt_kg, height_m=height_m)
            for position_m, tnt_kg, height_m in charges
        ]
        document = site.model_dump(mode="json", exclude_none=True)
        document["charge"] = [
            source.model_dump(mode="json", exclude_none=True) for source in sources
        ]
        document["objective"] = {}
        found = Scenario.from_document(document, name)
        layout = max(layouts_by_rule(found, charges[0]).values(), key=len)
        cells: tuple[Cells, Cells] = "coarse", "fine" if name in WITH_ERRORS else "coarse"
        save_scenario(found, folder / "site.toml")
        write_layout(folder / "layout.json", found, layout, {})
        return cls(load_scenario(folder / "site.toml"), layout, cells, folder)

    @cached_property
    def work(self) -> WorkFolder:
        return WorkFolder(self.folder / "work")

    @property
    def charges(self) -> list[Charge]:
        return [threat.charge_against(self.scenario) for threat in threats_of(self.scenario)]

    def command(self, name: str, *options: str) -> str:
        """Return the output of a command on the site with the layout and the finer cells."""
        site, layout = (str(self.folder / file) for file in ("site.toml", "layout.json"))
        first = (name, site) if name == "assess" else (name, "--scenario", site)
        shared = ("--cache", str(self.work.cache), "--cells", str(self.cells[1]))
        done = CliRunner().invoke(
            app, [*first, "--layout", layout, *shared, *options], env={"COLUMNS": "400"}
        )
        assert done.exit_code == 0, done.output
        return done.stdout


def rows_of(document: Document, title: str) -> list[tuple[str, ...]]:
    """Return the rows of the first table with a title."""
    tables = (part for part in document.parts if isinstance(part, Table))
    return next(table.cells() for table in tables if title in table.title)


def row_of(text: str, *words: str) -> str:
    """Return the line of a text that has all words, with single spaces."""
    return next(
        " ".join(line.split()) for line in text.splitlines() if all(word in line for word in words)
    )


@pytest.mark.parametrize("name", [*COARSE, *WITH_ERRORS, *LARGE])
def test_all_doors_say_the_same(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = Inquiry.on(name, tmp_path)
    options = StudyOptions(
        charges=tuple(asked.charges),
        cells=asked.cells,
        items=False,
        places=1,
        cache=asked.work.cache,
    )
    study = run_study(asked.scenario, asked.layout, options)
    monkeypatch.setattr(GasEngine, "record", None)  # all others find the blasts in the store
    engine = GasEngine.with_cells(asked.cells[1])
    coarser = engine.coarser if name in WITH_ERRORS else None
    store = BlastStore(asked.work.cache)

    # The governing threat: by Python, with the load and the level that are looked for elsewhere.
    threats = [LoadCase(charge, name=f"T{k}") for k, charge in enumerate(asked.charges, start=1)]
    layouts: dict[str, Layout] = {"no barrier": (), "layout": asked.layout}
    campaign = Campaign.on(asked.scenario, layouts, threats, engine, coarser, store)
    blasts = campaign.run(worst=lambda found: consequences_of(found).worst_number)
    consequences = consequences_of(blasts)
    worst = consequences.worst_number
    charge = threats[worst].charge
    assert isinstance(charge, Charge)
    (x_m, y_m), kg = charge.position_m, charge.tnt_kg
    given = f"{x_m!r},{y_m!r},{kg!r}"
    found = evaluate_layout(
        asked.scenario,
        asked.layout,
        engine=engine,
        threats=[LoadCase(charge)],
        cache=store,
    )
    buildings = {
        str(row["structure"]): (
            Number(
                row["unprotected_impulse_pa_s"], error=row["unprotected_impulse_error_pa_s"]
            ).text(),
            Number(row["impulse_pa_s"], error=row["impulse_error_pa_s"]).text(),
            Number.share(row["reduction"], row["reduction_error"]).text(),
        )
        for row in found.building_table.to_dict("records")
        if row["protected"]
    }
    levels = {own: consequences.level_words(own) for own in consequences.buildings}
    unprotected, protected = found.unprotected_impulse_pa_s.value, found.impulse_pa_s.value

    _says_evaluate(asked, given, buildings, found)
    likely = _says_assess(asked, charge, levels, found)
    document = _says_report(study, worst, buildings, levels)
    facts = next(part for part in document.parts if isinstance(part, Table))
    assert any(cells[1].startswith(f"level {likely};") for cells in facts.cells())
    _says_page(asked, worst, buildings, consequences, levels)
    assert unprotected >= protected or found.mean_reduction < 0.0


def _says_evaluate(
    asked: Inquiry, given: str, buildings: Mapping[str, tuple[str, ...]], found: Evaluation
) -> None:
    """Text and JSON."""
    text = asked.command("evaluate", "--charge", given, "--seeds", "1")
    content = json.loads(asked.command("evaluate", "--charge", given, "--seeds", "1", "--json"))
    assert content["cache"]["blasts"] == 0
    for name, numbers in buildings.items():
        row = row_of(text, name, " yes ")
        assert all(number in row for number in numbers)
        data = next(own for own in content["buildings"] if own["structure"] == name)
        nan = float("nan")
        assert (
            numbers[1]
            == Number(
                data["impulse_pa_s"],
                error=nan if (error := data["impulse_error_pa_s"]) is None else error,
            ).text()
        )
    assert content["result"]["reduction"]["value"] == found.mean_reduction
    worst = content["result"]["worst"]
    assert (worst["charge_x_m"], worst["charge_y_m"]) == found.worst.charge.position_m
    # With one threat that is the text above.
    count = len(asked.charges)
    whole = text if count == 1 else asked.command("evaluate", "--seeds", str(count))
    x_m, y_m = found.worst.charge.position_m
    assert f"worst threat: {found.worst.charge.tnt_kg:g} kg TNT at ({x_m:.2f}, {y_m:.2f})" in whole


def _says_assess(
    asked: Inquiry, charge: Charge, levels: Mapping[str, str], found: Evaluation
) -> str:
    """The level and the grid errors; return the probability of the level in words."""
    text = asked.command("assess", "--charges", "16")
    likely = row_of(text, "probability, ", "barrier ").partition(": ")[2]
    for building, level in levels.items():
        rows = [line for line in text.splitlines() if building in line and "barrier " in line]
        assert any(level in row for row in rows), text
    if found.grid_error is None:
        return likely
    share = found.grid_error
    sides = (
        Number(value.value, "Pa s", off * value.value).text()
        for value, off in (
            (found.unprotected_impulse_pa_s, share.of_unprotected(impulse_of)),
            (found.impulse_pa_s, share.of_load(impulse_of)),
        )
    )
    gone = Number.reduction(found.mean_reduction, share.of_reduction(impulse_of)).text()
    unprotected, protected = sides
    line = row_of(text, "impulse on the protected structures under the worst charge")
    assert line.endswith(f"{unprotected} without barrier, {protected} with, reduction {gone}")
    assert charge == share.threat.charge_against(asked.scenario)
    return likely


def _says_report(
    study: Study, worst: int, buildings: Mapping[str, tuple[str, ...]], levels: Mapping[str, str]
) -> Document:
    assert study.protected.worst_number == worst
    document = report_document(Report(study))
    for title, level in levels.items():
        name = study.scenario.title_of(title)
        rows = [row for row in rows_of(document, "worst of all charges") if name in row[1]]
        assert rows[-1][2] == level
    heads = [part for part in document.parts if isinstance(part, Line) and part.kind == "head"]
    tables = [
        part.cells()
        for part in document.parts
        if isinstance(part, Table) and part.title == "Protected buildings"
    ]
    assert [head.text()[:2] for head in heads if head.text()[0] == "T"] == [
        threat.name for threat in study.threats
    ]
    for building, (unprotected, protected, gone) in buildings.items():
        name = study.scenario.title_of(building)
        at = max(k for k, row in enumerate(tables[worst]) if row[0] == name)  # the finer cells
        assert tables[worst][at][4] == unprotected
        assert tables[worst][at + 1][4] == protected
        assert tables[worst][at + 1][9].startswith(gone)
    return document


def _says_page(
    asked: Inquiry,
    worst: int,
    buildings: Mapping[str, tuple[str, ...]],
    consequences: Consequences,
    levels: Mapping[str, str],
) -> None:
    session = Sessions(asked.work, Here()).new(asked.scenario, "begin")
    session.cells = asked.cells[1]
    session.put("layout", session.design.with_layout(asked.layout))
    session.threats = tuple(threat.name for threat in threats_of(asked.scenario))
    threats = session.chosen_threats()
    assert [threat.charge for threat in threats] == asked.charges
    table = session.comparison()
    one_structure = {
        building: numbers
        for building, numbers in buildings.items()
        if building in {structure.name for structure in asked.scenario.structures}
    }
    for building, (_, protected, gone) in one_structure.items():
        name = asked.scenario.title_of(building)
        row = next(own for own in table.cells() if own[:3] == ("A", threats[worst].name, name))
        assert row[3] == protected
        assert row[5].startswith(gone.removesuffix(" (the barrier makes it worse)"))
    for layout, threat, verdicts in session.verdicts():
        if (layout, threat) == ("A", threats[worst].name):
            for own in verdicts:
                level = consequences.under(worst).level_words(own.building)
                assert own.cells[0] == level
    answer = _answer_of(session)
    rows = rows_of(answer, "the worst of all charges")
    for building, level in levels.items():
        assert any(row[0] == "layout A" and building in row[1] and row[2] == level for row in rows)


def _answer_of(session: Session) -> Document:
    session.ask(Question.ASSESS, LevelOfProtection.LOW, 0.1, 10)
    ((answer, is_present),) = session.answers()
    assert is_present
    return answer.document
