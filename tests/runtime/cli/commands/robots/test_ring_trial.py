"""`echolocate ring-test`: what is found out about sensors and motors, and the whole command on the real firmware."""

from __future__ import annotations

import itertools
import math
import os
import re
import time
import tty
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter

from config.errors import DONE, FAILED, NOT_SHOWN, UserError
from config.files import list_shipped
from config.load import load_robot, load_settings
from drivers.emulator.event_device import EventDevice
from drivers.emulator.faults import Fault, StuckSensor, SuddenObject
from drivers.emulator.scene import NOWHERE
from drivers.messages import Flags, Floats, Odometry, Pose, Twist
from drivers.registry import make_device
from runtime.cli.app import run_command
from runtime.cli.commands.robots import ring_trial
from runtime.cli.commands.robots.ring_trial import RingTest, judge_motion, only_port, with_single_firing
from tests.drivers.firmware.board import install, start
from tests.drivers.ros2 import robot as ros_robot
from tests.hil.machine import TIMEOUT_S
from tests.runtime.virtual_time import MemoryLink, VirtualLoop


def odometry(x: float, y: float, theta: float) -> Odometry:
    return Odometry(0.0, Pose(x, y, theta), theta, Twist(0.0, 0.0), Flags.NONE, 0)


@pytest.mark.parametrize(
    ("asked", "after", "flags", "is_good"),
    [
        (Twist(0.1, 0.0), (0.0, 0.09, math.pi / 2), Flags.NONE, True),
        (Twist(0.1, 0.0), (0.09, 0.0, math.pi / 2), Flags.NONE, False),
        (Twist(-0.1, 0.0), (0.0, 0.1, math.pi / 2), Flags.NONE, False),
        (Twist(0.0, 0.6), (0.0, 0.0, math.pi / 2 + 0.5), Flags.NONE, True),
        (Twist(0.0, 0.6), (0.0, 0.0, math.pi / 2 - 0.5), Flags.NONE, False),
        (Twist(0.1, 0.0), (0.0, 0.09, math.pi / 2), Flags.MOTOR_FAULT | Flags.LATCHED, False),
        (Twist(0.1, 0.0), (0.0, 0.0, math.pi / 2), Flags.LATCHED, False),
    ],
)
def test_what_is_found_out_about_a_motion(
    asked: Twist, after: tuple[float, float, float], flags: Flags, is_good: bool
) -> None:
    finding = judge_motion(asked, odometry(0.0, 0.0, math.pi / 2), odometry(*after), flags, 1.0)
    assert finding.is_good is is_good


def test_without_a_port_there_must_be_exactly_one(monkeypatch: pytest.MonkeyPatch) -> None:
    class Port:
        def __init__(self, device: str) -> None:
            self.device = device

    for names, said in (((), "found none"), (("/dev/b", "/dev/a"), "found /dev/a, /dev/b")):
        monkeypatch.setattr(ring_trial, "comports", lambda names=names: [Port(name) for name in names])
        with pytest.raises(UserError, match=said):
            only_port()
    monkeypatch.setattr(ring_trial, "comports", lambda: [Port("/dev/ttyACM0")])
    assert only_port() == "/dev/ttyACM0"


HAND = SuddenObject(kind="sudden_object", at_s=1e6, radius_m=0.1)
"""What is held before a sensor; its time never comes."""
COMES_S = 1.0
"""The hand comes so long after it is asked for."""
ASKED = re.compile(r"hold something flat (\d+) to (\d+) cm from the sensor, .*\((-?\d+) degrees\)")


def reports_of(
    robot: str, monkeypatch: pytest.MonkeyPatch, *faults: Fault, move: bool = False, hand: bool = False
) -> tuple[int, list[str]]:
    """Test a shipped robot in virtual time, given what fails; return the exit code and the lines."""
    loop, said = VirtualLoop(), list[str]()
    config = load_settings("room", ("link.port=memory",), robot=robot)
    assert config.world is not None
    device = make_device(config, config.world, 3, faults=[*faults, HAND])
    assert isinstance(device, EventDevice)
    monkeypatch.setattr(ring_trial, "Link", lambda *args, **_options: MemoryLink(device, loop, *args))

    def write(text: str) -> None:
        said.append(text.rstrip())
        if (asked := ASKED.match(text)) is None:
            return
        near, far, degrees = map(int, asked.groups())
        mount = min(
            config.ring.mounts, key=lambda m: abs(math.remainder(m.angle_rad - math.radians(degrees), math.tau))
        )
        away_m = 0.005 * (near + far) + HAND.radius_m
        c, s = math.cos(mount.angle_rad), math.sin(mount.angle_rad)
        at = device.truth.pose.compose(Pose(mount.x_m + away_m * c, mount.y_m + away_m * s, 0.0))
        device._body.set_object(0, NOWHERE)
        loop.call_later(COMES_S, device._body.set_object, 0, (at.x, at.y, HAND.radius_m))

    try:
        test = RingTest(with_single_firing(config), write, loop.time, config.ring)
        code = loop.run_until_complete(test.run(10, move=move, hand=hand))
    finally:
        loop.close()
    return code, [line for line in said if not line.startswith("note: ")]


def test_the_line_of_a_robot_behind_ros_is_opened_as_its_family_does(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, object] = {}
    monkeypatch.setattr(ring_trial, "Link", lambda *_args, **options: given.update(options))
    RingTest(ros_robot.CONFIG, list[str]().append)
    assert given["opener"] is not None


OF_EACH_KIND = ("p3dx", "servo1")
"""Robots of different drivers and rings; the others are tested in `make soak`."""
ROBOTS = tuple(name for name in list_shipped("robots") if load_robot(name).robot.driver != "ros2")


EACH_ROBOT = [pytest.param(one, marks=[] if one in OF_EACH_KIND else [pytest.mark.soak]) for one in ROBOTS]


@pytest.mark.parametrize("robot", EACH_ROBOT)
def test_every_shipped_robot_is_tested_and_a_sensor_that_reads_what_it_cannot_is_found(
    robot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = load_robot(robot)
    count = len(config.ring.mounts)
    code, lines = reports_of(robot, monkeypatch)
    heard = [line for line in lines if line.startswith("sensor ")]
    (shown,) = (line for line in lines if line.startswith("not shown: "))
    assert code == (NOT_SHOWN if "whether " in shown else DONE), lines
    assert len(heard) == count or config.ring.has_servo
    assert all("hears nothing" in line or " echoes of " in line for line in heard)
    for sensor, range_m, said in (
        (min(count, 24) - 1, 0.1 * config.ring.range_min_m, ("TOO SHORT",)),
        (0, 0.0, ("ZERO", "TOO SHORT", "NO ANSWER")),  # a driver drops a 0 that its protocol does not have
        (min(count, 24) // 2, config.ring.range_max_m, ("AT ITS MAXIMUM", "hears nothing", "NO ANSWER")),
    ):
        fault = StuckSensor(kind="stuck_sensor", at_s=0.0, duration_s=1e3, sensor=sensor, range_m=range_m)
        code, lines = reports_of(robot, monkeypatch, fault)
        degrees = math.degrees(config.ring.mounts[sensor].angle_rad)
        (found,) = (
            line for line in lines if line.startswith(f"sensor {config.ring.sensor_of[sensor]:2} at {degrees:4.0f} ")
        )
        assert any(each in found for each in said), found
        assert code == (NOT_SHOWN if ": hears nothing within" in found else FAILED)


HOBBY = [("hobby3", 2), *(pytest.param(one, 1, marks=pytest.mark.soak)
                         for one in ("hobby3", "hobby8", "parking12", "servo1"))]  # fmt: skip
"""Robots, and which of their faults are tested: each second one, or all."""


def lie(kind: str, **values: object) -> Fault:
    """Return a fault that is there from the start."""
    adapter: TypeAdapter[Fault] = TypeAdapter(Fault)
    return adapter.validate_python({"kind": kind, "at_s": 0.0, "duration_s": 1e4} | values)


@pytest.mark.parametrize(("robot", "each"), HOBBY)
def test_what_robots_of_hobby_parts_are_built_with_is_named(
    robot: str, each: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the ranges, or by a hand before each sensor; without a hand nothing that it would show passes as good.

    What may be an honest sensor in the open is not called a fault: it is not shown to hear.
    """
    ring = load_robot(robot).ring
    ahead = ring.sensor_of[int(np.argmin([abs(math.remainder(m.angle_rad, math.tau)) for m in ring.mounts]))]
    one = [i for i, sensor in enumerate(ring.sensor_of) if sensor == ahead]
    alone, greatest_m = ring.sensor_count == 1, ring.range_max_m
    code, lines = reports_of(robot, monkeypatch, hand=True)
    assert (code, lines[-1]) == (DONE, "each sensor answers in its place")
    code, lines = reports_of(robot, monkeypatch, lie("silent_ring", sensors=one))
    assert code == NOT_SHOWN
    assert lines[-1].startswith("not shown: whether sensor"), lines
    assert lines[0].startswith(f"robot '{robot}' ")
    for fault, is_by_hand, said in (
        (lie("constant_ring", sensors=one, range_m=0.0017), False, "TOO SHORT"),
        (lie("reported_silence", sensors=one, range_m=0.0), True, None if not alone else "TOO SHORT"),
        (lie("constant_ring", sensors=one, range_m=greatest_m), False, "AT ITS MAXIMUM"),
        (lie("reported_silence", range_m=greatest_m), False, "AT ITS MAXIMUM"),
        (lie("constant_ring", sensors=one, range_m=1.0), False, "ONE RANGE" if alone else "STUCK|always the same"),
        (lie("silent_ring", sensors=one), True, f"sensor {ahead} DOES NOT HEAR"),
        (lie("silent_ring"), True, "DOES NOT HEAR" if alone else "NO SENSOR heard"),
        (lie("turned_ring", sensors=one, angle_deg=180.0), True, "TURNED" if alone else "DOES NOT HEAR|EXCHANGED"),
        (lie("turned_ring", angle_deg=180.0), True, "NO SENSOR heard" if robot == "hobby3" else "TURNED"),
        (lie("swapped_sensors", first=0, second=2), True, None if alone else "EXCHANGED"),
    )[::-each]:
        if said is not None:
            code, lines = reports_of(robot, monkeypatch, fault, hand=is_by_hand)
            assert (found := re.search(said, "\n".join(lines))), (said, lines)
            assert code == (NOT_SHOWN if found[0] == "always the same" else FAILED)


@pytest.mark.parametrize("robot", EACH_ROBOT)
def test_the_motors_of_every_shipped_robot_are_good(robot: str, monkeypatch: pytest.MonkeyPatch) -> None:
    code, lines = reports_of(robot, monkeypatch, move=True)
    assert code == (NOT_SHOWN if "whether " in "".join(lines) else DONE), lines
    assert sum(line.startswith("motors ") for line in lines) == 4
    assert not any("not what was asked" in line for line in lines)


@pytest.fixture
def plugged(tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Yield the arguments that name a robot with the real firmware on a pty.

    On a busy machine the firmware's start takes longer than a board's, and so do its firings and its silence.
    """
    monkeypatch.setattr("runtime.cycle.connection.CONNECT_MAX_S", TIMEOUT_S)
    monkeypatch.setattr(ring_trial, "SLACK_S", TIMEOUT_S)
    install(tmp_path, "pico", request.param)
    assert run_command(["firmware", "--board", "pico", "--out", str(tmp_path / "files")]) == DONE
    with (tmp_path / "files" / "robot.toml").open("a", encoding="utf-8") as robot:  # its last table is the link
        robot.write("tries = 100\nsilence_max_s = 60.0\n")
    board, port = os.openpty()
    tty.setraw(port)
    process = start(tmp_path, "realtime.py", stdin=board, stdout=board)
    yield [os.ttyname(port), "--robot", str(tmp_path / "files" / "robot.toml")]
    process.kill()
    process.wait()
    os.close(board)
    os.close(port)


@pytest.fixture
def _time_is_up_by_firings(monkeypatch: pytest.MonkeyPatch) -> None:
    """End each round of a trial once all sensors but one have answered three times, however long that takes."""
    exchange, answers, rounds = RingTest._exchange, Counter[int](), itertools.count(1)

    async def counted(trial: RingTest) -> list[Floats]:
        reported = await exchange(trial)
        for ranges_m in reported:
            answers.update(np.flatnonzero(~np.isnan(ranges_m)).tolist())
        if sum(count >= 3 for count in answers.values()) >= len(trial._config.ring.mounts) - 1:
            answers.clear()
            late_s = 2.0 * TIMEOUT_S * next(rounds)
            trial._clock = lambda: time.monotonic() + late_s
        return reported

    monkeypatch.setattr(RingTest, "_exchange", counted)


@pytest.mark.soak
@pytest.mark.usefixtures("_time_is_up_by_firings")
@pytest.mark.parametrize("plugged", ["FAKE_DEAD = (3,)"], indirect=True)
def test_a_dead_sensor_of_the_real_firmware_is_found(plugged: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run_command(["ring-test", *plugged, "--rounds", "2"]) == FAILED
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("robot 'ring' on ")
    # A busy machine may distort an echo, and that is said, too.
    silent = [line.startswith("sensor  3 ") for line in lines if "NO ANSWER" in line]
    assert silent == [True], lines
    assert {int(line.split()[1]) for line in lines if line.startswith("sensor ")} == {*range(12)}
    assert not any(line.startswith("motors ") for line in lines), "no wheel has turned"


@pytest.mark.soak
@pytest.mark.parametrize("plugged", [""], indirect=True)
def test_the_motors_of_the_real_firmware(plugged: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run_command(["ring-test", *plugged, "--rounds", "2", "--move"]) == DONE
    lines = capsys.readouterr().out.splitlines()
    assert lines[13].startswith("not shown: where each sensor looks")
    assert lines[14].startswith("WARNING: the wheels turn in")
    assert [line.split(":")[0] for line in lines[15:19]] == [
        "motors forward", "motors backward", "motors left (counter-clockwise from above)", "motors right",
    ]  # fmt: skip
