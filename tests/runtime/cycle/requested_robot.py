"""A scripted robot that gets drive requests."""

from __future__ import annotations

from typing import Any

import pytest

from behaviors.teleoperation import Teleoperate
from config.load import load_settings
from drivers.messages import Pose, Twist
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import STANDSTILL, CycleRecord, DriveRequest, Order
from tests.runtime.scripted_step import ScriptedRobot

FORWARD = Teleoperate(0.2, 0.1)


class RequestedRobot(ScriptedRobot):
    """A scripted robot that gets drive requests."""

    def request_drive(self, drive_request: DriveRequest | None, **found: object) -> CycleRecord:
        self.drive_request = drive_request
        return self.cycle(**found)  # type: ignore[arg-type]

    def move_to(self, pose: Pose) -> CycleRecord:
        self.pose = pose
        return self.request_drive(None)


def near(v: float, w: float) -> Any:
    """Return what equals a velocity up to rounding."""
    return Twist(pytest.approx(v), pytest.approx(w))  # type: ignore[arg-type]


def robot(*sets: str) -> RequestedRobot:
    return RequestedRobot(load_settings("hallway", ["perception.method=paper", *sets])) if sets else RequestedRobot()


def driving(*sets: str) -> RequestedRobot:
    script = robot(*sets)
    script.driving()
    return script


def hold_reason(script: RequestedRobot) -> str:
    """Return why it stands, empty where it drives."""
    return script.state.hold_reason or ""


def arm(script: RequestedRobot) -> CycleRecord:
    record = script.request_drive(None, request=Request.ARM)
    assert record.command is Order.RELEASE
    while script.state.mode.mode is not Mode.DRIVE:
        record = script.request_drive(None)
        assert record.mode.mode is Mode.DRIVE or record.command in {STANDSTILL, None}
    return record
