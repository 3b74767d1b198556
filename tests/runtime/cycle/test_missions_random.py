"""Random missions under random edits, stops and faults: nothing moves that may not, and nothing stands in silence."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from behaviors.missions.mission import Mission, MissionEdit, progress_problem, route
from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.load import load_settings
from config.mission import MissionConfig
from config.schema_use import SHIPPED_USES
from drivers.driver import LineState
from drivers.messages import Flags, Pose, Twist
from perception.detected_object import DetectedObject
from perception.pipeline import Perception
from runtime.cycle.drive_requests import DriveInput, Legs
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import STANDSTILL, CycleRecord
from tests.runtime.scripted_step import PERIOD_S, ScriptedRobot

SETTINGS = load_settings("room", ["perception.method=paper"])
HELPERS = tuple(name for name, use in SHIPPED_USES.items() if not use.leads)
CYCLES = 200
DRUM = DetectedObject("drum", 2.0, 1.0, 0.0, 0.01, 9, 1.0, 1.0, number=1)
SILENT_MAX_S = 60.0
"""Longest time in DRIVE without coming anywhere and without a reason: the longest `stuck_after_s` here, and some."""


def random_use(rng: random.Random) -> dict[str, Any]:
    """Return a schema with random settings."""
    x, y = rng.uniform(-4, 4), rng.uniform(-4, 4)
    frame = rng.choice(["odom", "odom", "map"])
    return rng.choice([
        {"name": "move_to_goal", "x_m": x, "y_m": y, "frame": frame, "heading_deg": rng.choice([None, 90.0])},
        {"name": "move_ahead", "direction_deg": rng.uniform(-180, 180), "distance_m": rng.choice([None, 0.5])},
        {"name": "turn", "heading_deg": rng.uniform(-180, 180), "relative_to": rng.choice(["robot", "odom", "map"])},
        {"name": "wander", "seed": rng.randrange(9), "persistence_s": 2.0},
        {"name": "follow_wall", "side": rng.choice(["left", "right"])},
        {"name": "stay_on_path", "points_m": [[0.0, 0.0], [x, y], [y, x + 0.5]], "frame": frame},
        {"name": "approach_object", "object": "drum", "choose": rng.choice(["nearest", "unvisited"]),
         "side_deg": rng.choice([None, 45.0]), "frame": frame},
        {"name": "search", "pattern": rng.choice(["spiral", "lawn_mower"]), "width_m": 2.0, "depth_m": 2.0},
    ])  # fmt: skip


def random_schemas(rng: random.Random) -> list[dict[str, Any]]:
    """Return the schemas of a step, with none to three that lead nowhere by themselves."""
    leads = [random_use(rng) for _ in range(rng.choice([0, 1, 1, 1, 2]))]
    helpers = rng.sample(HELPERS, rng.choice([0, 0, 1, 3]))
    return [*leads, *({"name": name, "gain": rng.choice([0.0, 0.5, 1.0])} for name in helpers)]


def random_condition(rng: random.Random, targets: list[str]) -> dict[str, Any]:
    """Return a condition with random settings."""
    conditions: list[dict[str, Any]] = [
        {"when": "reached"}, {"when": "stuck"}, {"when": "bumper"}, {"when": "lost", "after_s": rng.uniform(0, 3)},
        {"when": "unreachable"},
        {"when": "time", "after_s": rng.uniform(0.05, 6)}, {"when": "way", "after_m": rng.uniform(0.05, 2)},
        {"when": "seen", "object": "drum", "unvisited": rng.random() < 0.5},
        {"when": "unseen", "object": "drum", "after_s": rng.uniform(0, 3)},
    ]  # fmt: skip
    return {**rng.choice(conditions), "go": rng.choice(targets)}


def random_mission(rng: random.Random) -> Mission:
    """Return a valid mission with random steps; what `check` refuses is drawn again."""
    while True:
        names = ["one", "two", "three", "four"][: rng.randint(1, 4)]
        targets = [*names, "next", "done", "failed", "hold"]
        steps = [
            {
                "name": name, "schemas": random_schemas(rng), "avoid_gain": rng.choice([0.0, 1.0]),
                "stuck_after_s": rng.uniform(1, 5), "unreachable_after_s": rng.uniform(1, 9),
                "until": [random_condition(rng, targets) for _ in range(rng.randint(0, 3))],
            }
            for name in names
        ]  # fmt: skip
        try:
            return Mission(MissionConfig.model_validate({"name": "random", "endless": True, "step": steps}))
        except ValueError:
            continue


@dataclass
class RandomRun:
    """A robot under a random mission, random operators and random faults, whose every cycle is checked."""

    rng: random.Random
    busy: float = 1.0
    """So many times the usual edits and faults."""
    robot: ScriptedRobot = field(default_factory=lambda: ScriptedRobot(SETTINGS, quanta=0))
    velocity: Twist = STANDSTILL
    needs_resume: bool = False
    """The mission was stopped, and nothing has been requested since that lets it go on."""
    silent: tuple[float, Pose] | None = None
    objects: tuple[DetectedObject, ...] = ()
    frame: Pose | None = None
    driven: int = 0
    held: int = 0

    def input(self) -> DriveInput | None:
        """Return what an operator asks for in a cycle, mostly nothing."""
        kind = self.rng.random() / self.busy
        if kind < 0.04:
            return self.rng.choice([MissionEdit("hold"), MissionEdit("resume"), MissionEdit("skip")])
        if kind < 0.05:
            return random_mission(self.rng)
        if kind < 0.06:
            places = tuple((self.rng.uniform(-3, 3), self.rng.uniform(-3, 3), None) for _ in range(3))
            return route(places[: self.rng.randint(1, 3)], self.rng.choice(["odom", "map"]))
        if kind < 0.065:
            others: list[DriveInput] = [Legs(), Goal(1.0, 1.0), Goal(math.nan, 0.0), Teleoperate(0.1, 0.0)]
            return self.rng.choice(others)
        return None

    def fault(self) -> dict[str, Any]:
        """Return what goes wrong in a cycle, mostly nothing."""
        kind = self.rng.random() / self.busy
        if kind < 0.01:
            return {"request": self.rng.choice([Request.HALT, Request.DISARM])}
        if kind < 0.015:
            return {"flags": Flags.BUMPER | Flags.LATCHED}
        if kind < 0.02:
            line = self.rng.choice([LineState.DOWN, LineState.HANDSHAKE])
            return {"line": line, "firing": False, "odometry": False}
        if kind < 0.023:
            return {"rebooted": True}
        if kind < 0.03:
            return {"firing": False}
        may_arm = self.robot.state.mode.mode in {Mode.READY, Mode.SAFE_STOP}
        return {"request": Request.ARM} if may_arm and self.rng.random() < 0.4 else {}

    def cycle(self) -> CycleRecord:
        """Run a cycle, check it, and move the robot as commanded."""
        if self.rng.random() < 0.02:
            self.objects = () if self.objects else (DRUM,)
            self.frame = None if self.frame else Pose(0.1, 0.2, 0.3)
        robot, before = self.robot, self.robot.state.drive_request
        robot.drive_request, fault = self.input(), self.fault()
        was_in_drive = robot.state.mode.mode is Mode.DRIVE
        record = robot.cycle(**fault)
        is_moving = isinstance(record.command, Twist) and record.command != STANDSTILL
        self.check(record, before, is_moving=is_moving, was_in_drive=was_in_drive)
        if is_moving and isinstance(record.command, Twist):
            self.velocity = record.command
            theta = robot.pose.theta + self.velocity.w * PERIOD_S
            robot.pose = Pose(
                robot.pose.x + self.velocity.v * PERIOD_S * math.cos(theta),
                robot.pose.y + self.velocity.v * PERIOD_S * math.sin(theta), theta,
            )  # fmt: skip
        if fault.get("rebooted"):
            robot.pose = Pose(0.0, 0.0, 0.0)
        return record

    def check(self, record: CycleRecord, before: object, *, is_moving: bool, was_in_drive: bool) -> None:
        """Check that nothing moved that may not, and that a stand in DRIVE has its reason."""
        state = self.robot.state
        in_drive = state.mode.mode is Mode.DRIVE
        assert in_drive or not is_moving, "motion without DRIVE"
        mission = state.drive_request if isinstance(state.drive_request, Mission) else None
        asked = record.inputs.drive_request
        if asked is not None and not record.refused:
            resumes = not isinstance(asked, MissionEdit) or asked.action == "resume"
            self.needs_resume = self.needs_resume and not resumes
        if self.needs_resume and mission is not None and mission == before:
            assert not is_moving, "a mission resumed by itself"
        if was_in_drive and not in_drive and isinstance(before, Mission):
            self.needs_resume = True
            assert mission is None or mission.progress.status != "running", "a stop holds the mission"
        if mission is None:
            self.silent = None
            return
        assert progress_problem(mission) is None
        self.driven += in_drive and is_moving
        self.held += state.hold_reason is not None
        if not in_drive or state.hold_reason is not None:
            self.silent = None
            return
        assert is_moving, "it stands in DRIVE and does not say why"
        run_s, pose = record.inputs.run_s, self.robot.pose
        if self.silent is None or math.hypot(pose.x - self.silent[1].x, pose.y - self.silent[1].y) > 0.1:
            self.silent = (run_s, pose)
        turned = abs(pose.theta - self.silent[1].theta)
        assert run_s - self.silent[0] < SILENT_MAX_S or turned > 0.5, "it is stuck in silence"


def randomly_driven(
    seeds: range, monkeypatch: pytest.MonkeyPatch, cycles: int = CYCLES, busy: tuple[float, ...] = (1.0, 3.0)
) -> tuple[int, int]:
    """Drive a random mission for each seed, as `busy` as these in turn; return the cycles in motion, and held."""
    moved = reasons = 0
    current: list[RandomRun] = []
    monkeypatch.setattr(Perception, "labelled_objects", lambda _: current[-1].objects)
    monkeypatch.setattr(Perception, "known_map_frame", lambda _: current[-1].frame)
    monkeypatch.setattr(Perception, "localized", lambda _: "a place")
    perception = Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)
    for seed in seeds:
        run = RandomRun(random.Random(seed), busy[seed % len(busy)])
        perception.reset()
        run.robot.state.perception = perception
        run.robot.state.drive_request = random_mission(run.rng)
        current[:] = [run]
        for _ in range(cycles):
            run.cycle()
        moved += run.driven
        reasons += run.held
    return moved, reasons


@pytest.mark.compiled
@pytest.mark.promise("P32")
def test_random_edits_and_faults_on_random_missions(
    monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]
) -> None:
    moved, reasons = randomly_driven(range(30), monkeypatch, 60, busy=(3.0,))
    assert moved > 200, "some do move"
    assert reasons > 100
    measured(f"30 missions, {moved} cycles in motion, {reasons} with a reason for none")


@pytest.mark.soak
@pytest.mark.promise("P32")
def test_ten_thousand_missions(monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]) -> None:
    moved, reasons = randomly_driven(range(10_000, 20_000), monkeypatch)
    measured(f"10,000 missions, {moved} cycles in motion, {reasons} with a reason for none")


def test_a_stop_that_is_not_followed_by_a_resume_leaves_the_robot_standing() -> None:
    robot = ScriptedRobot(SETTINGS)
    robot.state.drive_request = Mission(
        MissionConfig.model_validate({"name": "on", "step": [
            {"name": "on", "schemas": [{"name": "move_ahead"}], "until": [{"when": "way", "after_m": 9.0}]},
        ]})
    )  # fmt: skip
    robot.driving()
    assert robot.cycle().command != STANDSTILL
    robot.cycle(flags=Flags.BUMPER | Flags.LATCHED)
    robot.cycle(request=Request.ARM)
    for _ in range(40):
        record = robot.cycle()
        assert record.command in {STANDSTILL, None}
    assert robot.state.mode.mode is Mode.DRIVE
    assert "resume it once the robot is armed" in str(robot.state.hold_reason)
    robot.drive_request = MissionEdit("resume")
    assert robot.cycle().command != STANDSTILL
    robot.drive_request = None
    robot.cycle(rebooted=True)
    assert not isinstance(robot.state.drive_request, Mission), "its places were of the odometry before the restart"
