"""Speed and turning change their sign once a second at most: random robots in random rooms, by every request."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from behaviors.memory.commitment import FAINT_RAD_S
from behaviors.missions.mission import Mission
from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.load import load_settings
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.messages import Twist
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.preparation import fresh_state
from tests.random_robots import random_furnished_room, random_robot
from tests.runtime.emulated_run import Run

pytestmark = pytest.mark.compiled

FREE_M = 0.5
"""Nothing is nearer to the rim in free space."""
STICK_S = 4.0
IN_5_S_MAX = 7
"""A stop, and three starts each followed by a stop, fit in any 5 s."""
REQUESTS = ("legs", "wander", "goal", "stick")


@dataclass
class Changes:
    """When the commanded speed changed its sign or standstill, by whether anything was near, and what else did."""

    free_s: list[float] = field(default_factory=list)
    near_s: list[float] = field(default_factory=list)
    turns_s: list[float] = field(default_factory=list)
    """When it turned to the other side."""
    reasons: list[str] = field(default_factory=list)


def changes_in(robot: int, room: int, request: str, seconds: float) -> Changes:
    """Return the changes of the commanded speed in a drive.

    What an operator's stick asks for changes by itself; those changes do not count.
    """
    settings = random_robot(robot)
    world = random_furnished_room(room, settings)
    run, scene = Run(settings, world, 100 * robot + room), compile_scene(world)
    run.state = fresh_state(settings, recognises=False)
    rng = np.random.default_rng([robot, room])
    mission = load_settings("room", mission="wander").mission
    if request == "wander":
        assert mission is not None
        run.state.drive_request = Mission(mission)
    elif request == "goal":
        run.state.drive_request = Goal(2.0, 0.5)
    found, before, side, stick = Changes(), None, 0, Teleoperate(0.0, 0.0)
    moved_at_s = 0.0
    while run.run_s < seconds and not any("bumper" in reason for reason in found.reasons):
        if request == "stick":
            if run.run_s >= moved_at_s:
                moved_at_s, before = run.run_s + STICK_S, None
                turn_rad_s = float(rng.choice([0.0, rng.uniform(-1.0, 1.0)]))
                stick = Teleoperate(float(rng.choice([-0.2, 0.3, 0.5])), turn_rad_s, 0.5)
            run.state.drive_request, run.state.requested_run_s = stick, run.run_s
        command = run.cycle(Request.ARM if run.mode is Mode.SAFE_STOP else None).command
        if run.mode is Mode.SAFE_STOP:
            found.reasons.append(run.state.mode.reason or "")
        if isinstance(command, Twist):
            sign = int(np.sign(command.v))
            turned = 0 if abs(command.w) <= FAINT_RAD_S else int(np.sign(command.w))
            if side * turned < 0 and request != "stick":
                found.turns_s.append(run.run_s)
            side = turned or side
            pose = run.robot.truth.pose
            is_free = clearance(pose.x, pose.y, scene.circles, scene.segments) > settings.body.radius_m + FREE_M
            if before is not None and sign != before:
                (found.free_s if is_free else found.near_s).append(run.run_s)
            before = sign
        else:
            before = None
    return found


def chatter(robots: range, rooms: range, seconds: float, report: Callable[[str], None] = lambda _: None) -> str:
    """Return the figures of drives by every second request; none chatters, and none is said not to move."""
    worst, free, near, turns, count = 0, 0, 0, 0, 0
    for robot in robots:
        for room in rooms:
            for request in REQUESTS[(robot + room) % 2 :: 2]:
                report(f"robot {robot}, room {room}, {request}")
                found = changes_in(robot, room, request, seconds)
                at_s = sorted(found.free_s + found.near_s)
                most = max((sum(a <= b < a + 5.0 for b in at_s) for a in at_s), default=0)
                worst, free, near = max(worst, most), free + len(found.free_s), near + len(found.near_s)
                turns, count = turns + len(found.turns_s), count + 1
                assert most <= IN_5_S_MAX, f"robot {robot}, room {room}, {request}: {at_s}"
                assert len(at_s) <= seconds, f"robot {robot}, room {room}, {request}: {at_s}"
                assert len(found.turns_s) <= seconds, f"robot {robot}, room {room}, {request}: {found.turns_s}"
                assert not any("does not move" in reason for reason in found.reasons), (robot, room, request)
    drives_s = count * seconds
    return (
        f"{len(robots)} random robots in {len(rooms)} rooms, {count} drives of {seconds:g} s: {free / drives_s:.2f} "
        f"changes of the speed's sign or standstill a second in free space, {near / drives_s:.2f} near obstacles, at "
        f"most {worst} in 5 s; {turns / drives_s:.2f} turns to the other side a second; none is said not to move"
    )


def test_no_random_robot_chatters(measured: Callable[[str], None]) -> None:
    measured(chatter(range(1), range(1), 15.0))


@pytest.mark.soak
def test_no_random_robot_chatters_in_many_rooms(measured: Callable[[str], None]) -> None:
    measured(chatter(range(100, 120), range(5), 40.0))
