"""The Chirp itself, emulated: fulfils `drivers.emulator.robot_device.RobotDevice`."""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.emulator.body import BRAKE_S, RAMP_S, Body
from drivers.emulator.fault_schedule import FaultSchedule
from drivers.emulator.faults import Bumper, Fault, LowBattery, MotorFault, OdometryJump, Reboot, StopButton
from drivers.emulator.faulty_line import FaultyLine
from drivers.emulator.latency_trace import FrameCounter
from drivers.emulator.robot_device import GroundTruth
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Flags, Pose, Twist
from tests.drivers.contract.example.lines import LineReader, line

TICK_US, REPORT_US, DEADMAN_MS = 5_000, 50_000, 400
STILL = Twist(0.0, 0.0)
LATCHING = ((Bumper, Flags.BUMPER), (MotorFault, Flags.MOTOR_FAULT), (StopButton, Flags.NONE))


class ChirpDevice:
    """It lives in ticks of 5 ms; all that happens, happens at one."""

    def __init__(self, robot: RobotConfig, world: WorldConfig, seed: int, faults: Sequence[Fault]) -> None:
        rngs = [np.random.default_rng(one) for one in np.random.SeedSequence(seed).spawn(5)]
        scene = compile_scene(world)
        start = Pose(world.start.x_m, world.start.y_m, math.radians(world.start.heading_deg))
        self._body = Body(robot.body, scene, start, world.odometry, rngs[0])
        self._sonar = Sonar(robot.ring, scene, world.acoustics, rngs[1])
        self._boot_rng = rngs[2]
        self._faults = FaultSchedule(faults)
        self._line = FaultyLine(robot.link.baud, self._faults, rngs[3], rngs[4])
        self._sensors = len(robot.ring.mounts)
        self._ticks, self._now_us = 0, 0
        self._boot()

    def _boot(self) -> None:
        self._boot_id, self._booted_us = int(self._boot_rng.integers(1, 2**31)), self._tick_us
        self._lines = LineReader()
        self._flags, self._target, self._go, self._go_us = Flags.NONE, STILL, 0, self._tick_us
        self._masks: list[int] = []
        self._step, self._step_us, self._period_us, self._window_m = 0, 0, 0, 0.0
        self._heard: deque[tuple[int, bytes]] = deque()
        self._line.clear()

    @property
    def _tick_us(self) -> int:
        return self._ticks * TICK_US

    @property
    def truth(self) -> GroundTruth:
        body = self._body
        return GroundTruth(1e-6 * self._tick_us, body.pose, body.ring_yaw, body.twist, self._flags, body.contacts)

    @property
    def plugged(self) -> bool:
        return self._line.plugged

    def frame_counter(self) -> FrameCounter:
        raise NotImplementedError("the Chirp's latency is not traced")

    def advance(self, to_s: float) -> bytes:
        to_us = round(1e6 * to_s)
        while self._tick_us + TICK_US <= to_us:
            self._ticks += 1
            self._now_us = self._tick_us
            self._tick()
        self._now_us = max(self._now_us, to_us)
        self._line.collect(self._now_us)
        return self._line.take()

    def receive(self, data: bytes) -> None:
        data = self._line.heard(data)
        if not self._faults.has(Reboot):
            for words in self._lines.feed(data):
                with contextlib.suppress(ValueError, IndexError):  # a right checksum and no sense
                    self._obey(words[0], words[1:])

    def _obey(self, word: str, fields: list[str]) -> None:
        if word == "HELLO":
            self._say("ROBOT", "Chirp", self._sensors, self._boot_id, DEADMAN_MS)
        elif word == "GO":
            go, v, w = map(int, fields)
            if not self._flags & Flags.LATCHED:
                self._go, self._target = go, Twist(1e-3 * v, 1e-3 * w)
                self._go_us, self._flags = self._now_us, self._flags & ~Flags.DEADMAN
        elif word in {"FIRE", "HALT", "FREE"}:
            if word == "FIRE":
                self._period_us, self._window_m = 1000 * int(fields[0]), 1e-3 * int(fields[1])
                self._masks = [int(text, 16) for text in fields[2:]]
                self._step, self._step_us = 0, self._tick_us + TICK_US
            elif word == "HALT":
                self._latch(Flags.NONE)
            else:
                self._flags = Flags.NONE
                self._latch_while_faulty()
            self._say("DONE", word)

    def _latch(self, why: Flags) -> None:
        self._flags, self._target = self._flags | Flags.LATCHED | why, STILL

    def _latch_while_faulty(self) -> None:
        for kind, flag in LATCHING:
            if self._faults.has(kind):
                self._latch(flag)

    def _tick(self) -> None:
        for begins, fault in self._faults.due(self._tick_us):
            self._line.collect(self._tick_us)
            self._faults.set_active(fault, on=begins)
            if begins and isinstance(fault, OdometryJump):
                self._body.jump_odometry(fault.dx_m, fault.dy_m, fault.dheading_rad)
            elif isinstance(fault, Reboot):
                self._body.reset_odometry()
                self._boot()
            else:
                self._latch_while_faulty()
        stops = self._flags & Flags.LATCHED or self._faults.has(Reboot)
        within_s = BRAKE_S if stops else RAMP_S if self._flags & Flags.DEADMAN else None
        if self._body.step(1e-6 * TICK_US, STILL if stops else self._target, within_s=within_s):
            self._latch(Flags.BUMPER)
        if self._faults.has(Reboot):
            return
        if self._tick_us - self._go_us >= 1000 * DEADMAN_MS:
            self._flags, self._target = self._flags | Flags.DEADMAN, STILL
        while self._heard and self._heard[0][0] <= self._tick_us:
            self._line.send(self._heard.popleft()[1], self._tick_us)
        if self._masks and self._tick_us >= self._step_us:
            self._fire()
        if (self._tick_us - self._booted_us) % REPORT_US == 0:
            self._report()
        self._line.add_garbage(self._tick_us, TICK_US)

    def _fire(self) -> None:
        mask = self._masks[self._step % len(self._masks)]
        self._step, self._step_us = self._step + 1, self._step_us + self._period_us
        fired = [k for k in range(self._sensors) if mask >> k & 1]
        ranges = self._sonar.fire(self._body.pose, self._body.ring_yaw, fired, self._window_m)
        millimetres = [round(1e3 * ranges[k]) if math.isfinite(ranges[k]) else 0 for k in fired]
        said = line("HEARD", self._clock_ms(), f"{mask:x}", *millimetres)
        self._heard.append((self._tick_us + round(2e6 * self._window_m / 343.0), said))

    def _report(self) -> None:
        pose, twist = self._body.odometry_pose, self._body.twist
        motion = (round(1e3 * x) for x in (pose.x, pose.y, pose.theta, twist.v, twist.w))
        flags = self._flags | Flags.BATTERY_LOW * self._faults.has(LowBattery)
        self._say("AT", self._clock_ms(), *motion, int(flags), self._go)

    def _clock_ms(self) -> int:
        return (self._tick_us - self._booted_us) // 1000

    def _say(self, *words: object) -> None:
        self._line.send(line(*words), self._now_us)
