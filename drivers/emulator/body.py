"""The base: its true pose, its odometry, and contacts of its rim with surfaces.

The true pose and the odometry are two states. The true pose moves on exact arcs and is stopped by surfaces; the
odometry follows the wheels with its own errors and does not depend on the world.
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
"""Duration of a hard brake from full speed, s; what the protocol's "at once" means for a base with mass."""
RAMP_S = 0.25
"""Duration of a ramped stop from full speed, s, unless the base's own acceleration is higher."""
_BISECTIONS = 40
"""Halvings of a step in the search for the point of contact: 2⁻⁴⁰ of a step is below any surface's precision."""
_CLEAR_MIN_M = 1e-6
"""With this much room left no rounding can hide a contact, m."""
_STRAIGHT_RAD = 1e-9
"""Half turn below which sin(x)/x is 1 in float64."""


def arc(pose: Pose, distance_m: float, turn_rad: float) -> Pose:
    """Return the pose at the end of a circular arc.

    Parameters
    ----------
    pose
        Where the arc starts.
    distance_m
        Its length; negative = backwards.
    turn_rad
        The change of heading along it.

    Notes
    -----
    The exponential of SE(2), Sola et al., *A micro Lie theory*, eq. 155-158, the chord written with sin(x)/x.
    """
    half = 0.5 * turn_rad
    chord = distance_m * (math.sin(half) / half if abs(half) > _STRAIGHT_RAD else 1.0)
    direction = pose.theta + half
    return Pose(pose.x + chord * math.cos(direction), pose.y + chord * math.sin(direction), pose.theta + turn_rad)


def _approach(speed: float, target: float, rate: float, dt_s: float) -> tuple[float, float]:
    """Return the speed after `dt_s` of constant acceleration `rate` towards `target`, and the distance covered."""
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
        Size and limits; on a synchro drive the ring keeps its direction while the wheels turn.
    scene
        The surfaces that stop the rim.
    start
        The true pose at time zero, where the odometry is zero.
    odometry
        How the odometry drifts.
    rng
        Source of the drift's random numbers.

    Attributes
    ----------
    pose, ring_yaw
        The true pose, in world coordinates; angles are unwrapped.
    odometry_pose, odometry_ring_yaw
        The odometry.
    odometry_m
        The way of the wheels by odometry, m; backwards counts below zero.
    odometry_factor
        What the wheels count is the odometry's way and turn times this, for a fault of the encoders.
    twist
        The wheels' velocity.
    contacts
        How often the rim has touched a surface.
    contact_m_s
        The greatest speed at which it did, m/s.
    """

    def __init__(
        self, config: BodyConfig, scene: Scene, start: Pose, odometry: OdometryConfig, rng: np.random.Generator
    ) -> None:
        self._config = config
        self._scene = scene
        self._odometry_errors = odometry
        self._rng = rng
        self.pose = start
        self.ring_yaw = start.theta
        self.odometry_pose = Pose(0.0, 0.0, 0.0)
        self.odometry_ring_yaw = 0.0
        self.odometry_m = 0.0
        self.odometry_factor = 1.0
        self.twist = Twist(0.0, 0.0)
        self.contacts = 0
        self.contact_m_s = 0.0
        self._last_clearance: tuple[Pose, float] | None = None
        """The pose whose clearance was computed last, and the clearance, m; a step ends where the next one starts."""
        self._clear_m = -math.inf
        """A lower bound of the clearance at `pose`, m."""

    @property
    def clearance_m(self) -> float:
        """Distance from the rim to the nearest surface, m; below zero only if the robot starts there."""
        return self._clearance(self.pose)

    @property
    def radius_m(self) -> float:
        """Radius of the rim, m."""
        return self._config.radius_m

    @property
    def odometry_twist(self) -> Twist:
        """The wheels' velocity as the encoders count it."""
        factor = self.odometry_factor
        return self.twist if factor == 1.0 else Twist(factor * self.twist.v, factor * self.twist.w)

    def reset_odometry(self) -> None:
        """Set the odometry to zero; the ring's angle to the wheels is measured at its gear and stays."""
        self.odometry_pose = Pose(0.0, 0.0, 0.0)
        self.odometry_ring_yaw = wrap_angle(self.ring_yaw - self.pose.theta)

    def set_object(self, number: int, circle: tuple[float, float, float]) -> None:
        """Set a drum into the scene that has a place for it, or take it away.

        Parameters
        ----------
        number
            Which of the scene's places for later drums, counted from the last.
        circle
            Centre and radius in world coordinates, m; `scene.NOWHERE` takes the drum away.
        """
        place = self._scene.circles[-1 - number]
        place.x, place.y, place.radius = circle
        self._last_clearance, self._clear_m = None, -math.inf

    def jump_odometry(self, dx_m: float, dy_m: float, dheading_rad: float) -> None:
        """Shift the odometry.

        Parameters
        ----------
        dx_m, dy_m
            By this vector in the odometry's frame.
        dheading_rad
            By this angle.
        """
        old = self.odometry_pose
        self.odometry_pose = Pose(old.x + dx_m, old.y + dy_m, old.theta + dheading_rad)
        self.odometry_ring_yaw += dheading_rad

    def step(
        self,
        dt_s: float,
        target: Twist,
        *,
        within_s: float | None = None,
        rates: tuple[float, float] | None = None,
    ) -> bool:
        """Move the base for `dt_s` and return whether its rim touched a surface.

        A contact stops the wheels at once, at the surface. From there the body can move away; any motion towards the
        surface is a new contact.

        Parameters
        ----------
        dt_s
            Duration of the step.
        target
            The velocity the wheels accelerate towards.
        within_s
            Time in which the wheels change by their full speed, even if the limits on acceleration are lower.
        rates
            Acceleration, m/s², and angular acceleration, rad/s², that the base's firmware has been set to; those of
            the robot file if not given.
        """
        limits = self._config
        rate, turn_rate = rates or (limits.acceleration_max_m_s2, limits.turn_acceleration_max_rad_s2)
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
                self.contact_m_s = max(self.contact_m_s, abs(v))
                return True
        return False

    def _clearance(self, pose: Pose) -> float:
        """Return the distance from the edge of the base to the nearest surface, m; that of the last pose is kept."""
        if self._last_clearance is not None and self._last_clearance[0] is pose:
            return self._last_clearance[1]
        here_m = clearance(pose.x, pose.y, self._scene.circles, self._scene.segments) - self._config.radius_m
        self._last_clearance = (pose, here_m)
        return here_m

    def _free_share(self, end: Pose, distance: float, turn: float) -> float:
        """Return which share of the arc to `end`, 0 to 1, can be driven before the rim touches a surface.

        Call it once for each arc that is driven: it counts the distance down that is free in any direction.
        """
        if distance == 0.0:
            return 1.0
        self._clear_m -= abs(distance)  # no surface can come nearer by more than the distance driven
        if self._clear_m > _CLEAR_MIN_M:
            return 1.0
        before, after = self._clearance(self.pose), self._clearance(end)
        self._clear_m = after
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
        """Move along the arc as far as it is free, and return which share of it that is.

        The odometry counts the same arc with its errors; the ring turns as well, but on a synchro drive.
        """
        end = arc(self.pose, distance, turn)
        share = self._free_share(end, distance, turn)
        if share < 1.0:
            distance, turn = share * distance, share * turn
            end = arc(self.pose, distance, turn)
        self.pose = end
        errors = self._odometry_errors
        drift = errors.heading_rad_per_sqrt_m
        wander = drift * math.sqrt(abs(distance)) * self._rng.standard_normal() if drift > 0.0 else 0.0
        counted = self.odometry_factor * (errors.turn_scale * turn + errors.veer_rad_per_m * distance + wander)
        counted_m = self.odometry_factor * errors.scale * distance
        self.odometry_pose = arc(self.odometry_pose, counted_m, counted)
        self.odometry_m += counted_m
        if not self._config.synchro:
            self.ring_yaw += turn
            self.odometry_ring_yaw += counted
        return share
