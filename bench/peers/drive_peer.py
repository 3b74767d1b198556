"""What the peers that drive have in common: the ring's latest ranges, the odometry, and velocities for the base.

A peer commands the base directly: neither our schemas nor our arbiter stand between it and the robot.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Final

import numpy as np

from behaviors.move_to_goal import Goal
from bench.trials.navigation_trials import Outcome
from config.settings import Settings
from drivers.driver import LineState, RobotDriver
from drivers.messages import Firing, Flags, Floats, Odometry, Pose, Twist, wrap_angle

RELEASED_S: Final = 0.5
"""Time after the release before the first velocity, s."""


class DrivePeer(ABC):
    """A controller of `bench.trials.navigation_trials` without our cycle.

    Parameters
    ----------
    settings : Settings
        The robot's; the base velocity is the peer's largest one.
    goal : Goal
        In odometry's frame.
    """

    def __init__(self, settings: Settings, goal: Goal) -> None:
        self.settings = settings
        self.goal = goal
        self.mounts = np.array(settings.ring.mounts, dtype=np.float64)
        self.ranges_m: Floats = np.full(len(self.mounts), np.inf)
        """The latest range of each sensor, inf for silence, m."""
        self.v_max = settings.behaviors.arbiter.base_velocity_m_s
        self._odometry: Odometry | None = None
        self._released_s: float | None = None

    def cycle(self, driver: RobotDriver, run_s: float) -> Outcome | None:
        """See `Controller.cycle`."""
        driver.tick(run_s)
        received = driver.take_received()
        for firing in received.firings:
            fired = ~np.isnan(firing.ranges_m)
            self.ranges_m[fired] = firing.ranges_m[fired]
            self.on_firing(firing)
        self._odometry = received.odometry or self._odometry
        if self._odometry is None or driver.state is not LineState.READY:
            return None
        if self._released_s is None or self._odometry.flags & Flags.LATCHED:
            driver.release()
            self._released_s = run_s if self._released_s is None else self._released_s
            return None
        pose = self._odometry.pose
        if math.dist((pose.x, pose.y), (self.goal.x, self.goal.y)) <= self.reached_m:
            driver.drive(Twist(0.0, 0.0))
            return "arrived"
        if run_s - self._released_s < RELEASED_S:
            return None
        body = self.settings.body
        twist = self.velocity(pose, self._odometry.ring_yaw, run_s)
        w = max(-body.turn_max_rad_s, min(body.turn_max_rad_s, twist.w))
        driver.drive(Twist(max(-self.v_max, min(self.v_max, twist.v)), w))
        return None

    @property
    def reached_m(self) -> float:
        """Distance at which the goal is reached, m: the same for all."""
        return self.settings.behaviors.move_to_goal.success_radius_m

    def on_firing(self, firing: Firing) -> None:
        """Take a firing into the peer's own map; a peer without one keeps the ranges only."""
        del firing

    @abstractmethod
    def velocity(self, pose: Pose, ring_yaw: float, run_s: float) -> Twist:
        """Return the peer's velocity."""

    def goal_bearing(self, pose: Pose) -> float:
        """Return the goal's direction from the drive heading, rad."""
        return wrap_angle(math.atan2(self.goal.y - pose.y, self.goal.x - pose.x) - pose.theta)
