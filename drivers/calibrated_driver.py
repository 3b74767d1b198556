"""A driver whose robot's odometry and ranges are wrong by known scales: everything beyond it sees them corrected."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from config.robot import CalibrationConfig
from drivers.messages import Firing, Odometry, Pose, Twist

if TYPE_CHECKING:
    from drivers.driver import Received, RobotDriver


class CalibratedDriver:
    """A `drivers.driver.RobotDriver` around another one: corrects what it receives and what it is asked to drive.

    The corrected path begins where the robot's odometry does. Each step of the odometry is an arc: its turn is
    divided by the turn's scale and its chord by the distance's, so that corrected poses stay continuous.

    `synchro`: the ring does not turn with the wheels, so its direction is measured for itself, and not corrected.
    """

    def __init__(self, driver: RobotDriver, calibration: CalibrationConfig, *, synchro: bool) -> None:
        self._driver = driver
        self._calibration = calibration
        self._synchro = synchro
        self._reported: Pose | None = None
        self._corrected = Pose(0.0, 0.0, 0.0)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - all other members are the driver's, as they are
        return getattr(self._driver, name)

    def drive(self, twist: Twist) -> None:
        """Request a true velocity: the base, which measures wrongly, is asked for what it takes for that.

        Raises
        ------
        ValueError
            The velocity is not finite.
        """
        self._driver.drive(Twist(twist.v * self._calibration.distance_scale, twist.w * self._calibration.turn_scale))

    def take_received(self) -> Received:
        """Return what was received since the last call, corrected, and remove it."""
        received = self._driver.take_received()
        if received.rebooted:
            self._reported = None
        odometry = received.odometry
        if odometry is not None:
            self._corrected, self._reported = self._at(odometry.pose), odometry.pose
            odometry = self._odometry(odometry)
        return replace(received, odometry=odometry, firings=tuple(map(self._firing, received.firings)))

    def _at(self, reported: Pose) -> Pose:
        """Return the corrected pose of a reported one, which lies a short way before or after the last sample."""
        if self._reported is None:
            return reported
        step = self._reported.inverse().compose(reported)
        turn = step.theta / self._calibration.turn_scale
        # The chord of an arc lies half the arc's turn off its beginning.
        chord, bend = math.hypot(step.x, step.y) / self._calibration.distance_scale, 0.5 * (turn - step.theta)
        direction = math.atan2(step.y, step.x) + bend
        return self._corrected.compose(Pose(chord * math.cos(direction), chord * math.sin(direction), turn))

    def _ring_yaw(self, reported: float, heading: float, corrected: float) -> float:
        return reported if self._synchro else reported - heading + corrected

    def _odometry(self, sample: Odometry) -> Odometry:
        """Return the newest sample at its corrected pose."""
        pose, scales = self._corrected, self._calibration
        twist = Twist(sample.twist.v / scales.distance_scale, sample.twist.w / scales.turn_scale)
        yaw = self._ring_yaw(sample.ring_yaw, sample.pose.theta, pose.theta)
        return replace(sample, pose=pose, ring_yaw=yaw, twist=twist)

    def _firing(self, firing: Firing) -> Firing:
        pose = self._at(firing.pose)
        yaw = self._ring_yaw(firing.ring_yaw, firing.pose.theta, pose.theta)
        return replace(firing.over_scale(self._calibration.range_scale), pose=pose, ring_yaw=yaw)
