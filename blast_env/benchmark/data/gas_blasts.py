"""`load("gas_blasts")`: one row per structure and blast, with the load without a barrier."""

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from blast_env.errors import BlastEnvError, UnknownNameError, import_extra
from blast_env.tables import Column
from blast_env.values import path_of

if TYPE_CHECKING:
    import pandas as pd

TABLES: Final = (
    "gas_blasts",
    "many_site_blasts",
    "close_site_blasts",
    "front_site_blasts",
    "kerb_site_blasts",
    "street_site_blasts",
    "module_site_blasts",
    "liked_site_blasts",
    "further_site_blasts",
    "later_site_blasts",
    "strong_site_blasts",
    "screened_site_blasts",
)
"""Files of the set, named after the origin of their blasts."""

COLUMNS: Final = (
    Column("table", "", "file that the row is from: bundled or generated sites", True),
    Column("split", "", "train, validation or test; all rows of a site are in one", True),
    Column("scenario", "", "name of the site", True),
    Column("scenario_hash", "", "content hash of the scenario", True),
    Column(
        "layout", "", "JSON: [row, column] per module, [row, column, item, turned] per piece", True
    ),
    Column("charge_x_m", "m", "where the charge went off, from the left border"),
    Column("charge_y_m", "m", "from the lower border"),
    Column("charge_height_m", "m", "height of its centre; 0: it lay on the ground"),
    Column("tnt_kg", "kg", "its mass"),
    Column("structure", "", "name of the structure", True),
    Column(
        "protected", "", "whether its load counts; other loads are cut off where those are known"
    ),
    Column("impulse_pa_s", "Pa s", "mean impulse on the assessed walls"),
    Column("peak_pa", "Pa", "largest overpressure on them"),
    Column("unprotected_impulse_pa_s", "Pa s", "the same blast without a barrier; else missing"),
    Column("unprotected_peak_pa", "Pa", "the same for the overpressure"),
    Column(
        "point_impulses_pa_s", "Pa s", "JSON: at the points of `WallPoints`; [] if unknown", True
    ),
    Column("point_peaks_pa", "Pa", "JSON: the largest overpressures there; [] if unknown", True),
    Column("engine", "", "engine with its version and fields", True),
)
"""Columns of the set, with units."""

_TESTED: Final = 0.1
_VALIDATED: Final = 0.2
_BLAST: Final = ("scenario_hash", "charge_x_m", "charge_y_m", "charge_height_m", "tnt_kg")
_LOADS: Final = ("impulse_pa_s", "peak_pa")


def load(name: str = "gas_blasts", paths: Sequence[str | Path] = ()) -> "pd.DataFrame":
    """Return the gas blasts as one table, with one row per structure and blast; see `COLUMNS`.

    The hash of a site assigns it to a split: 80 % for training, 10 % each for validation and test.
    Test sites are never in the training split, also when data are added.

    Args:
        name: `gas_blasts`: all tables in `docs/data` of the repository.
        paths: Some of these files, or of `python -m studies.blast_table`, to read instead.

    Raises:
        UnknownNameError: If there is no such set.
        BlastEnvError: If a file cannot be read, or has other columns; as `sources`.
    """
    import pandas as pd

    from blast_env.parquet import checked_table, read_parquet

    if name != "gas_blasts":
        raise UnknownNameError("data set", name, ("gas_blasts",))
    tables = []
    for path in paths or sources():
        if paths:
            own, _ = read_parquet(path, COLUMNS[2:13])
        else:
            own = checked_table(path_of(path)).to_pandas(ignore_metadata=True)
        tables.append(own.assign(table=path_of(path).stem))
    rows = pd.concat(tables, ignore_index=True)
    keys = [*_BLAST, "structure"]
    # Each row beside the same blast without a barrier, if the table has it.
    unprotected = rows.loc[rows["layout"] == "[]", [*keys, *_LOADS]].drop_duplicates(keys)
    rows = rows.merge(
        unprotected.rename(columns={load: f"unprotected_{load}" for load in _LOADS}), "left", keys
    )
    splits = {value: split_of(value) for value in rows["scenario_hash"].unique()}
    rows["split"] = rows["scenario_hash"].map(splits)
    return rows[[column.name for column in COLUMNS]]


def split_of(scenario_hash: str) -> str:
    """Return the split of a site: `train`, `validation` or `test`."""
    share = int(sha256(scenario_hash.encode()).hexdigest()[:8], 16) / 2**32
    if share < _TESTED:
        return "test"
    return "validation" if share < _VALIDATED else "train"


def sources() -> tuple[Path, ...]:
    """Return the files of the set in the checkout; an installed package has none.

    Raises:
        BlastEnvError: If there is no checkout around the package.
    """
    folder = Path(__file__).resolve().parents[3] / "docs" / "data"
    if not folder.is_dir():
        raise BlastEnvError(
            "gas_blasts: its tables are in docs/data of the repository, not in the package; give "
            "their paths: load('gas_blasts', paths)"
        )
    return tuple(folder / f"{table}.parquet" for table in TABLES)


def as_tensors(rows: "pd.DataFrame") -> tuple[Any, Any]:
    """Return numeric inputs, and loads relative to those without a barrier, as torch tensors.

    Inputs are the charge and the bare load. Layouts have any length, so they stay in the table.

    Returns:
        Inputs (rows, 6): x, y, height of the charge in m, its mass in kg, impulse in Pa s and peak
        in Pa without a barrier; and outputs (rows, 2): remaining shares of impulse and peak.
        Rows without a bare load are left out.

    Raises:
        MissingExtraError: If torch is not installed.
    """
    with import_extra("agents", "tensors"):
        import torch

    known = rows.dropna(subset=["unprotected_impulse_pa_s", "unprotected_peak_pa"])
    inputs = known[[*_BLAST[1:], "unprotected_impulse_pa_s", "unprotected_peak_pa"]]
    unprotected = known[["unprotected_impulse_pa_s", "unprotected_peak_pa"]].to_numpy()
    shares = known[list(_LOADS)].to_numpy() / unprotected
    return torch.tensor(inputs.to_numpy()).float(), torch.tensor(shares).float()
