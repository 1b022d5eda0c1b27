"""The built wheel, installed where nothing of the checkout is."""

import subprocess
import sys
import sysconfig
from pathlib import Path

REPOSITORY = Path(__file__).parents[1]
CALIBRATIONS = (
    "ballistic_kb_100kg",
    "ballistic_ufc",
    "collisional_fine_kb",
    "collisional_kb",
    "collisional_kb_1000kg",
    "collisional_kb_20kg",
)


def call(*command: str | Path, cwd: Path) -> str:
    return subprocess.run(
        [str(part) for part in command], cwd=cwd, capture_output=True, text=True, check=True
    ).stdout


def test_a_wheel_in_a_clean_environment_loads_the_scenarios_by_name(tmp_path: Path) -> None:
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "-q")
    call(
        *pip, "wheel", REPOSITORY, "--no-deps", "--no-build-isolation", "-w", tmp_path, cwd=tmp_path
    )
    (wheel,) = tmp_path.glob("*.whl")
    call(sys.executable, "-m", "venv", "--without-pip", "clean", cwd=tmp_path)
    clean = tmp_path / "clean"
    (site,) = clean.glob("lib/python*/site-packages")
    call(*pip, "install", "--no-deps", "--target", site, wheel, cwd=tmp_path)
    # The dependencies only: an editable install of the checkout would be found through a .pth
    # file, and .pth files count only in a site folder, not in one that another .pth file names.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    code = (
        "import blast_env; print(blast_env.__file__);"
        "print([blast_env.load_scenario(n).name for n in blast_env.bundled_scenarios()]);"
        "from blast_env.calibration import *;"
        "print([load_calibration(n).name for n in stored_calibrations()], len(paper_table()),"
        " round(kingery_bulmash('reflected_impulse', 10.0, 100.0)))"
    )
    where, names, data = call(clean / "bin" / "python", "-c", code, cwd=tmp_path).splitlines()
    assert Path(where).is_relative_to(clean)
    assert names == "['courtyard', 'free_field', 'perimeter_gate', 'street_junction']"
    assert data == f"{list(CALIBRATIONS)} 8 1543"
