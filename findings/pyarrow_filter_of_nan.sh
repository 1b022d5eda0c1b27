#!/usr/bin/env bash
# A blast whose load is not a number is found by `~(load >= 0)`, which also finds loads below zero.
# One would guess that a filter chooses the same rows of a table and of the Parquet file that the
# table was written to, as it does as soon as one load is negative. Without one, the file gives no
# row at all: minimum and maximum of the column leave NaN out, and by them all loads pass.
# A file is then checked and found sound, and the rows that pass and those that do not are fewer
# than the rows. Whether it happens hangs on which other rows are in the same group.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq pyarrow==26.0.1
venv/bin/python - <<'PYTHON'
import sys

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

sound = pc.field("load") >= 0.0


def chosen(loads):
    table = pa.table({"blast": list(range(len(loads))), "load": loads})
    pq.write_table(table, "blasts.parquet")
    of_table = [table.filter(each)["blast"].to_pylist() for each in (sound, ~sound)]
    of_file = [
        pq.read_table("blasts.parquet", filters=each)["blast"].to_pylist()
        for each in (sound, ~sound)
    ]
    return of_table, of_file


NAN = float("nan")
of_table, of_file = chosen([120.0, 80.0, NAN, 95.0])
with_negative = chosen([120.0, 80.0, NAN, 95.0, -1.0])
print("pyarrow", pa.__version__)
print("expected: rows that pass and that do not, of four:", of_table)
print("seen of the file:", of_file, "- with a fifth that is negative:", with_negative[1])
as_found = of_table == [[0, 1, 3], [2]] and of_file == [[0, 1, 3], []]
as_found = as_found and with_negative == ([[0, 1, 3], [2, 4]],) * 2
sys.exit(0 if as_found else "changed")
PYTHON
