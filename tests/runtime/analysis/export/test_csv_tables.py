"""Tests of the tables: CSV with every digit, Parquet with types, units and missing values."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from perception.detected_object import DetectedObject
from runtime.analysis.export.csv_tables import tables, write_csv, write_parquet
from tests.runtime.analysis.synthetic_timeline import (
    START_NS,
    synthetic_timeline,
    with_cross_paths,
    with_polyline,
)

TABLES = {"echoes", "cross_paths", "segments", "objects", "walls", "polylines", "odometry"}
RUN = synthetic_timeline()


def test_csv(tmp_path: Path) -> None:
    read = {}
    for path in write_csv(RUN, tmp_path):
        with path.open(encoding="utf-8", newline="") as file:
            read[path.stem] = list(csv.DictReader(file))
    assert set(read) == TABLES
    assert len(read["echoes"]) == len(RUN.echoes)
    for row, kept in zip(read["echoes"], RUN.echoes, strict=True):
        assert float(row["bearing_rad"]) == kept["bearing"], "every digit"
        assert row["heard"] == str(math.isfinite(kept["range_m"]))
        assert row["range_m"] == (str(float(kept["range_m"])) if math.isfinite(kept["range_m"]) else "")
    last = [row for row in read["objects"] if float(row["t_s"]) == RUN.seconds]
    assert [(r["model"], float(r["x_m"]), float(r["y_m"])) for r in last] == [
        (o.model, o.x, o.y) for o in RUN.objects
    ]
    assert all(float(r["first_seen_s"]) <= float(r["last_seen_s"]) for r in read["segments"])
    assert [float(r["v_m_s"]) for r in read["odometry"]] == [0.3] * 4
    (wall,) = read["walls"]
    assert (wall["t_s"], wall["number"]) == (str(RUN.seconds), "7")
    assert [float(wall["x1_m"]), float(wall["x2_m"])] == pytest.approx([0.0, 3.0])


def test_parquet(tmp_path: Path) -> None:
    folder = tmp_path / "\udcff"  # not UTF-8, which pyarrow opens by no path
    folder.mkdir()
    read = {path.stem: pq.read_table(io.BytesIO(path.read_bytes())) for path in write_parquet(RUN, folder)}
    assert set(read) == TABLES
    echoes = read["echoes"]
    assert b"metres" in echoes.schema.metadata[b"echolocate"]
    assert echoes.schema.metadata[b"start_unix_ns"] == str(START_NS).encode()
    assert echoes["sensor"].to_pylist() == RUN.echoes["sensor"].tolist()
    assert echoes["range_m"].null_count == 3
    assert read["objects"]["x_m"].to_pylist()[-1] == RUN.objects[-1].x
    assert read["objects"]["probability"].null_count == 6
    assert read["segments"].num_rows == 3


def test_a_cross_path_has_both_sensors_and_half_its_length(tmp_path: Path) -> None:
    run = with_cross_paths(synthetic_timeline())
    found = tables(run)["cross_paths"]
    assert [found[name] for name in ("transmitter", "listener", "heard", "half_path_m")] == [
        [6, 6, 6], [7, 7, 7], [True, True, False], [1.0, 1.5, None]
    ]  # fmt: skip
    (path,) = (path for path in write_parquet(run, tmp_path) if path.stem == "cross_paths")
    read = pq.read_table(path)
    assert read["listener"].to_pylist() == [7, 7, 7]
    assert read["listener_y_m"].to_pylist() == run.cross_paths["listener_y"].tolist()
    assert tables(RUN)["cross_paths"]["t_s"] == [], "no sensor of that ring listens"


def test_an_echo_is_placed_along_its_bearing() -> None:
    echoes = tables(RUN)["echoes"]
    for x, y, sensor_y, reach in zip(
        echoes["echo_x_m"], echoes["echo_y_m"], echoes["sensor_y_m"], echoes["range_m"], strict=True
    ):
        assert (x is None) == (y is None) == (reach is None)
        if reach is not None:
            assert y == pytest.approx(sensor_y + reach), "sensor 6 looks along y"


def test_objects_include_corners_and_edges_of_walls() -> None:
    run = synthetic_timeline()
    corner = DetectedObject("inside corner", 3.0, 1.0, 0.0, 0.02, 9, 0.99)
    run.snapshots[-1] = replace(run.snapshots[-1], corners=(corner,))
    found = tables(run)["objects"]
    assert (found["model"][-1], found["x_m"][-1], found["t_s"][-1]) == ("inside corner", 3.0, run.snapshots[-1].t_s)
    assert len(found["model"]) == len(tables(synthetic_timeline())["objects"]["model"]) + 1


def test_a_polyline_is_a_row_for_each_of_its_points(tmp_path: Path) -> None:
    run = with_polyline(synthetic_timeline())
    found = tables(run)["polylines"]
    assert found == {
        "t_s": [3.0] * 3, "number": [3] * 3, "probability": [0.9] * 3, "point": [0, 1, 2], "x_m": [1.0, 2.0, 2.0],
        "y_m": [0.0, 0.0, 1.0],
    }  # fmt: skip
    (path,) = (path for path in write_parquet(run, tmp_path) if path.stem == "polylines")
    assert pq.read_table(path).to_pydict() == found
    assert pq.read_schema(path).field("point").type == pq.read_schema(path).field("number").type
    assert tables(RUN)["polylines"]["t_s"] == [], "a run without any has the table with no row"
