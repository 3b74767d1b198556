"""A robot that drives missions in the simulator of `hall.py`, with ideal echoes and objects."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

from behaviors.arbiter import Drive
from behaviors.missions.mission import Mission
from behaviors.move_ahead import Leg
from config.load import load_settings
from config.mission import MissionConfig
from config.settings import Settings
from drivers.messages import Twist
from perception.percept import DetectedObject, Percept, Pose
from runtime.cycle.drive_state import DriveState, Moment
from runtime.cycle.driving import DriveResult, drive
from runtime.cycle.goal_drive import GoalDrive
from tests.behaviors.hall import STEP_S, World, clamp, echoes
from tests.behaviors.views import EVERYWHERE

SETTINGS = load_settings("room")
RADIUS_M = SETTINGS.body.radius_m


def mission(*steps: dict[str, Any], **also: object) -> Mission:
    """Return the mission of these steps, named a, b, c, … where they have no name."""
    named = [{"name": "abcdefgh"[i], **step} for i, step in enumerate(steps)]
    return Mission(MissionConfig.model_validate({"name": "test", "step": named, **also}))


def drum(number: int | None, x: float, y: float, probability: float = 1.0) -> DetectedObject:
    """Return a drum as perception reports it."""
    return DetectedObject("drum", x, y, 0.0, 0.01, 20, probability, probability, number=number)


@dataclass
class MissionRobot:
    """A robot in a world of discs and walls, which follows each command with limited acceleration."""

    mission: Mission
    world: World = World()  # noqa: RUF009 - frozen
    pose: Pose = Pose(0.0, 0.0, 0.0)  # noqa: RUF009 - frozen
    objects: tuple[DetectedObject, ...] = ()
    map_frame: Pose | None = None
    settings: Settings = SETTINGS
    velocity: Twist = Twist(0.0, 0.0)  # noqa: RUF009 - frozen
    run_s: float = 0.0
    clearance_m: float = math.inf
    path: list[Pose] = field(default_factory=list)
    steps: list[str] = field(default_factory=list)
    """Names of the steps in the order in which they were driven."""
    result: DriveResult | None = None
    goal_drive: GoalDrive | None = None

    def cycle(self) -> DriveResult:
        """Decide once, and move for a cycle; every stand has a reason."""
        percept = Percept(self.pose, echoes(self.world, self.pose, wide=False, noise=None), EVERYWHERE, self.objects)
        self.run_s += STEP_S
        before = DriveState(drive_request=self.mission, leg=Leg(0.0, 0.0), goal_drive=self.goal_drive)
        result = drive(before, percept, self.settings, Moment(self.run_s, STEP_S, self.map_frame))
        assert isinstance(result.decision, Drive), result.decision
        assert isinstance(result.state.drive_request, Mission)
        self.result, self.mission, twist = result, result.state.drive_request, result.decision.twist
        self.goal_drive = result.state.goal_drive
        assert result.hold_reason is not None or twist != Twist(0.0, 0.0), "it stands and does not say why"
        body = self.settings.body
        v = self.velocity.v + clamp(twist.v - self.velocity.v, body.acceleration_max_m_s2 * STEP_S)
        w = self.velocity.w + clamp(twist.w - self.velocity.w, body.turn_acceleration_max_rad_s2 * STEP_S)
        self.velocity, middle = Twist(v, w), self.pose.theta + 0.5 * w * STEP_S
        self.pose = Pose(
            self.pose.x + v * STEP_S * math.cos(middle), self.pose.y + v * STEP_S * math.sin(middle),
            self.pose.theta + w * STEP_S,
        )  # fmt: skip
        self.clearance_m = min(self.clearance_m, self.world.clearance(self.pose.x, self.pose.y) - RADIUS_M)
        self.path.append(self.pose)
        name = self.mission.step.name
        if not self.steps or self.steps[-1] != name:
            self.steps.append(name)
        return result

    def drive(self, seconds: float) -> MissionRobot:
        """Drive until the mission has ended or is held, or the time is up."""
        for _ in range(round(seconds / STEP_S)):
            if self.mission.progress.status != "running":
                break
            self.cycle()
        return self

    @property
    def status(self) -> str:
        """The mission's."""
        return self.mission.progress.status

    @property
    def reason(self) -> str:
        """Why the robot stands; empty where it moves."""
        return "" if self.result is None else self.result.hold_reason or ""

    def put(self, edits: Mission) -> None:
        """Go on with an edited mission."""
        self.mission, self.goal_drive = edits, None


def driven(*steps: dict[str, Any], seconds: float = 60.0, **about: Any) -> MissionRobot:
    """Return a robot that has driven these steps to their end."""
    endless = {"endless": True} if about.pop("endless", False) else {}
    return MissionRobot(mission(*steps, **endless), **about).drive(seconds)


def length_m(path: Iterable[Pose]) -> float:
    """Return the length of a way, m."""
    return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(path))


def moved(robot: MissionRobot, x: float, y: float) -> MissionRobot:
    """Return the robot elsewhere, as if carried there."""
    robot.pose = replace(robot.pose, x=x, y=y)
    return robot
