"""A robot with ROS in plain data and virtual time: eight sensors in a square room, before the driver."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from config.robot import RobotConfig
from drivers.driver import LineState
from drivers.messages import Firing, Odometry, Pose, Twist
from drivers.registry import make_driver
from drivers.ros2.robot_side import RobotSide

STEP_S = 0.01
WALL_M = 3.0
"""Distance of the walls from the start."""
START, STILL = Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0)
CONFIG = RobotConfig.model_validate({
    "robot": {"driver": "ros2"},
    "ring": {
        "count": 8, "radius_m": 0.2, "beam_half_angle_deg": 10.0, "resolution_m": 0.001, "range_min_m": 0.1,
        "range_max_m": 4.0, "firing": {"sets": [[0, 1, 2, 3, 4, 5, 6, 7]], "step_period_s": 0.1},
    },
    "body": {"radius_m": 0.25, "speed_max_m_s": 0.5, "turn_max_rad_s": 1.0},
    "link": {"port": "ros2", "deadman_max_s": 0.5},
    "ros2": {"ranges": ["range"], "frames": [f"us{k}" for k in range(8)], "odometry_period_s": 0.05},
})  # fmt: skip


@dataclass
class RosRobot:
    """The driver, the robot's side, and a base that drives at once as commanded; stamps begin anywhere."""

    offset_s: float = 5000.0
    steps: int = 0
    pose: Pose = START
    twist: Twist = STILL
    wanted: Twist | None = None
    """What the host drives at, twenty times a second; None = nothing."""
    frozen: bool = False
    """Whether the host does nothing."""
    firings: list[Firing] = field(default_factory=list)
    odometry: list[Odometry] = field(default_factory=list)
    restarts: int = 0
    notes: list[str] = field(default_factory=list)
    config: RobotConfig = CONFIG

    def __post_init__(self) -> None:
        self.driver, self.side = make_driver(self.config), RobotSide(self.config, 7)
        self.driver.line_opened(0.0)

    @property
    def now_s(self) -> float:
        return STEP_S * self.steps

    def step(self) -> None:
        self.steps += 1
        turned = self.pose.compose(Pose(self.twist.v * STEP_S, 0.0, self.twist.w * STEP_S))
        self.pose = turned
        stamp_s = self.offset_s + self.now_s
        if self.steps % 5 == 0:
            self.side.odometry("base_link", stamp_s, self.pose, self.twist, self.now_s)
        if self.steps % 10 == 3:
            for sensor in range(8):
                self.side.reading(f"us{sensor}", self.range_of(sensor), stamp_s)
        self.side.tick(self.now_s)
        if not self.frozen:
            self._host()
        if (velocity := self.side.take_velocity()) is not None:
            self.twist = velocity
        self.notes += self.side.take_notes()

    def range_of(self, sensor: int) -> float:
        """Return the distance of a sensor from the wall x = 3 m along its axis, +inf if it looks elsewhere."""
        eye = self.pose.compose(Pose(*self.config.ring.mounts[sensor]))
        along = math.cos(eye.theta)
        return (WALL_M - eye.x) / along if along > 0.8 else math.inf

    def _host(self) -> None:
        driver = self.driver
        driver.receive(self.side.take_output(), self.now_s)
        driver.tick(self.now_s)
        if self.wanted is not None and self.steps % 5 == 0:
            driver.drive(self.wanted)
        self.side.receive(driver.outgoing(writable=True), self.now_s)
        received = driver.take_received()
        self.firings += received.firings
        self.odometry += [] if received.odometry is None else [received.odometry]
        self.restarts += received.rebooted

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step()


def ready() -> RosRobot:
    """Return a robot whose line is READY."""
    robot = RosRobot()
    robot.run(1.0)
    assert robot.driver.state is LineState.READY, robot.driver.problem
    return robot
