"""A run as tables: echoes, cross paths, segments, objects, walls, polylines, odometry.

Metres, radians, seconds, in the odometry's frame.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from runtime.analysis.timeline import Timeline

Table: TypeAlias = Mapping[str, Sequence[Any]]
"""Columns by name, all of the same length. None means unknown."""

NAMES: Final = ("echoes", "cross_paths", "segments", "objects", "walls", "polylines", "odometry")
"""Tables, and files without their suffix."""
FRAME_NOTE = "metres, radians, seconds after the first cycle; coordinates in the frame of the odometry"


def tables(timeline: Timeline) -> dict[str, Table]:
    """Return the tables of a run by name."""
    found = (
        _echoes(timeline),
        _cross_paths(timeline),
        _segments(timeline),
        _objects(timeline),
        _walls(timeline),
        _polylines(timeline),
        _odometry(timeline),
    )
    return dict(zip(NAMES, found, strict=True))


def _echoes(timeline: Timeline) -> Table:
    """Return one row for each sensor that fired; `heard` is whether it received an echo."""
    rows = timeline.echoes
    heard = np.isfinite(rows["range_m"])
    reach = np.where(heard, rows["range_m"], np.nan)
    return {
        "t_s": rows["t_s"].tolist(),
        "robot_t_s": rows["robot_s"].tolist(),
        "sensor": rows["sensor"].astype(int).tolist(),
        "sensor_x_m": rows["x"].tolist(),
        "sensor_y_m": rows["y"].tolist(),
        "bearing_rad": rows["bearing"].tolist(),
        "heard": heard.tolist(),
        "range_m": _known(reach.tolist()),
        "echo_x_m": _known((rows["x"] + reach * np.cos(rows["bearing"])).tolist()),
        "echo_y_m": _known((rows["y"] + reach * np.sin(rows["bearing"])).tolist()),
    }


def _cross_paths(timeline: Timeline) -> Table:
    """Return one row for each sensor that listened to another one's pulse; `heard` is whether it received it."""
    rows = timeline.cross_paths
    heard = np.isfinite(rows["half_path_m"])
    return {
        "t_s": rows["t_s"].tolist(),
        "robot_t_s": rows["robot_s"].tolist(),
        "transmitter": rows["transmitter"].tolist(),
        "listener": rows["listener"].tolist(),
        "transmitter_x_m": rows["x"].tolist(),
        "transmitter_y_m": rows["y"].tolist(),
        "transmitter_bearing_rad": rows["bearing"].tolist(),
        "listener_x_m": rows["listener_x"].tolist(),
        "listener_y_m": rows["listener_y"].tolist(),
        "listener_bearing_rad": rows["listener_bearing"].tolist(),
        "heard": heard.tolist(),
        "half_path_m": _known(np.where(heard, rows["half_path_m"], np.nan).tolist()),
    }


def _segments(timeline: Timeline) -> Table:
    """Return one row for each outline segment that was in the run's own map at any snapshot."""
    names = ("first_seen_s", "last_seen_s", "x1_m", "y1_m", "x2_m", "y2_m", "normal_rad")
    return {name: timeline.segments[:, i].tolist() for i, name in enumerate(names)}


def _objects(timeline: Timeline) -> Table:
    """Return one row for each object at each snapshot, corners and edges of walls included."""
    seen = [(m.t_s, o) for m in timeline.snapshots for o in (*m.objects, *m.corners)]
    return {
        "t_s": [t for t, _ in seen],
        "number": [o.number for _, o in seen],
        "model": [o.model for _, o in seen],
        "x_m": [float(o.x) for _, o in seen],
        "y_m": [float(o.y) for _, o in seen],
        "theta_rad": [float(o.theta) for _, o in seen],
        "sigma_m": [float(o.sigma) for _, o in seen],
        "sigma_theta_rad": [o.sigma_theta for _, o in seen],
        "support": [int(o.support) for _, o in seen],
        "score": [float(o.score) for _, o in seen],
        "probability": [o.probability for _, o in seen],
        "covariance_xx_m2": [None if o.covariance is None else o.covariance[0] for _, o in seen],
        "covariance_xy_m2": [None if o.covariance is None else o.covariance[1] for _, o in seen],
        "covariance_yy_m2": [None if o.covariance is None else o.covariance[2] for _, o in seen],
    }


def _walls(timeline: Timeline) -> Table:
    """Return one row for each wall at each snapshot."""
    seen = [(m.t_s, wall, wall.ends) for m in timeline.snapshots for wall in m.walls if wall.ends is not None]
    places = {name: [ends[i] for _, _, ends in seen] for i, name in enumerate(("x1_m", "y1_m", "x2_m", "y2_m"))}
    return {
        "t_s": [t for t, _, _ in seen],
        "number": [wall.number for _, wall, _ in seen],
        **places,
        "sigma_rad": [wall.sigma_theta for _, wall, _ in seen],
        "support": [int(wall.support) for _, wall, _ in seen],
        "probability": [wall.probability for _, wall, _ in seen],
    }


def _polylines(timeline: Timeline) -> Table:
    """Return one row for each point of each polyline at each snapshot; `point` counts them along the polyline."""
    seen = [
        (m.t_s, one, k, x, y)
        for m in timeline.snapshots
        for one in m.polylines
        for k, (x, y) in enumerate(one.points.tolist())
    ]
    return {
        "t_s": [t for t, *_ in seen],
        "number": [one.number for _, one, *_ in seen],
        "probability": [one.probability for _, one, *_ in seen],
        "point": [k for *_, k, _, _ in seen],
        "x_m": [x for *_, x, _ in seen],
        "y_m": [y for *_, y in seen],
    }


def _odometry(timeline: Timeline) -> Table:
    """Return the table of the odometry; speeds that are not known are empty."""
    path_rows = timeline.odometry
    return {
        "t_s": [t for t, _ in path_rows],
        "robot_t_s": [o.robot_s for _, o in path_rows],
        "x_m": [o.pose.x for _, o in path_rows],
        "y_m": [o.pose.y for _, o in path_rows],
        "heading_rad": [o.pose.theta for _, o in path_rows],
        "ring_yaw_rad": [o.ring_yaw for _, o in path_rows],
        "v_m_s": _known([o.twist.v for _, o in path_rows]),
        "w_rad_s": _known([o.twist.w for _, o in path_rows]),
        "flags": [int(o.flags) for _, o in path_rows],
    }


def _known(values: list[float]) -> list[float | None]:
    return [None if math.isnan(value) else value for value in values]


def write_csv(timeline: Timeline, folder: Path) -> list[Path]:
    """Write a CSV file for each table and return the files; unknown values are empty cells.

    Raises
    ------
    OSError
        A file cannot be written.
    """
    paths = []
    for name, table in tables(timeline).items():
        path = folder / f"{name}.csv"
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(table)
            writer.writerows(zip(*table.values(), strict=True))
        paths.append(path)
    return paths


def write_parquet(timeline: Timeline, folder: Path) -> list[Path]:
    """Write a Parquet file for each table and return the files; their metadata holds units and frame.

    Raises
    ------
    OSError
        A file cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    whole = pa.int64()
    kinds = {
        "model": pa.string(),
        "heard": pa.bool_(),
        "sensor": whole,
        "support": whole,
        "flags": whole,
        "number": whole,
        "transmitter": whole,
        "listener": whole,
        "point": whole,
    }
    paths = []
    for name, table in tables(timeline).items():
        schema = pa.schema(
            [(column, kinds.get(column, pa.float64())) for column in table],
            metadata={"echolocate": FRAME_NOTE, "start_unix_ns": str(timeline.start_unix_ns)},
        )
        path = folder / f"{name}.parquet"
        with path.open("wb") as file:
            pq.write_table(pa.table(dict(table), schema=schema), file, compression="zstd")
        paths.append(path)
    return paths
