"""Settings of the behaviours: a table for each motor schema, and the arbiter's."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from config.strict import Strict


class MoveAheadConfig(Strict):
    """The move-ahead schema (Arkin 1989): a unit vector along a heading, in the odometry's frame."""

    move_ahead_gain: float = Field(default=1.0, ge=0.0, le=100.0)
    """Length of the schema's vector; 1 asks for the base velocity."""
    move_ahead_direction_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    """Heading in the odometry's frame, degrees counter-clockwise from x."""
    distance_m: float | None = Field(default=None, gt=0.0, le=1e6)
    """Distance to drive from the start, m; unlimited if not given."""
    at_end: Literal["stop", "turn_back"] = "stop"
    """After that distance: stop, or drive back and forth."""


class AvoidStaticObstacleConfig(Strict):
    """The avoid-static-obstacle schema (Arkin 1989); distances are from the robot's rim to the echo."""

    avoid_obstacle_gain: float = Field(default=1.0, ge=0.0, le=100.0)
    """G: factor on the repulsion; 0 turns the schema off."""
    avoid_obstacle_sphere_m: float = Field(default=0.6, gt=0.0, le=100.0)
    """S: obstacles farther away than this are ignored, m."""
    avoid_obstacle_safety_margin_m: float = Field(default=0.2, ge=0.0, le=100.0)
    """R: nearer than this the repulsion is unbounded, m. Must exceed the ring's least range to have an effect."""
    summing: Literal["sum", "largest"] = "largest"
    """`sum` adds the vectors of all echoes; `largest` limits the sum to the largest single push in its direction."""
    echo_age_max_s: float = Field(default=1.5, gt=0.0, le=60.0)
    """Age up to which an echo counts as an obstacle, and a direction as seen, s.

    The robot slows down so that it stands before a direction ahead of it is older.
    """

    @model_validator(mode="after")
    def _ordered(self) -> AvoidStaticObstacleConfig:
        if self.avoid_obstacle_safety_margin_m >= self.avoid_obstacle_sphere_m:
            raise ValueError("avoid_obstacle_safety_margin_m is not below avoid_obstacle_sphere_m")
        return self


class MoveToGoalConfig(Strict):
    """The move-to-goal schema (Arkin 1989): a vector towards a goal that the operator sets."""

    move_to_goal_gain: float = Field(default=1.0, ge=0.0, le=100.0)
    """Length of the schema's vector outside the controlled zone; 1 asks for the base velocity."""
    success_radius_m: float = Field(default=0.1, gt=0.0, le=100.0)
    """Distance at which the goal is reached and the robot stops, m."""
    controlled_zone_m: float = Field(default=0.6, gt=0.0, le=100.0)
    """Distance within which the robot slows down in proportion, m."""

    @model_validator(mode="after")
    def _ordered(self) -> MoveToGoalConfig:
        if self.success_radius_m > self.controlled_zone_m:
            raise ValueError("success_radius_m is above controlled_zone_m")
        return self


class TeleoperationConfig(Strict):
    """Teleoperation: velocities from the operator's keys, pointer or gamepad, each valid for a short time."""

    message_age_max_s: float = Field(default=0.25, ge=0.02, le=2.0)
    """Time without a message from the operator after which the robot stops, s of the host's clock."""
    avoid: bool = True
    """Let avoid-static-obstacle slow and steer the robot. The arbiter's clearance applies in any case."""


class ArbiterConfig(Strict):
    """The arbiter: how the sum of the schemas' vectors becomes a velocity."""

    base_velocity_m_s: float = Field(default=0.3, gt=0.0, le=10.0)
    """Speed straight ahead for a sum of length 1, m/s."""
    cautious_velocity_m_s: float = Field(default=0.1, ge=0.0, le=10.0)
    """Speed while the robot is 45° off course, m/s; it falls to 0 at 90°."""
    turn_gain_per_s: float = Field(default=2.0, gt=0.0, le=100.0)
    """Turning rate for each radian between the drive heading and the sum's direction, rad/s."""
    clearance_m: float = Field(default=0.16, ge=0.0, le=10.0)
    """Distance between rim and echo at which the base can still stop, m; it limits the speed.

    Choose it just above the ring's least range: an echo at that range may come from anything nearer.
    """


class BehaviorsConfig(Strict):
    """The motor schemas and their arbiter; the operator's drive request selects the schemas."""

    move_ahead: MoveAheadConfig = MoveAheadConfig()
    avoid_static_obstacle: AvoidStaticObstacleConfig = AvoidStaticObstacleConfig()
    move_to_goal: MoveToGoalConfig = MoveToGoalConfig()
    teleoperation: TeleoperationConfig = TeleoperationConfig()
    arbiter: ArbiterConfig = ArbiterConfig()
