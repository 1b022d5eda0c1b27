"""Import all maps and drawings of a folder, and print the sums of their ledgers.

`python -m studies.real_files FOLDER` reads GeoJSON, OpenStreetMap and DXF.
"""

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from blast_env.cli.output import print_line, user_errors
from blast_env.errors import BlastEnvError, shortened
from blast_env.io.importing.ledger import Fate
from studies.real_files.survey import files_of, survey

_WORDS = 100


def main(folder: Annotated[Path, typer.Argument(help="Folder of maps and drawings.")]) -> None:
    """Import all maps and drawings of a folder, and print the sums of their ledgers."""
    with user_errors():
        files = files_of(folder)
        if not files:
            raise BlastEnvError(f"{folder}: has no map and no drawing")
    sums: Counter[tuple[Fate, str]] = Counter()
    refusals: Counter[str] = Counter()
    for path in files:
        found = survey(path)
        sums += found.sums
        if found.refusal:
            refusals[shortened(found.refusal, _WORDS)] += 1
        counts = {
            fate: sum(count for (other, _), count in found.sums.items() if other is fate)
            for fate in Fate
        }
        words = found.refusal or ", ".join(f"{fate} {count}" for fate, count in counts.items())
        print_line(f"{path.relative_to(folder)}: {shortened(words, 2 * _WORDS)}")
    print_line(f"imported {len(files) - refusals.total()} of {len(files)} files")
    for (fate, kind), count in sorted(sums.items(), key=lambda each: (each[0][0], -each[1])):
        print_line(f"{fate}: {kind}: {count}")
    for refusal, count in refusals.most_common():
        print_line(f"refused: {refusal}: {count}")


if __name__ == "__main__":
    typer.run(main)
