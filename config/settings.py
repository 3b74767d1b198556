"""Everything the main process can be told: the robot, what it should recognise, how it sees, moves and logs.

The sections are named as in the files, so that a dotted path names a value everywhere: in a file, after
``--set``, and in an error.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from config.model import ModelConfig
from config.robot import RobotConfig
from config.strict import Strict, TomlList
from config.world import WorldConfig


class CycleConfig(Strict):
    """The perception-action cycle."""

    rate_hz: float = Field(default=20.0, ge=1.0, le=200.0)
    perception_budget_s: float = Field(default=0.005, ge=0.0, le=1.0)
    """Time perception may take in a cycle; refinement stops there and resumes in the next."""
    overruns_max: int = Field(default=10, ge=1, le=10_000)
    """After so many cycles in a row that left no time for the next one the robot stops and says whose fault it is."""


class SegmentsConfig(Strict):
    """Which pairs of readings of one sensor make an outline segment (paper §3.2)."""

    baseline_min_m: float = Field(default=0.25, gt=0.0, le=10.0)
    """Two readings nearer than this are not paired: their quantisation would dominate the direction."""
    baseline_max_m: float = Field(default=0.5, gt=0.0, le=10.0)
    """Two readings farther apart than this hardly see the same surface."""
    gap_max_s: float = Field(default=3.0, gt=0.0, le=60.0)
    """Two readings further apart in time than this are not consecutive."""

    @model_validator(mode="after")
    def _ordered(self) -> SegmentsConfig:
        if self.baseline_min_m >= self.baseline_max_m:
            raise ValueError(
                f"baseline_min_m {self.baseline_min_m} is not below baseline_max_m {self.baseline_max_m}"
            )
        return self


class MapConfig(Strict):
    """The outline map, the paper's raw map."""

    capacity: int = Field(default=4096, ge=16, le=4_000_000)
    """Segments held at most; the oldest leaves for a new one."""
    age_max_s: float = Field(default=120.0, gt=0.0, le=1e6)
    """Segments leave the map at this age."""
    contradiction_margin_m: float = Field(default=0.2, ge=0.0, le=10.0)
    """A segment leaves when a sensor that faces it hears an echo from this much behind it."""


class ClustersConfig(Strict):
    """Minimum-distance clustering (paper Table 1)."""

    threshold_m: float = Field(default=0.4572, gt=0.0, le=100.0)
    """T: a segment farther than this from every cluster's centre founds a new cluster."""
    segments_min: int = Field(default=8, ge=1, le=10_000)
    """Clusters of fewer segments get no model."""
    clusters_max: int = Field(default=128, ge=1, le=4096)


class RelaxationConfig(Strict):
    """Relaxation of the model onto a cluster's segments (paper §3.4)."""

    gamma: float = Field(default=2.0, gt=0.0, le=100.0)
    """γ: sphere_i = γ times the length of model segment i."""
    negligible_m: float = Field(default=3e-4, gt=0.0, le=1.0)
    negligible_rad: float = Field(default=1e-3, gt=0.0, le=1.0)
    """The process stops when the total increment is below both."""
    iterations_max: int = Field(default=500, ge=1, le=1_000_000)
    """A model that has not settled by then is left as it is until new evidence comes."""
    iterations_per_quantum: int = Field(default=20, ge=1, le=100_000)


class RecognitionConfig(Strict):
    """When a relaxed model counts as an object seen."""

    tolerance_m: float = Field(default=0.1, gt=0.0, le=10.0)
    tolerance_deg: float = Field(default=30.0, gt=0.0, le=90.0)
    """A segment supports the model where it lies this near to a side and this parallel to it."""
    support_min: float = Field(default=0.5, ge=0.0, le=1.0)
    """Share of the cluster's segments that support the model, at least."""
    separation_m: float = Field(default=0.3, ge=0.0, le=100.0)
    """Two candidates that rest nearer to one another than this are one object."""
    coverage_min: float = Field(default=0.35, ge=0.0, le=1.0)
    """Share of the model's outline whose sides have support, at least."""


class BayesConfig(Strict):
    """The Bayesian method: raw ranges held against every explanation there is."""

    report_probability: float = Field(default=0.95, gt=0.0, lt=1.0)
    """A model is reported from this probability on."""
    report_probability_near: float = Field(default=0.8, gt=0.0, lt=1.0)
    """The same for what was heard from within 6 ft; farther away are explanations that nobody thought of."""
    tracks_max: int = Field(default=48, ge=1, le=1000)
    """Round things held in mind at a time, models or not."""
    attempts_per_firing: int = Field(default=3, ge=0, le=64)
    """Unexplained outline segments looked at for new objects, a firing."""
    fresh_share: float = Field(default=0.08, gt=0.0, le=1.0)
    """An object is refined once this share of its readings is new."""
    quanta_per_firing: int = Field(default=2, ge=1, le=1000)
    """Refinements a firing, at most; what is left waits for the next one."""
    polygon_quanta_per_firing: int = Field(default=12, ge=1, le=1000)
    """The same for polygons, so that drums in view do not starve the boxes beside them."""


class PerceptionConfig(Strict):
    """Perception: the method and its constants; the sections below `bayes` are the paper's steps."""

    method: Literal["paper", "bayes"] = "bayes"
    """How objects are recognised: as the paper does it, or exactly."""
    bayes: BayesConfig = BayesConfig()

    segments: SegmentsConfig = SegmentsConfig()
    map: MapConfig = MapConfig()
    clusters: ClustersConfig = ClustersConfig()
    relaxation: RelaxationConfig = RelaxationConfig()
    recognition: RecognitionConfig = RecognitionConfig()


class MoveAheadConfig(Strict):
    """The move-ahead schema (Arkin 1989): a unit vector along a heading, in the odometry's frame."""

    move_ahead_gain: float = Field(default=1.0, ge=0.0, le=100.0)
    move_ahead_direction_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    distance_m: float | None = Field(default=None, gt=0.0, le=1e6)
    """How far to go from where the drive began; without end where it is not given."""
    at_end: Literal["stop", "turn_back"] = "stop"


class AvoidStaticObstacleConfig(Strict):
    """The avoid-static-obstacle schema (Arkin 1989), distances from the robot's rim to the echo."""

    avoid_obstacle_gain: float = Field(default=1.0, ge=0.0, le=100.0)
    avoid_obstacle_sphere_m: float = Field(default=0.6, gt=0.0, le=100.0)
    """S: obstacles farther away than this do not matter."""
    avoid_obstacle_safety_margin_m: float = Field(default=0.2, ge=0.0, le=100.0)
    """R: nearer than this the repulsion is unbounded; above the least range the ring can report, or it never is."""
    summing: Literal["sum", "largest"] = "largest"
    """Add all echoes' vectors, or keep only the largest magnitude along the sum's direction."""
    echo_age_max_s: float = Field(default=1.0, gt=0.0, le=60.0)
    """An echo older than this is no longer an obstacle."""

    @model_validator(mode="after")
    def _ordered(self) -> AvoidStaticObstacleConfig:
        if self.avoid_obstacle_safety_margin_m >= self.avoid_obstacle_sphere_m:
            raise ValueError("avoid_obstacle_safety_margin_m is not below avoid_obstacle_sphere_m")
        return self


class MoveToGoalConfig(Strict):
    """The move-to-goal schema (Arkin 1989): a vector towards a place that the operator names."""

    move_to_goal_gain: float = Field(default=1.0, ge=0.0, le=100.0)
    success_radius_m: float = Field(default=0.1, gt=0.0, le=100.0)
    """Nearer than this the goal is reached, and the robot stands."""
    controlled_zone_m: float = Field(default=0.6, gt=0.0, le=100.0)
    """Nearer than this it goes the slower the nearer it is."""

    @model_validator(mode="after")
    def _ordered(self) -> MoveToGoalConfig:
        if self.success_radius_m > self.controlled_zone_m:
            raise ValueError("success_radius_m is above controlled_zone_m")
        return self


class TeleoperationConfig(Strict):
    """Driving by hand: velocities from an operator's keys, pointer or gamepad, each good for a moment."""

    message_age_max_s: float = Field(default=0.25, ge=0.02, le=2.0)
    """With no further word from the operator for this long the robot stands, by the host's clock."""
    avoid: bool = True
    """Whether avoid-static-obstacle slows and steers; the arbiter's clearance holds in any case."""


class ArbiterConfig(Strict):
    """How the sum of the schemas becomes a velocity."""

    base_velocity_m_s: float = Field(default=0.3, gt=0.0, le=10.0)
    """Speed for a sum of magnitude one, straight ahead."""
    cautious_velocity_m_s: float = Field(default=0.1, ge=0.0, le=10.0)
    """Speed kept while the robot must turn."""
    turn_gain_per_s: float = Field(default=2.0, gt=0.0, le=100.0)
    """Turning rate for each radian between the drive heading and the sum's direction."""
    clearance_m: float = Field(default=0.16, ge=0.0, le=10.0)
    """The speed is held to what the base can stop from with this much left between its rim and an echo ahead.

    Just above the least range the ring can report: such an echo may be from anything nearer.
    """


class BehaviorsConfig(Strict):
    """The motor schemas and their arbiter; which of them are asked depends on what the operator wants driven."""

    move_ahead: MoveAheadConfig = MoveAheadConfig()
    avoid_static_obstacle: AvoidStaticObstacleConfig = AvoidStaticObstacleConfig()
    move_to_goal: MoveToGoalConfig = MoveToGoalConfig()
    teleoperation: TeleoperationConfig = TeleoperationConfig()
    arbiter: ArbiterConfig = ArbiterConfig()


class RealtimeConfig(Strict):
    """What the operating system is asked for, so that cycles begin on time; what it refuses is told, not fatal."""

    slice_s: float | None = Field(default=None, ge=0.0001, le=0.1)
    """Turns of the processor this short let a waking cycle in before programs that want it all (from Linux 6.12).

    One shorter than a cycle's work lets them in again in the middle of it.
    """
    priority: int | None = Field(default=None, ge=1, le=99)
    """Run under SCHED_FIFO at this priority: before everything that is not real-time."""
    core: int | None = Field(default=None, ge=0, le=4095)
    """Stay on this core."""
    lock_memory: bool = False
    """Never let memory be swapped out."""


class LogConfig(Strict):
    """Where the log goes and how much of it."""

    file: str | None = None
    """JSON lines; where it is not given, echolocate/echolocate.jsonl in the user's state folder."""
    level: Literal["debug", "info", "warning", "error"] = "info"


class RecordingConfig(Strict):
    """The recording that every run leaves behind, in a folder where the oldest make room for the newest."""

    enabled: bool = True
    """Keep one where ``--record`` names no file."""
    folder: str | None = None
    """Where it is not given, echolocate/runs in the user's state folder."""
    cap_mb: float = Field(default=1000.0, ge=1.0, le=1e7)
    """All recordings in the folder together, megabytes; an hour takes about 30."""
    keep: int = Field(default=100, ge=1, le=100_000)
    """Files in the folder, at most."""
    keyframe_period_s: float = Field(default=40.0, ge=0.1, le=3600.0)
    """So often the whole state is recorded: a replay can begin there."""


class ConsoleConfig(Strict):
    """The operator console: a page that the robot's own process serves, for watching and for driving."""

    enabled: bool = True
    host: str = Field(default="127.0.0.1", min_length=1)
    """Where it listens. Anything but this machine itself lets others reach it: they still need the token."""
    port: int = Field(default=8765, ge=0, le=65_535)
    """The next free one where it is taken; 0 = any free one."""
    watch_without_token: bool = False
    """Let who has no token watch; to halt, change or drive takes the token of the start URL in any case."""
    clients_max: int = Field(default=16, ge=1, le=256)
    """Pages that may be open at a time."""


class Settings(RobotConfig):
    """All settings of one run: the robot's sections at the top, then what it recognises and does."""

    models: TomlList[ModelConfig] = Field(min_length=1)
    world: WorldConfig | None = None
    """What the emulator shows where no port is given."""
    cycle: CycleConfig = CycleConfig()
    perception: PerceptionConfig = PerceptionConfig()
    behaviors: BehaviorsConfig = BehaviorsConfig()
    realtime: RealtimeConfig = RealtimeConfig()
    log: LogConfig = LogConfig()
    recording: RecordingConfig = RecordingConfig()
    console: ConsoleConfig = ConsoleConfig()

    @model_validator(mode="after")
    def _distinct_models(self) -> Settings:
        names = [m.name for m in self.models]
        twice = next((n for n in names if names.count(n) > 1), None)
        if twice is not None:
            raise ValueError(f"two models are named {twice}: a report could not tell them apart")
        return self
