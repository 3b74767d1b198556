"""The base: where it truly is, what it believes, and what its rim runs into.

Truth and odometry are two states. The truth moves on exact arcs and is stopped by surfaces; the odometry follows
the wheels with its own errors and knows nothing of the world.
"""

from __future__ import annotations

import math

import numpy as np

from config.robot import BodyConfig
from config.world import OdometryConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import Scene
from drivers.messages import Pose, Twist, wrap_angle

BRAKE_S = 0.1
"""A hard brake takes this long from full speed: what "stops at once" means for a base with mass."""
RAMP_S = 0.25
"""A ramp to a stop takes this long from full speed, where the base's own acceleration is not quicker still."""
_BISECTIONS = 40


def arc(pose: Pose, distance_m: float, turn_rad: float) -> Pose:
    """Return `pose` after a circular arc: the exponential of SE(2), its chord written with sin(x)/x."""
    half = 0.5 * turn_rad
    chord = distance_m * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    direction = pose.theta + half
    return Pose(pose.x + chord * math.cos(direction), pose.y + chord * math.sin(direction), pose.theta + turn_rad)


def _approach(speed: float, target: float, rate: float, dt_s: float) -> tuple[float, float]:
    """Return the speed after dt_s towards `target` at constant acceleration `rate`, and the way covered."""
    ramp_s = abs(target - speed) / rate
    if ramp_s <= dt_s:
        return target, 0.5 * (speed + target) * ramp_s + target * (dt_s - ramp_s)
    after = speed + math.copysign(rate * dt_s, target - speed)
    return after, 0.5 * (speed + after) * dt_s


class Body:
    """A round base on wheels in a scene.

    Parameters
    ----------
    config
        Size and limits; `synchro` keeps the ring's direction while the wheels turn.
    scene
        What stops the rim.
    start
        The true pose at time zero; odometry begins at zero there.
    odometry
        How the odometry drifts.
    rng
        The drift's source of randomness.

    Attributes
    ----------
    pose, ring_yaw
        The truth, in world coordinates; angles are unwrapped.
    believed, believed_ring_yaw
        The odometry.
    twist
        The wheels' speed now.
    contacts
        How often the rim has run into something.
    """

    def __init__(
        self, config: BodyConfig, scene: Scene, start: Pose, odometry: OdometryConfig, rng: np.random.Generator
    ) -> None:
        self._config = config
        self._scene = scene
        self._odometry = odometry
        self._rng = rng
        self.pose = start
        self.ring_yaw = start.theta
        self.believed = Pose(0.0, 0.0, 0.0)
        self.believed_ring_yaw = 0.0
        self.twist = Twist(0.0, 0.0)
        self.contacts = 0
        self._known: tuple[Pose, float] | None = None
        """The last pose that was asked about and its clearance, m: one step ends where the next one begins."""

    @property
    def clearance_m(self) -> float:
        """Distance from the rim to the nearest surface; never below zero unless the robot starts there."""
        return self._clearance(self.pose)

    def reset_odometry(self) -> None:
        """Begin the odometry at zero here; the ring's angle to the wheels is read off its gear and survives."""
        self.believed = Pose(0.0, 0.0, 0.0)
        self.believed_ring_yaw = wrap_angle(self.ring_yaw - self.pose.theta)

    def jump_odometry(self, dx_m: float, dy_m: float, dheading_rad: float) -> None:
        """Shift what the odometry believes, by a vector in its own frame and an angle."""
        old = self.believed
        self.believed = Pose(old.x + dx_m, old.y + dy_m, old.theta + dheading_rad)
        self.believed_ring_yaw += dheading_rad

    def step(self, dt_s: float, target: Twist, *, within_s: float | None = None) -> bool:
        """Let `dt_s` pass, the wheels on their way to `target`; return whether the rim ran into something.

        With `within_s` the wheels change their speed by their full speed in that time, even where the limits on
        acceleration are lower. A contact stops the wheels dead, at the surface; from there the body can move away,
        and any motion towards the surface is a new contact.
        """
        limits = self._config
        rate, turn_rate = limits.acceleration_max_m_s2, limits.turn_acceleration_max_rad_s2
        if within_s is not None:
            rate = max(rate, limits.speed_max_m_s / within_s)
            turn_rate = max(turn_rate, limits.turn_max_rad_s / within_s)
        goal_v = min(limits.speed_max_m_s, max(-limits.speed_max_m_s, target.v))
        goal_w = min(limits.turn_max_rad_s, max(-limits.turn_max_rad_s, target.w))
        v, distance = _approach(self.twist.v, goal_v, rate, dt_s)
        w, turn = _approach(self.twist.w, goal_w, turn_rate, dt_s)
        if (v, w) != (self.twist.v, self.twist.w):
            self.twist = Twist(v, w)
        if distance == 0.0 and turn == 0.0:
            return False
        # In pieces that no thin wall can slip through.
        pieces = max(1, math.ceil(abs(distance) / (0.5 * limits.radius_m)))
        for _ in range(pieces):
            share = self._move(distance / pieces, turn / pieces)
            if share < 1.0:
                self.twist = Twist(0.0, 0.0)
                self.contacts += 1
                return True
        return False

    def _clearance(self, pose: Pose) -> float:
        if self._known is not None and self._known[0] is pose:
            return self._known[1]
        here_m = clearance(pose.x, pose.y, self._scene.circles, self._scene.segments) - self._config.radius_m
        self._known = (pose, here_m)
        return here_m

    def _free_share(self, end: Pose, distance: float, turn: float) -> float:
        """Return how much of the arc to `end` can be driven, 0 to 1, before the rim touches."""
        if distance == 0.0:
            return 1.0
        before, after = self._clearance(self.pose), self._clearance(end)
        if after >= min(0.0, before):
            return 1.0
        free, blocked = 0.0, 1.0
        for _ in range(_BISECTIONS):
            middle = 0.5 * (free + blocked)
            if self._clearance(arc(self.pose, middle * distance, middle * turn)) >= min(0.0, before):
                free = middle
            else:
                blocked = middle
        return free

    def _move(self, distance: float, turn: float) -> float:
        """Move along the arc as far as it is free; return how much of it that is."""
        end = arc(self.pose, distance, turn)
        share = self._free_share(end, distance, turn)
        if share < 1.0:
            distance, turn = share * distance, share * turn
            end = arc(self.pose, distance, turn)
        self.pose = end
        drift = self._odometry.heading_rad_per_sqrt_m
        wander = drift * math.sqrt(abs(distance)) * self._rng.standard_normal() if drift > 0.0 else 0.0
        self.believed = arc(self.believed, self._odometry.scale * distance, turn + wander)
        if not self._config.synchro:
            self.ring_yaw += turn
            self.believed_ring_yaw += turn + wander
        return share
