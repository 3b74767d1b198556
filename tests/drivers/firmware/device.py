"""The firmware as an emulated robot in a world: sensors get the echoes of its acoustics, wheels move the body.

Its faults are those of a line and of a board: mute, deaf, garbage, bit errors, unplug, reboot, bumper, low battery.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.denning.wire_frame_counter import WireFrameCounter
from drivers.emulator.acoustics import clearance
from drivers.emulator.fault_schedule import FaultSchedule, flip_bits
from drivers.emulator.faults import BitErrors, Bumper, Deaf, Fault, Garbage, LowBattery, Mute, Reboot, Unplug
from drivers.emulator.robot_device import GroundTruth
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Flags, Pose, Twist
from drivers.se2 import exp
from tests.drivers.firmware.board import BoardRobot

TICK_US = 5000
BUMPER_PIN = 22
NOTHING_US = 38_000
SOUND_M_S = 343.0
WHEEL_BASE_M = 0.15


class FirmwareDevice:
    """A `drivers.emulator.robot_device.RobotDevice`; `folder` takes the board's files."""

    def __init__(
        self, folder: Path, config: RobotConfig, world: WorldConfig, seed: int, faults: Sequence[Fault] = ()
    ) -> None:
        self._folder, self._boots = folder, 0
        rng = np.random.default_rng(seed)
        self._scene = compile_scene(world)
        self._sonar = Sonar(config.ring, self._scene, world.acoustics, rng)
        self._rng, self._radius_m = rng, config.body.radius_m
        self._faults = FaultSchedule(faults)
        self._pose = Pose(world.start.x_m, world.start.y_m, math.radians(world.start.heading_deg))
        self._twist = Twist(0.0, 0.0)
        self._contacts, self._touches = 0, False
        self._now_us = 0
        self._boot()

    def _boot(self) -> None:
        folder = self._folder / f"boot{self._boots}"
        folder.mkdir(parents=True)
        self._boots += 1
        self._board = BoardRobot(folder, changes=f"BUMPER = {BUMPER_PIN}\nBATTERY = (26, 13.2, 6.6)")
        self._board.wait_until_ready()
        self._booted_us, self._ways = self._now_us, (0.0, 0.0)
        self._widths: list[int] = []
        self._twist = Twist(0.0, 0.0)

    def close(self) -> None:
        self._board.close()

    @property
    def truth(self) -> GroundTruth:
        pose = self._pose
        return GroundTruth(self._now_us * 1e-6, pose, pose.theta, self._twist, Flags.NONE, self._contacts)

    @property
    def plugged(self) -> bool:
        return not self._faults.has(Unplug)

    def frame_counter(self) -> WireFrameCounter:
        return WireFrameCounter()

    def receive(self, data: bytes) -> None:
        if data and self.plugged and not self._faults.has(Deaf) and not self._faults.has(Reboot):
            for bit_errors in self._faults.all(BitErrors):
                data = flip_bits(data, bit_errors.rate, self._rng)
            self._board.receive(data)

    def advance(self, to_s: float) -> bytes:
        to_us, said = round(to_s * 1e6), b""
        while self._now_us < to_us:
            self._update_faults()
            self._now_us = min(to_us, self._now_us // TICK_US * TICK_US + TICK_US)
            if self._faults.has(Reboot):
                continue
            self._sense()
            part = self._board.advance((self._now_us - self._booted_us) * 1e-6)
            self._move()
            said += self._on_the_line(part)
        return said

    def _on_the_line(self, part: bytes) -> bytes:
        for bit_errors in self._faults.all(BitErrors):
            part = flip_bits(part, bit_errors.rate, self._rng)
        for garbage in self._faults.all(Garbage):
            part += self._rng.bytes(max(1, round(garbage.bytes_per_s * TICK_US * 1e-6)))
        return b"" if self._faults.has(Mute) or not self.plugged else part

    def _update_faults(self) -> None:
        for begins, fault in self._faults.due(self._now_us):
            self._faults.set_active(fault, on=begins)
            if isinstance(fault, Reboot) and begins:
                self.close()
                self._twist = Twist(0.0, 0.0)
            elif isinstance(fault, Reboot) and not self._faults.has(Reboot):
                self._boot()

    def _sense(self) -> None:
        """Give each sensor the pulse that the world has for it, and press the bumper."""
        ranges = self._sonar.fire(self._pose, self._pose.theta)
        widths = [round(2e6 * r / SOUND_M_S) if math.isfinite(r) else NOTHING_US for r in ranges.tolist()]
        if widths != self._widths:
            self._board.ask("U", *widths)
            self._widths = widths
        presses = self._touches or self._faults.has(Bumper)
        self._board.ask("P", BUMPER_PIN, int(not presses))
        self._board.ask("V", 30_000 if self._faults.has(LowBattery) else 40_000)

    def _move(self) -> None:
        left, right = map(float, self._board.ask("M").strip("()").split(","))
        moved = left - self._ways[0], right - self._ways[1]
        self._ways = left, right
        v, w = 0.5 * (moved[0] + moved[1]) * 1e-3, (moved[1] - moved[0]) * 1e-3 / WHEEL_BASE_M
        self._twist = Twist(v / (TICK_US * 1e-6), w / (TICK_US * 1e-6))
        pose = self._pose.compose(exp(v, 0.0, w))
        touches = clearance(pose.x, pose.y, self._scene.circles, self._scene.segments) <= self._radius_m
        self._contacts += touches and not self._touches
        self._touches = bool(touches)
        self._pose = self._pose if touches else pose
