"""How well the emulator's time follows the host's clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.hil.machine import stalls_excused
from tests.hil.running import emulated
from tests.hil.truth import Truth

pytestmark = pytest.mark.usefixtures("warm_kernels")


@stalls_excused
def test_its_time_is_real_time(tmp_path: Path, measured: Callable[[str], None]) -> None:
    with emulated(tmp_path, fresh=True) as robot:
        truth = Truth(robot.trace)
        begin_s = time.monotonic()
        first = truth.wait(lambda row: row.host_s > begin_s, "a row")
        last = truth.wait(lambda row: row.host_s > begin_s + 2.0, "two seconds")
        late_s = time.monotonic() - last.host_s
    slipped_s = (last.host_s - first.host_s) - (last.t_s - first.t_s)
    assert abs(slipped_s) < 0.01
    assert late_s < 0.15
    measured(f"slipped by {1e3 * slipped_s:.1f} ms in 2 s; its trace was read {1e3 * late_s:.1f} ms later")
