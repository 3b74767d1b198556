"""The emulator's latency trace on a real pty: its moments lie where the host's own clock says they must."""

from __future__ import annotations

import os
import select
import time
from pathlib import Path

import pytest

from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import Drive, Echo, Hello, Pattern
from tests.hil.machine import TIMEOUT_S
from tests.hil.running import emulated

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]


def test_echo_and_command_are_stamped_by_the_hosts_clock(tmp_path: Path) -> None:
    trace = tmp_path / "latency.csv"
    with emulated(tmp_path, "--latency", str(trace), "--world", "hallway") as robot:
        line = os.open(robot.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            begin_s = time.monotonic()
            os.write(line, b"\0" + encode(Hello(0)) + encode(Pattern(1, 60, 100, (0b1,))))
            decoder, heard = Decoder("robot", midway=True), False
            while not heard:
                assert time.monotonic() < begin_s + TIMEOUT_S
                if select.select([line], [], [], 0.1)[0]:
                    heard = any(isinstance(frame, Echo) for frame in decoder.feed(os.read(line, 4096)))
            heard_s = time.monotonic()
            os.write(line, encode(Drive(2, 0, 0)))
            answered = False
            while not answered:  # odometry holds the last command the robot accepted
                assert time.monotonic() < heard_s + TIMEOUT_S
                if select.select([line], [], [], 0.1)[0]:
                    frames = decoder.feed(os.read(line, 4096))
                    answered = any(getattr(frame, "last_drive_seq", None) == 2 for frame in frames)
            end_s = time.monotonic()
        finally:
            os.close(line)
    header, *rows = trace.read_text().splitlines()
    assert header == "host_s,frame"
    stamps = [(float(row.split(",")[0]), row.split(",")[1]) for row in rows]
    (drive_s,) = [host_s for host_s, frame in stamps if frame == "drive"]
    first_echo_s = next(host_s for host_s, frame in stamps if frame == "echo")
    rounding_s = 1e-6
    assert begin_s - rounding_s <= first_echo_s <= heard_s + rounding_s
    assert heard_s - rounding_s <= drive_s <= end_s + rounding_s
    moments = [host_s for host_s, _ in stamps]
    assert moments == sorted(moments)
