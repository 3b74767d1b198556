"""The speed's sign and standstill change rarely in free space: random robots in random rooms, by every request."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from behaviors.missions.mission import Mission
from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.load import load_settings
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.messages import Twist
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.preparation import unprepared_state
from tests.random_robots import random_furnished_room, random_robot
from tests.runtime.emulated_run import Run

pytestmark = pytest.mark.compiled

FREE_M = 0.5
"""Nothing is nearer to the rim in free space."""
STICK_S = 4.0
REQUESTS = ("legs", "wander", "goal", "stick")


def changes_at_s(robot: int, room: int, request: str, seconds: float) -> tuple[list[float], list[str]]:
    """Return when the commanded speed changed its sign or standstill in free space, and why the robot stopped.

    What an operator's stick asks for changes by itself; those changes do not count.
    """
    settings = random_robot(robot)
    world = random_furnished_room(room, settings)
    run, scene = Run(settings, world, 100 * robot + room), compile_scene(world)
    run.state = unprepared_state(settings)
    rng = np.random.default_rng([robot, room])
    mission = load_settings("room", mission="wander").mission
    if request == "wander":
        assert mission is not None
        run.state.drive_request = Mission(mission)
    elif request == "goal":
        run.state.drive_request = Goal(2.0, 0.5)
    found, reasons, before, stick = list[float](), list[str](), None, Teleoperate(0.0, 0.0)
    moved_at_s = 0.0
    while run.run_s < seconds and not any("bumper" in reason for reason in reasons):
        if request == "stick":
            if run.run_s >= moved_at_s:
                moved_at_s, before = run.run_s + STICK_S, None
                turn_rad_s = float(rng.choice([0.0, rng.uniform(-1.0, 1.0)]))
                stick = Teleoperate(float(rng.choice([-0.2, 0.3, 0.5])), turn_rad_s, 0.5)
            run.state.drive_request, run.state.requested_run_s = stick, run.run_s
        command = run.cycle(Request.ARM if run.mode is Mode.SAFE_STOP else None).command
        if run.mode is Mode.SAFE_STOP:
            reasons.append(run.state.mode.reason or "")
        if isinstance(command, Twist):
            sign = int(np.sign(command.v))
            pose = run.robot.truth.pose
            is_free = clearance(pose.x, pose.y, scene.circles, scene.segments) > settings.body.radius_m + FREE_M
            if before is not None and sign != before and is_free:
                found.append(run.run_s)
            before = sign
    return found, reasons


def assert_calm(robots: range, rooms: range, seconds: float, requests: tuple[str, ...] = REQUESTS) -> str:
    worst, total, count = 0, 0, 0
    for robot in robots:
        for room in rooms:
            for request in requests[(robot + room) % 2 :: 2] if len(requests) > 2 else requests:
                found, reasons = changes_at_s(robot, room, request, seconds)
                most = max((sum(at_s <= other_s < at_s + 5.0 for other_s in found) for at_s in found), default=0)
                worst, total, count = max(worst, most), total + len(found), count + 1
                assert len(found) <= seconds, f"robot {robot}, room {room}, {request}: {found}"
                assert not any("does not move" in reason for reason in reasons), (robot, room, request)
    assert total > 0
    rate = total / (count * seconds)
    return (
        f"{len(robots)} random robots in {len(rooms)} rooms, {count} drives of {seconds:g} s: {rate:.2f} changes of "
        f"the speed's sign or standstill a second in free space, at most {worst} in 5 s; none is said not to move"
    )


def test_no_random_robot_chatters(measured: Callable[[str], None]) -> None:
    measured(assert_calm(range(8), range(1), 15.0))


@pytest.mark.soak
def test_no_random_robot_chatters_in_many_rooms(measured: Callable[[str], None]) -> None:
    measured(assert_calm(range(100, 120), range(5), 40.0))
