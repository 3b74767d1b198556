"""Logs with good odometry, replayed with correction of drift and without."""

from __future__ import annotations

import math

import pytest

from bench.correction_drives import ROBOTS, ROOMS, correction_drive
from config.world import OdometryConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.messages import wrap_angle
from runtime.recording.ring_log_replay import replay_firings, replay_localized
from runtime.simulation.drift_trials import LEVELS

PERCEIVED = ("objects", "walls", "corners", "canyons", "segments", "clusters")


def is_left_alone(seed: int, seconds: float | None = None) -> bool:
    """Return whether correction changes nothing of what is perceived in a log with good odometry, nor of its pose."""
    drive = correction_drive(seed, LEVELS[0], seconds)
    plain = replay_firings(drive.settings, drive.firings)
    corrected = replay_localized(drive.settings, drive.firings, lambda *_: None)
    end, pose = drive.firings[-1].pose, corrected["pose"]
    assert all(plain[name] == corrected[name] for name in PERCEIVED)  # type: ignore[literal-required]  # each is one
    return (pose["x"], pose["y"], pose["theta"]) == (end.x, end.y, end.theta)


def test_drives_keep_clear_of_surfaces_and_odometry_without_errors_is_the_path() -> None:
    for seed in range(len(ROOMS)):
        drive = correction_drive(seed, LEVELS[0], 5.0)
        scene = compile_scene(drive.world)
        radius_m = drive.settings.body.radius_m
        for firing, true in zip(drive.firings, drive.truth, strict=True):
            at = drive.start.compose(true)
            assert clearance(at.x, at.y, scene.circles, scene.segments) > radius_m
            assert (firing.pose.x, firing.pose.y) == pytest.approx((true.x, true.y), abs=1e-4)
            assert wrap_angle(firing.pose.theta - true.theta) == pytest.approx(0.0, abs=1e-4)


def test_the_seeds_cover_robots_and_rooms() -> None:
    drives = [correction_drive(seed, LEVELS[0], 0.1) for seed in range(40)]
    assert {drive.room for drive in drives} == set(ROOMS)
    assert {len(drive.settings.ring.mounts) for drive in drives} >= {8, 16, 24}
    assert len(ROBOTS) == 10


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("seed", "seconds"), [(11, 12.0), *(pytest.param(k, 40.0, marks=pytest.mark.soak) for k in (0, 11, 28))]
)
def test_correction_of_good_odometry_changes_nothing(seed: int, seconds: float) -> None:
    assert is_left_alone(seed, seconds)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(1000, 1040))
def test_correction_of_good_odometry_changes_nothing_in_any_room(seed: int) -> None:
    assert is_left_alone(seed)


@pytest.mark.compiled
@pytest.mark.parametrize("seconds", [40.0, pytest.param(120.0, marks=pytest.mark.soak)])
def test_odometry_that_drifts_among_drums_is_corrected(seconds: float) -> None:
    drive = correction_drive(39, OdometryConfig(scale=1.02, heading_rad_per_sqrt_m=math.radians(1.0)), seconds)
    corrected = replay_localized(drive.settings, drive.firings, lambda *_: None)
    end, reported, pose = drive.truth[-1], drive.firings[-1].pose, corrected["pose"]
    off = math.dist((reported.x, reported.y), (end.x, end.y))
    assert math.dist((pose["x"], pose["y"]), (end.x, end.y)) < 0.5 * off
