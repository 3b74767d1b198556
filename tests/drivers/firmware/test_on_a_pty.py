"""The firmware's own main.py on a pty, in real time, as on a board's USB socket; the driver connects and drives."""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from config.robot import RobotConfig
from drivers.denning.codec import encode
from drivers.denning.driver import DenningDriver
from drivers.denning.frames import Halt
from drivers.driver import LineState
from drivers.firmware.bundle import Board
from drivers.messages import Twist
from tests.drivers.firmware.board import install, start
from tests.hil.machine import TIMEOUT_S


class Pty:
    """The firmware behind a pty, and a driver at its other end."""

    def __init__(self, folder: Path, board: Board) -> None:
        self.config: RobotConfig = install(folder, board)
        self.line, device = os.openpty()
        tty.setraw(device)
        self.process: subprocess.Popen[bytes] = start(folder, "realtime.py", stdin=device, stdout=device)
        os.close(device)
        self.driver = DenningDriver(self.config)
        self.heard = 0

    def until(self, reached: Callable[[], bool]) -> None:
        """Let the driver and the robot talk until something is reached."""
        end_s = time.monotonic() + TIMEOUT_S
        while not reached():
            assert time.monotonic() < end_s, self.driver.problem
            readable, _, _ = select.select([self.line], [], [], 0.02)
            run_s = time.monotonic()
            if readable:
                self.driver.receive(os.read(self.line, 4096), run_s)
            self.driver.tick(run_s)
            self.driver.drive(Twist(0.1, 0.0))
            os.write(self.line, self.driver.outgoing(writable=True))
            self.heard += len(self.driver.take_received().firings)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.line)


@pytest.fixture
def pty(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Pty]:
    robot = Pty(tmp_path, request.param)
    robot.driver.line_opened(time.monotonic())
    yield robot
    robot.close()


@pytest.mark.parametrize("pty", ["pico", "esp32"], indirect=True)
def test_the_driver_connects_drives_and_hears_echoes(pty: Pty) -> None:
    pty.until(lambda: pty.driver.state is LineState.READY)
    pty.until(lambda: pty.heard >= 10)
    assert pty.driver.counts.bad == 0
    assert pty.driver.counts.lost == 0
    assert pty.driver.problem is None


@pytest.mark.parametrize("pty", ["pico"], indirect=True)
def test_mpremote_gets_the_console_although_ctrl_c_is_a_byte_of_frames(pty: Pty) -> None:
    pty.until(lambda: pty.driver.state is LineState.READY)
    os.write(pty.line, encode(Halt(3)) + b"\r\x03\r\x01")
    drained = time.monotonic() + TIMEOUT_S
    with contextlib.suppress(OSError):  # the line ends with the program
        while pty.process.poll() is None and time.monotonic() < drained:
            if select.select([pty.line], [], [], 0.05)[0]:
                os.read(pty.line, 4096)
    assert pty.process.wait(timeout=TIMEOUT_S) == 0
