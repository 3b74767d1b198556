"""What is explained and what is false, against plain geometry, on a drive that is written here."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest

from bench.real_rooms import measure, read_drive, rounded
from config.errors import UserError

pytestmark = pytest.mark.compiled
ROBOT = """[ring]
sensors = [{x_m = 0.0, y_m = 0.0, angle_deg = 90.0}, {x_m = 0.0, y_m = 0.0, angle_deg = -90.0}]
beam_half_angle_deg = 12.0
resolution_m = 0.01
range_min_m = 0.1
range_max_m = 5.0

[body]
radius_m = 0.25
speed_max_m_s = 0.5
turn_max_rad_s = 1.0
synchro = false
"""


def write(path: Path, header: str, rows: list[list[float | str]]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header.split(","))
        writer.writerows(rows)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A robot along a wall at y = 1, beside nothing, there and back."""
    drive = tmp_path / "aisle-cone"
    drive.mkdir()
    (drive / "robot.toml").write_text(ROBOT)
    xs = [0.05 * k for k in range(80)] + [4.0 - 0.05 * k for k in range(80)]
    write(drive / "ring.csv", "t,x,y,theta,r00,r01", [[0.1 * k, x, 0.0, 0.0, 1.0, "inf"] for k, x in enumerate(xs)])
    write(drive / "truth.csv", "x,y,theta", [[x, 0.02 * math.sin(x), 0.0] for x in xs])
    write(drive / "bearings.csv", "b00,b01", [[0.5 * math.pi, ""] for _ in xs])
    write(tmp_path / "aisle-points.csv", "x,y", [[0.05 * k, 1.0] for k in range(-5, 90)])
    return drive


def test_a_drive_along_a_wall_is_explained(folder: Path) -> None:
    row = measure([folder], 2, lambda _: None)["aisle-cone"]
    assert row["echoes"] == 160
    assert row["with outlines"] > 0.9
    assert row["false"] == row["drums"] == 0.0
    assert 0.0 <= row["spread"] < 0.2
    assert row["image false"] == row["points in free"] == 0.0


def test_rounded_numbers(folder: Path) -> None:
    drive = read_drive(folder)
    for firing in rounded(drive.firings, (0.1, 0.3, 1.0)):
        assert firing.pose.x == pytest.approx(round(firing.pose.x, 1))
        assert firing.ranges_m[0] == pytest.approx(0.9)
        assert math.isinf(firing.ranges_m[1])
        assert firing.robot_s == round(firing.robot_s)


def test_a_folder_without_a_drive_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(ROBOT)
    with pytest.raises(UserError, match=r"ring\.csv"):
        read_drive(tmp_path)
