"""The results of a sweep in its folder: a small file for each finished run, and one table of them all.

A row is written beside its place and then renamed, so a file is whole or not there, however the sweep ends; and a run
that is made twice has one file.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import orjson

from config.study import StudyConfig, Value
from runtime import VERSION
from runtime.batch.runs import Run
from runtime.batch.worker import Row
from runtime.support.whole_file import whole_file

ROWS: Final = "rows"
TABLE: Final = "runs.parquet"
FIGURES: Final = (
    "truth",
    "found",
    "recall",
    "f1",
    "false",
    "mean_error_m",
    "max_error_m",
    "inside_95",
    "objects",
    "mean_sigma_m",
    "stops",
    "predicted_nat",
    "virtual_s",
    "cycle_us_p50",
    "cycle_us_p99",
    "elapsed_s",
)
"""Columns of results. Empty where a run has no such figure."""
COUNTS: Final = frozenset({"truth", "found", "false", "objects", "stops"})


class RowFolder:
    """The files of finished runs in the folder of a sweep."""

    def __init__(self, folder: Path) -> None:
        self._rows = folder / ROWS

    def write(self, row: Row) -> None:
        """Write the row of a finished run.

        Raises
        ------
        OSError
            It cannot be written.
        """
        self._rows.mkdir(exist_ok=True)
        with whole_file(self._rows / f"{row['key']}.json") as part:
            part.write_bytes(orjson.dumps(row))

    def read(self, runs: Iterable[Run]) -> dict[str, Row]:
        """Return the rows of those runs that are finished, by key; a damaged file counts as none."""
        found: dict[str, Row] = {}
        for run in runs:
            with contextlib.suppress(OSError, ValueError):
                row = orjson.loads((self._rows / f"{run.key}.json").read_bytes())
                if isinstance(row, dict) and row.get("key") == run.key and "status" in row:
                    found[run.key] = row
        return found


def table(study: StudyConfig, runs: Iterable[Run], rows: Mapping[str, Row]) -> dict[str, list[Any]]:
    """Return the columns of all finished runs: what was run, each varied setting, the results; `rows` are by key."""
    done = [(run, rows[run.key]) for run in runs if run.key in rows]
    columns: dict[str, list[Any]] = {
        "key": [run.key for run, _ in done],
        "kind": [run.kind for run, _ in done],
        "subject": [run.subject for run, _ in done],
        "seed": [run.seed for run, _ in done],
    }
    for vary in study.vary:
        columns[vary.setting] = like_each_other([run.varied[vary.setting] for run, _ in done])
    for name in ("status", "reason", *FIGURES, "version"):
        columns[name] = [row.get(name) for _, row in done]
    return columns


def like_each_other(values: Sequence[Value]) -> list[Value]:
    """Return values of one type for a column: as they are, all as numbers, or all as texts in JSON."""
    if len({type(value) for value in values}) <= 1:
        return list(values)
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return [float(value) for value in values]
    return [value if isinstance(value, str) else json.dumps(value) for value in values]


def write_table(study: StudyConfig, columns: Mapping[str, list[Any]], folder: Path) -> Path:
    """Write the table as Parquet, with the study in its metadata, and return the file.

    Raises
    ------
    OSError
        It cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    text, whole, number = pa.string(), pa.int64(), pa.float64()
    texts = ("key", "kind", "subject", "status", "reason", "version")
    kinds = {name: whole if name in COUNTS else number for name in FIGURES}
    kinds |= {"seed": whole, **dict.fromkeys(texts, text)}
    fields = [
        pa.field(name, kinds[name]) if name in kinds else pa.field(name, pa.array(values).type)
        for name, values in columns.items()
    ]
    schema = pa.schema(fields, metadata={"echolocate": VERSION, "study": study.model_dump_json()})
    path = folder / TABLE
    with whole_file(path) as part:
        pq.write_table(pa.table(dict(columns), schema=schema), part, compression="zstd")
    return path
