"""Sound files of the formats that the packages read, and their readers."""

import json
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import torch
from blast_agents.training import load_hyperparameters
from blast_agents.training.evaluations import (
    EvaluationRow,
    read_episodes,
    read_evaluations,
    write_evaluations,
)
from blast_agents.training.hyperparameters import hyperparameter_keys, parse_options
from blast_agents.training.run_folder import RunConfiguration, RunFolder
from blast_agents.training.weights import read_parameters
from stable_baselines3.common.save_util import save_to_zip_file

from blast_env.answers import Document, Line, Table
from blast_env.app.design import Design, DesignStep, History
from blast_env.app.folder import DesignFolder
from blast_env.app.kept import read_kept, write_kept
from blast_env.app.work import Answer, Question
from blast_env.cluster import address_of
from blast_env.errors import BlastEnvWarning
from blast_env.evaluation import BlastKey, BlastLoads, BlastStore, StructureLoad
from blast_env.evaluation.engines import simulate
from blast_env.io.importing import ImportOptions, import_site
from blast_env.layout import LayoutFile, write_layout
from blast_env.parquet import _run_record, checked_table, write_table
from blast_env.particles import COLLISION_COLUMNS
from blast_env.particles.calibration import load_calibration, save_calibration
from blast_env.site import Charge, Scenario, load_scenario, save_scenario
from tests.agents.training_runs import SMALL, hyperparameters, settings, small_scenario
from tests.io.importing.maps import BLOCK, LAYERS
from tests.site.documents import full_document


@dataclass(frozen=True)
class Format:
    """A kind of file.

    Attributes:
        samples: Sound files.
        read: Reads one as the packages do: `BlastEnvError` or `None` for one that is refused.
        has_checksum: Whether whatever is read must be what a sample says.
    """

    samples: tuple[bytes, ...]
    read: Callable[[bytes], Any]
    has_checksum: bool = False


def _from_file(path: Path, read: Callable[[Path], Any]) -> Callable[[bytes], Any]:
    def from_content(content: bytes) -> Any:
        path.write_bytes(content)
        return read(path)

    return from_content


def _scenario(folder: Path) -> Format:
    samples = []
    for scenario in (
        small_scenario(),
        load_scenario("courtyard"),
        load_scenario("hotel_forecourt"),
        Scenario.from_document(full_document(), "full"),
    ):
        save_scenario(scenario, folder / "a.toml")
        samples.append((folder / "a.toml").read_bytes())
    return Format(tuple(samples), _from_file(folder / "a.toml", load_scenario))


def _layout(folder: Path) -> Format:
    path = folder / "a.json"
    write_layout(path, small_scenario(), [(0, 0), (1, 0), (1, 1)], {"method": "mine", "seed": 1})
    pieces = {"pieces": [{"item": "t_wall", "row": 3, "column": 4, "turned": True}] * 2}
    samples = (path.read_bytes(), b"[[0, 0], [0, 1]]", json.dumps(pieces, indent=1).encode())

    scenario = small_scenario()

    def read(path: Path) -> Any:
        file = LayoutFile.load(path)
        return (
            file if any(len(element) > 2 for element in file.layout) else file.layout_for(scenario)
        )

    return Format(samples, _from_file(path, read))


def _calibration(folder: Path) -> Format:
    samples = []
    for name in ("ballistic_ufc", "collisional_kb_20kg"):
        engine = "event"
        save_calibration(load_calibration(name, engine), folder / "a.json")
        samples.append((folder / "a.json").read_bytes())
    return Format(tuple(samples), _from_file(folder / "a.json", load_calibration), True)


def _run_configuration() -> RunConfiguration:
    return RunConfiguration(
        settings=settings(Path("a.toml")),
        hyperparameters=hyperparameters(),
        scenario_hash=small_scenario().content_hash,
    )


def _settings(name: str) -> Callable[[Path], Format]:
    """Return a file of the settings of a run."""

    def form(folder: Path) -> Format:
        run = RunFolder(folder / "run")
        run.make(_run_configuration(), small_scenario(), "command")
        path = run.path / "BlastBarrier-v0" / name
        return Format((path.read_bytes(),), _from_file(path, lambda _: run.configuration()))

    return form


def _episodes(folder: Path) -> Format:
    head = '#{"t_start": 1.0, "env_id": "None"}\nr,l,t,reduction\n'
    rows = "".join(f"0.25,{n},{1.5 * n},0.125\n" for n in range(1, 8))
    return Format(((head + rows).encode(),), _from_file(folder / "0.monitor.csv", read_episodes))


def _evaluations(folder: Path) -> Format:
    path = folder / "evaluations.npz"
    rows = [
        EvaluationRow(16 * n, (0.1, 0.2), (3, 4), 0.15, 0.1, 0.2, n, 10 * n, 1.5 * n)
        for n in range(1, 8)
    ]
    write_evaluations(path, rows)
    return Format((path.read_bytes(),), _from_file(path, read_evaluations), True)


def _weights(folder: Path) -> Format:
    path = folder / "best_model.zip"
    rng = np.random.default_rng(0)
    weights = {"a": torch.from_numpy(rng.random(40)), "b": torch.zeros(3)}
    save_to_zip_file(path, params={"policy": weights})

    def read(path: Path) -> Any:
        found = read_parameters(path)["policy"]
        return {name: tensor.numpy().tobytes() for name, tensor in found.items()}

    return Format((path.read_bytes(),), _from_file(path, read), True)


def _setting(_: Path) -> Format:
    samples = tuple(f"{key}={value}".encode() for key, value in SMALL.items())
    samples += (b"learning_rate=lin_3e-4", b"env_wrapper=[]", b"gamma=0.5", b"target_kl=null")
    known = hyperparameter_keys()

    def read(content: bytes) -> Any:
        changes = parse_options([content.decode("utf-8", "surrogateescape")], known)
        return load_hyperparameters("maskable_ppo", "BlastBarrier-v0", SMALL | changes)

    return Format(samples, read)


def _loads(folder: Path) -> Format:
    key = BlastKey("0" * 64, ((0, 0),), Charge((1.0, 2.0), 100.0), 1, "event 1", "1" * 64, "2" * 64)
    load = StructureLoad(
        *("building", True, 1.0, 0.01, None, 0.0, True),
        ("a note",),
        "building",
        impulse_sim=5.0,
    )
    BlastStore(folder).add(key, BlastLoads((load,), np.arange(8.0)))
    path = folder / "blasts.sqlite"

    def read(_: Path) -> Any:
        with warnings.catch_warnings(action="ignore", category=BlastEnvWarning):
            loads = BlastStore(folder).get(key)
        return None if loads is None else (loads.structures, loads.module_impulse_n_s.tobytes())

    return Format((path.read_bytes(),), _from_file(path, read), True)


def _map(suffix: str, **options: Any) -> Callable[[Path], Format]:
    """Return the invented block of a town as one kind of map."""

    def form(folder: Path) -> Format:
        def read(path: Path) -> Any:
            return import_site(path, ImportOptions(protect=("Town Hall",), **options)).scenario

        sample = BLOCK.with_suffix(suffix).read_bytes()
        return Format((sample,), _from_file(folder / f"map{suffix}", read))

    return form


def _parquet(folder: Path) -> Format:
    path = folder / "a.parquet"
    result = simulate(small_scenario(), engine="event")
    write_table(result.collisions, COLLISION_COLUMNS, result.run_record, path)

    def read(path: Path) -> Any:  # without the process of `read_parquet`, whose start takes long
        return _run_record(path, checked_table(path).schema.metadata or {})

    return Format((path.read_bytes(),), _from_file(path, read))


def _design(folder: Path) -> Format:
    design = DesignFolder(folder)
    history = History(DesignStep("begin", Design(small_scenario())))
    history = history.then("layout", history.design.with_layout(((0, 0), (1, 0))))
    design.save(history)
    path = folder / "design.json"

    def read(_: Path) -> Any:
        design.entry()
        return design.load()

    return Format((path.read_bytes(),), _from_file(path, read))


def _answer(folder: Path) -> Format:
    table = Table.of("largest", ("layout", "low"), [("A", "12")])
    answer = Answer(
        question=Question.CAPACITY, subject="a1", document=Document.of([Line.of("complies"), table])
    )
    path = folder / "answer.json"
    write_kept(answer, path)
    return Format((path.read_bytes(),), _from_file(path, lambda path: read_kept(Answer, path)))


def _scheduler(folder: Path) -> Format:
    record = {"type": "Scheduler", "id": "Scheduler-1", "address": "tcp://10.0.0.1:8786"}
    sample = json.dumps({**record, "services": {"dashboard": 8787}, "workers": {}}, indent=2)
    path = folder / "scheduler.json"
    return Format((sample.encode(),), _from_file(path, lambda path: address_of(str(path))))


FORMATS: Final[Mapping[str, Callable[[Path], Format]]] = MappingProxyType(
    {
        "scenario": _scenario,
        "layout": _layout,
        "calibration": _calibration,
        "run: config.yml": _settings("config.yml"),
        "run: args.yml": _settings("args.yml"),
        "run: monitor.csv": _episodes,
        "run: evaluations.npz": _evaluations,
        "run: best_model.zip": _weights,
        "--set": _setting,
        "store of blasts": _loads,
        "GeoJSON": _map(".geojson"),
        "OpenStreetMap": _map(".osm"),
        "DXF": _map(".dxf", units="mm", **LAYERS),
        "collisions (Parquet)": _parquet,
        "page: design": _design,
        "page: answer": _answer,
        "scheduler file": _scheduler,
    }
)
"""By names for a table; each is made in a folder of its own."""
