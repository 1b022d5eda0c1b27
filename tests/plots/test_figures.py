from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from blast_env.errors import UnknownNameError
from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.particles.tables import faces_hit
from blast_env.plots.figures import (
    heat_map,
    impulse_over_time,
    save_figure,
)
from blast_env.plots.style import short_number
from blast_env.site import Scenario


def modules_of(figure: Figure, panel: int) -> PolyCollection:
    (modules,) = (
        artist for artist in figure.axes[panel].collections if isinstance(artist, PolyCollection)
    )
    return modules


def texts_of(figure: Figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_the_heat_map_shows_every_modules_impulse(barrier_result: BlastResult) -> None:
    figure = heat_map(barrier_result)
    impulse = modules_of(figure, 1).get_array()
    shelter = barrier_result.obstacle("shelter")
    assert isinstance(impulse, np.ma.MaskedArray)
    assert impulse.filled(0.0).tolist() == [part.impulse for part in shelter.parts]
    assert impulse.mask.tolist() == [part.hits == 0 for part in shelter.parts]
    written = [text.get_text() for text in figure.axes[1].texts]
    assert written == [short_number(part.impulse) for part in shelter.parts if part.hits]


def test_the_heat_map_has_units_and_a_legend(barrier_result: BlastResult) -> None:
    figure = heat_map(barrier_result)
    for axes in figure.axes[:2]:
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (m)", "y (m)")
    assert figure.axes[-1].get_ylabel() == "impulse per module (simulation units); white: not hit"
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == [
        "barrier module",
        "charge",
        "protected structure",
        "other structure",
        "build zone",
        "no-build area",
        "site border",
    ]
    assert {"shelter", "wall"} <= set(texts_of(figure))


def test_a_structure_can_be_chosen_for_the_heat_map(result: BlastResult) -> None:
    figure = heat_map(result, "wall")
    assert figure.axes[1].get_title().startswith("wall\n")
    impulse = modules_of(figure, 1).get_array()
    assert impulse is not None
    assert impulse.sum() == pytest.approx(result.impulse_sim("wall"))
    with pytest.raises(UnknownNameError, match="did you mean 'wall'"):
        heat_map(result, "walls")


def test_impulse_over_time_ends_at_the_sums_of_the_facades(result: BlastResult) -> None:
    figure = impulse_over_time(result)
    for axes, name in zip(figure.axes, ("shelter", "wall"), strict=True):
        assert axes.get_xlabel() == "time (ms)"
        assert axes.get_ylabel() == "cumulative impulse (simulation units)"
        assert axes.get_title().startswith(name)
        ends = [float(np.asarray(line.get_ydata())[-1]) for line in axes.lines]
        assert sum(ends) == pytest.approx(result.impulse_sim(name))
    assert any("ms" in text.get_text() for text in figure.texts)


def test_facades_are_told_by_the_normal(result: BlastResult) -> None:
    table = result.collisions
    facade = faces_hit(table)
    modules = result.modules.set_index("module_id")
    on_wall = table[(table["structure"] == "wall") & (facade == "bottom")]
    assert len(on_wall) > 10
    assert (modules.loc[on_wall["module_id"], "row"] == 0).all()


def test_a_blast_without_hits_can_be_drawn(result: BlastResult) -> None:
    empty = replace(
        result, collision_array=result.collision_array[:0], obstacles=result.blast.scene.obstacles()
    )
    assert "no hits" in texts_of(impulse_over_time(empty))
    heat_map(empty).draw_without_rendering()


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_a_figure_is_saved_as_the_suffix_says(
    result: BlastResult, tmp_path: Path, suffix: str
) -> None:
    path = save_figure(heat_map(result), tmp_path / f"map{suffix}")
    starts = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}
    assert path.read_bytes().startswith(starts[suffix])
    assert list(tmp_path.iterdir()) == [path]


def test_the_parts_of_a_building_are_one_on_the_heat_map(blast: Blast) -> None:
    document = blast.scenario.model_dump(mode="json", exclude_none=True)
    for each in document["structures"]:
        each["building"] = "town"
    joined = replace(blast, scenario=Scenario.from_document(document, "joined")).run()
    figure = heat_map(joined)
    title, *_ = (axes.get_title() for axes in figure.axes[1:])
    count = sum(each.hits for each in joined.obstacles if each.cells is None)
    assert title.startswith("town (protected)\n")
    assert f"{count} hits" in title
    assert len(figure.axes) == 3  # the site, the building, the bar
    assert heat_map(joined, "wall").axes[1].get_title().startswith("wall\n")
    with pytest.raises(UnknownNameError, match="did you mean 'wall'"):
        heat_map(joined, "walls")
