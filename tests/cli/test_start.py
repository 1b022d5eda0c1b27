"""The command line starts at once, and everywhere: what it imports, and what it does not need."""

import subprocess
import sys
from pathlib import Path

from blast_env import save_scenario
from tests.report.sites import small_hut

SLOW = ("matplotlib", "numba", "pandas", "pyarrow", "pymunk", "scipy", "torch", "xlsxwriter")
"""What takes a tenth of a second or more to import."""

NOT_ON_WINDOWS = ("fcntl", "grp", "pwd", "resource", "syslog", "termios")


def python(code: str, *arguments: str | Path) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


IMPORTED = f"""
import sys, typer
from blast_env.cli import app
for name, command in typer.main.get_command(app).commands.items():
    assert "blast_env.cli." + name not in sys.modules, name
    command.loaded
    found = [module for module in {SLOW} if module in sys.modules]
    if found:
        print("imported:", name, *found)
app(["draw", "--check-only", "courtyard"], standalone_mode=False)
app(["train", "--scenario", "nosuch", "--run", "run"], standalone_mode=False)
print("imported:", *(name for name in {SLOW} if name in sys.modules))
"""


def test_options_of_all_commands_and_checks_need_nothing_slow() -> None:
    """Each command is imported when it is asked for, and what it works with, when it works."""
    assert python(IMPORTED).partition("imported:")[2].split() == []


ON_WINDOWS = f"""
import sys
for name in {NOT_ON_WINDOWS}:
    sys.modules[name] = None
from blast_env.cli import app
for engine in ("gas", "event"):
    app(["simulate", sys.argv[1], "--engine", engine], standalone_mode=False)
"""


def test_it_starts_and_runs_blasts_without_what_windows_lacks(tmp_path: Path) -> None:
    site = tmp_path / "site.toml"
    save_scenario(small_hut(), site)
    shown = python(ON_WINDOWS, site)
    assert "engine gas " in shown
    assert "engine event " in shown
