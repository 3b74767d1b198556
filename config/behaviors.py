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
    stuck_after_s: float = Field(default=20.0, ge=1.0, le=3600.0)
    """The goal is given up after the robot has moved less than `stuck_m` for so long, or, if something stands on the
    goal, has come no nearer, s."""
    stuck_m: float = Field(default=0.3, gt=0.0, le=10.0)
    """See `stuck_after_s`, m."""
    unreachable_after_s: float = Field(default=120.0, ge=1.0, le=1e5)
    """The goal is given up after the robot has not come nearer to it than ever before for so long, s."""
    turn_rate_max_rad_s: float = Field(default=0.3, gt=0.0, le=20.0)
    """On its way to a goal the robot turns no faster than this, rad/s."""
    turn_acceleration_max_rad_s2: float = Field(default=0.6, gt=0.0, le=100.0)
    """Its turning rate changes no faster than this there, rad/s²: an echo that comes and goes does not turn it to and
    fro. Near an obstacle that pushes it the base turns as fast as it can. Choose it above half of the turning gain
    times the highest rate, so that the turn ends at the direction."""

    @model_validator(mode="after")
    def _ordered(self) -> MoveToGoalConfig:
        if self.success_radius_m > self.controlled_zone_m:
            raise ValueError("success_radius_m is above controlled_zone_m")
        return self


class FollowValleyConfig(Strict):
    """The follow-valley schema: towards a goal through the free valleys between obstacles (VFH+, with look-ahead)."""

    follow_valley_gain: float = Field(default=1.0, ge=0.0, le=100.0)
    """Factor on move-to-goal's vector, whose direction this schema replaces; 0 drives straight towards the goal."""
    safety_m: float = Field(default=0.2, ge=0.0, le=10.0)
    """Room to keep between rim and obstacle, m. Choose it above the arbiter's clearance, which stops the robot. Where
    nothing so wide leads the same way, a gap is passed that leaves .085 m on either side."""
    comfort_m: float = Field(default=0.35, ge=0.0, le=10.0)
    """A direction that passes an obstacle nearer than this is chosen only if it saves a turn or a way, m."""
    block_m: float = Field(default=0.7, gt=0.0, le=100.0)
    """A direction is blocked if the robot cannot drive so far in it, m."""
    free_m: float = Field(default=0.9, gt=0.0, le=100.0)
    """A blocked direction is free again if the robot can drive so far in it, m."""
    occupied_probability: float = Field(default=0.6, ge=0.5, lt=1.0)
    """Probability from which on a cell of the evidence grid counts as an obstacle."""
    sure_probability: float = Field(default=0.8, gt=0.5, le=1.0)
    """Probability from which on an occupied cell is sure. One in between blocks a shorter way."""
    wide_valley_deg: float = Field(default=40.0, ge=5.0, le=180.0)
    """A valley from this width on is wide: its sides are driven at half of it from the border, degrees."""
    target_weight: float = Field(default=5.0, ge=0.0, le=1000.0)
    """μ₁: cost of a direction for each 5° from the target's."""
    heading_weight: float = Field(default=2.0, ge=0.0, le=1000.0)
    """μ₂: the same from the drive heading."""
    last_weight: float = Field(default=2.0, ge=0.0, le=1000.0)
    """μ₃: the same from the direction chosen before."""
    near_cost: float = Field(default=20.0, ge=0.0, le=1e6)
    """Cost of a direction that passes an obstacle nearer than `comfort_m`."""
    turn_share: float = Field(default=0.07, gt=0.0, le=1.0)
    """The direction turns by this share of the angle to the chosen one in each cycle; 1 turns at once."""
    turning_radius_m: float = Field(default=0.0, ge=0.0, le=100.0)
    """Least radius that the robot drives, m; 0 if it can turn on the spot."""
    look_ahead_step_m: float = Field(default=0.5, gt=0.05, le=10.0)
    """Length of a step of the look-ahead (VFH*), m."""
    look_ahead_nodes_max: int = Field(default=600, ge=0, le=2000)
    """Most places that a look-ahead projects; 0 for none, which is VFH+."""
    look_ahead_period_s: float = Field(default=1.0, ge=0.0, le=60.0)
    """Time from one look-ahead to the next, s."""
    carrot_m: float = Field(default=1.0, gt=0.0, le=10.0)
    """Distance of the target on the way that the look-ahead has found, m."""
    near_share: float = Field(default=0.5, ge=0.0, le=100.0)
    """Cost of a step that passes an obstacle nearer than `comfort_m`, as a share of its length."""
    keep_share: float = Field(default=0.25, ge=0.0, lt=1.0)
    """What a step along the way in force costs less, as a share of its length: like ways do not alternate."""
    turn_cost_m_per_rad: float = Field(default=0.3, ge=0.0, le=10.0)
    """Cost of a turn on the way, m for each radian."""

    @model_validator(mode="after")
    def _ordered(self) -> FollowValleyConfig:
        if self.free_m < self.block_m:
            raise ValueError("free_m is below block_m")
        if self.sure_probability <= self.occupied_probability:
            raise ValueError("sure_probability is not above occupied_probability")
        if self.target_weight <= self.heading_weight + self.last_weight:
            raise ValueError(
                "target_weight is not above heading_weight + last_weight: the robot would not turn to it"
            )
        return self


class LeaveCanyonConfig(Strict):
    """The leave-canyon schema: round dead ends and other obstacles between the robot and its goal."""

    leave_canyon_gain: float = Field(default=1.0, ge=0.0, le=100.0)
    """Length of the schema's vector; 0 turns the schema off."""
    room_m: float = Field(default=0.25, ge=0.0, le=10.0)
    """Distance that is kept between the rim and what is gone round, m. A gap with less room on either side is passed
    in its middle, down to .085 m."""
    look_m: float = Field(default=0.6, gt=0.0, le=10.0)
    """The detour begins where something is nearer than this to the robot and its room, m."""
    look_ahead_m: float = Field(default=8.0, ge=0.0, le=100.0)
    """What stays in the way as far ahead as this may be the back of a canyon, and is given room, m; 0: nothing is.

    With an evidence grid nothing is, as its look-ahead leads round what was heard.
    """
    probability_min: float = Field(default=0.9, ge=0.0, le=1.0)
    """Canyons that are less probable are not avoided."""


class AvoidPastConfig(Strict):
    """The avoid-past schema (Balch & Arkin 1993): away from where the robot has been."""

    avoid_past_gain: float = Field(default=0.0, ge=0.0, le=100.0)
    """Greatest length of the schema's vector; 0 turns the schema off."""
    horizon_m: float = Field(default=1.0, gt=0.0, le=100.0)
    """Half the side of the square about the robot in which its trail counts, m."""
    saturation_m: float = Field(default=4.0, gt=0.0, le=1000.0)
    """Length of the trail in that square at which the vector has its greatest length, m."""


class NoiseConfig(Strict):
    """The noise schema (Arkin 1989): a random direction, kept for a while."""

    noise_gain: float = Field(default=0.0, ge=0.0, le=100.0)
    """Length of the schema's vector; 0 turns the schema off."""
    persistence_s: float = Field(default=3.0, gt=0.0, le=3600.0)
    """Time for which a direction is kept, s."""
    seed: int = Field(default=0, ge=0, le=2**31)
    """The same seed gives the same directions."""


class SwirlConfig(Strict):
    """The swirl schema (MissionLab): round obstacles, on the side of the robot's way."""

    swirl_gain: float = Field(default=0.0, ge=0.0, le=100.0)
    """Greatest length of the schema's vector; 0 turns the schema off."""
    swirl_sphere_m: float = Field(default=3.0, gt=0.0, le=100.0)
    """Obstacles farther from the rim than this are ignored, m."""
    swirl_safety_margin_m: float = Field(default=0.5, ge=0.0, le=100.0)
    """Nearer than this the vector grows no more, m."""

    @model_validator(mode="after")
    def _ordered(self) -> SwirlConfig:
        if self.swirl_safety_margin_m >= self.swirl_sphere_m:
            raise ValueError("swirl_safety_margin_m is not below swirl_sphere_m")
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
    """Distance between rim and echo at which the base can still stop, m; it limits the speed. At its cautious
    velocity the robot keeps .085 m to what it only passes, as the posts of a doorway.

    Choose it just above the ring's least range: an echo at that range may come from anything nearer.
    """


class BehaviorsConfig(Strict):
    """The motor schemas and their arbiter; the operator's drive request selects the schemas."""

    move_ahead: MoveAheadConfig = MoveAheadConfig()
    avoid_static_obstacle: AvoidStaticObstacleConfig = AvoidStaticObstacleConfig()
    move_to_goal: MoveToGoalConfig = MoveToGoalConfig()
    follow_valley: FollowValleyConfig = FollowValleyConfig()
    leave_canyon: LeaveCanyonConfig = LeaveCanyonConfig()
    avoid_past: AvoidPastConfig = AvoidPastConfig()
    noise: NoiseConfig = NoiseConfig()
    swirl: SwirlConfig = SwirlConfig()
    teleoperation: TeleoperationConfig = TeleoperationConfig()
    arbiter: ArbiterConfig = ArbiterConfig()
