"""Removal of jumps of the odometry, so that poses stay continuous and the map stays valid.

Odometry that jumps by more than the wheels can have turned means that a counter was set or a wheel slipped, not that
the body moved. The jump then moves the origin of the poses that are passed on.
"""

from __future__ import annotations

import math
from dataclasses import replace

from config.robot import BodyConfig
from drivers import se2
from drivers.messages import IDENTITY, Odometry, wrap_angle

_RESET_M, _RESET_M_S = 0.5, 20.0
"""A pose that moved farther than this, m plus m/s, was reset: the robot may have restarted."""
_JUMP_M, _JUMP_RAD = 0.1, 0.1
"""Allowed difference of odometry from its own velocities, m and rad, besides a stop within one sample."""
_STEADY_SAMPLES = 10
"""A deviation counts as a jump only after this many samples without one; otherwise it is how this base moves."""


class OdometryJumps:
    """Finds the jumps of one base's odometry, and removes them.

    The limits of its body distinguish a motion from a jump.
    """

    def __init__(self, body: BodyConfig) -> None:
        self.count = 0
        """Jumps that were removed."""
        self.origin = IDENTITY
        """The origin of the poses passed on, in the robot's own odometry; the identity until that jumps."""
        self._body = body
        self._ring_offset = 0.0
        """The same of the ring's direction, rad."""
        self._last: Odometry | None = None
        """The last sample, after the removal of jumps."""
        self._steady = 0
        """Samples in a row that moved as the wheels said."""

    def restart(self) -> None:
        """Forget all samples: the odometry restarted at zero."""
        self._last, self._steady = None, 0
        self.origin, self._ring_offset = IDENTITY, 0.0

    def rebase(self, reported: Odometry) -> None:
        """Take `reported`, the next sample, as the place of the last one: the odometry was set, and nothing moved."""
        if self._last is not None:
            self.origin = reported.pose.compose(self._last.pose.inverse())
            self._ring_offset = self._last.ring_yaw - reported.ring_yaw

    def is_reset(self, reported: Odometry) -> bool:
        """Return whether a sample is so far from the last one that the robot may have restarted."""
        if self._last is None:
            return False
        here, last = self._from_origin(reported), self._last
        moved_m = math.hypot(here.pose.x - last.pose.x, here.pose.y - last.pose.y)
        return moved_m > _RESET_M + _RESET_M_S * (here.robot_s - last.robot_s)

    def remove(self, reported: Odometry) -> tuple[Odometry, str | None]:
        """Return the sample in the frame of those before, and the message about a jump that was removed.

        A jump is replaced by the prediction from the wheels' speeds, and moves `origin`. A base may move otherwise
        than it says, as in steps; but none moves as far as after a reset of its odometry.
        """
        sample, last = self._from_origin(reported), self._last
        self._last = sample
        if last is None:
            return sample, None
        dt_s = sample.robot_s - last.robot_s
        v, w = 0.5 * (last.twist.v + sample.twist.v), 0.5 * (last.twist.w + sample.twist.w)
        expected = last.pose.compose(se2.exp(v * dt_s, 0.0, w * dt_s))
        ring_yaw = last.ring_yaw if self._body.synchro else last.ring_yaw + w * dt_s
        off_m = math.hypot(sample.pose.x - expected.x, sample.pose.y - expected.y)
        turned = sample.pose.theta - expected.theta
        off_rad = max(abs(turned), abs(sample.ring_yaw - ring_yaw))
        limits = self._body
        if off_m <= _JUMP_M + limits.speed_max_m_s * dt_s and off_rad <= _JUMP_RAD + limits.turn_max_rad_s * dt_s:
            self._steady += 1
            return sample, None
        steady, self._steady = self._steady, 0
        if steady < _STEADY_SAMPLES and off_m <= _RESET_M + _RESET_M_S * dt_s:
            return sample, None
        self.count += 1
        self.origin = reported.pose.compose(expected.inverse())
        self._ring_offset = ring_yaw - reported.ring_yaw
        self._last = replace(reported, pose=expected, ring_yaw=ring_yaw)
        return self._last, _message(off_m, wrap_angle(turned), wrap_angle(sample.ring_yaw - ring_yaw))

    def _from_origin(self, reported: Odometry) -> Odometry:
        """Return a sample in the frame of those before."""
        if self.origin == IDENTITY and self._ring_offset == 0.0:
            return reported
        pose = self.origin.inverse().compose(reported.pose)
        return replace(reported, pose=pose, ring_yaw=reported.ring_yaw + self._ring_offset)


def _message(off_m: float, turned_rad: float, ring_rad: float) -> str:
    """Return the message for a jump of the odometry.

    `off_m` and `turned_rad` are how far the odometry is from where the wheels' speeds would have brought the base,
    `ring_rad` the same of the ring's direction.
    """
    return (
        f"the odometry jumped by {off_m:.2f} m and {math.degrees(turned_rad):+.0f} degrees, the ring's direction by "
        f"{math.degrees(ring_rad):+.0f}: more than the wheels can have turned; a wheel slipped, or an "
        f"encoder or its counter failed: the jump is removed and the map stays valid; if it happens again, check "
        f"wheels and encoders"
    )
