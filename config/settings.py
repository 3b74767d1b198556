"""All settings of a run: the robot, the models, perception, behaviours, the cycle, logs, recordings and the console.

The sections have the same names as in the files, so that a dotted path names a setting everywhere: in a file, after
``--set``, and in an error message. The text below each setting is its help in the console and in docs/.
"""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field, model_validator

from config.behaviors import BehaviorsConfig
from config.files import did_you_mean
from config.mission import MissionConfig
from config.mission_step import LABELS, Frame
from config.model import ModelConfig
from config.places import PlacesConfig
from config.robot import RingConfig, RobotConfig
from config.strict import Strict, TomlList
from config.world import WorldConfig

MODELS_MAX: Final = 60
"""Most models of a run."""
TRACKS_MAX: Final = 1000
ITERATIONS_MAX: Final = 1_000_000
QUANTA_MAX: Final = 1000


class CycleConfig(Strict):
    """The perception-action cycle."""

    rate_hz: float = Field(default=20.0, ge=1.0, le=200.0)
    """Cycles per second, Hz."""
    perception_budget_s: float = Field(default=0.005, ge=0.0, le=1.0)
    """Time for perception in each cycle, s. Refinement stops then and continues in the next cycle."""
    overruns_max: int = Field(default=10, ge=1, le=10_000)
    """Consecutive cycles that may overrun their period. One more stops the robot; the reason names the slow part."""


class SegmentsConfig(Strict):
    """Pairs of readings of one sensor that form an outline segment (paper §3.2)."""

    baseline_min_m: float = Field(default=0.25, gt=0.0, le=10.0)
    """Shortest distance between paired readings, m. Below it quantisation dominates the segment's direction."""
    baseline_max_m: float = Field(default=0.5, gt=0.0, le=10.0)
    """Longest distance between paired readings, m. Beyond it they rarely see the same surface."""
    gap_max_s: float = Field(default=3.0, gt=0.0, le=60.0)
    """Longest time between paired readings, s."""

    @model_validator(mode="after")
    def _ordered(self) -> SegmentsConfig:
        if self.baseline_min_m >= self.baseline_max_m:
            raise ValueError(
                f"baseline_min_m {self.baseline_min_m} is not below baseline_max_m {self.baseline_max_m}"
            )
        return self


class MapConfig(Strict):
    """The outline map: the paper's raw map of segments (§3.3)."""

    capacity: int = Field(default=4096, ge=16, le=4_000_000)
    """Largest number of segments; a new one then replaces the oldest."""
    age_max_s: float = Field(default=120.0, gt=0.0, le=1e6)
    """Age at which segments leave the map, s."""
    contradiction_margin_m: float = Field(default=0.2, ge=0.0, le=10.0)
    """A segment leaves the map when a sensor that faces it hears an echo from at least this far behind it, m."""


class ClustersConfig(Strict):
    """Minimum-distance clustering (paper Table 1)."""

    threshold_m: float = Field(default=0.4572, gt=0.0, le=100.0)
    """T: a segment farther than this from every cluster's centre starts a new cluster, m."""
    segments_min: int = Field(default=8, ge=1, le=10_000)
    """Least number of segments in a cluster that a model is fitted to."""
    clusters_max: int = Field(default=128, ge=1, le=4096)
    """Largest number of clusters."""


class RelaxationConfig(Strict):
    """Relaxation of the model onto the segments of a cluster (paper §3.4)."""

    gamma: float = Field(default=2.0, gt=0.0, le=100.0)
    """γ: radius of a model side's sphere of influence over its length."""
    negligible_m: float = Field(default=3e-4, gt=0.0, le=1.0)
    """Relaxation ends when a step moves the model by less than this, m, and turns it less than `negligible_rad`."""
    negligible_rad: float = Field(default=1e-3, gt=0.0, le=1.0)
    """Turn below which relaxation ends, rad, with `negligible_m`."""
    iterations_max: int = Field(default=500, ge=1, le=ITERATIONS_MAX)
    """Most iterations for one model; after them it stays where it is until its segments change."""
    iterations_per_quantum: int = Field(default=20, ge=1, le=100_000)
    """Iterations in one quantum of refinement."""


class RecognitionConfig(Strict):
    """Conditions under which a relaxed model is reported as an object."""

    tolerance_m: float = Field(default=0.1, gt=0.0, le=10.0)
    """Largest distance of a supporting segment from a side of the model, m."""
    tolerance_deg: float = Field(default=30.0, gt=0.0, le=90.0)
    """Largest angle between a supporting segment and that side, degrees."""
    support_min: float = Field(default=0.5, ge=0.0, le=1.0)
    """Least share of the cluster's segments that support the model, 0 to 1."""
    separation_m: float = Field(default=0.3, ge=0.0, le=100.0)
    """Candidates nearer to one another than this are one object, m."""
    coverage_min: float = Field(default=0.35, ge=0.0, le=1.0)
    """Least share of the model's outline that has support, 0 to 1."""


class BayesConfig(Strict):
    """The Bayesian method: raw ranges are compared under all alternative explanations."""

    report_probability: float = Field(default=0.95, gt=0.0, lt=1.0)
    """Least probability at which a model is reported."""
    report_probability_near: float = Field(default=0.8, gt=0.0, lt=1.0)
    """The same for objects heard from within 6 ft (1.83 m). Farther away unmodelled explanations are more likely."""
    tracks_max: int = Field(default=48, ge=1, le=TRACKS_MAX)
    """Largest number of tracks of round objects, models or not."""
    attempts_per_firing: int = Field(default=3, ge=0, le=64)
    """Unexplained outline segments examined for new objects after each firing."""
    fresh_share: float = Field(default=0.08, gt=0.0, le=1.0)
    """An object is refined again once this share of its readings is new, 0 to 1."""
    quanta_per_firing: int = Field(default=2, ge=1, le=QUANTA_MAX)
    """Most refinements of round objects after each firing; the others follow after the next one."""
    polygon_quanta_per_firing: int = Field(default=12, ge=1, le=QUANTA_MAX)
    """Most refinements of polygons after each firing, counted separately so that drums do not delay boxes."""


class LocalizationConfig(Strict):
    """Where the robot is: the drift of its odometry, and its place in a known room."""

    correct_drift: bool = False
    """Correct the drift of odometry by round objects, or by matching maps of the way. The robot drives in the
    odometry's frame all the same, which stays continuous; objects move in it."""
    known_room: WorldConfig | None = None
    """The map of the room in which the robot finds itself, as ``run --map`` sets it: walls, boxes, polygons, drums.
    The map frame is the room's; the robot drives in the odometry's all the same."""

    @property
    def has_map(self) -> bool:
        """Whether there is a map frame besides odometry's."""
        return self.correct_drift or self.known_room is not None

    def finds_echo_lag(self, ring: RingConfig) -> bool:
        """Whether the lag of ranges behind odometry is estimated: where drift is corrected, or the ring has one."""
        return self.correct_drift or ring.echo_lag_s != 0.0

    @model_validator(mode="after")
    def _one_map_frame(self) -> LocalizationConfig:
        """Refuse a known room without surfaces, and one beside the correction of drift."""
        if self.known_room is None:
            return self
        if self.correct_drift:
            raise ValueError(
                "correct_drift and known_room exclude each other: a known room corrects the drift itself, "
                "so leave correct_drift out"
            )
        if not self.known_room.sides_m() and not self.known_room.drum:
            raise ValueError("known_room has no surface: give it a wall, box, polygon or drum")
        return self


class GridConfig(Strict):
    """`[perception.grid]`: the evidence grid around the robot, for schemas that steer by free space, and for maps."""

    method: Literal["off", "directed", "moravec_elfes", "elfes"] = "off"
    """How cells are updated: `directed` keeps evidence apart for eight looking directions, `moravec_elfes` is the
    method of 1985 and `elfes` that of 1989; `off` keeps no grid."""
    cell_m: float = Field(default=0.1, ge=0.02, le=1.0)
    """Side of a cell, m."""
    cells: Literal[32, 64, 128, 256, 512, 1024] = 128
    """Cells along each side of the window, which moves with the robot."""


class SurfacesConfig(Strict):
    """`[perception.surfaces]`: walls and outlines of what is not made of the models' shapes, from all echoes."""

    map: Literal["logs", "always", "never"] = "logs"
    """When they are mapped: from ring logs alone, in runs as well, or never; only with the Bayesian method."""
    quanta_per_firing: int = Field(default=16, ge=1, le=QUANTA_MAX)
    """Most quanta of work on them after each firing, a twentieth of a millisecond each; the others follow later."""


class PerceptionConfig(Strict):
    """Perception: the method and its settings; the sections after `surfaces` are the paper's steps."""

    method: Literal["paper", "bayes"] = "bayes"
    """How objects are recognised: `paper` as Santamaría & Arkin do, `bayes` by comparing raw ranges."""
    bayes: BayesConfig = BayesConfig()
    localization: LocalizationConfig = LocalizationConfig()
    grid: GridConfig = GridConfig()
    surfaces: SurfacesConfig = SurfacesConfig()

    segments: SegmentsConfig = SegmentsConfig()
    map: MapConfig = MapConfig()
    clusters: ClustersConfig = ClustersConfig()
    relaxation: RelaxationConfig = RelaxationConfig()
    recognition: RecognitionConfig = RecognitionConfig()

    @property
    def maps_surfaces(self) -> bool:
        """Whether surfaces of any shape are mapped."""
        return self.surfaces.map == "always" and self.method == "bayes"


class GoalConfig(Strict):
    """`[goal]`: a place to which the robot drives once it is armed, instead of the configured legs."""

    x_m: float = Field(ge=-10_000.0, le=10_000.0)
    y_m: float = Field(ge=-10_000.0, le=10_000.0)
    """The place, m."""
    frame: Literal["odom", "map"] = "odom"
    """`odom`: the place is fixed in the robot's odometry. `map`: in the map (`run --map`, or correction of drift)."""
    heading_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Heading to which the robot turns at the goal, in its frame, degrees counter-clockwise from x."""


class RealtimeConfig(Strict):
    """Requests to the operating system for punctual cycles; a refused one is logged, and the run continues."""

    slice_s: float | None = Field(default=None, ge=0.0001, le=0.1)
    """Length of the process's time slice, s (from Linux 6.12). A short one lets a cycle start before busy programs.

    One shorter than a cycle's work lets those interrupt it.
    """
    priority: int | None = Field(default=None, ge=1, le=99)
    """Run under SCHED_FIFO at this priority, before all processes that are not real-time."""
    core: int | None = Field(default=None, ge=0, le=4095)
    """Run on this processor core only."""
    lock_memory: bool = False
    """Lock the process's memory against swapping."""


class LogConfig(Strict):
    """The log: its file, which is cut, and its level."""

    file: str | None = None
    """Path of the log, in JSON lines; by default echolocate/echolocate.jsonl in the user's state folder."""
    level: Literal["debug", "info", "warning", "error"] = "info"
    """Least severity that is logged."""
    cap_mb: float = Field(default=20.0, ge=0.1, le=1e6)
    """Size at which the file becomes NAME.1, in place of the one before, MB."""
    webhook: str | None = Field(default=None, pattern=r"^https?://", max_length=2000)
    """Web address to which warnings and errors are sent, as JSON with a text, as chat programs take it."""
    webhook_period_s: float = Field(default=10.0, ge=1.0, le=86_400.0)
    """Least time between two such messages, s; what comes between goes together."""


class RecordingConfig(Strict):
    """The recording of every run, in a folder from which the oldest recordings are deleted.

    A run deletes no more than it writes, only what runs have written into this folder, and nothing that is bookmarked
    or beside which a file NAME.mcap.keep lies.
    """

    enabled: bool = True
    """Record even if ``--record`` names no file."""
    folder: str | None = None
    """Folder of the recordings; by default echolocate/runs in the user's state folder."""
    cap_mb: float = Field(default=1000.0, ge=1.0, le=1e7)
    """Largest size of all recordings in the folder that are not kept for good, MB; an hour takes about 30 MB."""
    keep: int = Field(default=100, ge=1, le=100_000)
    """Largest number of runs in the folder whose recordings are not kept for good."""
    keyframe_period_s: float = Field(default=40.0, ge=0.1, le=3600.0)
    """Time between records of the whole state, from which a replay can start, s."""


class ConsoleConfig(Strict):
    """The operator console: a web page served by the robot's process, for monitoring and driving."""

    enabled: bool = True
    """Serve the console."""
    host: str = Field(default="127.0.0.1", min_length=1)
    """Address to listen on. Any other than this machine's own lets other machines connect; they need the token."""
    port: int = Field(default=8765, ge=0, le=65_535)
    """TCP port; if it is in use, the next free one. 0 = any free one."""
    watch_without_token: bool = False
    """Allow monitoring without the token. Halting, changing and driving always require the token of the start URL."""
    keep_token: bool = False
    """Keep the token across restarts, as a service does, so that open pages come back by themselves. It is in the
    file `console-token` of the state folder, which only its owner can read; delete that file for a new token."""
    announce: Literal["when_open", "always", "never"] = "when_open"
    """Announce this run on the local network by multicast DNS (name, mode, address, version; never the token), and
    list the other robots that are announced: where the console listens beyond this machine, always, or never."""
    clients_max: int = Field(default=16, ge=1, le=256)
    """Largest number of pages open at a time."""
    command_age_max_s: float = Field(default=1.0, ge=0.3, le=60.0)
    """A command of a page that can begin a motion is refused if it arrives later than this, s."""


class Settings(RobotConfig):
    """All settings of one run: the robot's sections first, then models, world, perception and behaviours."""

    models: TomlList[ModelConfig] = Field(min_length=1, max_length=MODELS_MAX)
    """The objects to recognise."""
    world: WorldConfig | None = None
    """The world of the emulator, which runs if no port is given."""
    places: PlacesConfig = PlacesConfig()
    """Named places, no-go areas and speed limits; those of a map (``run --map``) replace them."""
    cycle: CycleConfig = CycleConfig()
    perception: PerceptionConfig = PerceptionConfig()
    behaviors: BehaviorsConfig = BehaviorsConfig()
    goal: GoalConfig | None = None
    """Where to drive at the start; by default the robot follows the configured legs."""
    mission: MissionConfig | None = None
    """What to do at the start, step by step: the name of a mission, its file, or the mission itself."""
    realtime: RealtimeConfig = RealtimeConfig()
    log: LogConfig = LogConfig()
    recording: RecordingConfig = RecordingConfig()
    console: ConsoleConfig = ConsoleConfig()

    def of_log(self) -> Settings:
        """Return the settings for a ring log, which has time for what is mapped from logs alone."""
        if self.perception.surfaces.map != "logs":
            return self
        surfaces = SurfacesConfig(map="always", quanta_per_firing=QUANTA_MAX)
        return self.model_copy(update={"perception": self.perception.model_copy(update={"surfaces": surfaces})})

    @property
    def places_frame(self) -> Frame:
        """The frame in which the places lie."""
        return "map" if self.perception.localization.has_map else "odom"

    @model_validator(mode="after")
    def _distinct_models(self) -> Settings:
        names = [m.name for m in self.models]
        twice = next((n for n in names if names.count(n) > 1), None)
        if twice is not None:
            raise ValueError(f"two models are named {twice}: give each model a name of its own")
        return self

    @model_validator(mode="after")
    def _mission_can_be_driven(self) -> Settings:
        """Refuse a mission beside a goal, and one that looks for an object without a model."""
        if self.mission is None:
            return self
        if self.goal is not None:
            raise ValueError("goal and mission exclude each other: leave one of them out")
        known = [*(m.name for m in self.models), *LABELS]
        for name in sorted(self.mission.objects()):
            if name not in known:
                hint = did_you_mean(name, known) or f"; it recognises {', '.join(known)}"
                raise ValueError(
                    f"mission {self.mission.name} looks for {name}, which no model is named{hint}; add it to models"
                )
        return self
