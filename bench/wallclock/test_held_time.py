"""An emulator's time paused, stepped and sped up on a real pty: the speed is kept, and the deadman never trips."""

from __future__ import annotations

import asyncio
import itertools
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from drivers.messages import Flags
from runtime.cycle.modes import Mode
from tests.hil.machine import stalls_excused
from tests.hil.test_held_time import SETTINGS, driving
from tests.hil.truth import rows

pytestmark = pytest.mark.usefixtures("warm_kernels")

PERIOD_S = 1.0 / SETTINGS.cycle.rate_hz
PAUSE_S = 1.0
"""Twice the base's deadman, and more than any timeout of the line."""


@stalls_excused
async def test_paused_stepped_and_sped_up_the_robot_drives_on(
    tmp_path: Path, measured: Callable[[str], None]
) -> None:  # fmt: skip
    async with driving(tmp_path) as drive:
        control, records = drive.control, drive.records
        await drive.comes_to(Mode.DRIVE)
        await drive.advances(20)
        assert await control.pause() is None
        await asyncio.sleep(PAUSE_S)
        for _ in range(10):
            assert await control.single_step() is None
        assert await control.resume() is None
        await drive.advances(20)
        assert await control.set_speed(3.0) is None
        run_s, host_s = control.clock(), time.monotonic()
        await drive.advances(60)
        speed = (control.clock() - run_s) / (time.monotonic() - host_s)
        assert 1.2 < speed < 3.1
        assert await control.set_speed(0.5) is None
        await drive.advances(10)
        assert await control.set_speed(1.0) is None
        await drive.advances(20)
        assert {record.mode.mode for record in records[-130:]} == {Mode.DRIVE}
    times = [record.inputs.run_s for record in records]
    assert max(b - a for a, b in itertools.pairwise(times)) < 4.0 * PERIOD_S, "the run knows of no pause"
    driven = [row for row in rows(drive.truth.path) if not row.flags & (Flags.LATCHED | Flags.DEADMAN)]
    assert max(b.t_s - a.t_s for a, b in itertools.pairwise(driven)) < 0.1, "the deadman never tripped"
    measured(f"three times real time was {speed:.2f}")
