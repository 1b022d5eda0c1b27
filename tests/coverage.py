"""Run the tests and measure what they reach of the package: `python -m tests.coverage`.

Arguments are those of pytest, and `--least`, a share of branches in percent: to reach less is a
failure. What was reached is printed by room. Not measured are files of compiled functions, whose
bytecode must stay as it is, and what runs in processes of their own.
"""

import argparse
import json
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).parents[1]
PACKAGE: Final = "blast_env"

RARE: Final = 1_000
"""Calls that leave a reached line in SlipCover's hands. To free lines takes it a tenth of a second,
for it looks at all functions: with its own 50, a tenth of the time of the tests."""

_COMPILES: Final = re.compile(
    r"^from (numba|llvmlite)|^from blast_env\.compilation import .*\bcompiled\b", re.MULTILINE
)
_COUNTS: Final = ("covered_lines", "missing_lines", "covered_branches", "missing_branches")


def compiled_files(package: Path) -> list[str]:
    """Return the files of a package that compile functions, relative to the folder it is in."""
    return [
        path.relative_to(package.parent).as_posix()
        for path in sorted(package.rglob("*.py"))
        if _COMPILES.search(path.read_text(encoding="utf-8"))
    ]


def percent(covered: int, missing: int) -> float:
    """Return the share that was reached, %; all of nothing."""
    return 100.0 * covered / (covered + missing) if covered + missing else 100.0


def by_room(files: Mapping[str, Any]) -> dict[str, Counter[str]]:
    """Return the counts of lines and branches of each room, and of all of them as the last.

    Args:
        files: What was reached of each file, by its path from the folder of the package.
    """
    rooms: dict[str, Counter[str]] = {}
    whole = Counter[str]()
    for path, found in sorted(files.items()):
        room = path.split("/")[1].removesuffix(".py")
        counts = Counter({count: found["summary"][count] for count in _COUNTS})
        for sums in (rooms.setdefault(room, Counter()), whole):
            sums.update(counts)
    return {**rooms, PACKAGE: whole}


def table(rooms: Mapping[str, Counter[str]]) -> Iterable[str]:
    """Yield the lines of a table of what was reached of each room, %."""
    yield f"{'reached by tests, %':24}{'lines':>8}{'branches':>10}"
    for name, counts in rooms.items():
        lines, branches = (
            percent(counts[f"covered_{kind}"], counts[f"missing_{kind}"])
            for kind in ("lines", "branches")
        )
        yield f"{name:24}{lines:8.1f}{branches:10.1f}"


def main(arguments: Sequence[str]) -> int:
    """Run pytest, print what it reached, and return its exit code, or 1 if that is too little."""
    parser = argparse.ArgumentParser(allow_abbrev=False)
    parser.add_argument("--least", type=float, default=0.0)
    options, for_pytest = parser.parse_known_args(arguments)
    out = ROOT / "out" / "coverage.json"
    out.parent.mkdir(exist_ok=True)
    out.unlink(missing_ok=True)
    omit = ",".join(compiled_files(ROOT / PACKAGE))
    measured = ["slipcover", "--branch", "--omit", omit, "--json", "--out", str(out)]
    measured += ["--threshold", str(RARE)]
    environment = dict(os.environ)
    if "--numprocesses" in for_pytest:
        # Workers look for files that no test imports. The process that waits for them need not do
        # so again, for seconds in which the other cores have nothing to do.
        environment["SLIPCOVER_SOURCE"] = PACKAGE
    else:
        measured += ["--source", PACKAGE]
    python = [sys.executable, "-W", "ignore:Unable to activate pytest branch coverage"]
    command = [*python, "-m", *measured, "-m", "pytest", *for_pytest]
    code = subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode
    files = json.loads(out.read_text(encoding="utf-8"))["files"]
    rooms = by_room({path: files[path] for path in files if path.startswith(f"{PACKAGE}/")})
    print(*table(rooms), sep="\n")
    reached = percent(rooms[PACKAGE]["covered_branches"], rooms[PACKAGE]["missing_branches"])
    if reached < options.least:
        print(f"branches reached: {reached:.1f} %, must be at least {options.least:g} %")
    return code or int(reached < options.least)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
