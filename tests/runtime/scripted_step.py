"""The pure step with scripted inputs: a robot whose every cycle a test defines; shared by the tests of the step."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from config.load import load_settings
from config.settings import Settings
from drivers.driver import LineState, Received
from drivers.messages import Firing, Flags, Odometry, Pose, Twist
from perception.pipeline import Perception
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import STANDSTILL, CycleRecord, DriveInput, Inputs, Order, State, step

SETTINGS = load_settings("hallway", ["perception.method=paper"])

"""The paper's method, whose arrays are compared here."""

PERIOD_S = 1.0 / SETTINGS.cycle.rate_hz

NOTHING = Received((), None, rebooted=False)

HERE = Pose(0.0, 0.0, 0.0)

TIMEOUT_S = SETTINGS.behaviors.avoid_static_obstacle.echo_age_max_s


class Perceiving(Perception):
    """Perception that logs when it refines."""

    log: list[object]

    def refine(self) -> int:
        iterations = super().refine()
        self.log.append(("refined", iterations))
        return iterations


@dataclass
class ScriptedRobot:
    """A scripted robot: cycles at 20 Hz, each with odometry at the robot's time and a firing if there is one."""

    settings: Settings = SETTINGS
    quanta: int = 50
    log: list[object] = field(default_factory=list)
    run_s: float = 100.0
    robot_s: float = 7.0
    pose: Pose = HERE
    drive_request: DriveInput | None = None
    trembles: float = 0.0

    def __post_init__(self) -> None:
        perception = Perceiving(self.settings.ring, self.settings.models, self.settings.perception)
        perception.log = self.log
        self.state = State(perception)

    def may_refine(self, done: int) -> bool:
        self.log.append(("may?", done))
        return done < self.quanta

    def cycle(
        self,
        *,
        flags: Flags = Flags.NONE,
        line: LineState = LineState.READY,
        trouble: str | None = None,
        request: Request | None = None,
        firing: bool = True,
        odometry: bool = True,
        rebooted: bool = False,
        earlier_flags: Flags = Flags.NONE,
    ) -> CycleRecord:
        """Run one cycle; 3 m of free space around the robot; `earlier_flags` are of all odometry but the newest."""
        self.run_s += PERIOD_S
        self.robot_s += PERIOD_S
        sensors = len(self.settings.ring.mounts)
        self.trembles = 0.01 - self.trembles  # a ring that repeats its readings while it moves is frozen
        ranges = np.full(sensors, 3.0 + self.trembles)
        firings = (Firing(self.robot_s, self.pose, 0.0, ranges),) if firing else ()
        reported = Odometry(self.robot_s, self.pose, 0.0, Twist(0.0, 0.0), flags, 0) if odometry else None
        inputs = Inputs(
            self.run_s,
            line,
            trouble,
            Received(firings, reported, rebooted, flags=flags | earlier_flags),
            request,
            drive_request=self.drive_request,
        )
        self.log.clear()
        return step(self.state, inputs, self.settings, lambda c: self.log.append(("command", c)), self.may_refine)

    def driving(self) -> ScriptedRobot:
        """Arm and go on until it drives."""
        record = self.cycle()
        assert (record.mode.mode, record.command) == (Mode.READY, STANDSTILL)
        record = self.cycle(request=Request.ARM)
        assert (record.mode.mode, record.command) == (Mode.READY, Order.RELEASE)
        while record.mode.mode is Mode.READY:
            record = self.cycle()
        assert record.mode.mode is Mode.DRIVE
        assert isinstance(record.command, Twist)
        return self
