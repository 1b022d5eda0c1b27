"""The cost of the same work by two checkouts of the project, measured in turns.

`python -m studies.bench --against FOLDER` prints it. Each checkout has a process of its own that
runs this file, so `ROWS` use only what both have. To add a row, add a function that prepares the
work and returns what measures it.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from statistics import median
from time import process_time
from types import MappingProxyType
from typing import Any, Final

import numpy as np

Measure = Callable[[], tuple[float, int]]
"""Does a piece of work; returns its processor time, s, and the number of units in it."""


@dataclass(frozen=True)
class Row:
    """Work whose cost is compared.

    Attributes:
        title: The work.
        unit: What is counted in it.
        prepare: Does it once, so that everything is compiled, and returns what measures it.
    """

    title: str
    unit: str
    prepare: Callable[[], Measure]


# ---- Environments.

_ENVIRONMENTS: Final = 256
_STEPS: Final = 40
_SINGLE_STEPS: Final = 400


def _guesses() -> Any:
    """Return the engine of guesses: entry points are those of the installed checkout alone."""
    try:
        place = import_module("blast_env.surrogate.engine")
    except ModuleNotFoundError:  # the commit that ratios are told against has it there
        place = import_module("blast_env.design.surrogate.engine")
    return place.SurrogateEngine()


_SITES: Final = 16


def item_sites() -> Any:
    """Return a few generated sites: to generate a site takes longer than its episode."""
    from blast_env.sites.source import FAMILIES, SiteSource

    return SiteSource.training(_SITES, FAMILIES["item_sites"])


def batch(scenario: Any, observation: str = "features", warm_up: int = _STEPS) -> Measure:
    """Return a timer of steps of a batch on guesses, without the time to choose the actions."""
    import gymnasium as gym

    import blast_env  # noqa: F401  # registers the environments

    envs = gym.make_vec(
        "BlastBarrier-v0",
        num_envs=_ENVIRONMENTS,
        vectorization_mode="vector_entry_point",
        scenario=scenario,
        engine=_guesses(),
        observation=observation,
        action="place",
    )
    rng = np.random.default_rng(0)
    _, info = envs.reset(seed=0)
    over = np.zeros(_ENVIRONMENTS, dtype=bool)

    def measure(steps: int = _STEPS) -> tuple[float, int]:
        nonlocal info, over
        spent_s, count = 0.0, 0
        for _ in range(steps):
            masks = info["action_mask"]
            free = masks[:, :-1] * rng.random((len(masks), masks.shape[1] - 1), np.float32)
            actions = np.where(free.any(axis=1), free.argmax(axis=1), masks.shape[1] - 1)
            count += int(np.count_nonzero(~over))  # in the others an episode begins: no step
            began = process_time()
            _, _, ended, _, info = envs.step(actions)
            spent_s += process_time() - began
            over = ended
        return spent_s, count

    measure(warm_up)
    return measure


def single(scenario: str) -> Measure:
    """Return a timer of steps of one environment on guesses, without choosing the actions."""
    import gymnasium as gym

    import blast_env  # noqa: F401  # registers the environments

    env = gym.make(
        "BlastBarrier-v0",
        scenario=scenario,
        engine=_guesses(),
        observation="features",
        action="place",
    )
    rng, over, mask = np.random.default_rng(0), True, np.zeros(0)
    env.reset(seed=0)

    def measure() -> tuple[float, int]:
        nonlocal over, mask
        spent_s = 0.0
        for _ in range(_SINGLE_STEPS):
            if over:
                began = process_time()
                _, info = env.reset()
                spent_s += process_time() - began
                mask = info["action_mask"]
            free = np.flatnonzero(mask[:-1])
            action = rng.choice(free) if len(free) else len(mask) - 1
            began = process_time()
            _, _, over, _, info = env.step(action)
            spent_s += process_time() - began
            mask = info["action_mask"]
        return spent_s, _SINGLE_STEPS

    measure()
    return measure


# ---- Blasts.


def gas_blast(scenario: str, cells: str = "uniform") -> Measure:
    """Return a timer of a blast by gas dynamics without a barrier, from scenario to loads."""
    import blast_env

    def measure() -> tuple[float, int]:
        began = process_time()
        blast_env.simulate(scenario, engine="gas", cells=cells).loads()
        return process_time() - began, 1

    measure()
    return measure


_GAS_SITES: Final = (
    *("visitor_entrance", "control_room", "school_and_clinic", "hotel_forecourt"),
    *("shopping_street", "courtyard"),
)
_LARGE_SITE: Final = "street_front"

ROWS: Final[Mapping[str, Row]] = MappingProxyType(
    {
        "batch": Row("256 environments, control_room", "steps", lambda: batch("control_room")),
        "item-sites": Row(
            f"256 environments, {_SITES} item sites", "steps", lambda: batch(item_sites())
        ),
        "one": Row("one environment, control_room", "steps", lambda: single("control_room")),
        "one-courtyard": Row("one environment, courtyard", "steps", lambda: single("courtyard")),
        **{
            f"gas-{name}": Row(f"gas, {name}, 0.5 m", "blasts", partial(gas_blast, name))
            for name in _GAS_SITES
        },
        **{
            f"{cells}-{_LARGE_SITE}": Row(
                f"gas, {_LARGE_SITE}, {cells} cells",
                "blasts",
                partial(gas_blast, _LARGE_SITE, cells),
            )
            for cells in ("coarse", "fine")
        },
    }
)
"""The rows, by their names."""


# ---- Measuring in turns.


@dataclass(frozen=True)
class Ratio:
    """The costs of a row on both sides.

    Attributes:
        row: The row.
        old_s: Processor time of a unit by the older checkout, in the order of the turns.
        new_s: The same by this one.
    """

    row: Row
    old_s: tuple[float, ...]
    new_s: tuple[float, ...]

    @property
    def ratios(self) -> tuple[float, ...]:
        """The old cost over the new one in each turn."""
        return tuple(old / new for old, new in zip(self.old_s, self.new_s, strict=True))

    @property
    def ratio(self) -> float:
        """The old median over the new one: above 1 the new one is faster."""
        return median(self.old_s) / median(self.new_s)


class SideError(Exception):
    """A checkout could not measure a row."""


def compare(older: Path, newer: Path, names: Sequence[str], turns: int) -> Iterator[Ratio]:
    """Yield the costs of rows by two checkouts, each measured once per turn, in turns.

    Raises:
        SideError: If a checkout cannot measure a row; the message has its last line.
    """
    for name in names:
        with _side(older, name) as old, _side(newer, name) as new:
            pairs = [(old(), new()) for _ in range(turns)]
        olds, news = zip(*pairs, strict=True)
        yield Ratio(ROWS[name], olds, news)


@contextmanager
def _side(checkout: Path, name: str) -> Iterator[Callable[[], float]]:
    """Start the process of a checkout; give what measures the seconds of a unit in it."""
    paths = os.pathsep.join(map(str, (checkout, checkout / "agents")))
    process = subprocess.Popen(
        [sys.executable, str(Path(__file__).resolve()), name],
        env={**os.environ, "PYTHONPATH": paths, "PYTHONSAFEPATH": "1"},
        cwd=checkout,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    stdin, stdout = process.stdin, process.stdout

    def measured() -> float:
        try:
            stdin.write("go\n")
            stdin.flush()
            spent_s, count = json.loads(stdout.readline())
        except (OSError, ValueError):
            last = process.communicate()[1].strip().splitlines()[-1:]
            raise SideError(f"{checkout}: row {name!r}: {''.join(last) or 'no answer'}") from None
        return float(spent_s) / float(count)

    with process:
        try:
            yield measured
        finally:
            process.kill()  # also where the other side has failed and this one still prepares


def _answer(name: str) -> None:
    """Measure a row whenever a line arrives."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what the package prints is no answer
    measure: Any = ROWS[name].prepare()
    for _ in sys.stdin:
        print(json.dumps(measure()), file=answers, flush=True)


if __name__ == "__main__":
    _answer(sys.argv[1])
