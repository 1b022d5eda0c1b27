"""Processor time of the response of facades: `python -m studies.response_speed`."""

import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.cli.output import print_line
from blast_env.evaluation import BlastEvaluator, Threat
from blast_env.response.components import Glazing, Wall, catalogue
from blast_env.response.glass import glazing_responses
from blast_env.response.sdof import responses
from blast_env.site import Scenario, load_scenario
from blast_env.site.scene import Charge
from blast_env.units import MS_PER_S

_REPEATS: Final = 5
_PANES: Final = ("window_annealed_4", "window_laminated_12", "window_double_laminated")
_FACADE: Final = {"bay_m": 1.5, "glazing": "window_annealed_6", "wall": "concrete_200"}


def site(**objective: Any) -> Scenario:
    """Return the control room, with a facade if an objective is given."""
    document = load_scenario("control_room").model_dump(mode="json")
    document["name"] = "glazed_room"
    if objective:
        document["objective"] = objective
        document["structures"][0]["facade"] = _FACADE
    return Scenario.from_document(document, "glazed_room")


def histories(count: int, steps: int = 400) -> tuple[FloatArray, FloatArray]:
    """Return times (steps,) in s and triangular histories of 1 to 60 kPa and 12 ms, one per bay."""
    time_s = np.linspace(0.0, 0.08, steps)
    falls = np.maximum(1.0 - time_s / 0.012, 0.0)
    return time_s, np.linspace(1e3, 6e4, count)[:, np.newaxis] * falls


def least_ms(work: Callable[[], object]) -> float:
    """Return the least processor time of repeated work, without the first run, which compiles."""
    seconds = []
    for _ in range(_REPEATS + 1):
        begin = time.process_time()
        work()
        seconds.append(time.process_time() - begin)
    return MS_PER_S * min(seconds[1:])


def panels_ms(count: int = 1000) -> float:
    """Return the processor time of a number of wall panels, each under a different history."""
    wall = catalogue()["concrete_150"]
    assert isinstance(wall, Wall)
    systems, loads = [wall.panel(3.5).system] * count, histories(count)
    return least_ms(lambda: responses(systems, *loads))


def panes_ms(name: str, count: int = 1000) -> float:
    """Return the processor time of a number of panes, each under a different history."""
    glazing = catalogue()[name]
    assert isinstance(glazing, Glazing)
    panes, loads = [glazing.pane] * count, histories(count)
    return least_ms(lambda: glazing_responses(panes, *loads))


def main() -> None:
    """Print the response's share of a blast's processor time, and the time of 1,000 panels."""
    sites = {"with": site(kind="response"), "without": site()}
    seconds: dict[str, list[float]] = {name: [] for name in sites}
    for _ in range(_REPEATS + 1):  # the first run compiles
        for name, each in sites.items():
            evaluator = BlastEvaluator(each, "gas")
            begin = time.process_time()
            evaluator.loads((), Threat(Charge((2.0, 8.5), 5.0), 0))
            seconds[name].append(time.process_time() - begin)
    least = {name: min(each[1:]) for name, each in seconds.items()}
    more = least["with"] / least["without"] - 1.0
    bays = len(sites["with"].bays)
    print_line(
        f"processor time of a blast, with the response of {bays} bays: {100.0 * more:+.1f} %"
    )
    print_line(f"1,000 wall panels under histories of 400 steps: {panels_ms():.0f} ms")
    for name in _PANES:
        print_line(f"1,000 panes of {name}: {panes_ms(name):.0f} ms")


if __name__ == "__main__":
    main()
