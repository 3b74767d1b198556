"""Columns that are mirrored, or that begin with another sensor."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.load import load_settings
from runtime.recording.conventions.headings import SURE, Angles, echo_scores, mirror_image
from runtime.recording.conventions.options import AUTO
from runtime.recording.conventions.reading import open_ring_log
from runtime.recording.conventions.sensor_order import find_exchange, find_shift, mirrored_columns
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError
from tests.recordings import recording
from tests.runtime.recording.conventions.tables import Convention, make_drive, written

RING = load_settings("hallway", robot="p3dx").ring


def test_a_mirrored_ring_takes_each_column_for_the_sensor_on_the_other_side() -> None:
    columns = mirrored_columns(RING)
    for sensor, mount in enumerate(RING.mounts):
        image = RING.mounts[columns[sensor]]
        assert (image.x_m, -image.y_m, -image.angle_rad) == pytest.approx(tuple(mount), abs=1e-6)
    np.testing.assert_array_equal(columns[columns], np.arange(len(columns)))


@pytest.mark.parametrize("robot", ["denning", "p3dx"])
@pytest.mark.parametrize("shift", [0, pytest.param(1, marks=pytest.mark.soak), 5])
@pytest.mark.parametrize("is_mirrored", [False, True])
def test_columns_that_begin_with_another_sensor_are_found(robot: str, shift: int, *, is_mirrored: bool) -> None:
    drive = make_drive(11, robot, "room", "cone", 60.0)
    ring, sensors = drive.settings.ring, drive.ranges.shape[1]
    ranges = drive.ranges[:, mirrored_columns(ring)] if is_mirrored else drive.ranges
    ranges = np.roll(np.where(np.isinf(ranges), np.nan, ranges), shift, axis=1)
    table = Table(drive.t, drive.pose, ranges)
    ways = [Angles(), mirror_image(Angles())]
    others = echo_scores(table, drive.settings, ways, 1.0, 1.0)
    found = find_shift(table, drive.settings, ways, 1.0, 1.0, others.values())
    assert found.angles == ways[is_mirrored]
    assert found.sensor == (sensors - shift) % sensors
    assert (found.surely > SURE) == (shift > 0)
    if shift and is_mirrored:
        image = mirrored_columns(ring)[found.sensor]
        assert f"or r00 is sensor {image} and the columns run the other way round" in found.words(ring)


def exchanges(count: int) -> dict[str, list[int]]:
    """Return orders of columns that a table may have by mistake."""
    half, swapped, neighbours = count // 2, list(range(count)), list(range(count))
    swapped[1], swapped[half] = half, 1
    neighbours[2:4] = 3, 2
    return {
        "two": swapped,
        "neighbours": neighbours,
        "one array backward": [*reversed(range(half)), *range(half, count)],
    }


@pytest.mark.parametrize(
    ("robot", "model", "orders"),
    [
        ("denning", "specular", ["neighbours"]), pytest.param("p3dx", "cone", ["two"], marks=pytest.mark.soak),
        ("amigo", "specular", ["one array backward"]),
        *(pytest.param(robot, model, [*exchanges(8)], marks=pytest.mark.soak)
          for robot in ("denning", "p3dx", "amigo") for model in ("cone", "specular")),
    ],
)  # fmt: skip
def test_columns_that_are_exchanged_are_found_and_others_are_not(robot: str, model: str, orders: list[str]) -> None:
    drive = make_drive(13, robot, "room", model, 150.0)
    ranges = np.where(np.isinf(drive.ranges), np.nan, drive.ranges)
    ways = [Angles(), mirror_image(Angles())]
    table = Table(drive.t, drive.pose, ranges)
    found = find_exchange(table, drive.settings, Angles(), 1.0, 1.0, ways)
    assert found is None or found.surely < 0.0
    for name in orders:
        order = exchanges(ranges.shape[1])[name]
        exchanged = table._replace(ranges=ranges[:, order])
        found = find_exchange(exchanged, drive.settings, Angles(), 1.0, 1.0, ways)
        assert found is not None
        assert found.surely > SURE
        assert (found.sensors == order).mean() > 0.6


@pytest.mark.parametrize(
    ("robot", "column"), [("amigo", 2), ("amigo", 5), pytest.param("p3dx", 9, marks=pytest.mark.soak)]
)
def test_two_neighbours_that_are_exchanged_are_found_in_a_hall_of_drums(robot: str, column: int) -> None:
    """One of the two may fit as well in the other's place; both together do not."""
    drive = make_drive(109, robot, "hall", "cone", 150.0)
    ranges = np.where(np.isinf(drive.ranges), np.nan, drive.ranges)
    order = list(range(ranges.shape[1]))
    order[column : column + 2] = column + 1, column
    ways = [Angles(), mirror_image(Angles())]
    table = Table(drive.t, drive.pose, ranges)
    assert find_exchange(table, drive.settings, Angles(), 1.0, 1.0, ways) is None
    found = find_exchange(table._replace(ranges=ranges[:, order]), drive.settings, Angles(), 1.0, 1.0, ways)
    assert found is not None
    assert found.surely > SURE
    assert found.sensors.tolist() == order


@pytest.mark.parametrize(("seed", "robot"), [(202, "p3dx"), pytest.param(202, "magellan", marks=pytest.mark.soak)])
def test_a_small_gain_among_mirrors_is_no_exchange(seed: int, robot: str) -> None:
    drive = make_drive(seed, robot, "hall", "specular", 150.0)
    table = Table(drive.t, drive.pose, np.where(np.isinf(drive.ranges), np.nan, drive.ranges))
    found = find_exchange(table, drive.settings, Angles(), 1.0, 1.0, [Angles(), mirror_image(Angles())])
    assert found is None or found.surely <= 0.0


@pytest.mark.parametrize("name", ["corridor", pytest.param("ring24", marks=pytest.mark.soak)])
def test_real_recordings_are_in_their_order(name: str) -> None:
    robot, rows = recording(name)
    ranges = np.array([row.ranges_m for row in rows])
    pose = np.array([(row.pose.x, row.pose.y, row.pose.theta, row.ring_yaw) for row in rows])
    table = Table(np.array([row.robot_s for row in rows]), pose, np.where(np.isinf(ranges), np.nan, ranges))
    found = find_exchange(table, robot, Angles(), 1.0, 1.0, [Angles(), mirror_image(Angles())])
    limit = (
        0.0 if name == "corridor" else 0.5 * SURE
    )  # without a pose, echoes say little; a log is refused above this
    assert found is None or found.surely <= limit


@pytest.mark.parametrize(
    ("order", "named"),
    [
        ((0, 1, 12, *range(3, 12), 2, *range(13, 16)), "r02 is sensor 12, r12 is sensor 2 of the robot file"),
        pytest.param(
            (*range(7, -1, -1), *range(8, 16)),
            "r00 is sensor 7, r01 is sensor 6, r02 is sensor 5",
            marks=pytest.mark.soak,
        ),
    ],
)
def test_exchanged_columns_are_refused_with_their_sensors(order: tuple[int, ...], named: str, tmp_path: Path) -> None:
    drive, how = make_drive(12, "p3dx", "room", "specular"), Convention(order=order)
    path = written(drive, how, np.random.default_rng(12), tmp_path / "table.csv")
    with pytest.raises(RingLogError, match=named) as refused:
        list(open_ring_log(path, drive.settings))
    assert "or say --sensor-order file if they are right" in str(refused.value)
    taken = list(open_ring_log(path, drive.settings, replace(AUTO, sensor_order="file", echo_lag="0")))
    assert len(taken) == len(drive.ranges)
