"""The rows of a sweep: whole or not there, and a table with a column for each setting."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq

from config.study import StudyConfig, VaryConfig
from runtime.batch.rows import RowFolder, like_each_other, table, write_table
from runtime.batch.runs import Run
from runtime.batch.worker import Row

STUDY = StudyConfig(scenes=("clean",), vary=(VaryConfig(setting="a.b", values=(1, 2.5)),))
RUNS = [Run(f"k{k}", "scene", "clean", k, "{}", varied={"a.b": value}) for k, value in enumerate((1, 2.5, 1))]


def test_rows_are_found_again_and_a_damaged_one_is_none(tmp_path: Path) -> None:
    rows = RowFolder(tmp_path)
    assert rows.read(RUNS) == {}
    for key in ("k0", "k1", "k1", "another study's"):
        rows.write({"key": key, "status": "done", "recall": 0.5})
    (tmp_path / "rows" / "k2.json").write_text('{"key": "k2", "sta')
    assert set(RowFolder(tmp_path).read(RUNS)) == {"k0", "k1"}
    rows.write({"key": "k2", "status": "done"})
    assert set(rows.read(RUNS)) == {"k0", "k1", "k2"}


def test_the_table_has_a_row_a_run_and_a_column_a_setting(tmp_path: Path) -> None:
    rows: dict[str, Row] = {
        "k0": {"key": "k0", "status": "done", "reason": None, "recall": 0.5, "found": 3},
        "k2": {"key": "k2", "status": "failed", "reason": "it stopped"},
    }
    path = write_table(STUDY, table(STUDY, RUNS, rows), tmp_path)
    found = pq.read_table(path)
    assert found.schema.metadata[b"study"] == STUDY.model_dump_json().encode()
    shown = [(row["key"], row["seed"], row["a.b"], row["status"], row["recall"], row["found"], row["stops"])
             for row in found.to_pylist()]  # fmt: skip
    assert shown == [("k0", 0, 1, "done", 0.5, 3, None), ("k2", 2, 1, "failed", None, None, None)]
    assert pq.read_table(write_table(STUDY, table(STUDY, RUNS, {}), tmp_path)).num_rows == 0


def test_a_column_has_one_type() -> None:
    assert like_each_other([1, 2]) == [1, 2]
    assert [repr(value) for value in like_each_other([1, 2.5])] == ["1.0", "2.5"]
    assert like_each_other([True, 2, "x"]) == ["true", "2", "x"]
