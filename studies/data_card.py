"""The metadata of the published blasts, in the vocabulary of Croissant 1.1 (MLCommons).

`python -m studies.data_card` writes docs/data/croissant.json after the tables have changed. It
needs `pip install blast-env[datasets]`, with mlcroissant, which checks what it writes.
"""

import json
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from blast_env.answers.terminal import print_line
from blast_env.benchmark.data import TABLES, load
from blast_env.cli.output import user_errors
from blast_env.errors import import_extra
from blast_env.files import write_text
from blast_env.surrogate.samples import UNKNOWN
from blast_env.tables import Column
from studies.blast_table import COLUMNS

FOLDER: Final = Path("docs/data")
CARD: Final = FOLDER / "croissant.json"
SPECIFICATION: Final = "http://mlcommons.org/croissant/1.1"

_ORIGINS: Final = {
    "gas_blasts": "bundled sites: rules, random layouts and searches",
    "many_site_blasts": "generated sites with catalogues, and large ones",
    "close_site_blasts": "generated sites 16 to 26 m wide",
    "front_site_blasts": "such sites on which only the walls count that the blast comes from",
    "kerb_site_blasts": "generated sites along a kerb, with walls opposite and vehicles",
    "street_site_blasts": "streets open at both ends, where a vehicle drives along the fronts",
    "module_site_blasts": "generated sites of single modules, and courts between buildings",
    "liked_site_blasts": "further sites, and layouts that a surrogate and an agent like",
    "further_site_blasts": "further kerbs, streets, courts and short fronts, and such layouts",
    "later_site_blasts": "further ones of these kinds, two thirds with loads at points of walls",
    "strong_site_blasts": "close, front, square, street and kerb sites; layouts that take off much",
    "screened_site_blasts": "low buildings, lanes, streets and squares; layouts that take off much",
}
_CHARGE: Final = ("charge_x_m", "charge_y_m", "charge_height_m", "tnt_kg")
_TRUTHS: Final = ("protected",)
_COUNTS: Final = ("seed",)


def card() -> dict[str, Any]:
    """Return the metadata of the tables as they are now, as JSON.

    Raises:
        BlastEnvError: If mlcroissant is not installed.
    """
    with import_extra("datasets", "metadata of data sets"):
        import mlcroissant as mlc

    files = [
        mlc.FileObject(
            id=f"{table}.parquet",
            name=f"{table}.parquet",
            description=_ORIGINS[table],
            content_url=f"{table}.parquet",
            encoding_formats=["application/x-parquet"],
            sha256=digest_of(FOLDER / f"{table}.parquet"),
        )
        for table in TABLES
    ]
    records = [
        mlc.RecordSet(
            id=table,
            name=table,
            description=f"One row per structure and blast: {_ORIGINS[table]}.",
            fields=[_field(mlc, table, column) for column in COLUMNS],
        )
        for table in TABLES
    ]
    metadata = mlc.Metadata(
        name="blast-env-gas-blasts",
        description=(
            "Loads of blasts behind barriers, by the gas dynamics of blast-env on cells of 0.5 m: "
            "impulse and peak on each structure of generated and bundled sites, with the layout "
            "and the charge. Simulated, not measured."
        ),
        license=["https://spdx.org/licenses/MIT"],
        version="0.1.0",
        date_published="2026-11-28",
        creators=[mlc.Organization(name="The blast-env authors")],
        keywords=["blast", "protective design", "gas dynamics", "surrogate"],
        cite_as=Path("docs/citation.bib").read_text(encoding="utf-8").strip(),
        conforms_to=SPECIFICATION,
        data_limitations=(
            "No barrier of finite height was compared with a measurement. Peaks on cells of 0.5 m "
            "are too low; docs/engineers/gas.md has the grid error."
        ),
        distribution=files,
        record_sets=records,
    )
    found: dict[str, Any] = metadata.to_json()
    return found


def _field(mlc: Any, table: str, column: Column) -> Any:
    kind = mlc.DataType.TEXT if column.is_text else mlc.DataType.FLOAT
    if column.name in _TRUTHS:
        kind = mlc.DataType.BOOL
    if column.name in _COUNTS:
        kind = mlc.DataType.INTEGER
    return mlc.Field(
        id=f"{table}/{column.name}",
        name=column.name,
        description=f"{column.meaning}{f' ({column.unit})' if column.unit else ''}",
        data_types=[kind],
        source=mlc.Source(file_object=f"{table}.parquet", extract=mlc.Extract(column=column.name)),
    )


def contents() -> str:
    """Return in words how much there is: rows, blasts, sites, splits and charges."""
    rows = load()
    key = ["scenario_hash", "layout", *_CHARGE]
    blasts, pointed = (
        own.groupby(key).ngroups for own in (rows, rows[rows["point_impulses_pa_s"] != UNKNOWN])
    )
    sites = rows.drop_duplicates("scenario_hash")["split"].value_counts()
    known = rows["unprotected_impulse_pa_s"].notna().mean()
    low_kg, high_kg = rows["tnt_kg"].quantile([0.1, 0.9])
    return (
        f"{len(rows):,} rows, {blasts:,} blasts, {sites.sum():,} sites ({sites['validation']} for "
        f"validation, {sites['test']} for test); {pointed:,} blasts have loads at "
        f"points; {100.0 * known:.0f} % of the rows have the load without a "
        f"barrier; in 80 % of them the charge has {low_kg:.0f} to {high_kg:.0f} kg"
    )


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal digits."""
    return sha256(path.read_bytes()).hexdigest()


def main(
    out: Annotated[Path, typer.Option(help="The metadata, .json.")] = CARD,
) -> None:
    """Write the metadata of the published blasts, and have mlcroissant read them."""
    with user_errors():
        write_text(out, json.dumps(card(), indent=1, ensure_ascii=False) + "\n")
        import mlcroissant as mlc

        issues = mlc.Dataset(jsonld=str(out)).metadata.ctx.issues
        print_line(contents())
        print_line(f"wrote {out}; {len(issues.errors)} errors, {len(issues.warnings)} warnings")


if __name__ == "__main__":
    typer.run(main)
