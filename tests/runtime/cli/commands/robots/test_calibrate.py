"""Tests of `echolocate calibrate`: the robot file of a drive, and calls that it refuses."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.load import load_robot
from perception.calibration.calibrate import Calibration
from perception.calibration.drive import Scales
from perception.calibration.geometry_fit import RangeNoise
from runtime.cli.app import run_command
from runtime.cli.commands.robots.calibrate import refuse_without_gain
from runtime.recording.ring_log_rows import write_ring_log
from tests.calibration_drive import DRUM, CalibrationDrive, calibration_drive


@pytest.fixture(scope="module")
def drive() -> CalibrationDrive:
    return calibration_drive(200, "specular", 0.0, 8.0)


def robot_file(folder: Path, drive: CalibrationDrive) -> Path:
    body = {"radius_m": 0.25, "speed_max_m_s": 0.5, "turn_max_rad_s": 1.5}
    ring = drive.nominal.model_dump(mode="json", exclude_none=True)
    path = folder / "nominal.toml"
    path.write_text(tomli_w.dumps({"ring": ring, "body": body}), "utf-8")
    return path


def test_a_ring_log_of_a_drive_becomes_a_robot_file(
    drive: CalibrationDrive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = tmp_path / "drive.csv", tmp_path / "mine.toml"
    write_ring_log(log, drive.firings)
    nominal = str(robot_file(tmp_path, drive))
    call = ["calibrate", str(log), "--robot", nominal, "--out", str(out), "--drum", str(DRUM.radius_m)]
    assert run_command([*call, "--way", f"{drive.way_m:.3f}"]) == DONE
    found = load_robot(str(out))
    assert found.calibration.distance_scale == pytest.approx(drive.scales.distance, abs=0.002)
    assert found.calibration.turn_scale == pytest.approx(drive.scales.turn, abs=0.005)
    assert len(found.ring.mounts) == 16
    for mount, true in zip(found.ring.mounts, drive.true.mounts, strict=True):
        assert math.hypot(mount.x_m - true.x_m, mount.y_m - true.y_m) < 0.03
    assert found.ring.firing == drive.nominal.firing
    text = capsys.readouterr().out
    assert "Sensors, as calibrated" in text
    assert "odometry's distance" in text
    assert "# Calibrated from drive.csv." in out.read_text("utf-8")
    assert run_command(call) == WRONG_CALL, "it exists: --force"
    assert "--force" in capsys.readouterr().err


def test_a_drive_that_shows_nothing_writes_nothing(
    drive: CalibrationDrive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A robot that stands learns nothing of itself, however long it listens."""
    log, out, at = tmp_path / "stand.csv", tmp_path / "mine.toml", drive.firings[0].pose
    firings = [
        replace(f, pose=at, ring_yaw=at.theta, ranges_m=drive.firings[k % 4].ranges_m)
        for k, f in enumerate(drive.firings[:150])
    ]
    write_ring_log(log, firings)
    nominal = str(robot_file(tmp_path, drive))
    call = ["calibrate", str(log), "--robot", nominal, "--out", str(out), "--drum", str(DRUM.radius_m)]
    assert run_command(call) == FAILED
    assert "nothing was written" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("shows", "gains", "lag_is_new", "said"),
    [
        (False, False, False, "the drive shows neither"),
        (True, False, False, "the robot is as its file says"),
        (True, True, False, None),
        (True, False, True, None),
        (False, False, True, None),
    ],
)
def test_a_drive_that_says_no_more_than_the_file_is_refused(
    shows: bool, gains: bool, lag_is_new: bool, said: str | None
) -> None:
    unknown = Scales(math.inf, math.inf, math.inf)
    place_sigmas, angle_sigmas = np.array([0.01 if shows else math.inf]), np.array([math.inf])
    found = Calibration(
        np.zeros((1, 3)), place_sigmas, angle_sigmas, np.array([9]), 0.2, everything_echoes=False, scales=Scales(),
        scale_sigmas=unknown, noise=RangeNoise(0.01, 0.0), walls=1, drums=0, has_gain=gains,
    )  # fmt: skip
    if said is None:
        refuse_without_gain("drive.csv", found, lag_is_new=lag_is_new)
        return
    with pytest.raises(UserError, match=said):
        refuse_without_gain("drive.csv", found, lag_is_new=lag_is_new)


def test_calls_that_are_refused(hall_log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "mine.toml")
    assert run_command(["calibrate", str(hall_log), "--out", out, "--way", "-1"]) == WRONG_CALL
    assert "--way -1.0: must be a length above 0" in capsys.readouterr().err
    short = tmp_path / "short.csv"
    short.write_text("".join(hall_log.read_text("utf-8").splitlines(keepends=True)[:20]), "utf-8")
    assert run_command(["calibrate", str(short), "--out", out]) == FAILED
    assert "holds only 19 firings" in capsys.readouterr().err
    assert not Path(out).exists()
