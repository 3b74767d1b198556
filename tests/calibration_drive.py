"""A drive for calibration, emulated: a robot whose mounts, odometry and ranges are not what its file says."""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

import numpy as np

from config.robot import BodyConfig, FiringConfig, RingConfig, SensorConfig
from config.world import AcousticsConfig, DrumConfig, OdometryConfig, WallConfig, WorldConfig
from drivers.emulator.body import Body
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Floats, Pose, Twist
from perception.calibration.calibrate import Calibration
from perception.calibration.drive import Scales

SENSORS: Final = 16
STEP_S: Final = 0.04
TURN_RAD_S: Final = 0.12
SPEED_M_S: Final = 0.15
WAY_M: Final = 4.0
AWAY_RAD: Final = 0.6
"""The way leads away from the wall by this angle."""
DRUM: Final = DrumConfig(x_m=2.6, y_m=-0.87, radius_m=0.29)
"""The way passes it at 0.2 m: only its near echoes show how large the ring is all round."""
WALL: Final = WallConfig(x1_m=-3.0, y1_m=1.1, x2_m=7.0, y2_m=1.3)
BODY: Final = BodyConfig(radius_m=0.25, speed_max_m_s=0.5, turn_max_rad_s=1.5)
ANGLE_ERROR_DEG: Final = 3.0
PLACE_ERROR_M: Final = 0.03
DISTANCE_ERROR: Final = 0.02
TURN_ERROR: Final = 0.02
RANGE_ERROR: Final = 0.015


class CalibrationDrive(NamedTuple):
    """A drive, and what a calibration of it should find.

    Attributes
    ----------
    firings : list of Firing
        As the robot reports them.
    nominal : RingConfig
        The ring by the robot file.
    true : RingConfig
        The ring as it is.
    scales : Scales
        Reported over true.
    way_m : float
        True distance between both stands, m.
    """

    firings: list[Firing]
    nominal: RingConfig
    true: RingConfig
    scales: Scales
    way_m: float


def calibration_drive(
    seed: int, model: Literal["cone", "specular"], heading_rad_per_sqrt_m: float, pace: float = 1.0
) -> CalibrationDrive:
    """Return two turns on the spot, a way past a drum, and two turns again, beside a wall.

    Sensors look up to 3° off and sit up to 3 cm off in each axis; distance and turn are 2 % wrong, ranges 1.5 %, with
    .2 % noise, 1 mm steps, 3 % drop-outs and 2 % stray readings.

    Parameters
    ----------
    seed
        Of all that is random.
    model
        Of the reflection.
    heading_rad_per_sqrt_m
        Random walk of the heading.
    pace
        How many times as fast to drive and turn.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 7]))
    angles = np.arange(SENSORS) * 360.0 / SENSORS
    places = 0.25 * np.column_stack([np.cos(np.radians(angles)), np.sin(np.radians(angles))])
    moved = places + PLACE_ERROR_M * rng.uniform(-1.0, 1.0, places.shape)
    turned = angles + ANGLE_ERROR_DEG * rng.uniform(-1.0, 1.0, SENSORS)
    distance, turn, ranges = 1.0 + rng.choice([-1.0, 1.0], 3) * (DISTANCE_ERROR, TURN_ERROR, RANGE_ERROR)
    true = _ring(moved, turned)
    acoustics = AcousticsConfig(
        model=model, noise_relative=0.002, dropout=0.03, outliers=0.02, sound_speed_scale=1.0 / ranges
    )
    scene = compile_scene(WorldConfig(drum=(DRUM,), wall=(WALL,)))
    odometry = OdometryConfig(scale=distance, turn_scale=turn, heading_rad_per_sqrt_m=heading_rad_per_sqrt_m)
    body = Body(BODY, scene, Pose(0.0, 0.0, 0.0), odometry, rng)
    sonar = Sonar(true, scene, acoustics, rng)
    firings: list[Firing] = []
    turn_rad_s, speed_m_s = pace * TURN_RAD_S, pace * SPEED_M_S
    twice = (0.0, turn_rad_s, 4.0 * math.pi / turn_rad_s)
    legs = (twice, (0.0, -turn_rad_s, AWAY_RAD / turn_rad_s), (speed_m_s, 0.0, WAY_M / speed_m_s), twice)
    first = body.pose
    for v, w, seconds in legs:
        for _ in range(round(seconds / STEP_S)):
            body.step(STEP_S, Twist(v, w))
            fired = range(len(firings) % 4, SENSORS, 4)
            reported = body.odometry_pose
            ranges_m = sonar.fire(body.pose, body.ring_yaw, fired)
            firings.append(Firing(STEP_S * (len(firings) + 1), reported, reported.theta, ranges_m))
    way_m = math.hypot(body.pose.x - first.x, body.pose.y - first.y)
    return CalibrationDrive(firings, _ring(places, angles), true, Scales(distance, turn, ranges), way_m)


def _ring(places: Floats, angles: Floats) -> RingConfig:
    sensors = tuple(
        SensorConfig(x_m=float(x), y_m=float(y), angle_deg=float(angle))
        for (x, y), angle in zip(places.tolist(), angles.tolist(), strict=True)
    )
    return RingConfig(
        sensors=sensors, beam_half_angle_deg=15.0, resolution_m=0.001, range_min_m=0.1, range_max_m=5.0,
        firing=FiringConfig(preset="quadrants", step_period_s=STEP_S),
    )  # fmt: skip


class CalibrationErrors(NamedTuple):
    """How far a calibration is off.

    Attributes
    ----------
    angle_deg : float
        Direction of a sensor, root mean square.
    place_m : float
        Each coordinate of its place, root mean square.
    distance, turn, range : float
        Absolute error of each scale, relative.
    """

    angle_deg: float
    place_m: float
    distance: float
    turn: float
    range: float


def calibration_errors(drive: CalibrationDrive, found: Calibration) -> CalibrationErrors:
    """Return how far a calibration of a drive is off.

    Parameters
    ----------
    drive : CalibrationDrive
        The drive.
    found : Calibration
        Its calibration.
    """
    off = found.mounts - np.array(drive.true.mounts)
    angles = np.degrees(np.remainder(off[:, 2] + math.pi, 2.0 * math.pi) - math.pi)
    scales = [abs(value / true - 1.0) for value, true in zip(found.scales, drive.scales, strict=True)]
    return CalibrationErrors(
        float(np.sqrt(np.mean(angles**2))), float(np.sqrt(np.mean(off[:, :2] ** 2))), *scales
    )  # fmt: skip
