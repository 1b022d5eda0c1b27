"""The built wheel, installed where nothing of the checkout is."""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from zipfile import ZipFile

import pytest
from hatchling.builders.sdist import SdistBuilder
from hatchling.builders.wheel import WheelBuilder

from blast_env import save_scenario
from tests.scenarios import BALLISTIC_COURTYARD

REPOSITORY = Path(__file__).parents[1]
CALIBRATIONS = (
    "ballistic_kb_100kg",
    "ballistic_ufc",
    "collisional_fine_kb",
    "collisional_kb",
    "collisional_kb_1000kg",
    "collisional_kb_20kg",
)

COMMANDS = """
import json, sys
from typer.testing import CliRunner
from blast_env.cli import app
for arguments in json.loads(sys.argv[1]):
    result = CliRunner().invoke(app, arguments)
    print(json.dumps([result.exit_code, " ".join(result.stderr.split())]))
import blast_env.particles.event.engine, blast_env.gas.engine, agents
print(agents.Agent)
"""
"""Runs commands, and sees what the engines leave of another's package."""


def call(*command: str | Path, cwd: Path) -> str:
    """Run a command that finds nothing of the checkout through the environment.

    Nothing is compiled, which a new environment would do for ten seconds.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment["NUMBA_DISABLE_JIT"] = "1"
    done = subprocess.run(
        [str(part) for part in command], cwd=cwd, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with the wheel, the dependencies, and none of the extras that matter here."""
    folder = tmp_path_factory.mktemp("installed")
    (wheel,) = WheelBuilder(str(REPOSITORY)).build(directory=str(folder), versions=["standard"])
    call(sys.executable, "-m", "venv", "--without-pip", "clean", cwd=folder)
    (site,) = (folder / "clean").glob("lib/python*/site-packages")
    with ZipFile(wheel) as archive:  # all that an installer does, but for scripts
        archive.extractall(site)
    # The dependencies only: an editable install of the checkout would be found through a .pth
    # file, and .pth files count only in a site folder, not in one that another .pth file names.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    for name in ("pymoo", "matplotlib", "torch", "ezdxf"):  # found first, as if not installed
        (site / f"{name}.py").write_text(f"raise ModuleNotFoundError(name={name!r})\n")
    # A popular library is imported by this name.
    (site / "agents").mkdir()
    (site / "agents" / "__init__.py").write_text("class Agent:\n    pass\n")
    return folder / "clean"


def test_a_wheel_in_a_clean_environment_loads_the_scenarios_by_name(
    clean: Path, tmp_path: Path
) -> None:
    code = (
        "import blast_env; print(blast_env.__file__);"
        "print([blast_env.load_scenario(n).name for n in blast_env.bundled_scenarios()]);"
        "from blast_env.calibration import *;"
        "print([load_calibration(n).name for n in stored_calibrations()], len(paper_table()),"
        " round(kingery_bulmash('reflected_impulse', 10.0, 100.0)))"
    )
    where, names, data = call(clean / "bin" / "python", "-c", code, cwd=tmp_path).splitlines()
    assert Path(where).is_relative_to(clean)
    assert names == str(sorted(path.stem for path in (REPOSITORY / "scenarios").glob("*.toml")))
    assert data == f"{list(CALIBRATIONS)} 8 1543"


def test_a_wheel_says_where_the_published_blasts_are(clean: Path, tmp_path: Path) -> None:
    code = (
        "from blast_env.benchmark.data import load\n"
        "from blast_env.errors import BlastEnvError\n"
        "try: load()\n"
        "except BlastEnvError as error: print(error)\n"
        "print(len(load(paths=['table.parquet'])))"
    )
    shutil.copy(REPOSITORY / "docs" / "data" / "gas_blasts.parquet", tmp_path / "table.parquet")
    where, rows = call(clean / "bin" / "python", "-c", code, cwd=tmp_path).splitlines()
    assert "its tables are in docs/data of the repository, not in the package" in where
    assert int(rows) > 1000
    assert not [*clean.glob("lib/python*/site-packages/blast_env/**/*_blasts.parquet")]


def test_a_search_runs_beside_a_package_named_agents_and_without_extras(
    clean: Path, tmp_path: Path
) -> None:
    python = clean / "bin" / "python"
    # An engine that need not be compiled in every environment anew, and thin air.
    save_scenario(BALLISTIC_COURTYARD, tmp_path / "thin.toml")
    search = ["search", "--engine", "pymunk", "--scenario", "thin.toml", "--budget", "1"]
    search += ["--held-out", "1"]
    # One process for all: its imports take longer than they do.
    commands = [
        [*search, "--method", "random", "--out", "found"],
        [*search, "--method", "genetic"],
        ["train", "--run", "run"],
    ]
    lines = call(python, "-c", COMMANDS, json.dumps(commands), cwd=tmp_path).splitlines()
    drawn, genetic, training = map(json.loads, lines[:3])
    assert drawn[0] == 0, drawn[1]
    assert json.loads((tmp_path / "found" / "layout.json").read_text())["cells"]
    assert "pip install blast-env[render]" in drawn[1]  # no picture, and no blast lost for it
    assert genetic[0] == training[0] == 2
    assert "'pymoo': pip install blast-env[search]" in genetic[1]
    assert "'torch': pip install blast-env[agents,render]" in training[1]
    assert lines[3] == "<class 'agents.Agent'>"


def test_the_description_on_a_package_page_links_to_no_file(clean: Path) -> None:
    (metadata,) = clean.glob("lib/python*/site-packages/blast_env-*.dist-info/METADATA")
    description = metadata.read_text(encoding="utf-8").partition("\n\n")[2]
    links = re.findall(r"\]\(([^)]*)\)", description)
    assert links
    assert all(link.startswith("https://") for link in links)
    assert "docs/engineers/validity.md" in description  # named, though not linked


def test_the_source_archive_has_what_its_tests_read() -> None:
    """Whoever packages it for a distribution builds and tests from the archive alone."""
    included = SdistBuilder(str(REPOSITORY)).recurse_included_files()
    names = {str(recurse_included_file.distribution_path) for recurse_included_file in included}
    for folder in ("blast_env", "agents", "scenarios", "scripts", "studies", "tests", "docs"):
        here = {str(path.relative_to(REPOSITORY)) for path in (REPOSITORY / folder).rglob("*.*")}
        assert {name for name in here if "__pycache__" not in name} <= names
    assert {"Makefile", "README.md", "constraints.txt", "hatch_build.py"} <= names
